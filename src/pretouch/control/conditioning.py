"""What is done to a reading before its logarithm is differenced, and which readings are not used."""

from __future__ import annotations

from dataclasses import dataclass

from pretouch._core.declared import ONE_ROBOT, OUTPUT, check_declared, count, quantity
from pretouch._core.errors import InvalidInputError

from .butterworth import design_low_pass
from .structures import FilterSection, SensingNumbers

__all__ = ["LONGEST_WINDOW", "Conditioning"]

LONGEST_WINDOW = 16
"""Readings of the longest running median."""

_ANY_READING = 1e12
_ANY_FLOOR = 1e-24  # ln(xi / floor) has a number for every reading, also in single precision
_ANY_RATE = 1e15
_TIMEOUT_PERIODS = 10
_FADE_PERIODS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditioning:
    """Offset, floor, running median and Butterworth low-pass, at the sensor's rate, and when a reading is not used.

    Args:
        floor: what is below, after the offset, is taken for nothing there: above noise and drift [unit of xi], > 0.
        offset: output without an object [unit of xi], subtracted from each reading.
        saturation: from this raw reading on, the sensor is saturated [unit of xi]; None: never.
        sensor_period: nominal time between two readings [s], at least the loop's period; None: the loop's period.
        median_window: readings of the running median, 1 (none) to 16; 10 in the letter.
        low_pass_order: order of the Butterworth low-pass, 0 (none) to 8; 5 in the letter.
        cutoff: its cutoff [Hz]; 500 Hz in the letter.
        timeout: time without a usable reading after which the sensor counts as lost [s]; None: ten sensor periods.
        fade_time: time in which the force fades where a reading that is due does not come [s]; None: two sensor
            periods; 0: at once.
        largest_rate: largest |d ln xi/dt| that can be [1/s], the steepest |g| times the fastest approach; a reading
            that would need more is not used. None: no check.

    Examples:
        >>> letter = Conditioning(floor=1e-3, median_window=10, low_pass_order=5, cutoff=500.0)
        >>> letter.numbers(1e-4).timeout
        0.001
    """

    floor: float = quantity(OUTPUT, sign="positive", example="30.0")
    offset: float = quantity(OUTPUT, 0.0)
    saturation: float | None = quantity(OUTPUT, None)
    sensor_period: float | None = quantity("s", None, sign="positive")
    median_window: int = count(1, 1, "3")
    low_pass_order: int = count(0, 0, "2")
    cutoff: float | None = quantity("Hz", None, sign="positive")
    timeout: float | None = quantity("s", None, sign="positive")
    fade_time: float | None = quantity("s", None, sign="nonnegative")
    largest_rate: float | None = quantity("1/s", None, sign="positive")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)
        if self.saturation is not None and not self.offset + self.floor < self.saturation <= _ANY_READING:
            raise InvalidInputError(
                f"saturation: found {self.saturation:g}, which must exceed offset and floor together, "
                f"{self.offset + self.floor:g}, up to {_ANY_READING:g}"
            )
        if not abs(self.offset) + self.floor < _ANY_READING:
            raise InvalidInputError(f"offset, floor: found {self.offset:g}, {self.floor:g}, expected less than 1e12")
        if not self.floor >= _ANY_FLOOR:
            raise InvalidInputError(
                f"floor: found {self.floor:g}, expected at least {_ANY_FLOOR:g}; give xi in another unit"
            )
        length: object = self.median_window
        if not isinstance(length, int) or isinstance(length, bool) or not 1 <= length <= LONGEST_WINDOW:
            raise InvalidInputError(
                f"median_window: found {length!r}, expected a whole number of readings from 1 (no median) "
                f"to {LONGEST_WINDOW}"
            )

    def numbers(self, period: float) -> SensingNumbers:
        """Return the parameters as plain numbers.

        Args:
            period: T of the loop [s].

        Returns:
            The numbers that `pretouch_observe` takes, with the filter designed for the sensor's rate.

        Raises:
            InvalidInputError: the sensor is faster than the loop, the timeout shorter than its period, or the low-pass
                cannot be designed for its rate.
        """
        sensor_period = period if self.sensor_period is None else self.sensor_period
        if sensor_period < period * (1 - 1e-9):
            raise InvalidInputError(
                f"sensor_period: found {sensor_period:g} s, shorter than the loop's period of {period:g} s; "
                "run the loop at the sensor's rate, or give it every n-th reading"
            )
        timeout = _TIMEOUT_PERIODS * sensor_period if self.timeout is None else self.timeout
        if timeout < sensor_period:
            raise InvalidInputError(
                f"timeout: found {timeout:g} s, shorter than the time between two readings, {sensor_period:g} s"
            )
        low_pass = design_low_pass(self.low_pass_order, self.cutoff, 1 / sensor_period)
        return SensingNumbers(
            period=period,
            sensor_period=sensor_period,
            offset=self.offset,
            floor=self.floor,
            saturation=_ANY_READING if self.saturation is None else self.saturation,
            timeout=timeout,
            largest_rate=_ANY_RATE if self.largest_rate is None else self.largest_rate,
            median_length=self.median_window,
            sections=len(low_pass),
            low_pass=(FilterSection * 4)(*low_pass),
        )

    def fade_step(self, period: float) -> float:
        """Return by how much the force fades per period of the loop [s], 1 for at once."""
        sensor_period = period if self.sensor_period is None else self.sensor_period
        fade_time = _FADE_PERIODS * sensor_period if self.fade_time is None else self.fade_time
        return min(period / fade_time, 1.0) if fade_time > 0 else 1.0
