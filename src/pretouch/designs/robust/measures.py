"""Combine the objectives of many encounters into one number.

Examples are the mean and a quantile.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.files import with_kind
from pretouch._core.numbers import FloatArray, checked_probability, float_or_array


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure(ABC):
    """Base class of risk measures, such as the mean.

    A risk measure reduces the objectives of many encounters to one number. A risk measure must not fall unless some
    objective falls.
    """

    @property
    @abstractmethod
    def label(self) -> str:
        """The name of the risk measure in reports."""

    def to_dict(self) -> dict[str, Any]:
        """Return the risk measure as a JSON object.

        It contains name, label and parameters.
        """
        return {**with_kind(self), "label": self.label}

    @abstractmethod
    def of(self, values: Any) -> Any:
        """Compute the risk measure along the last axis.

        It is infinite if relevant objectives are infinite.
        """

    @abstractmethod
    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Estimate the risk measure from independent samples.

        Return the estimate and its confidence interval.
        """

    def difference(self, values: FloatArray, others: FloatArray) -> tuple[float, float]:
        """Compare the risk measure of two gains in the same encounters.

        A bootstrap over the pairs gives the standard error.

        Returns:
            The difference and its standard error, which is NaN if the difference is not finite.
        """
        difference = float(self.of(others) - self.of(values))
        if not math.isfinite(difference):
            return difference, math.nan
        resampled = np.random.default_rng(0).integers(len(values), size=(_DRAWS, len(values)))
        return difference, float(np.std(self.of(others[resampled]) - self.of(values[resampled]), ddof=1))


def checked_measure(measure: Any) -> Measure:
    """Check a user-defined risk measure, and return it.

    Returns:
        The measure.

    Raises:
        InvalidInputError: it is no Measure, or its class overrides `of` without `label` and `estimate`.
    """
    if not isinstance(measure, Measure):
        raise InvalidInputError(
            f"measure: found {measure!r}, expected Expected, Quantile, ConditionalValueAtRisk, WorstCase or a "
            "subclass of Measure",
            value=measure,
        )
    home = {name: next(c for c in type(measure).__mro__ if name in vars(c)) for name in ("of", "label", "estimate")}
    for name in ("label", "estimate"):
        if not issubclass(home[name], home["of"]):
            raise InvalidInputError(
                f"measure: the class {type(measure).__name__} overrides the method `of`, but not the method `{name}`; "
                f"override `{name}` as well"
            )
    if isinstance(measure, WorstCase) and home["of"] is not WorstCase:
        raise InvalidInputError(
            f"measure: the class {type(measure).__name__} overrides the method `of` of WorstCase, but a worst-case "
            "search does not call this method; use WorstCase itself"
        )
    return measure


