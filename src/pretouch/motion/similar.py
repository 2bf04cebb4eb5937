"""Many sensors of one kind as one sensor: encounters that are the same in other units of length and gain.

With X = s x the equation of motion keeps its form if the force does. For g(l) = -n / (l + l_0) and s = L_0 / l_0,
L + L_0 = s (l + l_0), so the curve (n, l_0) with gain D_p moves as the curve (N, L_0) does with s (n / N) D_p: times
are the same, lengths and speeds are s times as large, and so are forces. A constant slope g needs no other length: only
g D_p counts. So encounters of ten thousand sensors with other parameters are ten thousand encounters of one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import ExponentialFirstOrder, InversePower, Recessed, SensorModel

from .contact import Columns, ContactResult
from .scenario import Scenario

__all__ = ["Likeness", "find_likeness"]

_LENGTHS: Final = frozenset(
    {
        "distance",
        "position",
        "velocity",
        "acceleration",
        "displacement",
        "relative_velocity",
        "virtual_force",
        "largest_excursion",
        "largest_travel",
        "largest_speed",
        "largest_acceleration",
        "largest_virtual_force",
        "closest_distance",
        "settling_distance",
    }
)
"""What grows with the unit of length; forces do, since masses stay."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """How encounters of many sensors are encounters of one.

    Args:
        sensor: the one sensor.
        length: s of each encounter, by which its lengths are multiplied; 1 where they stay.
        gain: the factor of its gain.
    """

    sensor: SensorModel
    length: Any
    gain: Any

    def scenario(self, scenario: Scenario) -> Scenario:
        """Return the encounters of the one sensor."""
        if np.ndim(self.length) == 0 and self.length == 1:
            return scenario
        bodies = {}
        for part in ("obstacle", "plant", "reference"):
            body: Any = getattr(scenario, part)
            names = ("position", "velocity") if part == "plant" else ("position", "velocity", "acceleration")
            bodies[part] = replace(body, **{name: getattr(body, name) * self.length for name in names})
        return replace(scenario, **bodies)

    def result(self, found: ContactResult) -> ContactResult:
        """Return what was found in the lengths and gains of the many sensors."""
        return ContactResult(_Rescaled(found.columns, self.length, self.gain), found.method)


class _Rescaled:
    """The columns of a result in other units."""

    __slots__ = ("columns", "gain", "length")

    def __init__(self, columns: Columns, length: Any, gain: Any) -> None:
        self.columns, self.length, self.gain = columns, length, gain

    def column(self, name: str) -> Any:
        """Return a quantity of every run."""
        found = self.columns.column(name)
        if name in _LENGTHS:
            return found / self.length
        return found / self.gain if name == "gain" else found


def find_likeness(sensor: SensorModel, values: Mapping[str, FloatArray], distance: Any) -> Likeness | None:
    """Find the one sensor that stands for many.

    Args:
        sensor: a sensor.
        values: its parameters that differ, without `sensor.`, shape (n,) each, in SI.
        distance: the distances at the start [m], of a shape that broadcasts with (n,).

    Returns:
        The likeness, or None where there is none, or where a curve does not hold from the start to contact.
    """
    curve = sensor.sensor if isinstance(sensor, Recessed) else sensor
    recess = np.asarray(values.get("recess", getattr(sensor, "recess", 0.0)))
    low, high = curve.valid_range
    if not (np.all(low - recess <= 0) and np.all(np.asarray(distance) <= high - recess)):
        return None
    if isinstance(sensor, Recessed) and type(sensor.sensor) not in {InversePower, ExponentialFirstOrder}:
        return None
    if type(curve) is ExponentialFirstOrder:
        rate = np.asarray(values.get("rate", curve.rate))
        return None if not np.all(rate < 0) else Likeness(sensor=_unbounded(curve), length=1.0, gain=rate / curve.rate)
    if type(curve) is not InversePower:
        return None
    offset = np.asarray(values.get("distance_offset", curve.distance_offset)) + recess
    exponent = np.asarray(values.get("exponent", curve.exponent))
    if not (np.all(offset > 0) and np.all(exponent > 0)):
        return None
    own = float(np.median(offset))
    length = own / offset
    one = replace(_unbounded(curve), distance_offset=own)
    return Likeness(sensor=one, length=length, gain=length * (exponent / curve.exponent))


def _unbounded(curve: Any) -> Any:
    return replace(curve, minimum_distance=0.0, maximum_distance=np.inf)
