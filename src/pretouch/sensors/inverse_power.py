"""The inverse power curve, L(3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive

from .change import CurveChange
from .model import SensorModel, parameter

__all__ = ["InversePower"]


@dataclass(frozen=True, slots=True, kw_only=True)
class InversePower(SensorModel):
    """Inverse power curve xi = scale / (l + l_0)^n, L(3), with alpha beta psi lumped into one scale.

    Args:
        scale: alpha beta psi > 0, in the unit of the output times m^n; it cancels from the motion.
        distance_offset: l_0 [m], from the virtual source to the contact surface; l + l_0 must stay positive.
        exponent: n > 0, the diffusion exponent.
        minimum_distance: smallest valid l [m].
        maximum_distance: largest valid l [m].

    Examples:
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> round(sensor.log_slope(0.0), 3)
        -79.236
    """

    scale: float = parameter("alpha beta psi", "")
    distance_offset: float = parameter("l_0", "m")
    exponent: float = parameter("n", "")

    name: ClassVar[str] = "inverse-power"

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        positive(self.scale, "scale")
        positive(self.exponent, "exponent")
        offset = finite(self.distance_offset, "distance_offset", "m")
        if not self.minimum_distance + offset > 0:
            raise InvalidInputError(
                f"distance_offset: found {offset:g} m, which must exceed minus the minimum distance "
                f"({-self.minimum_distance:g} m), or the output is infinite there"
            )

    def _change_by(self, name: str) -> CurveChange | None:
        known = {
            "scale": CurveChange(),
            "distance_offset": CurveChange(shift=1.0),
            "exponent": CurveChange(output=1 / self.exponent),
        }
        return known.get(name)

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(np.log(self.scale) - self.exponent * np.log(distance + self.distance_offset))

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return np.asarray(-self.exponent / (distance + self.distance_offset))
