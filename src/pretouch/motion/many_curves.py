"""Combine many sensor curves for one solver call.

Each encounter can use a different curve.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pretouch._core.errors import OutOfRangeError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel

from .curve import reach_of
from .many_windows import ManyWindows, find_images, windows_from_pieces, windows_of_images, windows_side_by_side
from .scenario import Scenario

_METHODS: Final = ("auto", "integration")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ManyCurves:
    """Sensor curves of one class, one curve for each encounter.

    None has a constant slope, and all are valid down to l = 0.

    Args:
        sensor: the curve from which they are made.
        values: the parameters that differ, in SI, by names without `sensor.`, shape (n,) each.
        sensors: the n curves.
    """

    sensor: SensorModel
    values: Mapping[str, FloatArray]
    sensors: tuple[SensorModel, ...]
    _windows: dict[float, ManyWindows] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.sensors)

    def windows(self, reach: float) -> ManyWindows:
        """Approximate all sensor curves up to a given distance [m]."""
        if reach not in self._windows:
            tops = np.minimum([sensor.valid_range[1] for sensor in self.sensors], reach)
            images = find_images(self.sensor, self.values)
            if images is None:
                self._windows[reach] = windows_side_by_side(self.sensors, self.values, tops)
            else:
                self._windows[reach] = windows_of_images(images, tops)
        return self._windows[reach]

    def complete_windows(self, reach: float) -> ManyWindows:
        """Return as many polynomials as needed to approximate all sensor curves.

        The polynomials reach up to a given distance [m].
        """
        windows = self.windows(reach)
        if not (np.diff(windows.starts) > 0).all():
            tops = np.minimum([sensor.valid_range[1] for sensor in self.sensors], reach)
            windows = self._windows[reach] = windows_from_pieces(self.sensors, tops)
        return windows

    def check(self, scenario: Scenario) -> None:
        """Check that every encounter starts within its sensor curve's range.

        Raises:
            OutOfRangeError: an encounter starts outside this range.
        """
        low, high = np.array([sensor.valid_range for sensor in self.sensors]).T
        distance = np.asarray(scenario.distance) + np.zeros(len(self))
        outside = np.argwhere(~((low <= distance) & (distance <= high)))
        if len(outside):
            i = int(outside[0][-1])
            raise OutOfRangeError(
                f"obstacle position: encounter {i} starts at a distance of {distance[tuple(outside[0])]:g} m, "
                f"outside the sensor range. Its sensor curve ({self.sensor.name}) is valid only from {low[i]:g} m to "
                f"{high[i]:g} m. Start the encounter when the object enters this range",
                value=float(distance[tuple(outside[0])]),
                limit=(float(low[i]), float(high[i])),
            )

    def falls(self, scenario: Scenario) -> bool:
        """Return True if every sensor output falls with distance.

        The tested distances reach from contact to the farthest start.
        """
        return self.windows(reach_of(scenario)).falling

    def slope_at_contact(self) -> FloatArray:
        """Return the slope g [1/m] of each sensor curve at contact."""
        return np.array([sensor.log_slope(0.0) for sensor in self.sensors])

    def log_output(self, distance: FloatArray) -> FloatArray:
        """Return the logarithm of each sensor's output, ln xi.

        Distances [m] are limited to the valid range. Distances have the shape (..., n).
        """
        inside = [np.clip(distance[..., i], *sensor.valid_range) for i, sensor in enumerate(self.sensors)]
        return np.stack([s.log_output(d) for s, d in zip(self.sensors, inside, strict=True)], axis=-1)


def many_curves(
    sensor: SensorModel, values: Mapping[str, FloatArray], sensors: tuple[SensorModel, ...], method: str
) -> ManyCurves | None:
    """Combine sensor curves for a single solver call.

    Returns:
        The set; None if a curve has a constant slope or is not valid at contact, or if another method is requested.
    """
    suitable = all(s.constant_log_slope is None and s.valid_range[0] <= 0 for s in sensors)
    if not suitable or method not in _METHODS:
        return None
    return ManyCurves(sensor=sensor, values=values, sensors=sensors)
