"""The laws that every sensor curve obeys, as a check that users run on their own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .model import SensorModel

__all__ = ["LawCheck", "SensorConformance", "check_sensor"]

_REACH = 0.2  # how far beyond its start an unbounded valid range is probed [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class LawCheck:
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
class SensorConformance:
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
        log_output = np.asarray(sensor.log_output(distance))
        slope = np.asarray(sensor.log_slope(distance))
        checks = tuple(_laws(sensor, distance, log_output, slope))
    return SensorConformance(sensor=sensor.name or type(sensor).__name__, checks=checks)


def _laws(sensor: SensorModel, distance: FloatArray, log_output: FloatArray, slope: FloatArray) -> Iterator[LawCheck]:
    shaped = log_output.shape == slope.shape == distance.shape
    yield LawCheck(
        law="ln xi and g keep the shape of the distance",
        holds=shaped,
        evidence=f"{log_output.shape} and {slope.shape} for {distance.shape}",
    )
    if not shaped:
        return
    finite = bool(np.isfinite(log_output).all() and np.isfinite(slope).all())
    yield LawCheck(
        law="ln xi and g are finite on the valid range",
        holds=finite,
        evidence=f"{int((~np.isfinite(log_output) | ~np.isfinite(slope)).sum())} of {distance.size} are not",
    )
    if not finite:
        return
    yield LawCheck(
        law="the output does not grow with distance (g <= 0)",
        holds=bool((slope <= 0).all()),
        evidence=f"largest g = {slope.max():.4g} 1/m",
    )
    error, tolerance = _slope_error(sensor, distance, slope)
    yield LawCheck(
        law="g is the derivative of ln xi",
        holds=bool(error <= tolerance),
        evidence=f"largest difference {error:.2g} 1/m, {tolerance:.2g} 1/m allowed",
    )
    constant = sensor.constant_log_slope
    spread = 0.0 if constant is None else float(np.abs(slope - constant).max())
    yield LawCheck(
        law="a slope that is declared constant is constant",
        holds=spread <= 1e-12 * float(np.abs(slope).max()),
        evidence="not declared" if constant is None else f"largest difference {spread:.2g} 1/m",
    )
    one_by_one = np.array([sensor.log_output(float(d)) for d in distance[:: max(1, distance.size // 16)]])
    difference = float(np.abs(one_by_one - log_output[:: max(1, distance.size // 16)]).max())
    yield LawCheck(
        law="an array gives what its elements give one by one",
        holds=difference <= 1e-12 * float(np.abs(log_output).max() + 1),
        evidence=f"largest difference {difference:.2g}",
    )


def _slope_error(sensor: SensorModel, distance: FloatArray, slope: FloatArray) -> tuple[float, float]:
    """Compare g with ln xi between neighboring probes: their difference against Gauss's rule on g, 1/m."""
    offset, weight = np.polynomial.legendre.leggauss(8)
    edges = np.unique(np.concatenate([distance, [k for k in sensor.knots if distance[0] < k < distance[-1]]]))
    left, width = edges[:-1], np.diff(edges)
    nodes = left[:, None] + width[:, None] * (offset + 1) / 2
    mean_slope = np.asarray(sensor.log_slope(nodes)) @ (weight / 2)
    rise = np.diff(np.asarray(sensor.log_output(edges)))
    wide = width > 1e-3 * width.max()  # between a knot and a probe beside it, rounding decides
    error = np.abs(rise / width - mean_slope)[wide].max()
    return float(error), 1e-6 * float(np.abs(slope).max() + 1)
