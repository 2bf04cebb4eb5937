"""A sensor that is mounted behind the contact surface."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .model import SensorModel, _limit, _number
from .sensitivity import CurveSensitivity, curve_sensitivity

_ROUNDING: Final = 1e-12  # of a recess as deep as the curve starts: the mean of equal distances is not quite theirs


@dataclass(frozen=True, slots=True, kw_only=True)
class Recessed(SensorModel):
    """A calibrated sensor mounted so that contact (l = 0) happens at a distance `recess` from its own zero.

    Reflective sensors peak or saturate in the near field; sunk behind the contact surface by the start of their
    usable window, they work in the part of their curve that falls.

    Args:
        sensor: the curve over the distance from the sensor's own zero.
        recess: distance from the sensor's zero to the contact surface [m].
        minimum_distance: smallest valid l [m], from the contact surface; what the curve allows, where that is larger.
        maximum_distance: largest valid l [m], likewise.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> bare = ExponentialFirstOrder(scale=1.0, rate=-60.0, minimum_distance=0.005)
        >>> Recessed(sensor=bare, recess=0.005).valid_range
        (0.0, inf)
    """

    sensor: SensorModel = field()
    recess: float = field()
    minimum_distance: float = -np.inf

    name: ClassVar[str] = "recessed"

    def __post_init__(self) -> None:
        if not isinstance(self.sensor, SensorModel):
            raise InvalidInputError(f"sensor: found {self.sensor!r}, expected a sensor curve")
        recess = _number(self.recess, "recess", "m")
        low, high = self.sensor.valid_range
        nearest, farthest = (_limit(getattr(self, end), end) for end in ("minimum_distance", "maximum_distance"))
        object.__setattr__(self, "recess", recess)
        reach = 0.0 if math.isclose(low, recess, rel_tol=_ROUNDING) else low - recess
        object.__setattr__(self, "minimum_distance", max(nearest, reach))
        object.__setattr__(self, "maximum_distance", min(farthest, high - recess))
        if not self.maximum_distance > 0:
            raise InvalidInputError(
                f"recess: found {recess:g} m, which leaves no distance in front of the contact surface: "
                f"the {self.sensor.name} curve ends at {high:g} m"
            )
        SensorModel.__post_init__(self)

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters of the curve and the recess, in SI."""
        return {**self.sensor.parameters, "recess": self.recess}

    @property
    def bare(self) -> tuple[SensorModel, float]:
        """The curve and its recess [m]."""
        return self.sensor, self.recess

    @property
    def parameter_units(self) -> dict[str, str]:
        """The units of the curve's parameters and of the recess."""
        return {**self.sensor.parameter_units, "recess": "m"}

    def with_parameters(self, values: Mapping[str, float]) -> SensorModel:
        """Return the recessed curve with other parameters; the curve's own range decides where it holds."""
        curve = {name: value for name, value in values.items() if name != "recess"}
        inner = self.sensor.with_parameters(curve) if curve else self.sensor
        return Recessed(sensor=inner, recess=values.get("recess", self.recess))

    def _knots(self) -> Iterable[float]:
        return (knot - self.recess for knot in self.sensor.knots)

    @property
    def constant_log_slope(self) -> float | None:
        """The slope of the curve [1/m] where it is the same at every distance, else None."""
        return self.sensor.constant_log_slope

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:
        if name == "recess":
            return CurveSensitivity(shift=1.0)
        known = curve_sensitivity(self.sensor, name)
        slope = known.slope
        return CurveSensitivity(
            output=known.output,
            shift=known.shift + known.stretch * self.recess,  # (l + recess) g
            stretch=known.stretch,
            slope=None if slope is None else lambda distance: slope(self._own(distance)),
            nearest=known.nearest,
        )

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(self.sensor.log_output(self._own(distance)))

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return np.asarray(self.sensor.log_slope(self._own(distance)))

    def _own(self, distance: FloatArray) -> FloatArray:
        low, high = self.sensor.valid_range  # l + recess may round to just outside
        return np.clip(distance + self.recess, low, high)
