"""The laws that every sensor curve obeys, as a check that users run on their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .model import SensorModel

_REACH = 0.2  # how far beyond its start an unbounded valid range is probed [m]
_ROUNDING = 1e-12  # relative
_SLOPE_TOLERANCE = 1e-6  # of the largest slope
_HALVINGS = 20
_FEW = 64


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
    if not isinstance(sensor, SensorModel):
        raise InvalidInputError(f"sensor: found {type(sensor).__name__}, expected a class that inherits SensorModel")
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
    offset, weight = np.polynomial.legendre.leggauss(8)
    width = right - left
    mean_slope = sensor.log_slope(left[:, None] + width[:, None] * (offset + 1) / 2) @ (weight / 2)
    return np.asarray(np.abs((sensor.log_output(right) - sensor.log_output(left)) / width - mean_slope))
