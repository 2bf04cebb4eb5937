"""All models on one calibration, ranked by one criterion on the same readings, and the verdict on the sensor."""

from __future__ import annotations

import math

import numpy as np

from pretouch._core.units import format_quantity

from .data import Calibration
from .fit import MODELS, check_models, common_noise, fit_prepared, why_not
from .preparation import OffsetChoice, Prepared, prepare
from .result import CalibrationReport, SensorFit

__all__ = ["rank_models"]

_FEW_POINTS = 6
_LARGE_MISFIT = 0.1  # of ln xi: the virtual force is wrong by as much over one step of the calibration
_SMALL_MISFIT = 1e-3  # of ln xi: another shape by less than that is of no consequence to a controller
_FEW_RUNS = 0.05
_SLOPE_SHIFT = 0.2
_FAR_SHARE = 0.05  # of the largest signal
_SMALL_FALL = 1.0  # of ln xi over the window


def rank_models(
    calibration: Calibration,
    models: tuple[str, ...] = MODELS,
    *,
    offset: OffsetChoice = "auto",
    saturation: float | str | None = "auto",
    near_field_peak: float | str | None = "auto",
    floor_sigmas: float = 3.0,
) -> CalibrationReport:
    """Fit all models to the same readings with the same offset and noise, rank them by AICc, and give a verdict.

    An option that is none of those described raises `InvalidInputError`; a sensor without signal does not.

    Args:
        calibration: the readings.
        models: names of the models.
        offset: as `fit_sensor` takes it.
        saturation: as `fit_sensor` takes it.
        near_field_peak: as `fit_sensor` takes it.
        floor_sigmas: as `fit_sensor` takes it.

    Returns:
        The report; where there is no usable signal it has no fits and says why.

    Examples:
        >>> distance = np.repeat(np.arange(12) * 0.005, 3)
        >>> outputs = 0.3 + 2.0 * np.exp(-60 * distance) + np.tile([-0.002, 0.0, 0.002], 12)
        >>> report = rank_models(Calibration(distances=distance, outputs=outputs, no_object=[0.298, 0.3, 0.302]))
        >>> report.verdict, report.best.model
        ('usable', 'exponential-1')
    """
    models = tuple(dict.fromkeys(models))
    check_models(models)
    prepared = prepare(
        calibration,
        offset=offset,
        saturation=saturation,
        near_field_peak=near_field_peak,
        floor_sigmas=floor_sigmas,
    )
    fits: list[SensorFit] = []
    not_fitted: dict[str, str] = {}
    if not prepared.no_signal:
        noise = common_noise(prepared)
        for model in models:
            reason = why_not(model, prepared)
            if reason:
                not_fitted[model] = reason
            else:
                fits.append(fit_prepared(model, prepared, noise))
        fits.sort(key=_rank)
    reservations = prepared.no_signal or tuple(_reservations(prepared, fits))
    baseline = prepared.baseline
    return CalibrationReport(
        calibration=prepared.calibration,
        fits=tuple(fits),
        window=prepared.window,
        offset=baseline.offset if baseline else None,
        noise=baseline.noise if baseline else None,
        verdict=_verdict(prepared, reservations),
        reasons=reservations or (_praise(prepared, fits),),
        not_fitted=not_fitted,
    )


def _rank(fit: SensorFit) -> tuple[bool, bool, float, float]:
    """Order by AICc; models without one follow by cross-validation, the table last."""
    error = math.inf if fit.cross_validation is None else fit.cross_validation
    return fit.model == "table", fit.aicc is None, fit.aicc or 0.0, error


def _verdict(prepared: Prepared, reservations: tuple[str, ...]) -> str:
    if prepared.no_signal:
        return "no usable signal"
    return "usable with reservations" if reservations else "usable"


def _praise(prepared: Prepared, fits: list[SensorFit]) -> str:
    low, high = (format_quantity(d, "m") for d in (prepared.window.l_min, prepared.window.l_max))
    if not fits:
        return f"The signal is usable from {low} to {high}, and no model that was asked for describes it."
    best = fits[0]
    return (
        f"{best.model} describes {len(best.distances)} distances from {low} to {high} with an RMS error of "
        f"{100 * best.rmse_log_output:.2g} % of the output."
    )


