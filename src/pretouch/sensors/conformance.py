"""The laws that every sensor curve obeys, as a check that users run on their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .model import SensorModel, cache_by_curve, innermost

_REACH = 0.2  # how far beyond its start an unbounded valid range is probed [m]
_ROUNDING = 1e-12  # relative
_SLOPE_TOLERANCE = 1e-6  # of the largest slope
_HALVINGS = 20
_FEW = 64
_PROBES = 257
_ROUNDED = 1e-9  # of the largest value: what rounding may leave
_CONTRADICTION = 1e-3  # of the whole change of ln xi: less changes a contact by less than a calibration is known to
_MANY = 1000  # intervals, none of which may miss more than a share


@dataclass(frozen=True, slots=True, kw_only=True)
class LawCheck(Value):
    """One law, whether the curve obeys it, and what was measured.

    Args:
        law: the law in one sentence.
        holds: whether it was obeyed at every probed distance.
        evidence: the number that decided it, with its unit.
    """

    law: str
    holds: bool
    evidence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorConformance(Value):
    """What `check_sensor` found.

    Args:
        sensor: the name of the curve.
        checks: one entry per law.
    """

    sensor: str
    checks: tuple[LawCheck, ...]

    @property
    def conforms(self) -> bool:
        """Whether every law holds."""
        return all(check.holds for check in self.checks)

    def __str__(self) -> str:
        lines = [f"{'ok  ' if c.holds else 'FAIL'}  {c.law}: {c.evidence}" for c in self.checks]
        return "\n".join([f"{self.sensor}: {'conforms' if self.conforms else 'does not conform'}", *lines])


@check_arguments
def check_sensor(sensor: SensorModel, *, probes: int = 257) -> SensorConformance:
    """Check a sensor curve, a user's own above all, against the laws that the rest of pretouch relies on.

    Args:
        sensor: the curve.
        probes: how many distances are probed, spread over the valid range (its first 0.2 m where it is unbounded).

    Returns:
        One finding per law; `conforms` tells whether all hold, and printing it lists them.

    Raises:
        InvalidInputError: the object is no SensorModel, or there are too few probes to judge.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> check_sensor(InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32)).conforms
        True
    """
    if probes < 16:
        raise InvalidInputError(f"probes: found {probes}, which must be at least 16")
    low, high = sensor.valid_range
    distance = np.linspace(low, min(high, low + _REACH), probes)
    with np.errstate(all="ignore"):
        checks = tuple(LawCheck(law=law, holds=h, evidence=e) for law, h, e in _laws(sensor, distance))
    return SensorConformance(sensor=sensor.name or type(sensor).__name__, checks=checks)


def _laws(sensor: SensorModel, distance: FloatArray) -> Iterator[tuple[str, bool, str]]:
    """Check one law after the other, until one fails without which the next make no sense."""
    obstacle = _evaluation_obstacle(sensor, distance)
    taken = obstacle or "a number, a row and a table of distances"
    yield "ln xi and g take distances of any shape and keep it", obstacle is None, taken
    if obstacle is not None:
        return
    log_output, slope = sensor.log_output(distance), sensor.log_slope(distance)
    wrong = int((~np.isfinite(log_output) | ~np.isfinite(slope)).sum())
    yield "ln xi and g are finite on the valid range", not wrong, f"{wrong} of {distance.size} distances give none"
    if wrong:
        return
    top = slope.max()
    yield "the output does not grow with distance (g <= 0)", bool(top <= 0), f"largest g = {top:.4g} 1/m"
    error, tolerance = _slope_error(sensor, distance, slope)
    measured = f"largest difference {error:.2g} 1/m, {tolerance:.2g} 1/m allowed"
    yield "g is the derivative of ln xi", bool(error <= tolerance), measured
    constant = sensor.constant_log_slope
    spread = 0.0 if constant is None else float(np.abs(slope - constant).max())
    measured = "not declared" if constant is None else f"largest difference {spread:.2g} 1/m"
    flat = spread <= _ROUNDING * float(np.abs(slope).max())
    yield "a slope that is declared constant is constant", flat, measured
    difference = max(_scalar_difference(sensor.log_output, distance), _scalar_difference(sensor.log_slope, distance))
    measured = f"largest relative difference {difference:.2g}"
    yield "an array gives what its elements give one by one", difference <= _ROUNDING, measured
    value = _is_value(sensor)
    found = f"{type(sensor).__name__} is {'one' if value else 'none, so it can change after it was used'}"
    yield "the curve is a value: a frozen dataclass with fields that can be hashed", value, found


def refuse_invalid_curve(sensor: SensorModel, farthest: float) -> None:
    """Refuse a user's curve that breaks a law between its nearest distance and one where an encounter starts.

    A curve is looked at when it is first used, and again where an encounter starts farther away. What it does beyond
    the start of every encounter does not matter here: a motion that goes there says so by its status.

    Args:
        sensor: the curve.
        farthest: the largest distance at which an encounter starts [m].

    Raises:
        InvalidInputError: ln xi or g cannot be evaluated, is not finite or not the same each time, the output does not
            fall with the distance, or g is not the derivative of ln xi: the change of ln xi between two distances
            differs from the integral of g by more than 0.1 % of the whole change.
    """
    try:
        verified = _verified_reach(sensor)
    except TypeError:  # it cannot be hashed
        raise InvalidInputError(
            f"sensor: found a {type(innermost(sensor)).__name__} with a field that cannot be hashed, such as a list, "
            "expected a frozen dataclass of numbers, texts and tuples"
        ) from None
    low, high = sensor.valid_range
    low, high = max(low, 0.0), min(farthest, high)
    if not (high > low and high > verified[0]):
        return
    with np.errstate(all="ignore"):
        fault = _fault(sensor, np.linspace(low, high, _PROBES))
    if fault is not None:
        name = sensor.name or type(sensor).__name__
        raise InvalidInputError(f"sensor: the {name} curve is no curve of a sensor: {fault}")
    verified[0] = high


@cache_by_curve(256)
def _verified_reach(sensor: SensorModel) -> list[float]:  # noqa: ARG001 - it is kept by the curve
    """Return a place to note up to which distance [m] a curve was found to obey the laws."""
    return [-np.inf]


def _fault(sensor: SensorModel, distance: FloatArray) -> str | None:
    """Say which law a curve breaks, at which of some distances, and what is allowed; None where it breaks none."""
    obstacle = _evaluation_obstacle(sensor, distance)
    if obstacle is not None:
        return f"found {obstacle}, expected functions that take distances of any shape and return as many numbers"
    log_output, slope = sensor.log_output(distance), sensor.log_slope(distance)
    functions = (("ln xi", "", log_output, sensor.log_output), ("a slope", " 1/m", slope, sensor.log_slope))
    for what, unit, values, function in functions:
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            i = wrong[0]
            return (
                f"found {what} of {values[i]:g}{unit} at {distance[i]:g} m, which must be finite; end the curve by "
                "maximum_distance, or start it by minimum_distance, where it ceases to hold"
            )
        again = function(distance)
        i = int(np.abs(again - values).argmax())
        if abs(again[i] - values[i]) > _ROUNDED * np.abs(values).max():
            return (
                f"found {what} of {values[i]:g}{unit} at {distance[i]:g} m, and {again[i]:g}{unit} when asked again; "
                "the same distance must give the same number"
            )
    return _wrong_direction(sensor, distance, slope) or _contradiction(sensor, distance)


def _wrong_direction(sensor: SensorModel, distance: FloatArray, slope: FloatArray) -> str | None:
    """Say where the output does not fall with the distance, or not by the slope that is declared for all distances."""
    steepest, i = float(np.abs(slope).max()), int(slope.argmax())
    if steepest == 0:
        return "found a slope of 0 1/m at every distance, which must be negative: its output says nothing of an object"
    if slope[i] > _ROUNDED * steepest:
        return (
            f"found a slope of {slope[i]:g} 1/m at {distance[i]:g} m, which must not be positive: the output of a "
            "sensor falls with the distance; end the curve where it turns by minimum_distance or maximum_distance, or "
            "sink the sensor behind the surface by Recessed"
        )
    constant = sensor.constant_log_slope
    if constant is None:
        return None
    i = int(np.abs(slope - constant).argmax())
    if abs(slope[i] - constant) <= _ROUNDED * steepest:
        return None
    return (
        f"found a slope of {slope[i]:g} 1/m at {distance[i]:g} m, which must be the constant_log_slope of "
        f"{constant:g} 1/m that the curve declares"
    )


def _contradiction(sensor: SensorModel, distance: FloatArray) -> str | None:
    """Say where the slope is not the derivative of ln xi; None where both give the same impulses."""
    edges = np.unique(np.concatenate([distance, [k for k in sensor.knots if distance[0] < k < distance[-1]]]))
    left, right, limit = edges[:-1], edges[1:], 0.0
    parts: list[FloatArray] = []
    for _ in range(_HALVINGS):  # where g is steep, the rule needs short intervals
        change, integral = _changes(sensor, left, right)
        limit = limit or _CONTRADICTION * float(np.abs(integral).sum() + np.abs(change).sum()) / 2
        poor = np.abs(change - integral) > limit / _MANY
        parts.append(np.stack([left, right, change, integral])[:, ~poor])
        left, right = left[poor], right[poor]
        if not 0 < len(left) <= len(distance):
            break
        middle = (left + right) / 2
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
    found = np.concatenate([*parts, np.stack([left, right, *_changes(sensor, left, right)])], axis=1)
    left, right, change, integral = found[:, np.argsort(found[0])]
    if np.ptp(np.cumsum(np.append(0.0, change - integral))) <= limit:
        return None
    i = int(np.abs(change - integral).argmax())
    width = right[i] - left[i]
    return (
        f"found a slope of {integral[i] / width:.5g} 1/m from {left[i]:.5g} m to {right[i]:.5g} m, where ln xi changes "
        f"by {change[i] / width:.5g} 1/m; the slope must be the derivative of ln xi, to 0.1 %"
    )


def _changes(sensor: SensorModel, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the change of ln xi over intervals, and the integral of g by Gauss's rule."""
    if not len(left):
        return left, left
    offset, weight = np.polynomial.legendre.leggauss(8)
    width = right - left
    mean = sensor.log_slope(left[:, None] + width[:, None] * (offset + 1) / 2) @ (weight / 2)
    return np.asarray(sensor.log_output(right) - sensor.log_output(left)), np.asarray(mean * width)


