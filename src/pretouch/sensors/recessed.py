"""Describe a sensor that is mounted behind the contact surface."""

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

_ROUNDING: Final = 1e-12  # relative; a recess equal to the start of the curve may differ from it by rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Recessed(SensorModel):
    """A calibrated sensor mounted so that contact (l = 0) occurs at the distance `recess` from the sensor's own zero.

    The output of reflective sensors peaks or saturates in the near field. A sensor that is recessed behind the contact
    surface by the start of its usable window works only in the falling part of its curve.

    Args:
        sensor: the curve as a function of the distance from the sensor's own zero.
        recess: distance from the sensor's zero to the contact surface [m].
        minimum_distance: smallest valid l [m] from the contact surface; limited by the range of the curve.
        maximum_distance: largest valid l [m] from the contact surface; limited by the range of the curve.

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
        start = 0.0 if math.isclose(low, recess, rel_tol=_ROUNDING) else low - recess
        object.__setattr__(self, "minimum_distance", max(nearest, start))
        object.__setattr__(self, "maximum_distance", min(farthest, high - recess))
        if not self.maximum_distance > 0:
            raise InvalidInputError(
                f"recess: found {recess:g} m, but the {self.sensor.name} curve already ends at {high:g} m, so no "
                "distance in front of the contact surface remains; choose a smaller recess"
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
        """Return the recessed curve with other parameters, valid on the whole range of the curve."""
        curve = {name: value for name, value in values.items() if name != "recess"}
        inner = self.sensor.with_parameters(curve) if curve else self.sensor
        return Recessed(sensor=inner, recess=values.get("recess", self.recess))

    def _knots(self) -> Iterable[float]:
        return (knot - self.recess for knot in self.sensor.knots)

    @property
    def constant_log_slope(self) -> float | None:
        """The slope of the curve [1/m] if it is constant, else None."""
        return self.sensor.constant_log_slope

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:
        if name == "recess":
            return CurveSensitivity(shift=1.0)
        inner = curve_sensitivity(self.sensor, name)
        slope = inner.slope
        return CurveSensitivity(
            output=inner.output,
            shift=inner.shift + inner.stretch * self.recess,  # (l + recess) g
            stretch=inner.stretch,
            slope=None if slope is None else lambda distance: slope(self._sensor_distance(distance)),
            nearest=inner.nearest,
        )

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(self.sensor.log_output(self._sensor_distance(distance)))

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return np.asarray(self.sensor.log_slope(self._sensor_distance(distance)))

    def _sensor_distance(self, distance: FloatArray) -> FloatArray:
        """Return distances from the sensor's own zero; l + recess may round to just outside the valid range."""
        low, high = self.sensor.valid_range
        return np.clip(distance + self.recess, low, high)
