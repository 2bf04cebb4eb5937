"""Describe a proximity sensor that is mounted at a site of a robot model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray, are_numbers
from pretouch._core.units import to_si
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

AXES: Final = {f"{sign}{name}": (i, value) for sign, value in (("+", 1), ("-", -1)) for i, name in enumerate("xyz")}
"""The axes of a site by name, each with its index and its direction."""

HOLDS: Final = ("auto", "pose", "position", "axis")
"""What the joints hold while the site moves along its axis."""

_ROUNDING: Final = 1e-6  # largest deviation of the length of an axis from 1, for axes that are written with six digits


@dataclass(frozen=True, slots=True)
class SensorSite(Value):
    """A proximity sensor at a site of a MuJoCo model.

    The site marks the contact surface: the distance l is 0 if an object touches it. A sensor that is mounted deeper
    has a `Recessed` curve.

    Args:
        name: name of the site in the model.
        sensor: the sensor curve, over the distance from the site; None if only the robot is examined.
        axis: direction toward objects in the frame of the site: "+x", "-x", "+y", "-y", "+z", "-z" or a unit vector.
        field_of_view: full opening angle of the beam [rad], or text such as "8 deg"; 0 for a single ray.
        hold: what the joints hold while the site moves along its axis. "pose" holds the other directions and the
            orientation, "position" only the other directions, "axis" nothing. "auto" is the first of these that the
            joints can hold in the posture.

    Examples:
        >>> SensorSite("fingertip", axis="-z").direction
        array([ 0.,  0., -1.])
    """

    name: str
    sensor: SensorModel | None = None
    axis: Any = "+x"
    field_of_view: Any = 0.0
    hold: str = "auto"

    def __post_init__(self) -> None:
        check_types(self)
        axis = self.axis if isinstance(self.axis, str) else tuple(_unit_vector(self.axis))
        if isinstance(axis, str) and axis not in AXES:
            listed = ", ".join(AXES)
            raise InvalidInputError(
                f"axis: found {axis!r}, expected a unit vector or one of the axes {listed}", value=axis
            )
        angle = to_si(self.field_of_view, "rad", name="field_of_view")
        if not 0 <= angle < math.pi:
            raise InvalidInputError(
                f"field_of_view: found {math.degrees(angle):g} deg, expected an angle of at least 0 and below 180 deg"
            )
        if self.hold not in HOLDS:
            raise InvalidInputError(**not_one_of("hold", self.hold, HOLDS))
        object.__setattr__(self, "axis", axis)
        object.__setattr__(self, "field_of_view", angle)

    @property
    def direction(self) -> FloatArray:
        """The sensor axis as a unit vector in the site's frame."""
        if not isinstance(self.axis, str):
            return np.array(self.axis)
        index, sign = AXES[self.axis]
        direction = np.zeros(3)
        direction[index] = sign
        return direction


def _unit_vector(axis: Any) -> Any:
    """Return an axis as a vector after checking its length."""
    vector = np.asarray(axis, dtype=np.float64) if are_numbers(axis) else np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InvalidInputError(
            f"axis: found {axis!r}, expected a direction such as '+x', or three numbers that form a unit vector",
            value=axis,
        )
    length = float(np.linalg.norm(vector))
    if not abs(length - 1) <= _ROUNDING:
        raise InvalidInputError(
            f"axis: found a vector of length {length:g}, expected a unit vector; divide the vector by its length"
        )
    return vector / length
