"""Encounters of which each has a sensor curve of its own: the curves as one value, with their windows side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pretouch._core.errors import OutOfRangeError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel

from .curve import reach_of
from .many_windows import ManyWindows, find_images, windows_of_images, windows_side_by_side
from .scenario import Scenario

_METHODS: Final = ("auto", "integration")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ManyCurves:
    """Curves of one kind that differ in parameters, none of them of constant slope, all valid down to l = 0.

    Args:
        sensor: the one that they are made from.
        values: the parameters that differ, without `sensor.`, shape (n,) each, in SI.
        sensors: the curves, n of them.
    """

    sensor: SensorModel
    values: Mapping[str, FloatArray]
    sensors: tuple[SensorModel, ...]
    _made: dict[float, ManyWindows] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.sensors)

    def windows(self, reach: float) -> ManyWindows:
        """Return the windows of all curves up to a distance [m], or as far as a curve goes; made when first asked."""
        if reach not in self._made:
            tops = np.minimum([sensor.valid_range[1] for sensor in self.sensors], reach)
            images = find_images(self.sensor, self.values)
            if images is None:
                self._made[reach] = windows_side_by_side(self.sensors, self.values, tops)
            else:
                self._made[reach] = windows_of_images(images, tops)
        return self._made[reach]

    def check(self, scenario: Scenario) -> None:
        """Refuse encounters, of a shape that broadcasts with (n,), that start where their curve says nothing.

        Raises:
            OutOfRangeError: one does.
        """
        low, high = np.array([sensor.valid_range for sensor in self.sensors]).T
        distance = np.asarray(scenario.distance) + np.zeros(len(self))
        outside = np.argwhere(~((low <= distance) & (distance <= high)))
        if len(outside):
            i = int(outside[0][-1])
            raise OutOfRangeError(
                f"obstacle position: found a distance of {distance[tuple(outside[0])]:g} m at the start, outside "
                f"the {low[i]:g} m to {high[i]:g} m in which the {self.sensor.name} curve of encounter {i} holds: the "
                "encounter starts when the object enters the detection range"
            )

    def falls(self, scenario: Scenario) -> bool:
        """Tell whether ln xi of every curve is known to fall with the distance, from contact to all starts."""
        return self.windows(reach_of(scenario)).falling

    def slope_at_contact(self) -> FloatArray:
        """Return g [1/m] of each curve at l = 0, shape (n,)."""
        return np.array([sensor.log_slope(0.0) for sensor in self.sensors])

    def log_output(self, distance: FloatArray) -> FloatArray:
        """Return ln xi of each curve, brought into its range, at distances [m] of the shape (..., n)."""
        inside = [np.clip(distance[..., i], *sensor.valid_range) for i, sensor in enumerate(self.sensors)]
        return np.stack([s.log_output(d) for s, d in zip(self.sensors, inside, strict=True)], axis=-1)


def many_curves(
    sensor: SensorModel, values: Mapping[str, FloatArray], sensors: tuple[SensorModel, ...], method: str
) -> ManyCurves | None:
    """Put curves together that may be solved together.

    Returns:
        The curves; None where some are of constant slope or do not hold at contact, or another method is asked for.
    """
    alike = all(s.constant_log_slope is None and s.valid_range[0] <= 0 for s in sensors)
    if not alike or method not in _METHODS:
        return None
    return ManyCurves(sensor=sensor, values=values, sensors=sensors)