def _evaluation_obstacle(sensor: SensorModel, distance: FloatArray) -> str | None:
    """Say what keeps ln xi and g from being evaluated: the error that a user's function raises is a finding."""
    for function in (sensor.log_output, sensor.log_slope):
        for probe in (float(distance[0]), distance, distance[:16].reshape(4, 4)):
            try:
                function(probe)
            except Exception as error:
                return f"{type(error).__name__}: {error}"
    return None


def _scalar_difference(function: Callable[[Any], Any], distance: FloatArray) -> float:
    """Return the largest difference between an array's results and its elements', relative to the largest result."""
    some = distance[:: max(1, distance.size // 16)]
    together, alone = np.asarray(function(some)), np.array([function(float(d)) for d in some])
    return float(np.abs(together - alone).max() / (np.abs(together).max() + 1))


def _is_value(sensor: SensorModel) -> bool:
    own = vars(type(sensor)).get("__dataclass_params__")
    try:
        hash(sensor)
    except TypeError:
        return False
    return own is not None and bool(own.frozen)


def _slope_error(sensor: SensorModel, distance: FloatArray, slope: FloatArray) -> tuple[float, float]:
    """Compare g with ln xi between probes: the largest difference from Gauss's rule on g, and what is allowed, 1/m."""
    # Intervals that disagree are halved as long as there are few of them: where g is steep, the rule needs that.
    edges = np.unique(np.concatenate([distance, [k for k in sensor.knots if distance[0] < k < distance[-1]]]))
    width = np.diff(edges)
    left, right = (side[width > 1e-3 * width.max()] for side in (edges[:-1], edges[1:]))  # else rounding decides
    tolerance = _SLOPE_TOLERANCE * float(np.abs(slope).max() + 1)
    worst = 0.0
    for _ in range(_HALVINGS):
        error = _mean_slope_error(sensor, left, right)
        agree = error <= tolerance
        worst = max(worst, float(error[agree].max(initial=0.0)))
        left, right = left[~agree], right[~agree]
        if not len(left):
            return worst, tolerance
        if len(left) > _FEW:
            break
        middle = (left + right) / 2
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
    return float(np.nan_to_num(error, nan=np.inf).max()), tolerance


def _mean_slope_error(sensor: SensorModel, left: FloatArray, right: FloatArray) -> FloatArray:
    change, integral = _changes(sensor, left, right)
    return np.asarray(np.abs(change - integral) / (right - left))
