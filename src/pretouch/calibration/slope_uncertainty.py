"""Estimate the uncertainty of the sensor slope.

A warning is given if the readings have another slope than the best model. The slope is judged from the nearest usable
distance to the distance at which the signal has fallen to a tenth. The virtual force gives the impulse
D_p ln(xi / xi_0) until xi has grown from xi_0 to xi. Over the judged distances, xi grows by a factor of ten, so ln xi
grows by 2.3, which gives most of the impulse of any motion.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_percent, format_quantity
from pretouch._core.warning_codes import caution

from .averaging import slope_weights
from .family_fits import Problem
from .possible_curves import PossibleCurves
from .preparation import Prepared
from .result import Estimate, SensorFit, SlopeUncertainty, uncertainty_in_words

_ALLOWED: Final = 0.15  # relative difference of slopes from which on a reservation is made
_DECISIVE: Final = 0.1  # share of the signal at the nearest distance down to which g is judged
_PLACES: Final = 25  # distances at which g is evaluated where most of the force acts
_BEYOND: Final = 15  # distances at which g is evaluated from there to the end of the usable range
_FALL: Final = 0.5  # decrease of ln xi over which the slopes of readings and curve are compared
_FEWEST: Final = 4  # fewest readings in such a comparison
_SURE: Final = 4.0  # standard errors of a difference that is significant
_NORMAL: Final = 1.959964  # standard deviations from the mean to the end of a 95 % interval


def estimate_slope(prepared: Prepared) -> SlopeUncertainty | None:
    """Return the sensor slope and its uncertainty.

    All curves that fit contribute. The result is None if there are too few readings.
    """
    curves, used, offset = prepared.possible_curves, prepared.used, prepared.offset
    if curves is None or offset is None:
        return None
    signal = used.output - offset.value
    inside = np.flatnonzero(signal >= _DECISIVE * signal[0])
    last, end = float(used.distance[max(int(inside[-1]), 1)]), float(used.distance[-1])
    places = np.linspace(float(used.distance[0]), last, _PLACES)
    if end > last:
        places = np.concatenate([places, np.linspace(last, end, _BEYOND + 1)[1:]])
    log_slope, error = curves.slope(places)
    reach = np.maximum(_quantile(curves) * error, _change_by_offset(prepared, curves, places))
    if math.isfinite(prepared.steep_from):
        is_flat = places < prepared.steep_from
        log_secant, error = _secants(prepared, places)
        log_slope, reach = np.where(is_flat, log_secant, log_slope), np.where(is_flat, _NORMAL * error, reach)
    return SlopeUncertainty(
        distances=places,
        slope=-np.exp(log_slope),
        uncertainty=np.expm1(np.minimum(reach, 10.0)),
        decisive=last,
    )


def _quantile(curves: PossibleCurves) -> float:
    """Return the end of a 95 % interval in standard errors: Student's t, since few readings hardly show the noise."""
    return math.sqrt(curves.rise / curves.inflation)


def _change_by_offset(prepared: Prepared, curves: PossibleCurves, places: FloatArray) -> FloatArray:
    """Return the largest change of ln |g| at each place if the fitted offset is at an end of its interval.

    The interval of a fitted offset also covers the curves that flatten, which `curves` do not contain.
    """
    offset, used = prepared.offset, prepared.used
    if offset is None or prepared.noise is None or offset.kind != "fitted":
        return np.zeros_like(places)
    if math.isfinite(prepared.steep_from):
        used = used.part(used.distance >= prepared.steep_from)
    best = curves.best
    at = int(best.costs.argmin())
    ends = np.array([best.offsets[at], offset.low, offset.high])
    problem = Problem(curve=used, family=best.family, noise=prepared.noise, offsets=ends)
    x = problem.minimize(np.repeat(best.x[[at]], len(ends), axis=0)).x
    log_slopes = np.log(np.maximum(-best.family.slope(x, places), 1e-9))
    return np.asarray(np.abs(log_slopes[1:] - log_slopes[0]).max(axis=0))


