"""Define distributions of correlated inputs and of measured values."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions, kind_problem
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import format_range
from pretouch.motion.scenario import sensor_with

from .distributions import Distribution, Interval, JointDistribution, Normal, Uniform, normal_in_words

if TYPE_CHECKING:
    from pretouch.calibration import SensorFit

_DEVIATIONS: Final = 4.0  # standard deviations; one sample in 16,000 is farther from the mean


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelatedNormal(JointDistribution):
    """Joint normal distribution of several correlated inputs.

    The parameters of a sensor curve are an example.

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
        check_types(self)
        mean = np.atleast_1d(finite(self.mean, "mean"))
        covariance = np.atleast_2d(finite(self.covariance, "covariance"))
        count = len(self.names)
        if mean.shape != (count,) or covariance.shape != (count, count):
            raise InvalidInputError(
                f"covariance: found a matrix of the shape {covariance.shape}, expected one row and one column for each "
                f"name. Found {mean.shape[0]} mean values for {count} names, expected one mean value for each name"
            )
        scale = np.sqrt(np.outer(np.diag(covariance).clip(0), np.diag(covariance).clip(0)))
        if np.abs(covariance - covariance.T).max(initial=0) > 1e-9 * scale.max(initial=0):
            raise InvalidInputError("covariance: found a matrix that is not symmetric, expected a symmetric one")
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        object.__setattr__(self, "mean", tuple(mean.tolist()))
        object.__setattr__(self, "covariance", tuple(map(tuple, covariance.tolist())))
        self.root  # noqa: B018 - raises if the covariance is impossible

    @property
    def root(self) -> FloatArray:
        """Matrix square root of the covariance.

        It maps independent standard normal samples to correlated inputs.

        R R^T = covariance

        Raises:
            InvalidInputError: the covariance has a negative eigenvalue.
        """
        covariance = np.asarray(self.covariance)
        deviation = np.sqrt(np.diag(covariance).clip(0))
        unit = np.where(deviation > 0, deviation, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
        if values.min(initial=0) < -1e-9:
            raise InvalidInputError(
                "covariance: found a matrix with a negative eigenvalue, expected a positive semidefinite one"
            )
        return np.asarray(unit[:, None] * vectors * np.sqrt(values.clip(0)))

    def inputs(self, name: str) -> tuple[str, ...]:  # noqa: ARG002
        """Return the names of all correlated inputs."""
        return self.names

    def means(self) -> tuple[float, ...]:
        """Return the mean of each correlated input."""
        return self.mean

    def draw(self, points: FloatArray) -> FloatArray:
        """Convert unit-cube points to samples of the correlated inputs.

        Returns:
            One sample for each point.
        """
        from scipy.special import ndtri  # noqa: PLC0415 - SciPy, only when something is sampled

        return np.asarray(np.asarray(self.mean) + ndtri(points) @ self.root.T)

    def variance_along(self, slopes: FloatArray) -> float:
        """Return the variance of a weighted sum of the correlated inputs."""
        return float(slopes @ np.asarray(self.covariance) @ slopes)

    def alone(self, index: int) -> Normal:
        """Return the normal distribution of one input alone (the marginal distribution)."""
        return Normal(mean=self.mean[index], deviation=math.sqrt(self.covariance[index][index]))

    def others(self, index: int, values: FloatArray) -> FloatArray:
        """Return the conditional means of all inputs, given values of one input."""
        covariance, mean = np.asarray(self.covariance), np.asarray(self.mean)[:, None]
        slope = covariance[index] / covariance[index, index]
        return np.asarray(mean + slope[:, None] * (values - mean[index]))

    def rows(self, name: str, units: Mapping[str, str]) -> Iterator[tuple[str, str]]:
        """Yield name and distribution of each correlated input as text."""
        for i, member in enumerate(self.names):
            text = normal_in_words(self.mean[i], math.sqrt(self.covariance[i][i]), units.get(member, ""))
            yield member, f"{text}, jointly with the other inputs of {name}"


@check_arguments
def parameter_distribution(fit: SensorFit) -> CorrelatedNormal:
    """Return the joint normal distribution of fitted sensor parameters.

    The covariance is that of the fit.

    The scale of the output is not included, because it cancels from the virtual force. The parameters of a curve are
    strongly correlated: a larger exponent with a larger offset gives nearly the same curve. So independent
    variations would overestimate the uncertainty by far.

    Args:
        fit: one model fitted to one calibration; its covariance includes the effect of the no-object offset.

    Returns:
        The distribution of `sensor.NAME` for each parameter; use it under any name as a value of an uncertainty.

    Raises:
        InvalidInputError: the readings do not bound a parameter, the curve has none, or parameters four standard errors
            away are impossible.

    Examples:
        >>> from pretouch.calibration import Calibration, fit_sensor
        >>> distance = np.linspace(0.0, 0.08, 33)
        >>> noise = 1e-3 * np.sin(1e4 * distance)
        >>> measured = Calibration(distances=distance, outputs=np.exp(-61.0 * distance) + noise, unit="V")
        >>> distribution = parameter_distribution(fit_sensor(measured, "exponential-1", offset="zero"))
        >>> distribution.names, round(distribution.mean[0])
        (('sensor.rate',), -61)
    """
    names = [name for name in fit.parameters if name != "scale"]
    if not names:
        raise InvalidInputError(
            f"fit: the sensor curve {fit.model!r} has no parameters; fit a curve with parameters, such as inverse-power"
        )
    indices = [list(fit.parameters).index(name) for name in names]
    covariance = fit.covariance[np.ix_(indices, indices)]
    open_ended = [n for n in names if not np.isfinite(fit.parameters[n].standard_error)]
    if open_ended or not np.isfinite(covariance).all():
        unbounded = open_ended or names
        listed = f"parameter{'s' * (len(unbounded) > 1)} {' and '.join(unbounded)}"
        sentences = (
            f"fit: the readings do not determine the fitted {listed}, so the fit has no covariance.",
            *fit.unidentifiable,
            "Fit a curve with fewer parameters, such as exponential-1, or specify the distribution of each parameter",
        )
        raise InvalidInputError(" ".join(sentences))
    mean = np.array([fit.parameters[name].value for name in names])
    _check_tails(fit, names, mean, covariance)
    return CorrelatedNormal(
        names=tuple(f"sensor.{name}" for name in names),
        mean=tuple(mean.tolist()),
        covariance=tuple(map(tuple, covariance.tolist())),
    )


def _check_tails(fit: SensorFit, names: list[str], mean: FloatArray, covariance: FloatArray) -> None:
    """Reject fits with impossible sensor curves within four standard errors.

    For each parameter at its limits, the other parameters have their conditional means.

    Raises:
        InvalidInputError: a curve is impossible.
    """
    for i, name in enumerate(names):
        error = float(np.sqrt(max(covariance[i, i], 0.0)))
        if error == 0:
            continue
        for side in (-_DEVIATIONS, _DEVIATIONS):
            values = dict(zip(names, (mean + side * covariance[:, i] / error).tolist(), strict=True))
            try:
                sensor_with(fit.sensor, values)
            except InvalidInputError as impossible:
                raise InvalidInputError(
                    f"fit: the fitted parameter {name} has the value {mean[i]:.4g} and the standard error {error:.2g}. "
                    f"A normal distribution with this standard error includes impossible curves ({impossible}). "
                    "Calibrate with more readings, or specify the distribution of each parameter",
                    value=name,
                ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Empirical(Distribution):
    """Distribution of equally probable measured values of an input.

    Args:
        samples: the values, in SI, in any order; at least two.

    Examples:
        >>> Empirical(samples=(-0.31, -0.28, -0.30, -0.35)).quantile([0.1, 0.9])
        array([-0.35, -0.28])
    """

    samples: tuple[float, ...]

    def __post_init__(self) -> None:
        check_types(self)
        values = np.atleast_1d(finite(self.samples, "samples"))
        if values.ndim != 1 or len(values) < 2:
            raise InvalidInputError(
                f"samples: found an array of shape {np.shape(values)}, expected a list of two or more values"
            )
        object.__setattr__(self, "samples", tuple(np.sort(values).tolist()))

    @property
    def support(self) -> tuple[float, float]:
        """The smallest and the largest of the measured values."""
        return self.samples[0], self.samples[-1]

    @property
    def mean(self) -> float:
        """The mean of the measured values."""
        return math.fsum(self.samples) / len(self.samples)

    @property
    def variance(self) -> float:
        """The variance of the measured values.

        It is the mean squared deviation from their mean.
        """
        return math.fsum((x - self.mean) ** 2 for x in self.samples) / len(self.samples)

    def _quantile(self, probability: FloatArray) -> FloatArray:
        count = len(self.samples)
        return np.asarray(self.samples)[np.minimum((probability * count).astype(np.int64), count - 1)]

    def described(self, unit: str) -> str:
        """Return the number and the range of measured values as text."""
        return f"{len(self.samples)} measured values, {format_range(self.support, unit)}"


DISTRIBUTION_KINDS: Final = Extensions(
    group="pretouch.distributions",
    built_in=lambda: {"normal": Normal, "uniform": Uniform, "interval": Interval, "samples": Empirical},
    problem=kind_problem(Distribution, "pretouch.uncertainty.Distribution"),
)
"""The distributions of one input that files may name: those of pretouch, and those of installed packages."""
