"""Chance constraints: constraints that must hold with a probability."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.fields import check_types
from pretouch._core.numbers import float_or_array

from ..constraints import Constraint
from .measures import checked_probability, sample_quantile


@dataclass(frozen=True, slots=True, kw_only=True)
class Required:
    """A chance constraint: a constraint that must hold with a required probability.

    Args:
        constraint: the constraint.
        probability: the required probability, in (0, 1]; 1 requires it in every sampled encounter.

    Examples:
        >>> Required(constraint=Constraint(name="relative_velocity", limit=0.1), probability=0.6).share([0.5, 0.9, 1.2])
        0.9
    """

    constraint: Constraint
    probability: float = 1.0

    def __post_init__(self) -> None:
        check_types(self)
        if self.probability != 1:
            object.__setattr__(self, "probability", checked_probability(self.probability))

    def share(self, ratios: Any) -> Any:
        """Return the quantile of |quantity| / limit at the required probability of the constraint."""
        return (
            float_or_array(np.max(ratios, axis=-1))
            if self.probability == 1
            else sample_quantile(ratios, self.probability)
        )


def limits_of(constraints: Iterable[Constraint | Required]) -> tuple[Required, ...]:
    """Return constraints as chance constraints; a plain `Constraint` must hold in every encounter."""
    return tuple(c if isinstance(c, Required) else Required(constraint=c) for c in constraints)


def least_probability(held: int, count: int, confidence: float) -> float:
    """Return a lower confidence bound of a probability from a number of successes (Clopper and Pearson, 1934)."""
    from scipy.special import betaincinv  # noqa: PLC0415 - SciPy is imported only for a validation

    return 0.0 if held == 0 else float(betaincinv(held, count - held + 1, 1 - confidence))
