"""Tabulate a sensor curve, for controllers that convert a measured distance to the output of the sensor."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray

from .law_design import LawDesign

_BELOW_FLOOR: Final = 1.0  # ln xi below the detection threshold at which the table of the sensor curve ends


class CurveTable(NamedTuple):
    """A sensor curve at equal steps of the distance.

    Args:
        curve: name of the curve.
        start: smallest distance [m].
        step: step of the distance [m].
        values: ln xi at each distance.
        error: largest error of ln xi if it is interpolated linearly.
        reach: largest distance for which the curve is valid [m]; beyond, a sensor of distances sees no object.
    """

    curve: str
    start: float
    step: float
    values: FloatArray
    error: float
    reach: float

    def reach_text(self, suffix: str, infinity: str) -> str:
        """Return the reach as a number of C with a suffix; if it is infinite, the given text."""
        return f"{self.reach!r}{suffix}" if math.isfinite(self.reach) else infinity

    def rows(self, suffix: str = "") -> str:
        """Return the values as lines of a C initializer; each number has the given suffix."""
        rows = (self.values[i : i + 6] for i in range(0, len(self.values), 6))
        return "\n".join(f"    {', '.join(f'{float(v)!r}{suffix}' for v in row)}," for row in rows)


def curve_table(design: LawDesign, steps: int) -> CurveTable:
    """Return the sensor curve as a table, from the smallest valid distance to one without detection.

    Args:
        design: the design.
        steps: number of steps of the table.
    """
    sensor: Any = design.task.sensor
    start, end = _curve_range(sensor, math.log(design.controller.conditioning.floor) - _BELOW_FLOOR)
    step = (end - start) / steps
    distances = start + step * np.arange(steps + 1)
    distances[-1] = end
    values = sensor.log_output(distances)
    between = sensor.log_output((distances[1:] + distances[:-1]) / 2) - (values[1:] + values[:-1]) / 2
    error = 1.06 * float(np.max(np.abs(between)))
    reach = float(sensor.valid_range[1])
    return CurveTable(type(sensor).__name__, float(start), float(step), values, error, reach)


def _curve_range(sensor: Any, lowest: float) -> tuple[float, float]:
    """Return the first and last distance of a curve table [m]."""
    start, end = sensor.valid_range
    far = min(start + 1e-3, end)
    if sensor.log_output(start) <= lowest:
        return start, far
    while far < end and sensor.log_output(far) > lowest:
        far = min(start + 2 * (far - start), end)
    near = start
    for _ in range(60):
        middle = (near + far) / 2
        near, far = (middle, far) if sensor.log_output(middle) > lowest else (near, middle)
    return start, far
