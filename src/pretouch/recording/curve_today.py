"""Find the sensor curves that readings of today at known distances allow."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch.sensors import InversePower, Recessed, SensorModel, Table

from .known_distances import KnownDistance

CERTAIN: Final = 3.0
"""Standard errors within which a decision must be the same."""

_SHOWN: Final = 4.0  # standard errors from which a signal is there
_FAINT: Final = 0.02  # of the floor: a signal that is negligible without an object
_FAINT_ERROR: Final = 0.5  # relative error of such a signal
_GRID: Final = 400  # points of a curve of today
_CLOSER: Final = 200.0  # how much denser these points are near the sensor than far away
_FARTHEST: Final = 1.0  # m, up to which such a curve reaches at least
_MISFIT: Final = 13.8  # chi-square with 2 degrees of freedom, exceeded by chance in 0.1 %
_LEAST_MISFIT: Final = 0.03  # of ln xi: smaller deviations do not matter
_CLEARLY: Final = 4.0  # of the cost, by which an explanation is clearly better: two standard errors
_ROUNDS: Final = 8  # steps toward the best shift
_STEP: Final = 1e-6  # of ln xi, for a derivative
_ROUNDING: Final = 1e-12  # variance of ln xi, which keeps the covariance of exact readings regular


class Doubt(NamedTuple):
    """Why a recording cannot decide whether a calibration still holds.

    Args:
        reason: what is wrong, as a clause.
        action: what to do about it, as a clause that follows "Next:".
    """

    reason: str
    action: str


class Signal(NamedTuple):
    """Signal of today relative to the calibration.

    Args:
        places: usable distances [m], increasing.
        ratios: logarithm of the signal today divided by that of the calibration.
        covariance: covariance of these logarithms.
    """

    places: FloatArray
    ratios: FloatArray
    covariance: FloatArray


def offset_of(measured: Sequence[KnownDistance], floor: float) -> tuple[float, float] | None:
    """Return the offset of today and its standard error.

    Args:
        measured: mean readings at the known distances. Without readings of the empty scene, those of a far object
            count, whose faint signal is subtracted.
        floor: detection threshold of the controller.

    Returns:
        Both; None if it is unknown.
    """
    empty = [each for each in measured if math.isinf(each.distance)]
    far = empty or [each for each in measured if 0 <= each.signal < _FAINT * floor]
    if not far:
        return None
    errors = np.array([max(math.hypot(e.error, _FAINT_ERROR * e.signal), 1e-12 * floor) for e in far])
    weights = errors**-2 / (errors**-2).sum()
    value = float(weights @ np.array([e.reading - e.signal for e in far]))
    return value, float((errors**-2).sum() ** -0.5)


def signals_of(
    measured: Sequence[KnownDistance],
    offset: tuple[float, float],
    bare: SensorModel,
    floor: float,
    distance_error: float,
) -> tuple[Signal | None, tuple[Doubt, ...]]:
    """Return the signals of today relative to the calibration.

    Args:
        measured: mean readings at the known distances.
        offset: the offset of today and its standard error.
        bare: the curve of the calibration.
        floor: detection threshold of the controller; signals below 2 % of it are not used.
        distance_error: standard deviation of a known distance [m].

    Returns:
        The signals; None if there are too few. And reasons not to use them.
    """
    near = [each for each in measured if math.isfinite(each.distance) and each.signal >= _FAINT * floor]
    doubts = (*_doubts_about_offset(measured, offset, floor), *_doubts(near, offset))
    used = [each for each in near if _doubt(each, offset) is None]
    places = np.array([each.distance for each in used])
    if len(used) < 2:
        return None, doubts or (_too_few(measured, bare),)
    height = np.array([each.reading - offset[0] for each in used])
    if (np.diff(height) > 0).all():
        return None, (
            *doubts,
            Doubt(
                "the signal grows with the named distance, as if the near and the far distances were swapped",
                "correct the named distances (--distances or --reference), and run pretouch replay again",
            ),
        )
    if (np.diff(height) >= 0).any():
        return None, (
            *doubts,
            Doubt(
                "the signal does not fall with the distance",
                "check whether two of the named distances are swapped or wrong; if they are right, check the sensor",
            ),
        )
    covariance = np.diag((np.array([each.error for each in used]) / height) ** 2)
    covariance += np.outer(offset[1] / height, offset[1] / height)
    by_distance = np.asarray(bare.log_slope(places)) * distance_error
    if any(each.span for each in used):  # one motion: its start and its end are wrong by different lengths
        u = (places - places[0]) / np.ptp(places)
        covariance += np.outer(by_distance, by_distance) * (np.outer(1 - u, 1 - u) + np.outer(u, u))
    else:
        covariance += np.diag(by_distance**2)
    ratios = np.log(height / np.array([each.signal for each in used]))
    return Signal(places, ratios, covariance + np.diag(np.full(len(used), _ROUNDING))), doubts


def _doubts_about_offset(
    measured: Sequence[KnownDistance], offset: tuple[float, float], floor: float
) -> Iterator[Doubt]:
    """Yield why the readings without an object are no offset."""
    for each in measured:
        if math.isinf(each.distance) and not each.is_steady(offset[0] - floor):
            yield Doubt(
                f"without an object, the readings change by {each.change:+.4g} during the recording",
                "let the sensor warm up, keep everything out of its view, and record again",
            )


def _too_few(measured: Sequence[KnownDistance], bare: SensorModel) -> Doubt:
    """Return which distances would be needed for the slope."""
    low, high = bare.valid_range
    within = format_quantity(low, "m")
    within += " on" if math.isinf(high) else f" to {format_quantity(high, 'm')}"
    known = [each.distance for each in measured if math.isfinite(each.distance)]
    return Doubt(
        "the slope needs the readings at two distances or more within the range of the calibration, which is from "
        f"{within}; the recording has {_in_words(known) if known else 'none'}",
        "record again, with the object at a near and at a far distance within this range",
    )


def _doubts(measured: Sequence[KnownDistance], offset: tuple[float, float]) -> Iterator[Doubt]:
    """Yield why the readings at distances cannot be used, each reason once."""
    places: dict[Doubt, list[float]] = {}
    for each in measured:
        doubt = _doubt(each, offset)
        if doubt is not None:
            places.setdefault(doubt, []).append(each.distance)
    for doubt, distances in places.items():
        yield doubt._replace(reason=doubt.reason.format(_in_words(distances)))


def _in_words(distances: Sequence[float]) -> str:
    *others, last = (format_quantity(each, "m") for each in distances)
    return f"{', '.join(others)} and {last}" if others else last


def _doubt(each: KnownDistance, offset: tuple[float, float]) -> Doubt | None:
    """Return why the readings at a distance, which the reason has as {}, cannot be used; None if they can."""
    error = math.hypot(each.error, offset[1])
    height = each.reading - offset[0]
    if each.clipped:
        return Doubt("the readings at {} are at the limit of the sensor", "record again, with the object farther away")
    if height < -_SHOWN * error:
        return Doubt(
            "the reading at {} is below the one without an object",
            "check the named distances; if they are right, check sign and wiring of the sensor",
        )
    if height <= _SHOWN * error:
        return Doubt(
            "the sensor shows no object at {}",
            "check the sensor and its cable, and whether the object was there; then record again",
        )
    if not each.is_steady(offset[0]):
        return Doubt(
            "the readings at {} change while the object is held",
            "check the times of the named distances; if they are right, let the sensor warm up, hold the object still, "
            "and record again",
        )
    return None


def saturated(
    measured: Sequence[KnownDistance],
    offset: tuple[float, float],
    bare: SensorModel,
    distance_error: float,
    limit: float,
) -> str:
    """Return at which distance the sensor saturates although the calibration has a lower reading there.

    Args:
        measured: mean readings at the known distances.
        offset: the offset of today and its standard error.
        bare: the curve of the calibration.
        distance_error: standard deviation of a known distance [m].
        limit: reading from which the sensor is clipped.

    Returns:
        The reason to recalibrate; empty if there is none.
    """
    for each in measured:
        nearest = max(each.distance - each.span - CERTAIN * distance_error, bare.valid_range[0])
        if each.clipped and each.signal > 0 and offset[0] + float(bare.output(nearest)) < limit:
            return (
                f"at {format_quantity(each.distance, 'm')}, the sensor is at its limit, where the calibration has "
                f"{offset[0] + each.signal:.5g}; the law ignores such readings, so the contact is not softened there"
            )
    return ""


class Explanation(NamedTuple):
    """Change of ln xi since the calibration, of one kind.

    Args:
        curve: returns the curve of today for a change at the nearest and at the farthest distance; None if it does not
            fall.
        ends: the fitted change there.
        covariance: its covariance.
        cost: weighted sum of squared residuals of the ratios.
        fits: whether the readings agree with it.
    """

    curve: Callable[[FloatArray], SensorModel | None]
    ends: FloatArray
    covariance: FloatArray
    cost: float
    fits: bool


def explanations_of(signal: Signal, bare: SensorModel) -> tuple[Explanation, ...]:
    """Fit changes of the curve to the ratios: a line over the distance, and a factor with a shift of the distance.

    Args:
        signal: the signals.
        bare: the curve of the calibration.

    Returns:
        The explanations with which the readings agree; a shift only of an inverse power curve, because an exponential
        curve does not show it. The line comes twice: nearer than the nearest distance, the change continues or stays
        constant. The first one is the most likely: the shift, unless the line fits clearly better.
    """
    near, far = float(signal.places[0]), float(signal.places[-1])
    u = (signal.places - near) / (far - near)
    design = np.column_stack([1 - u, u])
    line = _fitted(signal, lambda ends: design @ ends, lambda ends: _tilted(bare, near, far, ends, continues=True))

    def predicted(ends: FloatArray) -> FloatArray | None:
        curve = _shifted(bare, near, far, ends)
        return None if curve is None else np.asarray(curve.log_output(signal.places) - bare.log_output(signal.places))

    shift = _fitted(signal, predicted, lambda ends: _shifted(bare, near, far, ends), start=line.ends)
    constant = line._replace(curve=lambda ends: _tilted(bare, near, far, ends, continues=False))
    fitting = [each for each in (shift, line, constant) if each.fits]
    # noise decides between nearly equal costs, so that they must not decide which one comes first
    least = min((each.cost for each in fitting), default=0.0)
    return tuple(sorted(fitting, key=lambda each: each.cost > least + _CLEARLY))


def _fitted(
    signal: Signal,
    predict: Callable[[FloatArray], FloatArray | None],
    curve: Callable[[FloatArray], SensorModel | None],
    start: FloatArray | None = None,
) -> Explanation:
    """Fit the change at both ends by Gauss and Newton; a linear prediction takes one step."""
    ends = np.zeros(2) if start is None else start
    weights = np.linalg.inv(signal.covariance)
    at = predict(ends)
    covariance, cost = np.full((2, 2), np.nan), math.inf
    for _ in range(1 if start is None else _ROUNDS):
        first, last = (predict(ends + _STEP * unit) for unit in np.eye(2))
        if first is None or last is None or at is None:
            break
        change = np.column_stack([first - at, last - at]) / _STEP
        covariance = np.linalg.inv(change.T @ weights @ change)
        ends = ends + covariance @ change.T @ weights @ (signal.ratios - at)
        at = predict(ends)
    if at is not None:
        rest = signal.ratios - at
        cost = float(rest @ weights @ rest)
        freedom = len(rest) - 2
        small = float(np.abs(rest).max()) <= _LEAST_MISFIT
        return Explanation(curve, ends, covariance, cost, freedom < 1 or small or cost <= _MISFIT + 2 * (freedom - 2))
    return Explanation(curve, ends, covariance, cost, fits=False)


def curves_of(explanation: Explanation, recess: float) -> tuple[SensorModel | None, ...]:
    """Return the curves that an explanation allows.

    Args:
        explanation: one with which the readings agree.
        recess: distance of the sensor behind the contact surface [m].

    Returns:
        Its best curve, and four that are three standard errors from it: two to both sides along each principal axis of
        the errors. A curve that does not fall is None.
    """
    values, vectors = np.linalg.eigh(explanation.covariance)
    moved = [
        explanation.ends + side * CERTAIN * math.sqrt(max(value, 0.0)) * vector
        for value, vector in zip(values, vectors.T, strict=True)
        for side in (-1, 1)
    ]
    curves = [explanation.curve(ends) for ends in (explanation.ends, *moved)]
    return tuple(curve if curve is None or not recess else Recessed(sensor=curve, recess=recess) for curve in curves)


def _tilted(bare: SensorModel, near: float, far: float, ends: FloatArray, *, continues: bool) -> SensorModel | None:
    """Return the curve whose ln xi is changed by a line over the distance; None if it does not fall."""
    low, high = bare.valid_range
    top = min(high, max(_FARTHEST, 4 * far))
    reach = top - low
    grid = (
        low + reach * np.expm1(np.linspace(0.0, 1.0, _GRID) * math.log1p(_CLOSER)) / _CLOSER
    )  # dense near the contact
    grid[-1] = top
    first = -math.inf if continues else 0.0
    share = np.clip((grid - near) / (far - near), first, 1.0)
    change = ends[0] + (ends[1] - ends[0]) * share
    logs = np.asarray(bare.log_output(grid)) + change
    if not (np.diff(logs) < 0).all():
        return None
    return Table(distances=tuple(grid.tolist()), outputs=tuple(np.exp(logs).tolist()))


def _shifted(bare: SensorModel, near: float, far: float, ends: FloatArray) -> SensorModel | None:
    """Return the inverse power k S(l + d) with the given change of ln xi at two distances; None if there is none.

    With L = l + l_0, the change at the far minus that at the near distance is -n ln((L_f + d) L_n / ((L_n + d) L_f)).
    It rises with d without a bound on the near side, so that d is unique; for an infinite d the signals are equal.
    """
    if not isinstance(bare, InversePower):
        return None
    one, other = near + bare.distance_offset, far + bare.distance_offset
    ratio = other / one * math.exp(-float(ends[1] - ends[0]) / bare.exponent)  # (L_f + d) / (L_n + d)
    if not ratio > 1:
        return None
    shift = (other - ratio * one) / (ratio - 1)
    place = bare.distance_offset + shift
    if not bare.minimum_distance + place > 0:
        return None
    factor = float(ends[0]) + bare.exponent * math.log((one + shift) / one)
    return replace(bare, distance_offset=place, scale=bare.scale * math.exp(factor))


def is_from_distances(signal: Signal, bare: SensorModel, distance_error: float) -> bool:
    """Return True if the error of the known distances is the largest part of the error of the nearest signal.

    Args:
        signal: the signals.
        bare: the curve of the calibration.
        distance_error: standard deviation of a known distance [m].
    """
    part = float(np.asarray(bare.log_slope(signal.places[0]))) * distance_error
    return bool(part**2 > signal.covariance[0, 0] / 2)


def signal_of(bare: SensorModel) -> Callable[[FloatArray], FloatArray]:
    """Return a function of distances: the signal of the calibration, NaN where the curve is not valid.

    Args:
        bare: the curve.
    """
    low, high = bare.valid_range

    def signal(distance: FloatArray) -> FloatArray:
        inside = (distance >= low) & (distance <= high)
        return np.asarray(np.where(inside, np.exp(bare.log_output(np.clip(distance, low, high))), np.nan))

    return signal
