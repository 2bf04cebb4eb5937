"""Check that a sensor curve meets the assumptions of pretouch.

For example, its output must not rise with distance.
"""

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

_REACH = 0.2  # length of the probed part of an unbounded valid range [m]
_ROUNDING = 1e-12  # relative error
_SLOPE_TOLERANCE = 1e-6  # error relative to the largest slope
_HALVINGS = 20
_FEW = 64
_PROBES = 257
_ROUNDED = 1e-9  # relative tolerance for rounding
_CONTRADICTION = 1e-3  # of the whole change of ln xi; smaller errors are below the accuracy of a calibration
_SHARES = 1000  # an interval is halved while its error exceeds this part of the tolerance


@dataclass(frozen=True, slots=True, kw_only=True)
class LawCheck(Value):
    """Result of one check of a sensor curve.

    Args:
        law: the law in one sentence.
        holds: whether the curve obeys it at every probed distance.
        evidence: the number that decided it, with its unit.
    """

    law: str
    holds: bool
    evidence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorConformance(Value):
    """Result of `check_sensor` for one sensor curve.

    Args:
        sensor: the name of the curve.
        checks: one check per law.
    """

    sensor: str
    checks: tuple[LawCheck, ...]

    @property
    def conforms(self) -> bool:
        """Whether the sensor curve passed every check."""
        return all(check.holds for check in self.checks)

    def __str__(self) -> str:
        lines = [f"{'ok  ' if c.holds else 'FAIL'}  {c.law}: {c.evidence}" for c in self.checks]
        return "\n".join([f"{self.sensor}: {'conforms' if self.conforms else 'does not conform'}", *lines])


@check_arguments
def check_sensor(sensor: SensorModel, *, probes: int = 257) -> SensorConformance:
    """Check that a sensor curve has all properties on which pretouch relies.

    Args:
        sensor: the curve.
        probes: number of probed distances, at least 16, spread over the valid range. Of an unbounded range the first
            0.2 m are probed.

    Returns:
        One check per law. `conforms` is True if all hold, and `print` lists them.

    Raises:
        InvalidInputError: the object is no SensorModel, or there are too few probes.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> check_sensor(InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32)).conforms
        True
    """
    if probes < 16:
        raise InvalidInputError(f"probes: found {probes}, which must be at least 16", value=probes)
    low, high = sensor.valid_range
    distance = np.linspace(low, min(high, low + _REACH), probes)
    with np.errstate(all="ignore"):
        checks = tuple(LawCheck(law=law, holds=h, evidence=e) for law, h, e in _laws(sensor, distance))
    return SensorConformance(sensor=sensor.name or type(sensor).__name__, checks=checks)


def _laws(sensor: SensorModel, distance: FloatArray) -> Iterator[tuple[str, bool, str]]:
    """Yield the result of each check of a sensor curve. Stop if later checks would be meaningless."""
    obstacle = _evaluation_obstacle(sensor, distance)
    evidence = obstacle or "a number, a row and a table of distances"
    yield "ln xi and g accept distances of any shape and return the same shape", obstacle is None, evidence
    if obstacle is not None:
        return
    log_output, slope = sensor.log_output(distance), sensor.log_slope(distance)
    wrong = int((~np.isfinite(log_output) | ~np.isfinite(slope)).sum())
    yield (
        "ln xi and g are finite on the valid range",
        not wrong,
        f"{wrong} of {distance.size} distances give no finite number",
    )
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
    yield "an array gives the same values as its elements one by one", difference <= _ROUNDING, measured
    value = _is_value(sensor)
    verdict = "frozen and hashable" if value else "not frozen or not hashable, so it can change after its first use"
    evidence = f"{type(sensor).__name__} is {verdict}"
    yield "the curve is a value: a frozen dataclass with hashable fields", value, evidence