_DRAWS: Final = 400  # bootstrap samples, which give the standard error to about 4 %


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected(Measure):
    """The mean of the objective over all encounters.

    Examples:
        >>> Expected().of([1.0, 2.0, 6.0])
        3.0
    """

    label: ClassVar[str] = "expected value"

    def of(self, values: Any) -> Any:
        """Return the mean of values along the last axis."""
        return float_or_array(np.mean(values, axis=-1))

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the mean with its confidence interval.

        The interval uses Student's t distribution.
        """
        from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is imported only for a validation

        middle = float(np.mean(values))
        if not math.isfinite(middle) or len(values) < 2:
            return middle, -math.inf, math.inf
        half = float(stdtrit(len(values) - 1, 0.5 + 0.5 * confidence)) * float(np.std(values, ddof=1))
        half /= math.sqrt(len(values))
        return middle, middle - half, middle + half

    def difference(self, values: FloatArray, others: FloatArray) -> tuple[float, float]:
        """Return the mean of paired differences and its standard error."""
        differences = others - values
        if not np.isfinite(differences).all() or len(differences) < 2:
            return float(np.mean(others) - np.mean(values)), math.nan
        return float(differences.mean()), float(differences.std(ddof=1)) / math.sqrt(len(differences))


@dataclass(frozen=True, slots=True, kw_only=True)
class _AtProbability(Measure):
    probability: float

    def __post_init__(self) -> None:
        check_types(self)
        object.__setattr__(self, "probability", checked_probability(self.probability))


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantile(_AtProbability):
    """The quantile of the objective.

    A given share of the encounters does not exceed it.

    Args:
        probability: in (0, 1).

    Examples:
        >>> Quantile(probability=0.6).of([1.0, 2.0, 3.0, 4.0, 5.0])
        3.0
    """

    @property
    def label(self) -> str:
        """The name of the quantile in reports."""
        return f"{100 * self.probability:g} % quantile"

    def of(self, values: Any) -> Any:
        """Return the sample quantile of the values along the last axis."""
        return sample_quantile(values, self.probability)

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the quantile with its confidence interval.

        The interval is valid for every distribution. The interval lies between order statistics.
        """
        from scipy.stats import binom  # noqa: PLC0415 - SciPy is imported only for a validation

        ordered, n = np.sort(values), len(values)
        tail = 0.5 * (1 - confidence)
        # P(x_(k) <= q) = P(Binomial(n, p) >= k)
        lower = int(binom.ppf(tail, n, self.probability))
        upper = int(binom.ppf(1 - tail, n, self.probability)) + 1
        low = float(ordered[lower - 1]) if lower >= 1 else -math.inf
        high = float(ordered[upper - 1]) if upper <= n else math.inf
        return float(self.of(values)), low, high


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionalValueAtRisk(_AtProbability):
    """The mean of the values beyond a quantile.

    This is the tail mean of Rockafellar and Uryasev, J. Risk 2 (2000) 21.

    Args:
        probability: probability of the quantile, in (0, 1): 0.9 averages the worst 10 %.

    Examples:
        >>> ConditionalValueAtRisk(probability=0.6).of([1.0, 2.0, 3.0, 4.0, 5.0])
        4.5
    """

    @property
    def label(self) -> str:
        """The name of the tail mean in reports."""
        return f"mean of the worst {100 * (1 - self.probability):g} %"

    def of(self, values: Any) -> Any:
        """Return the mean of the values beyond a quantile.

        With the quantile q of probability p, it is q + mean(max(f - q, 0)) / (1 - p).
        """
        f = np.asarray(values, dtype=np.float64)
        q = np.asarray(sample_quantile(f, self.probability))[..., None]
        with np.errstate(invalid="ignore"):
            beyond = np.where(f > q, f - q, 0.0).mean(axis=-1)
        return float_or_array(q[..., 0] + beyond / (1 - self.probability))

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the tail mean with its confidence interval.

        The interval is valid for large numbers of samples. The interval is that of the mean of q + max(f - q, 0) / (1 -
        p).
        """
        terms = self._terms(values)
        if not np.isfinite(terms).all():
            return math.inf, -math.inf, math.inf
        return Expected().estimate(terms, confidence)

    def difference(self, values: FloatArray, others: FloatArray) -> tuple[float, float]:
        """Return the difference of the tail means in the same encounters, and its standard error.

        The standard error is valid for large numbers of samples. It is that of the mean of the paired differences of
        q + max(f - q, 0) / (1 - p).
        """
        return Expected().difference(self._terms(values), self._terms(others))

    def _terms(self, values: FloatArray) -> FloatArray:
        """Return numbers whose mean is the tail mean: q + max(f - q, 0) / (1 - p); infinite if q is infinite."""
        q = sample_quantile(values, self.probability)
        if not math.isfinite(q):
            return np.full(len(values), np.inf)
        return np.asarray(q + np.maximum(values - q, 0.0) / (1 - self.probability))


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstCase(Measure):
    """The largest objective of all possible encounters.

    Examples:
        >>> WorstCase().of([1.0, 2.0, 6.0])
        6.0
    """

    label: ClassVar[str] = "worst case"

    def of(self, values: Any) -> Any:
        """Return the largest value along the last axis."""
        return float_or_array(np.max(values, axis=-1))

    def estimate(self, values: FloatArray, confidence: float) -> tuple[float, float, float]:
        """Return the largest value, with infinity as its upper confidence bound.

        Samples cannot bound a worst case.
        """
        del confidence
        largest = float(np.max(values))
        return largest, largest, math.inf

    def difference(self, values: FloatArray, others: FloatArray) -> tuple[float, float]:
        """Return the difference of the largest values of two samples.

        Its standard error is unknown and therefore NaN.
        """
        return float(np.max(others) - np.max(values)), math.nan


def sample_quantile(values: Any, probability: float) -> Any:
    """Return the quantile of samples along the last axis.

    It is the smallest value such that at least this share of the values does not exceed it.
    """
    f = np.asarray(values, dtype=np.float64)
    rank = min(max(math.ceil(probability * f.shape[-1] - 1e-9), 1), f.shape[-1]) - 1
    return float_or_array(np.partition(f, rank, axis=-1)[..., rank])
