"""ln xi of any curve as a table of values and slopes, the form that the loop in C++ reads."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel
from pretouch.sensors.kept import kept_by_curve

__all__ = ["curve_table"]

_FEWEST: Final = 257
_MOST: Final = 1 << 16
_ERROR: Final = 1e-12  # of ln xi, in the middle between two rows


@kept_by_curve(1024)  # as many samples of a sensor as a robust design on a loop or a verdict has
def curve_table(sensor: SensorModel, high: float) -> tuple[FloatArray, float, float]:
    """Tabulate ln xi up to a distance [m], at equal steps, until cubics between them meet it to 1e-12, or at 65,537.

    Returns:
        Values of ln xi and its slopes times the step, shape (n, 2); the first distance and the step [m].
    """
    low, end = sensor.valid_range[0], min(high, sensor.valid_range[1])
    count = _FEWEST
    while True:
        distance = np.linspace(low, end, count)
        spacing = (end - low) / (count - 1)
        table = np.stack([sensor.log_output(distance), np.asarray(sensor.log_slope(distance)) * spacing], axis=1)
        middle = np.asarray(sensor.log_output(distance[:-1] + spacing / 2))
        between = (table[:-1, 0] + table[1:, 0]) / 2 + (table[:-1, 1] - table[1:, 1]) / 8
        if count > _MOST or np.all(np.abs(between - middle) <= _ERROR * (1 + np.abs(middle))):
            table.setflags(write=False)
            return table, low, spacing
        count = 2 * count - 1
