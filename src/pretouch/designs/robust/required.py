"""Define chance constraints: limits that must be met with a required probability."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.fields import check_types
from pretouch._core.numbers import checked_probability, float_or_array

from ..constraints import Constraint
from .measures import sample_quantile

_ROUNDING: Final = 1e-9  # a share times the number of runs may be just below a whole number


@dataclass(frozen=True, slots=True, kw_only=True)
class Required:
    """A chance constraint: a constraint with a required probability.

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
        """Return the constraint ratio at the required probability.

        The required share of the encounters does not exceed this ratio |quantity| / limit.
        """
        return (
            float_or_array(np.max(ratios, axis=-1))
            if self.probability == 1
            else sample_quantile(ratios, self.probability)
        )


def limits_of(constraints: Iterable[Constraint | Required]) -> tuple[Required, ...]:
    """Convert constraints to chance constraints.

    Returns:
        The chance constraints; every encounter must meet a constraint without a probability.
    """
    return tuple(c if isinstance(c, Required) else Required(constraint=c) for c in constraints)


_MOST_RUNS: Final = 1_000_000  # more runs are not advised


def runs_to_show(share: float, probability: float, confidence: float) -> int | None:
    """Return how many test runs are needed to demonstrate a probability.

    `share` is the rate of successful runs. None if over a million runs are needed.

    Examples:
        >>> runs_to_show(1.0, 0.99, 0.95), runs_to_show(0.95, 0.95, 0.95)
        (299, None)
    """

    def shows(count: int) -> bool:
        return least_probability(math.floor(share * count + _ROUNDING), count, confidence) >= probability

    few, many = 0, 1
    while not shows(many):
        few, many = many, 2 * many
        if many > _MOST_RUNS:
            return None
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (few, middle) if shows(middle) else (middle, many)
    return many


def least_probability(held: int, count: int, confidence: float) -> float:
    """Return a lower confidence bound of a probability.

    It follows from a number of successes (Clopper and Pearson, 1934).
    """
    from scipy.special import betaincinv  # noqa: PLC0415 - SciPy is imported only for a validation

    return 0.0 if held == 0 else float(betaincinv(held, count - held + 1, 1 - confidence))
