"""What is made of an objective that differs from encounter to encounter: one number to be minimized."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.files import with_kind
from pretouch._core.numbers import FloatArray, finite, float_or_array

from ..constraints import Constraint


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure(ABC):
    """One number for many objectives; it never falls where none of them does."""

    @property
    @abstractmethod
    def label(self) -> str:
        """What it is called in reports."""

    def to_dict(self) -> dict[str, Any]:
        """Return it as one JSON object: its kind, its label and its fields."""
        return {**with_kind(self), "label": self.label}

    @abstractmethod
    def of(self, values: Any) -> Any:
        """Return the number for values along the last axis; infinite where the values that count are."""

    @abstractmethod
    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the estimate from independent samples, and the ends of its confidence interval."""

    def difference(self, values: FloatArray, others: FloatArray) -> tuple[float, float]:
        """Return by how much others exceed values in this measure, in the same encounters, and its standard error.

        The error is that of drawing the pairs again from themselves (the bootstrap); NaN where it is not known.
        """
        found = float(self.of(others) - self.of(values))
        if not math.isfinite(found):
            return found, math.nan
        again = np.random.default_rng(0).integers(len(values), size=(_DRAWS, len(values)))
        return found, float(np.std(self.of(others[again]) - self.of(values[again]), ddof=1))


def checked_measure(measure: Any) -> Measure:
    """Refuse what is no Measure, and one that computes its own number under the label or the interval of another."""
    if not isinstance(measure, Measure):
        raise InvalidInputError(
            f"measure: found {measure!r}, expected Expected, Quantile, ConditionalValueAtRisk, WorstCase or a Measure"
        )
    home = {name: next(c for c in type(measure).__mro__ if name in vars(c)) for name in ("of", "label", "estimate")}
    for name in ("label", "estimate"):
        if not issubclass(home[name], home["of"]):
            raise InvalidInputError(
                f"measure: found {type(measure).__name__}, which has an `of` of its own and the `{name}` of "
                f"{home[name].__name__}, expected its own `{name}`, too"
            )
    if isinstance(measure, WorstCase) and home["of"] is not WorstCase:
        raise InvalidInputError(
            f"measure: found {type(measure).__name__}, a worst case with an `of` of its own, expected WorstCase "
            "itself: its encounters are searched for, not computed"
        )
    return measure


_DRAWS: Final = 400  # of the pairs again: the standard error is then known to some 4 %


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected(Measure):
    """The mean.

    Examples:
        >>> Expected().of([1.0, 2.0, 6.0])
        3.0
    """

    label: ClassVar[str] = "expected value"

    def of(self, values: Any) -> Any:
        """Return the mean."""
        return float_or_array(np.mean(values, axis=-1))

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the mean and its interval by Student's t."""
        from scipy.special import stdtrit  # noqa: PLC0415 - SciPy, only when something is validated

        middle = float(np.mean(values))
        if not math.isfinite(middle) or len(values) < 2:
            return middle, -math.inf, math.inf
        half = float(stdtrit(len(values) - 1, 0.5 + 0.5 * confidence)) * float(np.std(values, ddof=1))
        half /= math.sqrt(len(values))
        return middle, middle - half, middle + half

    def difference(self, values: FloatArray, others: FloatArray) -> tuple[float, float]:
        """Return the mean of the differences and its standard error."""
        apart = others - values
        if not np.isfinite(apart).all() or len(apart) < 2:
            return float(np.mean(others) - np.mean(values)), math.nan
        return float(apart.mean()), float(apart.std(ddof=1)) / math.sqrt(len(apart))


def _probability(value: Any) -> float:
    p = float(finite(value, "probability"))
    if not 0 < p < 1:
        raise InvalidInputError(f"probability: found {p:g}, expected a number between 0 and 1, such as 0.95")
    return p