def refuse_invalid_curve(sensor: SensorModel, farthest: float) -> None:
    """Raise an error if a custom sensor curve is invalid.

    The curve must be valid between contact and the farthest start of an encounter. A curve is checked when it is first
    used, and again if an encounter starts farther away. Distances beyond the start of every encounter are not checked:
    a motion that reaches them reports this by its status.

    Args:
        sensor: the curve.
        farthest: largest distance at which an encounter starts [m].

    Raises:
        InvalidInputError: ln xi or g cannot be evaluated, is not finite, or is not reproducible; the output does not
            fall with the distance; or g is not the derivative of ln xi. The last is tested between two distances: the
            change of ln xi may differ from the integral of g by 0.1 % of the whole change.
    """
    try:
        verified = _verified_reach(sensor)
    except TypeError:  # the curve cannot be hashed
        raise InvalidInputError(
            f"sensor: the class {type(innermost(sensor)).__name__} has a field that cannot be hashed, such as a "
            "list. Use a frozen dataclass whose fields are numbers, strings and tuples"
        ) from None
    low, high = sensor.valid_range
    low, high = max(low, 0.0), min(farthest, high)
    if not (high > low and high > verified[0]):
        return
    with np.errstate(all="ignore"):
        fault = _fault(sensor, np.linspace(low, high, _PROBES))
    if fault is not None:
        name = sensor.name or type(sensor).__name__
        raise InvalidInputError(f"sensor: the {name} curve is not a valid sensor curve: {fault}")
    verified[0] = high


@cache_by_curve(256)
def _verified_reach(sensor: SensorModel) -> list[float]:  # noqa: ARG001 - the key of the cache
    """Return a list of one element, which the caller updates: the largest checked distance of a curve [m]."""
    return [-np.inf]


def _fault(sensor: SensorModel, distance: FloatArray) -> str | None:
    """Return the first missing property of an invalid sensor curve; None if the curve is valid."""
    obstacle = _evaluation_obstacle(sensor, distance)
    if obstacle is not None:
        return (
            f'the function log_output or log_slope raised the error "{obstacle}". Both functions must accept '
            "distances of any shape and return the same shape"
        )
    log_output, slope = sensor.log_output(distance), sensor.log_slope(distance)
    functions = (("log_output", "", log_output, sensor.log_output), ("log_slope", " 1/m", slope, sensor.log_slope))
    for name, unit, values, function in functions:
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            i = wrong[0]
            return (
                f"the function {name} returned {values[i]:g}{unit} at a distance of {distance[i]:g} m, but its values "
                "must be finite; exclude this distance by minimum_distance or maximum_distance"
            )
        again = function(distance)
        i = int(np.abs(again - values).argmax())
        if abs(again[i] - values[i]) > _ROUNDED * np.abs(values).max():
            first, second = f"{values[i]:g}{unit}", f"{again[i]:g}{unit}"
            return (
                f"the function {name} returned {first} at a distance of {distance[i]:g} m, but {second} in a second "
                "call. A sensor curve must always return the same number for the same distance"
            )
    return _wrong_direction(sensor, distance, slope) or _contradiction(sensor, distance)


def _wrong_direction(sensor: SensorModel, distance: FloatArray, slope: FloatArray) -> str | None:
    """Return an error message for a wrong sensor slope. The slope is zero, positive, or not the declared constant."""
    steepest, i = float(np.abs(slope).max()), int(slope.argmax())
    if steepest == 0:
        return "found a slope of 0 1/m at every distance, which must be negative: the output is constant"
    if slope[i] > _ROUNDED * steepest:
        return (
            f"the slope is {slope[i]:g} 1/m at a distance of {distance[i]:g} m, but must not be positive. The output "
            "of a sensor falls with the distance. Limit the curve to its falling part by minimum_distance or "
            "maximum_distance. For a sensor behind the contact surface, use the class Recessed"
        )
    constant = sensor.constant_log_slope
    if constant is None:
        return None
    i = int(np.abs(slope - constant).argmax())
    if abs(slope[i] - constant) <= _ROUNDED * steepest:
        return None
    return (
        f"the slope is {slope[i]:g} 1/m at a distance of {distance[i]:g} m, but the sensor curve declares a "
        f"constant_log_slope of {constant:g} 1/m"
    )


