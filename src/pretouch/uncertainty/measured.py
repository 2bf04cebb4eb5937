"""What was measured, as what is known of an input."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import format_range

from .distributions import Distribution


@dataclass(frozen=True, slots=True, kw_only=True)
class Empirical(Distribution):
    """What was measured: each value as likely as it is frequent.

    Args:
        samples: the values, in SI, in any order; at least two.

    Examples:
        >>> Empirical(samples=(-0.31, -0.28, -0.30, -0.35)).quantile([0.1, 0.9])
        array([-0.35, -0.28])
    """

    samples: tuple[float, ...]

    def __post_init__(self) -> None:
        values = np.atleast_1d(finite(self.samples, "samples"))
        if values.ndim != 1 or len(values) < 2:
            raise InvalidInputError(f"samples: found {np.shape(values)}, expected a row of two values or more")
        object.__setattr__(self, "samples", tuple(np.sort(values).tolist()))

    @property
    def support(self) -> tuple[float, float]:
        """The smallest and the largest value."""
        return self.samples[0], self.samples[-1]

    @property
    def mean(self) -> float:
        """The mean of the values."""
        return math.fsum(self.samples) / len(self.samples)

    @property
    def variance(self) -> float:
        """The mean squared distance from the mean."""
        return math.fsum((x - self.mean) ** 2 for x in self.samples) / len(self.samples)

    def _quantile(self, probability: FloatArray) -> FloatArray:
        count = len(self.samples)
        return np.asarray(self.samples)[np.minimum((probability * count).astype(np.int64), count - 1)]

    def described(self, unit: str) -> str:
        """Say how many values there are, and between what."""
        return f"{len(self.samples)} measured values, {format_range(self.support, unit)}"
