"""Decide whether a sensor output has settled, and select the readings for the calibration."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.calibration.averaging import MAD_TO_SIGMA

_FEWEST: Final = 6  # readings from which a drift is judged
_BLOCKS: Final = 20  # averages of neighboring readings from which it is judged
_FALSE_ALARM: Final = 1e-3  # probability that noise alone counts as drift
_JUDGMENTS: Final = 50  # judgments during one dwell
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


def drifts(values: FloatArray) -> bool:
    """Return True if readings rise or fall more than noise explains.

    Args:
        values: the readings in the order of their arrival, shape (N,).

    Returns:
        Whether the slope of a straight line through the readings is significant. Neighboring readings are averaged
        into at most 20 blocks first, because the noise of fast sensors is correlated. Fewer than six readings never
        drift.

    Examples:
        >>> drifts(np.array([10.0, 11.0, 10.0, 9.0, 10.0, 11.0, 10.0])), drifts(np.arange(7.0))
        (False, True)
    """
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only when a sensor is read

    if len(values) < _FEWEST:
        return False
    steps = np.diff(np.unique(values))
    blocks = np.array([block.mean() for block in np.array_split(values, min(len(values), _BLOCKS))])
    place = np.arange(len(blocks)) - (len(blocks) - 1) / 2
    slope = float(place @ blocks / (place @ place))
    freedom = len(blocks) - 2
    residual = blocks - blocks.mean() - slope * place
    # the readings of a converter may all be equal, although the true output is anywhere within one step
    rounding = float(steps.min()) ** 2 / 12 * len(blocks) / len(values) if len(steps) else 0.0
    error = math.sqrt(max(float(residual @ residual) / freedom, rounding) / float(place @ place))
    return abs(slope) > float(stdtrit(freedom, 1 - _FALSE_ALARM / 2)) * error


class Stay:
    """Selection of the calibration readings at one object distance.

    The calibration uses only readings after settling.

    Args:
        wanted: number of readings that count.
        dwell: time over which these are spread, at least [s]; the output must have been steady for half of it.
    """

    def __init__(self, wanted: int, dwell: float) -> None:
        self._wanted, self._dwell = wanted, dwell
        self._recent = deque[tuple[float, float]]()
        self._start: float | None = None
        self._counted_from: float | None = None
        self._judged = -math.inf
        self.counted: list[float] = []
        self.has_settled = True

    def add(self, time: float, output: float) -> bool:
        """Add a reading, and return True if the calibration uses it.

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
        """Whether the calibration has enough readings at this distance."""
        return len(self.counted) >= self._wanted

    @property
    def is_settling(self) -> bool:
        """Whether the sensor output is still settling.

        The calibration does not use readings during settling.
        """
        return self._counted_from is None

    @property
    def has_drifted(self) -> bool:
        """Whether the readings for the calibration drift.

        Drifting readings rise or fall.
        """
        return drifts(np.array(self.counted))

    @property
    def recent(self) -> FloatArray:
        """The readings since the sensor output settled.

        Before that, these are the latest readings.
        """
        return np.array(self.counted or [output for _, output in self._recent])

    def _is_steady(self, now: float) -> bool:
        """Return True if the sensor output has settled. The result is also True after the longest settling time."""
        if len(self._recent) < _FEWEST or now - self._recent[0][0] < 0.4 * self._dwell:
            return False
        if now - self._judged < self._dwell / _JUDGMENTS:  # so that fast sensors need little computing time
            return False
        self._judged = now
        if not drifts(np.array([output for _, output in self._recent])):
            return True
        assert self._start is not None  # noqa: S101 - set by the first reading
        if now - self._start > _PATIENCE * max(self._dwell, 0.1):
            self.has_settled = False
            return True
        return False