@dataclass(frozen=True, slots=True, kw_only=True)
class _AtProbability(Measure):
    probability: float

    def __post_init__(self) -> None:
        check_types(self)
        object.__setattr__(self, "probability", _probability(self.probability))


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantile(_AtProbability):
    """The objective that is not exceeded with a probability.

    Args:
        probability: in (0, 1).

    Examples:
        >>> Quantile(probability=0.6).of([1.0, 2.0, 3.0, 4.0, 5.0])
        3.0
    """

    @property
    def label(self) -> str:
        """What it is called in reports."""
        return f"{100 * self.probability:g} % quantile"

    def of(self, values: Any) -> Any:
        """Return the smallest value that at least this share does not exceed."""
        return _quantile(values, self.probability)

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the quantile and an interval between order statistics, which holds for every distribution."""
        from scipy.stats import binom  # noqa: PLC0415 - SciPy, only when something is validated

        ordered, n = np.sort(values), len(values)
        beside = 0.5 * (1 - confidence)
        # P(x_(k) <= q) = P(Binomial(n, p) >= k)
        lower = int(binom.ppf(beside, n, self.probability))
        upper = int(binom.ppf(1 - beside, n, self.probability)) + 1
        low = float(ordered[lower - 1]) if lower >= 1 else -math.inf
        high = float(ordered[upper - 1]) if upper <= n else math.inf
        return float(self.of(values)), low, high


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionalValueAtRisk(_AtProbability):
    """The mean of the worst cases: of what lies beyond a quantile (Rockafellar and Uryasev, J. Risk 2 (2000) 21).

    Args:
        probability: of the quantile, in (0, 1): 0.9 averages the worst tenth.

    Examples:
        >>> ConditionalValueAtRisk(probability=0.6).of([1.0, 2.0, 3.0, 4.0, 5.0])
        4.5
    """

    @property
    def label(self) -> str:
        """What it is called in reports."""
        return f"mean of the worst {100 * (1 - self.probability):g} %"

    def of(self, values: Any) -> Any:
        """Return q + mean(max(f - q, 0)) / (1 - p) with the quantile q."""
        f = np.asarray(values, dtype=np.float64)
        q = np.asarray(_quantile(f, self.probability))[..., None]
        with np.errstate(invalid="ignore"):
            beyond = np.where(f > q, f - q, 0.0).mean(axis=-1)
        return float_or_array(q[..., 0] + beyond / (1 - self.probability))

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the mean of the tail and its asymptotic interval: that of the mean of q + max(f - q, 0) / (1 - p)."""
        q = _quantile(values, self.probability)
        if not math.isfinite(q):
            return math.inf, -math.inf, math.inf
        return Expected().estimate(q + np.maximum(values - q, 0.0) / (1 - self.probability), confidence)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstCase(Measure):
    """The largest objective of all encounters that are possible.

    Examples:
        >>> WorstCase().of([1.0, 2.0, 6.0])
        6.0
    """

    label: ClassVar[str] = "worst case"

    def of(self, values: Any) -> Any:
        """Return the largest value."""
        return float_or_array(np.max(values, axis=-1))

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the largest value; no sample bounds a worst case from above."""
        del confidence
        largest = float(np.max(values))
        return largest, largest, math.inf

    def difference(self, values: FloatArray, others: FloatArray) -> tuple[float, float]:
        """Return the difference of the largest values, of which samples give no standard error."""
        return float(np.max(others) - np.max(values)), math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Required:
    """A constraint that must hold with a probability: a chance constraint.

    Args:
        constraint: the limit.
        probability: with which it must hold, in (0, 1]; 1 asks for every encounter that is sampled.

    Examples:
        >>> Required(constraint=Constraint(name="relative_velocity", limit=0.1), probability=0.6).share([0.5, 0.9, 1.2])
        0.9
    """

    constraint: Constraint
    probability: float = 1.0

    def __post_init__(self) -> None:
        check_types(self)
        if self.probability != 1:
            object.__setattr__(self, "probability", _probability(self.probability))

    def share(self, ratios: Any) -> Any:
        """Return the ratio |quantity| / limit that is not exceeded with the probability, along the last axis."""
        return float_or_array(np.max(ratios, axis=-1)) if self.probability == 1 else _quantile(ratios, self.probability)


def limits_of(constraints: Iterable[Constraint | Required]) -> tuple[Required, ...]:
    """Return constraints, each with its probability: a plain one must hold in every encounter."""
    return tuple(c if isinstance(c, Required) else Required(constraint=c) for c in constraints)


def _quantile(values: Any, probability: float) -> Any:
    f = np.asarray(values, dtype=np.float64)
    rank = min(max(math.ceil(probability * f.shape[-1] - 1e-9), 1), f.shape[-1]) - 1
    return float_or_array(np.partition(f, rank, axis=-1)[..., rank])


def least_probability(held: int, count: int, confidence: float) -> float:
    """Return the one-sided lower bound of a probability after so many successes (Clopper and Pearson, 1934)."""
    from scipy.special import betaincinv  # noqa: PLC0415 - SciPy, only when something is validated

    return 0.0 if held == 0 else float(betaincinv(held, count - held + 1, 1 - confidence))
