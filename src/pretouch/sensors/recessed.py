"""Describe a sensor that is mounted behind the contact surface of the robot."""

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
    """Curve of a sensor mounted behind the contact surface.

    The recess is the distance of the sensor behind the robot's contact surface. The output of reflective sensors peaks
    or saturates in the near field. A sensor that is recessed behind the contact surface by the start of its usable
    window works only in the falling part of its curve.

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
            raise InvalidInputError(f"sensor: found {self.sensor!r}, expected a sensor curve", value=self.sensor)
        recess = _number(self.recess, "recess", "m")
        low, high = self.sensor.valid_range
        nearest, farthest = (_limit(getattr(self, end), end) for end in ("minimum_distance", "maximum_distance"))
        object.__setattr__(self, "recess", recess)
        start = 0.0 if math.isclose(low, recess, rel_tol=_ROUNDING) else low - recess
        object.__setattr__(self, "minimum_distance", max(nearest, start))
        object.__setattr__(self, "maximum_distance", min(farthest, high - recess))
        if not self.maximum_distance > 0:
            raise InvalidInputError(
                f"recess: found {recess:g} m, expected less than {high:g} m. The {self.sensor.name} curve of the "
                "sensor ends at this distance. Choose a smaller recess",
                value=recess,
                limit=high,
            )
        SensorModel.__post_init__(self)

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters of the sensor curve and the recess.

        They are given by name, in SI units.
        """
        return {**self.sensor.parameters, "recess": self.recess}

    @property
    def bare(self) -> tuple[SensorModel, float]:
        """The sensor curve without recess, and the recess [m].

        The recess is how far the sensor is behind the contact surface.
        """
        return self.sensor, self.recess

    @property
    def parameter_units(self) -> dict[str, str]:
        """The SI units of the curve parameters and recess.

        They are given by parameter name.
        """
        return {**self.sensor.parameter_units, "recess": "m"}

    def with_parameters(self, values: Mapping[str, float]) -> SensorModel:
        """Return a copy of the recessed sensor with new parameters.

        The copy is valid on the whole range of the inner curve.
        """
        curve = {name: value for name, value in values.items() if name != "recess"}
        inner = self.sensor.with_parameters(curve) if curve else self.sensor
        return Recessed(sensor=inner, recess=values.get("recess", self.recess))

    def _knots(self) -> Iterable[float]:
        return (knot - self.recess for knot in self.sensor.knots)

    @property
    def constant_log_slope(self) -> float | None:
        """The constant slope g of the sensor curve without recess [1/m].

        It is None if the slope depends on the distance.
        """
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
        """Return distances from the sensor for distances from the contact surface. Both are in m.

        The sensor distances are limited to the valid range because sums are rounded.
        """
        low, high = self.sensor.valid_range
        return np.clip(distance + self.recess, low, high)


def recess_in_words(nearest: float) -> str:
    """Return the smallest suitable recess of a sensor as text.

    With this recess, contact lies at the sensor's nearest usable distance. It is rounded up to 1 um.

    Examples:
        >>> recess_in_words(0.0075), recess_in_words(0.0123441)
        ('7.5 mm', '12.345 mm')
    """
    return f"{math.ceil(1e6 * nearest * (1 - 1e-12)) / 1e3:.10g} mm"