def _secants(prepared: Prepared, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ln |g| and its standard deviation between neighboring readings on either side of each place.

    The impulse of the virtual force depends only on this mean slope, and not on the curve between the readings.
    """
    points, offset, noise = prepared.falling, prepared.offset, prepared.noise
    if points is None or offset is None or noise is None:
        return np.zeros_like(places), np.full_like(places, np.inf)
    signal = points.output - offset.value
    error = noise.of_readings(points.count, signal) / signal
    fall = -np.diff(np.log(signal))
    interval = np.clip(np.searchsorted(points.distance, places, side="right") - 1, 0, len(fall) - 1)
    return np.log(fall / np.diff(points.distance))[interval], (np.hypot(error[:-1], error[1:]) / fall)[interval]


def with_choice_of_family(middle: Estimate, prepared: Prepared) -> Estimate:
    """Return the slope in the middle of the usable range with errors that include the choice of the curve family.

    `middle` has the errors within one family. Other families that fit the readings as well have other slopes.
    """
    curves = prepared.possible_curves
    if curves is None or not middle.value < 0:
        return middle
    place = np.array([(prepared.used.distance[0] + prepared.used.distance[-1]) / 2])
    log_slope, error = (float(v[0]) for v in curves.slope(place))
    error = math.hypot(error, log_slope - math.log(-middle.value))
    factor = math.exp(min(_quantile(curves) * error, 10.0))
    return replace(
        middle,
        standard_error=max(middle.standard_error, -middle.value * error),
        low=min(middle.low, middle.value * factor),
        high=max(middle.high, middle.value / factor),
    )


def uncertain_slope(prepared: Prepared, best: SensorFit, slope: SlopeUncertainty | None) -> list[str]:
    """Return what to measure if the sensor slope is uncertain at some distance."""
    if slope is None or slope.largest <= _ALLOWED:
        return []
    worst = slope.largest
    offset = prepared.offset
    remedy, detail = "read more distances, each several times, where the signal is strong", ""
    if offset is not None and offset.kind == "fitted":
        used = prepared.used.output - offset.value
        remedy = "record the output with no object, or measure out to where it no longer changes"
        if prepared.reaches_last:
            remaining = format_percent(used[-1] / used[0])
            detail = f" The signal at the farthest distance is still {remaining} of the largest signal."
    elif offset is not None and best.slope_shift > 0.5 * _ALLOWED / _NORMAL:
        remedy = "record the output with no object more often, because its uncertainty changes the slope"
    size = uncertainty_in_words(worst)
    near, far = (format_quantity(float(d), "m", 3) for d in (slope.distances[0], slope.decisive))
    return [
        caution(
            "PT107",
            f"The sensor slope g is uncertain by {size} at the distance {format_quantity(slope.worst_at, 'm', 3)}: "
            f"{remedy}.{detail} This is the largest uncertainty (95 %) from {near} to {far}, where most of the virtual "
            "force acts.",
        )
    ]


def slope_reservations(prepared: Prepared, fits: list[SensorFit], slope: SlopeUncertainty | None) -> list[str]:
    """Return a warning if the slope of the readings differs from that of the best model."""
    gap = None if slope is None else _largest_gap(prepared, fits[0], slope.decisive)
    if gap is None:
        return []
    share, near, far = gap[0], *(format_quantity(d, "m", 3) for d in gap[1:])
    difference = f"{100 * abs(share):.0f} % {'flatter' if share > 0 else 'steeper'}"
    has_table = any(fit.model == "table" for fit in fits)
    remedy = (
        "use the table model, or check how the distances were set"
        if has_table
        else ("check how the distances were set, and measure again at these distances")
    )
    follows = ", and the table model follows this shape" if has_table else ""
    return [
        caution(
            "PT108",
            f"Between the distances {near} and {far}, the readings are {difference} than the best model, "
            f"{fits[0].model}: {remedy}. The true curve has another shape{follows}.",
        )
    ]


def _largest_gap(prepared: Prepared, best: SensorFit, last: float) -> tuple[float, float, float] | None:
    """Return the largest significant error of the fitted slope.

    The fitted slope is compared with the slope of the readings. The result is the relative difference and the two
    distances [m] between which it occurs. It is None if no difference is both significant and too large.
    """
    used, noise = prepared.used, prepared.noise
    if noise is None or best.model == "table" or len(used.distance) < _FEWEST + 1:
        return None
    signal = used.output - best.offset.value
    errors = np.hypot(noise.output, noise.relative * signal) / np.sqrt(used.count) / signal
    log, worst = np.log(signal), None
    for k in range(len(log) - _FEWEST + 1):
        if used.distance[k] > last:
            break
        stop = k + _FEWEST
        while stop < len(log) and log[k] - log[stop - 1] < _FALL:
            stop += 1
        if log[k] - log[stop - 1] < _FALL:  # too few readings remain for such a decrease
            break
        part = slice(k, stop)
        line = slope_weights(used.distance[part], errors[part] ** 2 + 1e-12)
        difference, error = float(line @ best.residuals[part]), math.sqrt(float(line**2 @ errors[part] ** 2))
        g = -float(np.mean(np.asarray(best.sensor.log_slope(used.distance[part]))))
        if abs(difference) > max(_SURE * error, _ALLOWED * g) and (
            worst is None or abs(difference / g) > abs(worst[0])
        ):
            worst = (difference / g, float(used.distance[k]), float(used.distance[stop - 1]))
    return worst