def _reservations(prepared: Prepared, fits: list[SensorFit]) -> list[str]:
    """List what is wrong with a usable signal, each with what to do about it."""
    calibration, window, used = prepared.calibration, prepared.window, prepared.used
    low, high = (format_quantity(d, "m") for d in (window.l_min, window.l_max))
    found = []
    if len(used.distance) < _FEW_POINTS:
        found.append(
            f"The window from {low} to {high} holds only {len(used.distance)} distinct distances: measure at 8 or more "
            "inside it."
        )
    if used.count.max() == 1:
        found.append(
            "Every distance was read once, so the noise is inferred from the curve itself: read each distance 3 times "
            "or more."
        )
    found += _offset_reservations(prepared, fits)
    if prepared.outlier_distances:
        where = ", ".join(format_quantity(d, "m") for d in prepared.outlier_distances)
        found.append(
            f"The output at {where} fits no curve through the other readings and was left out: measure it again."
        )
    fall = (
        float(np.log(used.output[0] - fits[0].offset.value) - np.log(used.output[-1] - fits[0].offset.value))
        if fits
        else 0
    )
    if fits and fall < _SMALL_FALL:
        found.append(
            f"From {low} to {high} the output falls only by a factor of {math.exp(fall):.2g}: measure "
            "over a wider range."
        )
    dropped = calibration.source.dropped if calibration.source else 0
    if dropped > 0.2 * (dropped + len(calibration.outputs)):
        found.append(f"{dropped} rows have no output: check the recording.")
    if fits:
        found += _misfits(fits)
    return found


def _offset_reservations(prepared: Prepared, fits: list[SensorFit]) -> list[str]:
    """Say where the offset is what limits the slope."""
    unit, found = prepared.calibration.unit, []
    baseline, free = prepared.baseline, prepared.free_offset
    if baseline is None:
        return []
    offset = baseline.offset
    shift = fits[0].slope_shift if fits else 0.0
    if shift > _SLOPE_SHIFT:
        found.append(
            f"The offset ({offset.kind}, {offset.value:.4g} ± {offset.standard_error:.2g} {unit}) is so uncertain that "
            f"one standard error moves the slope by {100 * shift:.0f} %: record the output with no object."
        )
    used = prepared.used.output - offset.value
    if fits and offset.kind == "fitted" and used[-1] > _FAR_SHARE * used[0] and prepared.reaches_last:
        found.append(
            f"The readings end where the signal still is {100 * used[-1] / used[0]:.2g} % of its largest value, so the "
            "fitted offset rests on the form of the inverse power: measure out to where the output no longer changes, "
            "or record the output with no object."
        )
    if free is not None and free.low > offset.high + 1e-3 * abs(free.value - offset.value):
        found.append(
            f"The far readings level off at {free.value:.4g} {unit} (95 % interval {free.low:.4g} to {free.high:.4g}), "
            f"above the {offset.kind} offset of {offset.value:.4g} {unit}: a pedestal left in weakens the virtual "
            "force; record the output with no object, or fit the offset."
        )
    return found


def _misfits(fits: list[SensorFit]) -> list[str]:
    """Say where even the best model does not follow the readings."""
    best, found = fits[0], []
    table = " The table follows the readings." if any(f.model == "table" for f in fits) else ""
    if best.rmse_log_output > _LARGE_MISFIT:
        found.append(
            f"{best.model}, the best model, misses ln xi by {best.rmse_log_output:.2g} (RMS), so the virtual force is "
            f"off by about as much over one step of distance: take more readings per distance.{table}"
        )
    if best.runs_p_value is not None and best.runs_p_value < _FEW_RUNS and best.rmse_log_output > _SMALL_MISFIT:
        found.append(
            f"The residuals of {best.model} keep their sign along the distance (runs test, "
            f"p = {best.runs_p_value:.2g}): the curve has another shape.{table}"
        )
    return found
