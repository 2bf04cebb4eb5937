"""What a calibration gives: estimates with their uncertainty, the fit of one model, the report over all."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Final, Protocol

import numpy as np

from pretouch._core.blocks import Described
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .data import Calibration


@dataclass(frozen=True, slots=True, kw_only=True)
class SlopeKnowledge(Value):
    """What all curves that the readings allow say about g, in the part where most of the virtual force is given.

    Args:
        distances: from the nearest usable one to where the signal is a tenth of that there [m], shape (N,).
        slope: the mean of g over all curves [1/m], shape (N,).
        uncertainty: half the width of the 95 % interval of g, relative to it, shape (N,).
        worst_at: where that is largest [m].
    """

    distances: FloatArray
    slope: FloatArray
    uncertainty: FloatArray
    worst_at: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnCurve(Value):
    """One curve that the readings allow, with the offset that goes with it.

    Args:
        sensor: the curve, valid on the window.
        offset: what would have to be subtracted for it, in the unit of the outputs.
    """

    sensor: SensorModel
    offset: float


class AllowedCurves(Protocol):
    """Curves that the readings allow."""

    def through_readings(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Return curves through all readings, monotone between neighbors, whatever family was fitted."""

    def draw(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Draw curves of ideal families under soft ceilings, each as probable as the readings make it."""


_FINEST: Final = 1e-4  # of xi: nothing is known better; exact numbers are weighed as their logarithms


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate(Value):
    """A number with its uncertainty.

    Args:
        value: the estimate, in SI.
        standard_error: its standard error; infinite where the readings do not bound it.
        low: lower end of the 95 % profile interval; -inf (0 for a positive quantity) where it has none.
        high: upper end of the 95 % profile interval; inf where it has none.
        unit: SI unit, empty for a pure number.
    """

    value: float
    standard_error: float
    low: float
    high: float
    unit: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate as one JSON object, in SI."""
        interval = (self.low, self.high)
        return {"value": self.value, "standard_error": self.standard_error, "interval": interval, "unit": self.unit}


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetEstimate(Value):
    """The output with no object in range: what has to be subtracted before a logarithm is taken.

    Args:
        value: the offset o, in the unit of the outputs.
        standard_error: its standard error; 0 where it was declared to be exact.
        low: lower end of its 95 % interval.
        high: upper end of its 95 % interval.
        kind: `measured` (no-object readings), `fitted` (with the curve) or `declared`.
    """

    value: float
    standard_error: float
    low: float
    high: float
    kind: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseEstimate(Value):
    """What lies between readings and the curve: noise, drawn anew for every reading, and misfit, which stays.

    The mean of n readings has the variance (output^2 + (relative xi)^2) / n + (misfit xi)^2 about the curve.

    Args:
        output: standard deviation of one reading where there is no signal, in the unit of the outputs.
        relative: standard deviation of one reading relative to xi, on top.
        resolution: step in which the outputs come; 0 where none was found.
        misfit: RMS distance of the means from the best curve beyond what noise explains, relative to xi.
        misfit_length: correlation length of the misfit [m], by its changes of sign; 0 where there is none.
        output_source: where `output` comes from.
        relative_source: where `relative` comes from.
    """

    output: float
    relative: float
    resolution: float = 0.0
    misfit: float = 0.0
    misfit_length: float = 0.0
    output_source: str = ""
    relative_source: str = ""

    def relative_of_means(self, count: IntArray) -> FloatArray:
        """Return the part of the standard deviation of means of `count` readings that grows with xi, over xi."""
        return np.asarray(np.maximum(np.sqrt(self.relative**2 / count + self.misfit**2), _FINEST))

    def of_means(self, count: IntArray, signal: FloatArray) -> FloatArray:
        """Return the standard deviation of means of `count` readings at signals xi, in the unit of the outputs."""
        return np.asarray(np.hypot(self.output / np.sqrt(count), self.relative_of_means(count) * signal))


@dataclass(frozen=True, slots=True, kw_only=True)
class UsableWindow(Value):
    """The distances at which the sensor can be used, and why they end where they do.

    Args:
        distances: the measured distances inside the window [m], increasing; empty where nothing stands above the floor.
        start_reason: why the window starts where it does, in a sentence.
        end_reason: why it ends where it does, in a sentence.
        saturation: output from which readings count as clipped; None where no clipping was found or given.
        floor: output below which a reading does not tell a signal from the offset.
    """

    distances: tuple[float, ...]
    start_reason: str
    end_reason: str
    saturation: float | None
    floor: float

    @property
    def l_min(self) -> float:
        """The smallest usable distance [m]."""
        return self._end(0)

    @property
    def l_max(self) -> float:
        """The largest usable distance [m]."""
        return self._end(-1)

    def _end(self, which: int) -> float:
        if not self.distances:
            raise ResultUnavailableError(f"this calibration has no usable window: {self.end_reason}")
        return self.distances[which]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SensorFit(Described, Value):
    """One model fitted to one calibration. Residual quantities are over the points that were used.

    Args:
        model: name of the model.
        sensor: the fitted curve, valid on the window.
        parameters: estimate of each parameter, by name.
        covariance: covariance of the parameters, in the order of `parameters`, with the share of the offset.
        middle_slope: g in the middle of the window [1/m], which is known even where the parameters run away.
        window: the usable window.
        offset: the offset that was subtracted.
        noise: the noise that weighs the readings.
        distances: the distances that were used [m], shape (N,).
        residuals: ln(y - o) - ln xi at these, shape (N,).
        r_squared: share of the variance of xi that the model explains; for comparison with the letter only.
        rmse_log_output: root mean square of `residuals`.
        rmse_log_slope: root mean square difference between measured and modelled slope of ln xi, neighbor to
            neighbor [1/m]; None below two points.
        aicc: corrected Akaike criterion; only its differences within one ranking mean anything. None for a table,
            or too few points.
        cross_validation: root mean square error of ln xi at distances left out one by one; None where too few.
        slope_shift: how far one standard error of the offset moves `middle_slope`, relative to it.
        runs_p_value: chance of as few runs of equal signs in the residuals if these were independent; None without
            two signs.
        outliers: indices of the readings that were left out as fitting no curve.
        identifiable: what the readings cannot tell apart, in sentences.
        warnings: what to mind when using this fit, in sentences.
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
    slope_shift: float = 0.0
    outliers: tuple[int, ...] = ()
    identifiable: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    page: ClassVar[str] = "pretouch.calibration.page:fit_page"

    def to_dict(self) -> dict[str, Any]:
        """Return the fit as one JSON object: numbers in SI, None where there is none."""
        estimates = self.parameters.items()
        names = ("covariance", "middle_slope", "r_squared", "rmse_log_output", "rmse_log_slope", "aicc")
        more = ("cross_validation", "runs_p_value", "slope_shift", "outliers", "identifiable", "warnings")
        told = {
            "name": self.model,
            "parameters": {name: e.value for name, e in estimates},
            "standard_errors": {name: e.standard_error for name, e in estimates},
            "intervals": {name: (e.low, e.high) for name, e in estimates},
            "units": {name: e.unit for name, e in estimates},
            **{name: getattr(self, name) for name in (*names, *more)},
        }
        return dict(plain(told))

    def __repr__(self) -> str:
        return (
            f"<SensorFit {self.model}: g = {self.middle_slope.value:.4g} 1/m, RMS of ln xi {self.rmse_log_output:.2g}>"
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CalibrationReport(Described, Value):
    """All models on one calibration, ranked, and the verdict on the sensor.

    Args:
        calibration: the readings.
        fits: the fits, best first; empty where there is no usable signal.
        window: the usable window.
        offset: the offset under the signal; None where there were too few readings to know it.
        noise: the noise of the readings; None likewise.
        verdict: `usable`, `usable with reservations` or `no usable signal`.
        reasons: why, and what to do, in sentences.
        not_fitted: models that were asked for and not fitted, with the reason.
        slope: how well g is known, whatever the model; None where there are too few readings.
        left_out: readings that no model saw, in groups, in sentences.
        curves: curves that the readings allow, on which answers are tried; None where there is no usable signal.
    """

    calibration: Calibration
    fits: tuple[SensorFit, ...]
    window: UsableWindow
    offset: OffsetEstimate | None
    noise: NoiseEstimate | None
    verdict: str
    reasons: tuple[str, ...]
    not_fitted: dict[str, str] = field(default_factory=dict)
    slope: SlopeKnowledge | None = None
    left_out: tuple[str, ...] = ()
    curves: AllowedCurves | None = None

    page: ClassVar[str] = "pretouch.calibration.page:calibration_page"

    @property
    def best(self) -> SensorFit | None:
        """The first of the ranked fits; None where there is no usable signal."""
        return self.fits[0] if self.fits else None

    def to_dict(self) -> dict[str, Any]:
        """Return the report as one JSON object: numbers in SI, None where there is none."""
        calibration, slope = self.calibration, self.slope
        source = calibration.source
        told = {
            "verdict": self.verdict,
            "reasons": self.reasons,
            "best": self.best.model if self.best else None,
            "window": (self.window.l_min, self.window.l_max) if self.fits else None,
            "window_reasons": (self.window.start_reason, self.window.end_reason),
            "saturation": self.window.saturation,
            "offset": self.offset or dict.fromkeys(OffsetEstimate.__slots__),
            "noise": self.noise or dict.fromkeys(NoiseEstimate.__slots__),
            "slope": slope and {"distances": slope.distances, "values": slope.slope, "uncertainty": slope.uncertainty},
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
        return dict(plain(told))

    def __repr__(self) -> str:
        best = f", best {self.best.model}" if self.best else ""
        return f"<CalibrationReport {self.calibration.name}: {self.verdict}{best}>"