def _contradiction(sensor: SensorModel, distance: FloatArray) -> str | None:
    """Return why the slope is not the derivative of the log output; None if it is."""
    edges = np.unique(np.concatenate([distance, [k for k in sensor.knots if distance[0] < k < distance[-1]]]))
    left, right, limit = edges[:-1], edges[1:], 0.0
    parts: list[FloatArray] = []
    for _ in range(_HALVINGS):  # steep parts of g need short intervals
        change, integral = _changes(sensor, left, right)
        limit = limit or _CONTRADICTION * float(np.abs(integral).sum() + np.abs(change).sum()) / 2
        poor = np.abs(change - integral) > limit / _SHARES
        parts.append(np.stack([left, right, change, integral])[:, ~poor])
        left, right = left[poor], right[poor]
        if not 0 < len(left) <= len(distance):
            break
        middle = (left + right) / 2
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
    rows = np.concatenate([*parts, np.stack([left, right, *_changes(sensor, left, right)])], axis=1)
    left, right, change, integral = rows[:, np.argsort(rows[0])]
    if np.ptp(np.cumsum(np.append(0.0, change - integral))) <= limit:
        return None
    i = int(np.abs(change - integral).argmax())
    width = right[i] - left[i]
    return (
        f"log_slope contradicts log_output between the distances {left[i]:.5g} m and {right[i]:.5g} m. There, the "
        f"average of log_slope is {integral[i] / width:.5g} 1/m, but log_output changes by {change[i] / width:.5g} per "
        "meter. The function log_slope must be the derivative of log_output within 0.1 %"
    )


def _changes(sensor: SensorModel, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the change of log output and the integral of the slope over each interval."""
    if not len(left):
        return left, left
    offset, weight = np.polynomial.legendre.leggauss(8)
    width = right - left
    mean = sensor.log_slope(left[:, None] + width[:, None] * (offset + 1) / 2) @ (weight / 2)
    return np.asarray(sensor.log_output(right) - sensor.log_output(left)), np.asarray(mean * width)


def _evaluation_obstacle(sensor: SensorModel, distance: FloatArray) -> str | None:
    """Evaluate a sensor curve and return its error as text. The result is None if the curve raises no error."""
    for function in (sensor.log_output, sensor.log_slope):
        for probe in (float(distance[0]), distance, distance[:16].reshape(4, 4)):
            try:
                function(probe)
            except Exception as error:
                return f"{type(error).__name__}: {error}"
    return None


def _scalar_difference(function: Callable[[Any], Any], distance: FloatArray) -> float:
    """Return the largest relative difference between array and scalar results."""
    some = distance[:: max(1, distance.size // 16)]
    together, alone = np.asarray(function(some)), np.array([function(float(d)) for d in some])
    return float(np.abs(together - alone).max() / (np.abs(together).max() + 1))


def _is_value(sensor: SensorModel) -> bool:
    """Return True if a sensor curve is immutable and hashable. It must be a frozen dataclass with hashable fields."""
    parameters = vars(type(sensor)).get("__dataclass_params__")
    try:
        hash(sensor)
    except TypeError:
        return False
    return parameters is not None and bool(parameters.frozen)


def _slope_error(sensor: SensorModel, distance: FloatArray, slope: FloatArray) -> tuple[float, float]:
    """Return the largest slope error of a sensor curve. Also return the allowed error. Both are in 1/m.

    The means of g and of the derivative of ln xi over intervals are compared. Intervals that disagree are halved while
    there are few of them, since steep parts of g need short intervals.
    """
    edges = np.unique(np.concatenate([distance, [k for k in sensor.knots if distance[0] < k < distance[-1]]]))
    width = np.diff(edges)
    left, right = (
        side[width > 1e-3 * width.max()] for side in (edges[:-1], edges[1:])
    )  # rounding dominates in shorter ones
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
