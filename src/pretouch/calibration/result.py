"""Define the results of a calibration, such as fitted parameters with their uncertainties."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np

from pretouch._core.display import Described
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.units import format_percent, format_quantity, supported_digits
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .data import Calibration


@dataclass(frozen=True, slots=True, kw_only=True)
class SlopeUncertainty(Value):
    """The sensor slope and its uncertainty in the usable range.

    The uncertainty covers all curves that fit the readings, and all offsets with which they fit.

    Args:
        distances: increasing, from the nearest to the farthest usable distance [m], shape (N,).
        slope: the mean of g over all curves [1/m], shape (N,).
        uncertainty: half the width of the 95 % interval of g, relative to g, shape (N,).
        decisive: the distance, among `distances`, at which the signal has fallen to a tenth [m]; most of the virtual
            force acts between the nearest distance and this one.
    """

    distances: FloatArray
    slope: FloatArray
    uncertainty: FloatArray
    decisive: float

    @property
    def largest(self) -> float:
        """The largest relative uncertainty of g at the distances where most of the virtual force acts."""
        return float(self.uncertainty[self.distances <= self.decisive].max())

    @property
    def worst_at(self) -> float:
        """The distance of this largest uncertainty [m]."""
        return float(self.distances[int(self.uncertainty[self.distances <= self.decisive].argmax())])

    @property
    def largest_anywhere(self) -> float:
        """The largest relative uncertainty of g in the usable range."""
        return float(self.uncertainty.max())

    @property
    def worst_anywhere_at(self) -> float:
        """The distance of the largest uncertainty in the usable range [m]."""
        return float(self.distances[int(self.uncertainty.argmax())])


_LARGEST_FACTOR: Final = 1000.0


def uncertainty_in_words(uncertainty: float, digits: int = 2) -> str:
    """Return the relative half width of an interval as text.

    Examples:
        >>> uncertainty_in_words(0.123), uncertainty_in_words(79.0)
        ('12 %', 'a factor of 80')
    """
    if uncertainty < 1:
        return format_percent(uncertainty, digits)
    factor = 1 + uncertainty
    if factor > _LARGEST_FACTOR:
        return f"more than a factor of {_LARGEST_FACTOR:.0f}"
    return f"a factor of {factor:.{supported_digits(factor, least=2)}g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnCurve(Value):
    """Random sensor curve that fits the readings.

    Args:
        sensor: the curve, valid on the window.
        offset: the output without an object that belongs to this curve, in the unit of the outputs.
        ignored: the distance of a reading that this curve ignores because it may be wrong [m]; None for none.
    """

    sensor: SensorModel
    offset: float
    ignored: float | None = None


class AllowedCurves(Protocol):
    """Interface of objects that draw random sensor curves.

    The curves fit the readings.
    """

    def through_readings(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Return random monotone sensor curves through all readings.

        The curves agree with the readings within their errors.
        """

    def draw(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Draw random sensor curves with soft saturation according to their posterior probabilities."""


_FINEST: Final = 1e-4  # smallest relative error of a mean: no sensor is better, and exact numbers need a weight
_WIDE: Final = 6.0  # standard errors: a 95 % interval wider than this is not described by the standard error


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate(Value):
    """An estimated value with its standard error and its 95 % interval.

    Args:
        value: the estimate, in SI.
        standard_error: its standard error; infinite if the readings do not bound it.
        low: lower end of the 95 % profile interval; -inf (0 for a positive quantity) if unbounded.
        high: upper end of the 95 % profile interval; inf if unbounded.
        unit: SI unit, empty for a pure number.
    """

    value: float
    standard_error: float
    low: float
    high: float
    unit: str = ""

    def is_within(self, factor: float) -> bool:
        """Return True if both ends of the interval differ from the value by at most a factor.

        Examples:
            >>> from dataclasses import replace
            >>> slope = Estimate(value=-40.0, standard_error=5.0, low=-50.0, high=-30.0, unit="1/m")
            >>> slope.is_within(3.0), replace(slope, high=-5.0).is_within(3.0)
            (True, False)
        """
        ends = (self.low / self.value, self.high / self.value) if self.value else (0.0, 0.0)
        return all(1 / factor <= end <= factor for end in ends)

    def to_dict(self) -> dict[str, Any]:
        """Return the estimated value as a dictionary for JSON, in SI units."""
        interval = (self.low, self.high)
        return {"value": self.value, "standard_error": self.standard_error, "interval": interval, "unit": self.unit}


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetEstimate(Value):
    """The sensor output without an object in range (offset), with its uncertainty.

    Args:
        value: the offset o, in the unit of the outputs.
        standard_error: its standard error; 0 if it was declared without one.
        low: lower end of its 95 % interval.
        high: upper end of its 95 % interval.
        kind: `measured` (no-object readings), `fitted` (with the curve) or `declared`.
    """

    value: float
    standard_error: float
    low: float
    high: float
    kind: str

    @property
    def is_wide(self) -> bool:
        """Whether the 95 % interval of the offset is wide.

        Then the standard error alone would be misleading.
        """
        return self.high - self.low > _WIDE * self.standard_error

    def digits(self, least: int = 4) -> int:
        """Return the number of significant digits that show the offset and both ends of its interval apart."""
        return supported_digits(self.value, self.high - self.low, least)

    def interval_in_words(self, unit: str, least: int = 4) -> str:
        """Return the 95 % interval of the offset as text.

        Examples:
            >>> offset = OffsetEstimate(
            ...     value=3186950.0, standard_error=120.0, low=3186714.0, high=3187186.0, kind="measured"
            ... )
            >>> offset.interval_in_words("Hz")
            '3186714 Hz to 3187186 Hz'
        """
        width = self.high - self.low
        return " to ".join(format_quantity(v, unit, supported_digits(v, width, least)) for v in (self.low, self.high))

    @property
    def error_in_words(self) -> str:
        """The standard error of the offset as text with two significant digits."""
        return f"{self.standard_error:.{supported_digits(self.standard_error, least=2)}g}"

    def in_words(self, unit: str, digits: int = 4) -> str:
        """Return the offset as text with its standard error.

        The standard error is omitted if it is zero or would be misleading.

        Examples:
            >>> offset = OffsetEstimate(value=180.0, standard_error=1.2, low=177.6, high=182.4, kind="measured")
            >>> from dataclasses import replace
            >>> offset.in_words("counts")
            '180 ± 1.2 counts'
            >>> replace(offset, low=140.0, high=220.0).in_words("counts")
            '180 counts'
        """
        error = "" if self.is_wide or self.standard_error == 0 else f" ± {self.error_in_words}"
        return f"{self.value:.{self.digits(digits)}g}{error} {unit}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseEstimate(Value):
    """Noise of the readings and misfit of the curve.

    The misfit is the systematic error of the fitted sensor curve. The mean of n readings has the variance (output^2 +
    (relative xi)^2) / n + (misfit xi)^2 about the curve.

    Args:
        output: standard deviation of one reading without a signal, in the unit of the outputs.
        relative: additional standard deviation of one reading, relative to xi.
        resolution: step between outputs (LSB); 0 if none was found.
        misfit: RMS deviation of the means from the best curve beyond their noise, relative to xi.
        misfit_length: correlation length of the misfit [m], estimated from its changes of sign; 0 without misfit.
        output_source: the data from which `output` was estimated.
        relative_source: the data from which `relative` was estimated.
    """

    output: float
    relative: float
    resolution: float = 0.0
    misfit: float = 0.0
    misfit_length: float = 0.0
    output_source: str = ""
    relative_source: str = ""

    def relative_of_means(self, count: IntArray) -> FloatArray:
        """Return the relative error of the mean of `count` readings.

        It is caused by noise and by the error of the curve.
        """
        return np.asarray(np.maximum(np.sqrt(self.relative**2 / count + self.misfit**2), _FINEST))

    def of_readings(self, count: IntArray, signal: FloatArray) -> FloatArray:
        """Return the standard deviation of the mean of `count` readings, without the error of the curve.

        It is in the unit of the sensor outputs.
        """
        return np.asarray(np.hypot(self.output, self.relative * signal) / np.sqrt(count))

    def of_means(self, count: IntArray, signal: FloatArray) -> FloatArray:
        """Return the standard deviation of the mean of `count` readings.

        It is in the unit of the sensor outputs.
        """
        return np.asarray(np.hypot(self.output / np.sqrt(count), self.relative_of_means(count) * signal))


@dataclass(frozen=True, slots=True, kw_only=True)
class UsableWindow(Value):
    """Range of distances with a usable sensor signal.

    Args:
        distances: the measured distances inside the window [m], increasing; empty if no signal is above the floor.
        start_reason: the reason for its start, as a clause.
        end_reason: the reason for its end, as a clause.
        saturation: output at and above which readings are clipped; None without clipping.
        floor: output below which a reading cannot be distinguished from the offset.
    """

    distances: tuple[float, ...]
    start_reason: str
    end_reason: str
    saturation: float | None
    floor: float

    @property
    def l_min(self) -> float:
        """The smallest usable distance of the sensor [m]."""
        return self._end(0)

    @property
    def l_max(self) -> float:
        """The largest usable distance of the sensor [m]."""
        return self._end(-1)

    def _end(self, which: int) -> float:
        if not self.distances:
            raise ResultUnavailableError(f"this calibration has no usable window: {self.end_reason}")
        return self.distances[which]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SensorFit(Described, Value):
    """Result of fitting one sensor model to a calibration.

    Residuals and their statistics refer to the points that were used.

    Args:
        model: name of the model.
        sensor: the fitted curve, valid on the window.
        parameters: estimate of each parameter, by name.
        covariance: covariance of the parameters, in the order of `parameters`, including the effect of the offset.
        middle_slope: g in the middle of the window [1/m], which is determined even if the parameters are not. Its
            errors include the choice of the curve family.
        window: the usable window.
        offset: the offset that was subtracted.
        noise: the noise by which the readings were weighted.
        distances: the distances that were fitted [m], shape (N,).
        residuals: ln(y - o) - ln xi at these distances, shape (N,).
        r_squared: share of the variance of xi that the model explains; for comparison with the letter only.
        rmse_log_output: root mean square of `residuals`.
        rmse_log_slope: root mean square difference between measured and modelled slope of ln xi, neighbor to
            neighbor [1/m]; None below two points.
        aicc: corrected Akaike criterion; only differences within one ranking are meaningful. None for a table, or
            with too few points.
        cross_validation: root mean square error of ln xi at distances left out one by one; None with too few.
        slope_shift: relative change of `middle_slope` for one standard error of the offset.
        influences: relative change of g at the nearest distance if one distance is left out, for each of `distances`;
            empty for a table, or with too few points.
        runs_p_value: p-value of the runs test: chance of as few runs of equal signs in independent residuals; None if
            all have one sign.
        outliers: indices of the readings that were left out as outliers.
        unidentifiable: parameters that the readings cannot distinguish, in sentences.
        warnings: cautions for using this fit, in sentences.
    """

    model: str
    sensor: SensorModel
    parameters: dict[str, Estimate]
    covariance: FloatArray
    middle_slope: Estimate
    window: UsableWindow
    offset: OffsetEstimate
    noise: NoiseEstimate
    distances: FloatArray
    residuals: FloatArray
    r_squared: float
    rmse_log_output: float
    rmse_log_slope: float | None
    aicc: float | None
    cross_validation: float | None
    runs_p_value: float | None
    influences: tuple[float, ...] = ()
    slope_shift: float = 0.0
    outliers: tuple[int, ...] = ()
    unidentifiable: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the fit of a sensor model as a dictionary.

        It is for JSON, in SI units.
        """
        estimates = self.parameters.items()
        names = ("covariance", "middle_slope", "r_squared", "rmse_log_output", "rmse_log_slope", "aicc")
        more = (
            "cross_validation",
            "influences",
            "runs_p_value",
            "slope_shift",
            "outliers",
            "unidentifiable",
            "warnings",
        )
        fields = {
            "name": self.model,
            "parameters": {name: e.value for name, e in estimates},
            "standard_errors": {name: e.standard_error for name, e in estimates},
            "intervals": {name: (e.low, e.high) for name, e in estimates},
            "units": {name: e.unit for name, e in estimates},
            **{name: getattr(self, name) for name in (*names, *more)},
        }
        return dict(plain(fields))

    def __repr__(self) -> str:
        return (
            f"<SensorFit {self.model}: g = {self.middle_slope.value:.4g} 1/m, RMS of ln xi {self.rmse_log_output:.2g}>"
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CalibrationReport(Described, Value):
    """Ranking of all sensor models for a calibration.

    The report also contains a verdict on the sensor.

    Args:
        calibration: the readings.
        fits: the fits, best first; empty without a usable signal and with too few distances.
        window: the usable window.
        offset: the offset; None with too few readings to determine it.
        noise: the noise of the readings; None with too few readings to determine it.
        verdict: `usable`, `usable with reservations`, `too few distances` or `no usable signal`.
        reasons: the reasons of the verdict, and what to do, in sentences.
        contradictions: the reasons why the curve itself is doubtful, such as readings that deviate from it. Results
            with this curve repeat them first.
        notes: what would make the readings better, in sentences, although the verdict does not depend on it.
        not_fitted: requested models that could not be fitted, each with the reason.
        slope: the slope g and its uncertainty over all models; None with too few readings.
        left_out: groups of readings that the fits of all models ignore, in sentences.
        curves: source of curves that fit the readings, on which a gain is checked; None without a usable signal.
        scenario_lines: the lines of the section [sensor] of a scenario file that repeat this fit; empty if the readings
            are not from a file.
    """

    calibration: Calibration
    fits: tuple[SensorFit, ...]
    window: UsableWindow
    offset: OffsetEstimate | None
    noise: NoiseEstimate | None
    verdict: str
    reasons: tuple[str, ...]
    contradictions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    not_fitted: dict[str, str] = field(default_factory=dict)
    slope: SlopeUncertainty | None = None
    left_out: tuple[str, ...] = ()
    curves: AllowedCurves | None = None
    scenario_lines: tuple[str, ...] = ()

    @property
    def best(self) -> SensorFit | None:
        """The fit of the best sensor model.

        It is None if no curve can be fitted to the readings.
        """
        return self.fits[0] if self.fits else None

    def to_dict(self) -> dict[str, Any]:
        """Return the calibration results as a dictionary for JSON, in SI units."""
        calibration, slope = self.calibration, self.slope
        source = calibration.source
        fields = {
            "verdict": self.verdict,
            "reasons": self.reasons,
            "notes": self.notes,
            "best": self.best.model if self.best else None,
            "window": (self.window.l_min, self.window.l_max) if self.fits else None,
            "window_reasons": (self.window.start_reason, self.window.end_reason),
            "saturation": self.window.saturation,
            "offset": self.offset or dict.fromkeys(OffsetEstimate.__slots__),
            "noise": self.noise or dict.fromkeys(NoiseEstimate.__slots__),
            "slope": slope
            and {
                "distances": slope.distances,
                "values": slope.slope,
                "uncertainty": slope.uncertainty,
                "decisive_distance": slope.decisive,
                "largest_uncertainty": slope.largest,
                "largest_uncertainty_anywhere": slope.largest_anywhere,
            },
            "left_out": self.left_out,
            "models": self.fits,
            "not_fitted": self.not_fitted,
            "calibration": {
                "file": source and source.file,
                "sha256": source and source.sha256,
                "label": calibration.label,
                "output_unit": calibration.unit,
                "readings": len(calibration.outputs),
                "no_object_readings": len(calibration.no_object),
                "dropped": source.dropped if source else 0,
                "notes": source.notes if source else (),
            },
        }
        return dict(plain(fields))

    def __repr__(self) -> str:
        best = f", best {self.best.model}" if self.best else ""
        return f"<CalibrationReport {self.calibration.name}: {self.verdict}{best}>"
