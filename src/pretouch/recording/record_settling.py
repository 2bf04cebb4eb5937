"""Decide whether a sensor output has settled, and choose the readings that count."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.calibration.averaging import MAD_TO_SIGMA

_FEWEST: Final = 6  # readings from which settling is judged, three in each half
_SIGNIFICANT: Final = 3.0  # standard errors of the difference between two halves
_PATIENCE: Final = 10.0  # s, or 10 times the dwell, after which readings count although the output drifts


def robust_spread(values: FloatArray) -> float:
    """Return the standard deviation of readings, estimated by the median absolute deviation.

    Args:
        values: the readings, shape (N,), N >= 1.

    Returns:
        The estimate, which a few outliers hardly change, in the unit of the readings.

    Examples:
        >>> round(robust_spread(np.array([10.0, 11.0, 9.0, 10.0, 400.0])), 2)
        1.48
    """
    return MAD_TO_SIGMA * float(np.median(np.abs(values - np.median(values))))


def differs(first: FloatArray, second: FloatArray) -> bool:
    """Return True if two series of readings differ by more than three standard errors.

    Args:
        first: the first readings, shape (N,), N >= 1.
        second: the second readings, shape (M,), M >= 1.

    Returns:
        False if noise, or the resolution of the readings, explains the difference between the means.
    """
    both = np.concatenate([first - np.median(first), second - np.median(second)])
    steps = np.diff(np.unique(np.concatenate([first, second])))
    resolution = float(steps.min()) if len(steps) else 0.0
    sigma = max(MAD_TO_SIGMA * float(np.median(np.abs(both))), resolution / math.sqrt(12))
    error = sigma * math.sqrt(1 / len(first) + 1 / len(second))
    return abs(float(np.mean(second)) - float(np.mean(first))) > _SIGNIFICANT * error


class Stay:
    """The readings while the object stays at one distance: those until the output has settled, then those that count.

    Args:
        wanted: number of readings that count.
        dwell: time over which these are spread, at least [s]; the output must have been steady for half of it.
    """

    def __init__(self, wanted: int, dwell: float) -> None:
        self._wanted, self._dwell = wanted, dwell
        self._recent = deque[tuple[float, float]]()
        self._start: float | None = None
        self._counted_from: float | None = None
        self.counted: list[float] = []
        self.has_settled = True

    def add(self, time: float, output: float) -> bool:
        """Add a reading, and return True if it counts.

        Args:
            time: when the reading arrived [s].
            output: the reading.

        Returns:
            Whether the reading belongs to the calibration.
        """
        self._start = time if self._start is None else self._start
        if self._counted_from is None:
            self._recent.append((time, output))
            while len(self._recent) > _FEWEST and time - self._recent[0][0] > self._dwell / 2:
                self._recent.popleft()
            if not self._is_steady(time):
                return False
            self._counted_from = time
        due = self._counted_from + len(self.counted) * self._dwell / self._wanted
        if self.is_done or time < due:
            return False
        self.counted.append(output)
        return True

    @property
    def is_done(self) -> bool:
        """Whether enough readings were counted."""
        return len(self.counted) >= self._wanted

    @property
    def is_settling(self) -> bool:
        """Whether the output still changes, so that no reading counts yet."""
        return self._counted_from is None

    @property
    def has_drifted(self) -> bool:
        """Whether the counted readings changed from their first to their second half."""
        half = len(self.counted) // 2
        return half >= _FEWEST // 2 and differs(np.array(self.counted[:half]), np.array(self.counted[half:]))

    @property
    def recent(self) -> FloatArray:
        """The counted readings, or the latest readings while the output settles."""
        return np.array(self.counted or [output for _, output in self._recent])

    def _is_steady(self, now: float) -> bool:
        """Return True if the latest readings do not drift, or if the output had enough time."""
        if len(self._recent) < _FEWEST or now - self._recent[0][0] < 0.4 * self._dwell:
            return False
        outputs = np.array([output for _, output in self._recent])
        half = len(outputs) // 2
        if not differs(outputs[:half], outputs[half:]):
            return True
        assert self._start is not None  # noqa: S101 - set by the first reading
        if now - self._start > _PATIENCE * max(self._dwell, 0.1):
            self.has_settled = False
            return True
        return False
