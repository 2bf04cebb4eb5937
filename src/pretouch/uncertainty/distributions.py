"""Define probability distributions of uncertain inputs, such as uniform and normal distributions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch._core.files import with_kind
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity, format_range

_NARROW: Final = 1e-4
"""Width of a truncated normal distribution, in deviations, below which its density is taken as exponential.

Differences of Phi lose all digits there; the relative error of the exponential is the square of this width."""

_FLAT: Final = 1e-3
"""Decrease of ln of this exponential density below which its mean is computed to first order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDistribution(ABC):
    """Abstract base class of joint distributions of several inputs.

    Users can derive their own distributions.
    """

    @abstractmethod
    def inputs(self, name: str) -> tuple[str, ...]:
        """Return the names of the inputs that have this distribution.

        `name` is the key of the distribution in the uncertainty.
        """

    @abstractmethod
    def means(self) -> tuple[float, ...]:
        """Return the mean of each input in SI units."""

    @abstractmethod
    def draw(self, points: FloatArray) -> FloatArray:
        """Convert points of the unit cube to samples of the inputs.

        The cube is open, and each point gives one sample. Points and samples have the shape (n, k).
        """

    @abstractmethod
    def variance_along(self, slopes: FloatArray) -> float:
        """Return the variance of a weighted sum of the inputs.

        The slopes are the weights.
        """

    @abstractmethod
    def alone(self, index: int) -> Distribution:
        """Return the distribution of one input alone (the marginal distribution)."""

    @abstractmethod
    def others(self, index: int, values: FloatArray) -> FloatArray:
        """Return the conditional means of all inputs given one input.

        For n values of one of k inputs, the shape is (k, n).
        """

    def rows(self, name: str, units: Mapping[str, str]) -> Iterator[tuple[str, str]]:
        """Yield the name and a description of the distribution of each input.

        `units` has the SI units of inputs.
        """
        members = self.inputs(name)
        others = f", jointly with the other inputs of {name}" if len(members) > 1 else ""
        for i, member in enumerate(members):
            yield member, self.alone(i).described(units.get(member, "")) + others

    def to_dict(self) -> dict[str, Any]:
        """Return the distribution as a JSON dictionary in SI units.

        The dictionary contains the kind and the parameters.
        """
        return with_kind(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Distribution(JointDistribution):
    """Abstract base class of distributions of one input.

    Derived classes define `support` and `_quantile`.
    """

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """The smallest and the largest possible value of the input.

        Either may be infinite.
        """

    @abstractmethod
    def _quantile(self, probability: FloatArray) -> FloatArray:
        """Return the quantiles of the distribution for probabilities between 0 and 1."""

    @property
    def mean(self) -> float:
        """The mean of the uncertain input.

        The quadrature is of the Gauss-Legendre type.
        """
        nodes, weights = np.polynomial.legendre.leggauss(200)
        return float(0.5 * (weights * self.quantile(0.5 * (nodes + 1))).sum())

    @property
    def variance(self) -> float:
        """The variance of the uncertain input.

        For an interval, it is that of a uniform distribution.
        """
        nodes, weights = np.polynomial.legendre.leggauss(200)
        deviation = self.quantile(0.5 * (nodes + 1)) - self.mean
        return float(0.5 * (weights * deviation**2).sum())

    def described(self, unit: str) -> str:
        """Return a description of the distribution as text.

        An example is `uniform, 38 mm to 46 mm`.

        `unit` is the SI unit of the input.
        """
        return f"{type(self).__name__}, {format_range(self.support, unit)}"

    @final
    def quantile(self, probability: Any) -> Any:
        """Return the quantile of the distribution for a probability.

        The probability is from 0 to 1. At 0 and 1, the quantile is an end of the support.

        Examples:
            >>> Uniform(low=-0.5, high=-0.1).quantile(0.25)
            -0.4
        """
        p = np.asarray(probability, dtype=np.float64)
        inside = np.clip(p, np.finfo(np.float64).tiny, 1 - 2.0**-53)
        low, high = self.support
        values = np.where(p <= 0, low, np.where(p >= 1, high, self._quantile(inside)))
        return float(values) if values.ndim == 0 else values

    @final
    def inputs(self, name: str) -> tuple[str, ...]:
        """Return the name of the only input as a tuple."""
        return (name,)

    @final
    def means(self) -> tuple[float, ...]:
        """Return a tuple with one element, the mean of the input."""
        return (self.mean,)

    @final
    def draw(self, points: FloatArray) -> FloatArray:
        """Convert probabilities to samples of the input.

        Returns:
            The samples: the quantile at each probability.
        """
        return np.asarray(self.quantile(points))

    @final
    def variance_along(self, slopes: FloatArray) -> float:
        """Return the variance of the product of a slope and the input."""
        return float(slopes[0] ** 2 * self.variance)

    @final
    def alone(self, index: int) -> Distribution:  # noqa: ARG002
        """Return this distribution itself, because it has only one input."""
        return self

    @final
    def others(self, index: int, values: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the values as an array with one row.

        This distribution has only one input.
        """
        return values[None]


def normal_in_words(mean: float, deviation: float, unit: str) -> str:
    """Return a description of a normal distribution as text.

    It contains the mean and the standard deviation with the unit of the input.
    """
    return f"normal, {format_quantity(mean, unit)} with a standard deviation of {format_quantity(deviation, unit)}"


def _check_order(low: float, high: float) -> None:
    if not low < high:
        raise InvalidInputError(
            f"low: found the range from low = {low:g} to high = {high:g}, but low must be smaller than high"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval(Distribution):
    """Range of an input without a probability distribution, for worst-case designs.

    If samples are drawn nevertheless, alone or together with other inputs, they are uniform.

    Args:
        low: the smallest value, in SI.
        high: the largest value.

    Examples:
        >>> Interval(low=0.03, high=0.05).mean
        0.04
    """

    low: float = quantity("")
    high: float = quantity("")
    _words: ClassVar[str] = "anywhere"

    def __post_init__(self) -> None:
        check_declared(self)
        _check_order(self.low, self.high)

    @property
    def support(self) -> tuple[float, float]:
        """The lower and the upper bound of the interval."""
        return self.low, self.high

    @property
    def mean(self) -> float:
        """The middle of the interval."""
        return 0.5 * (self.low + self.high)

    @property
    def variance(self) -> float:
        """The variance of a uniform distribution over the interval."""
        return (self.high - self.low) ** 2 / 12

    def _quantile(self, probability: FloatArray) -> FloatArray:
        return self.low + (self.high - self.low) * probability

    def described(self, unit: str) -> str:
        """Return a description of the interval: its two bounds."""
        return f"{self._words}, {format_range(self.support, unit)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Uniform(Interval):
    """Uniform distribution between two values.

    Args:
        low: the smallest value, in SI.
        high: the largest value.

    Examples:
        >>> Uniform(low=-0.5, high=-0.1).support
        (-0.5, -0.1)
    """

    _words: ClassVar[str] = "uniform"


@dataclass(frozen=True, slots=True, kw_only=True)
class Normal(Distribution):
    """Normal distribution with a mean and a standard deviation.

    Args:
        mean: mu, in SI.
        deviation: the standard deviation sigma > 0.

    Examples:
        >>> round(Normal(mean=0.0, deviation=1.0).quantile(0.975), 4)
        1.96
    """

    mean: float = quantity("")
    deviation: float = quantity("", sign="positive")

    def __post_init__(self) -> None:
        check_declared(self)

    @property
    def support(self) -> tuple[float, float]:
        """The range of the normal distribution, which is infinite."""
        return -math.inf, math.inf

    @property
    def variance(self) -> float:
        """The variance of the normal distribution."""
        return self.deviation**2

    def _quantile(self, probability: FloatArray) -> FloatArray:
        from scipy.special import ndtri  # noqa: PLC0415 - SciPy, only when something is sampled

        return np.asarray(self.mean + self.deviation * ndtri(probability))

    def described(self, unit: str) -> str:
        """Return mean and standard deviation of the distribution as text."""
        return normal_in_words(self.mean, self.deviation, unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class TruncatedNormal(Distribution):
    """Normal distribution whose values are restricted to a range.

    Args:
        location: mean mu of the normal distribution before truncation, in SI.
        deviation: its standard deviation sigma > 0.
        low: the smallest possible value; may be minus infinity.
        high: the largest possible value; may be infinite.

    Examples:
        >>> speed = TruncatedNormal(location=-0.3, deviation=0.1, low=-0.5, high=-0.05)
        >>> round(speed.mean, 4)
        -0.2962
    """

    location: float = quantity("")
    deviation: float = quantity("", sign="positive")
    low: float = quantity("", -math.inf, infinite=True)
    high: float = quantity("", math.inf, infinite=True)

    def __post_init__(self) -> None:
        check_declared(self)
        low, high = self.low, self.high
        _check_order(low, high)
        if max(low - self.location, self.location - high) > 30 * self.deviation:
            raise InvalidInputError(
                f"low: the range from {low:g} to {high:g} is more than 30 standard deviations away from the location "
                f"{self.location:g} of the distribution. Choose a range nearer to this location"
            )

    @property
    def support(self) -> tuple[float, float]:
        """The smallest and the largest possible value of the truncated normal distribution."""
        return self.low, self.high

    @property
    def mean(self) -> float:
        """The mean of the truncated normal distribution.

        It is mu + sigma (phi(a) - phi(b)) / (Phi(b) - Phi(a)), accurate in both tails.
        """
        a, b = ((x - self.location) / self.deviation for x in self.support)
        if b - a < _NARROW:
            fall = (b * b - a * a) / 2
            share = 0.5 - fall / 12 if abs(fall) < _FLAT else 1 / fall - 1 / math.expm1(fall)
            return self.location + self.deviation * (a + (b - a) * share)
        a, b, sign = (-b, -a, -1.0) if a > 0 else (a, b, 1.0)  # Phi(b) - Phi(a) loses digits in the upper tail
        mass = (math.erfc(-b / math.sqrt(2)) - math.erfc(-a / math.sqrt(2))) / 2
        density = (math.exp(-a * a / 2) - math.exp(-b * b / 2)) / math.sqrt(2 * math.pi)
        return self.location + sign * self.deviation * density / mass

    def _quantile(self, probability: FloatArray) -> FloatArray:
        from scipy.special import ndtr, ndtri  # noqa: PLC0415 - SciPy, only when something is sampled

        a, b = ((x - self.location) / self.deviation for x in self.support)
        if b - a < _NARROW:
            fall = (b * b - a * a) / 2
            z = a + (b - a) * (-np.log1p(probability * math.expm1(-fall)) / fall if fall else probability)
        elif a > 0:
            z = -ndtri(ndtr(-a) * (1 - probability) + ndtr(-b) * probability)
        else:
            z = ndtri(ndtr(a) * (1 - probability) + ndtr(b) * probability)
        return np.asarray(np.clip(self.location + self.deviation * z, self.low, self.high))

    def described(self, unit: str) -> str:
        """Return a description of the truncated normal distribution."""
        normal = normal_in_words(self.location, self.deviation, unit)
        return f"{normal}, truncated to {format_range(self.support, unit)}"
