"""What is known of several inputs that were estimated together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.json_text import with_kind
from pretouch._core.numbers import FloatArray, finite

from .distributions import normal_in_words

__all__ = ["CorrelatedNormal"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelatedNormal:
    """Several inputs that were estimated together, such as the parameters of a fitted curve.

    Args:
        names: the inputs, such as `sensor.exponent`.
        mean: their estimates, in SI.
        covariance: their covariance, in the order of the names; rows of numbers.

    Examples:
        >>> both = CorrelatedNormal(
        ...     names=("sensor.exponent", "sensor.distance_offset"),
        ...     mean=(3.32, 0.0419),
        ...     covariance=((1e-2, 2e-4), (2e-4, 5e-6)),
        ... )
        >>> both.root.shape
        (2, 2)
    """

    names: tuple[str, ...]
    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        mean = np.atleast_1d(finite(self.mean, "mean"))
        covariance = np.atleast_2d(finite(self.covariance, "covariance"))
        count = len(self.names)
        if mean.shape != (count,) or covariance.shape != (count, count):
            raise InvalidInputError(
                f"covariance: found shape {covariance.shape} and {mean.shape[0]} means for {count} names"
            )
        scale = np.sqrt(np.outer(np.diag(covariance).clip(0), np.diag(covariance).clip(0)))
        if np.abs(covariance - covariance.T).max(initial=0) > 1e-9 * scale.max(initial=0):
            raise InvalidInputError("covariance: found a matrix that is not symmetric")
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        object.__setattr__(self, "mean", tuple(mean.tolist()))
        object.__setattr__(self, "covariance", tuple(map(tuple, covariance.tolist())))
        self.root  # noqa: B018 - raises where no such covariance is possible

    @property
    def root(self) -> FloatArray:
        """A matrix R with R R^T the covariance: what independent normal numbers are multiplied by.

        Raises:
            InvalidInputError: the matrix is no covariance.
        """
        covariance = np.asarray(self.covariance)
        deviation = np.sqrt(np.diag(covariance).clip(0))
        unit = np.where(deviation > 0, deviation, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
        if values.min(initial=0) < -1e-9:
            raise InvalidInputError("covariance: found a matrix with a negative eigenvalue, which none has")
        return np.asarray(unit[:, None] * vectors * np.sqrt(values.clip(0)))

    def rows(self, name: str, units: Mapping[str, str]) -> Iterator[tuple[str, str]]:
        """Yield the name of each input that it speaks of, and what is known of it.

        Args:
            name: what all of them go by.
            units: the SI unit of each.

        Yields:
            Name and text.
        """
        for i, member in enumerate(self.names):
            text = normal_in_words(self.mean[i], math.sqrt(self.covariance[i][i]), units.get(member, ""))
            yield member, f"{text}, together with the others of {name}"

    def to_dict(self) -> dict[str, Any]:
        """Return it as one JSON object: its kind and its fields, in SI."""
        return with_kind(self)
