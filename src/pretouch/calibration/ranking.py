"""All models on one calibration, ranked by one criterion on the same readings, and the verdict on the sensor.

How well g is known where it matters: from the nearest usable distance to where the signal is a tenth of that there. The
virtual force gives the impulse D_p ln(xi / xi_0) until xi has grown from xi_0 to xi. Where xi is a tenth of its value
at contact, a factor of ten is still to come, ln 10 = 2.3 of ln xi: most of what any motion makes use of.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.units import format_quantity

from .averaging import average, slope_weights
from .data import Calibration
from .fit import attempt_fit, check_models, model_names
from .preparation import OffsetChoice, Prepared, prepare
from .result import CalibrationReport, SensorFit, SlopeKnowledge

KNOWN: Final = 0.15
"""Relative error of g up to which a sensor is usable without reservation."""

_DECISIVE: Final = 0.1  # of the signal at the nearest distance
_PLACES: Final = 25
_FALL: Final = 0.5  # of ln xi, over which slopes of readings and curve are compared
_FEWEST: Final = 4
_SURE: Final = 4.0  # standard errors
_NORMAL: Final = 1.959964


def slope_knowledge(prepared: Prepared) -> SlopeKnowledge | None:
    """Tell how well all curves that the readings allow agree about g; None where there are too few readings."""
    courses, used, offset = prepared.courses, prepared.used, prepared.offset
    if courses is None or offset is None:
        return None
    signal = used.output - offset.value
    inside = np.flatnonzero(signal >= _DECISIVE * signal[0])
    last = float(used.distance[max(int(inside[-1]), 1)])
    places = np.linspace(float(used.distance[0]), last, _PLACES)
    log_slope, error = courses.slope(places)
    worst = int(error.argmax())
    return SlopeKnowledge(
        distances=places,
        slope=-np.exp(log_slope),
        uncertainty=np.expm1(_NORMAL * np.minimum(error, 10.0)),
        worst_at=float(places[worst]),
    )


def slope_reservations(prepared: Prepared, best: SensorFit, known: SlopeKnowledge | None) -> list[str]:
    """Say where g is not known well enough, and what would tell it."""
    if known is None:
        return []
    found = []
    worst = float(known.uncertainty.max())
    if worst > KNOWN:
        offset = prepared.offset
        remedy = "read more distances, each several times, where the signal is strong"
        if offset is not None and offset.kind == "fitted":
            used = prepared.used.output - offset.value
            remedy = "record the output with no object, or measure out to where it no longer changes"
            if prepared.reaches_last:
                left = f"{100 * used[-1] / used[0]:.2g} %"
                remedy += f" (the readings end where the signal still is {left} of its largest)"
        elif offset is not None and best.slope_shift > 0.5 * KNOWN / _NORMAL:
            remedy = "record the output with no object more often: its uncertainty moves the slope"
        size = f"{100 * worst:.0f} %" if worst < 1 else f"a factor of {1 + worst:.2g}"
        near, far = (format_quantity(float(d), "m", 3) for d in known.distances[[0, -1]])
        found.append(
            f"g is known to {size} only (at {format_quantity(known.worst_at, 'm', 3)}, of the part from {near} to "
            f"{far} in which the virtual force is given), and {100 * KNOWN:.0f} % is what a design can rely on: "
            f"{remedy}."
        )
    gap = _largest_gap(prepared, best, float(known.distances[-1]))
    if gap is not None:
        share, near, far = gap[0], *(format_quantity(d, "m", 3) for d in gap[1:])
        found.append(
            f"From {near} to {far} the readings are {100 * abs(share):.0f} % {'flatter' if share > 0 else 'steeper'} "
            f"than {best.model}, the best model: the curve has another shape; the table follows it."
        )
    return found


def _largest_gap(prepared: Prepared, best: SensorFit, last: float) -> tuple[float, float, float] | None:
    """Find where the local slope of the readings differs most from that of a fit, if surely and by too much."""
    used, noise = prepared.used, prepared.noise
    if noise is None or best.model == "table" or len(used.distance) < _FEWEST + 1:
        return None
    signal = used.output - best.offset.value
    own = np.hypot(noise.output, noise.relative * signal) / np.sqrt(used.count) / signal
    log, worst = np.log(signal), None
    for k in range(len(log) - _FEWEST + 1):
        if used.distance[k] > last:
            break
        stop = k + _FEWEST
        while stop < len(log) and log[k] - log[stop - 1] < _FALL:
            stop += 1
        if log[k] - log[stop - 1] < _FALL:  # the last readings, over which nothing falls by so much
            break
        part = slice(k, stop)
        line = slope_weights(used.distance[part], own[part] ** 2 + 1e-12)
        size, error = float(line @ best.residuals[part]), math.sqrt(float(line**2 @ own[part] ** 2))
        g = -float(np.mean(np.asarray(best.sensor.log_slope(used.distance[part]))))
        if abs(size) > max(_SURE * error, KNOWN * g) and (worst is None or abs(size / g) > abs(worst[0])):
            worst = (size / g, float(used.distance[k]), float(used.distance[stop - 1]))
    return worst


_FEW_POINTS = 6
_MORE_THAN_UNKNOWNS = 3  # distances by which a fit is judged
_LARGE_MISFIT = 0.1  # of ln xi: the virtual force is wrong by as much over one step of the calibration
_FEW_EMPTY = 4  # readings without an object, which tell the noise as repeats do
_DOUBT = {"declared": 1.0, "measured": 3.5, "fitted": 1.0}  # times the interval of what the readings ask for instead
_MOST_NAMED = 5  # distances, one by one
_SMALL_FALL = 0.3  # of ln xi over the window: less tells hardly more than a slope


@check_arguments
def rank_models(
    calibration: Calibration,
    models: tuple[str, ...] | None = None,
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
        models: names of the models; all of them where none are given.
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
    models = model_names() if models is None else tuple(dict.fromkeys(models))
    check_models(models)
    prepared = prepare(calibration, offset, saturation, near_field_peak, floor_sigmas)
    fits: list[SensorFit] = []
    not_fitted: dict[str, str] = {}
    if not prepared.no_signal:
        attempts = {model: attempt_fit(model, prepared) for model in models}
        not_fitted = {model: reason for model, reason in attempts.items() if isinstance(reason, str)}
        fits = sorted((fit for fit in attempts.values() if isinstance(fit, SensorFit)), key=_rank)
    slope = slope_knowledge(prepared)
    reservations = prepared.no_signal or tuple(_reservations(prepared, fits, slope))
    usable = "usable with reservations" if reservations else "usable"
    return CalibrationReport(
        calibration=prepared.calibration,
        fits=tuple(fits),
        window=prepared.window,
        offset=prepared.offset,
        noise=prepared.noise,
        verdict="no usable signal" if prepared.no_signal else usable,
        reasons=reservations or (_praise(prepared, fits),),
        not_fitted=not_fitted,
        slope=slope,
        left_out=_left_out(prepared),
        curves=prepared.witness,
    )


def _rank(fit: SensorFit) -> tuple[bool, bool, float, float]:
    """Order by AICc; models without one follow by cross-validation, the table last."""
    error = math.inf if fit.cross_validation is None else fit.cross_validation
    return fit.model == "table", fit.aicc is None, fit.aicc or 0.0, error


def _left_out(prepared: Prepared) -> tuple[str, ...]:
    """Name the readings that no model saw, in groups."""
    calibration, window, found = prepared.calibration, prepared.window, []
    at_bad = np.isin(calibration.distances, prepared.outlier_distances)
    single = [i for i in prepared.outliers if not at_bad[i]]
    if single:
        at = (format_quantity(float(calibration.distances[i]), "m") for i in single)
        shown = [f"{_level(calibration, calibration.outputs[i])} at {d}" for i, d in zip(single, at, strict=True)]
        named = ", ".join(shown[:_MOST_NAMED]) + (", ..." if len(shown) > _MOST_NAMED else "")
        found.append(f"{_readings(len(single))} ({named}): lost, or far off the others at the same distance.")
    for distance in prepared.outlier_distances:
        here = calibration.distances == distance
        named = f"{_level(calibration, np.mean(calibration.outputs[here]))} at {format_quantity(distance, 'm')}"
        found.append(f"{_readings(here.sum())} ({named}): no curve through the others comes near; measure again.")
    if window.distances:
        low, high = window.l_min, window.l_max
        for there, where, reason in (
            (calibration.distances < low, f"nearer than {format_quantity(low, 'm')}", window.start_reason),
            (calibration.distances > high, f"beyond {format_quantity(high, 'm')}", window.end_reason),
        ):
            if (there & ~at_bad).any():
                found.append(f"{_readings((there & ~at_bad).sum())} {where}: {reason}.")
    return tuple(found)


def _level(calibration: Calibration, output: float) -> str:
    return f"{output:.4g} {calibration.unit}".rstrip()


def _readings(count: Any) -> str:
    return f"{count:,} reading{'s' if count != 1 else ''}"


def _praise(prepared: Prepared, fits: list[SensorFit]) -> str:
    low, high = (format_quantity(d, "m") for d in (prepared.window.l_min, prepared.window.l_max))
    if not fits:
        return f"The signal is usable from {low} to {high}, and no model that was asked for describes it."
    best = fits[0]
    return (
        f"{best.model} describes {len(best.distances)} distances from {low} to {high} with an RMS error of "
        f"{100 * best.rmse_log_output:.2g} % of the output."
    )


def _reservations(prepared: Prepared, fits: list[SensorFit], slope: SlopeKnowledge | None) -> list[str]:
    """List what is wrong with a usable signal, each with what to do about it."""
    calibration, window, used = prepared.calibration, prepared.window, prepared.used
    low, high = (format_quantity(d, "m") for d in (window.l_min, window.l_max))
    signal = used.output - (fits[0].offset.value if fits else 0.0)
    fall = float(np.log(signal[0]) - np.log(signal[-1])) if fits else math.inf
    count, bad = len(used.distance), len(prepared.outlier_distances)
    dropped = calibration.source.dropped if calibration.source else 0
    once = "Every distance was read once, so the noise is inferred from the curve itself"
    unknowns = (len(fits[0].parameters) or 3) + (fits[0].offset.kind == "fitted") if fits else 0
    few = f"The window from {low} to {high} holds only {count} distinct distances for {unknowns} unknowns of the curve"
    lacking = count < _FEW_POINTS or count - unknowns < _MORE_THAN_UNKNOWNS
    found = [f"{few}: measure at 8 or more inside it."] if lacking else []
    if used.count.max() == 1 and len(calibration.no_object) < _FEW_EMPTY:
        found.append(f"{once}: read each distance 3 times or more.")
    found += _offset_reservations(prepared)
    if bad > 1 + count // 10:
        found.append(f"The output at {bad} distances fits no curve through the other readings: measure again.")
    if fall < _SMALL_FALL:
        falls = f"the output falls only by a factor of {math.exp(fall):.2g}"
        found.append(f"From {low} to {high} {falls}: measure over a wider range.")
    if dropped > 0.2 * (dropped + len(calibration.outputs)):
        found.append(f"{dropped} rows have no output: check the recording.")
    if fits:
        found += slope_reservations(prepared, fits[0], slope)
        found += _misfits(prepared, fits)
    return found


def _offset_reservations(prepared: Prepared) -> list[str]:
    """Say where the readings contradict the offset, and offsets that no sensor has."""
    unit, offset, noise, found = prepared.calibration.unit, prepared.offset, prepared.noise, []
    if offset is None or noise is None:
        return []
    curve, record = average(prepared.calibration), "record the output with no object"
    at = int(curve.output.argmin())
    lowest = float(curve.output[at])
    named = f"{offset.kind} offset of {_level(prepared.calibration, offset.value)}"
    if offset.value < 0 and offset.high < 0 and min([lowest, *prepared.calibration.no_object]) >= 0:
        found.append(f"The {named} is negative, which no reading is: {record}.")
    if offset.kind == "declared" and offset.value > lowest + 4 * noise.output / math.sqrt(float(curve.count[at])):
        readings = _level(prepared.calibration, lowest)
        found.append(f"The {named} is larger than readings ({readings}): no signal is left there; {record}.")
    if offset.kind == "fitted" and prepared.flattens:
        bent = "The offset was fitted to a curve whose near part flattens, and both bend it alike"
        found.append(f"{bent}: {record}.")
    if prepared.free is None or prepared.free.doubt(offset) <= _DOUBT[offset.kind]:
        return found
    free = prepared.free.offset("fitted")
    asked = f"{free.value:.4g} {unit} (95 % interval {free.low:.4g} to {free.high:.4g})"
    what = (
        f"level off at {asked}, above the {named}: a pedestal left in weakens the virtual force"
        if free.value > offset.value
        else f"fall more steeply than any curve on the {named}; they ask for {asked}: too much is subtracted, which "
        "makes the virtual force too strong far away"
    )
    return [*found, f"The far readings {what}; {record}, or fit the offset."]


def _misfits(prepared: Prepared, fits: list[SensorFit]) -> list[str]:
    """Say where even the best model does not follow the readings."""
    if prepared.noise is None or prepared.noise.misfit <= _LARGE_MISFIT:
        return []
    table = " The table follows the readings." if any(f.model == "table" for f in fits) else ""
    return [
        f"The readings miss {fits[0].model}, the best model, by {100 * prepared.noise.misfit:.0f} % of xi (RMS) beyond "
        "their noise, and the virtual force is off by about as much over one step of distance: check how distances "
        f"were set.{table}"
    ]
