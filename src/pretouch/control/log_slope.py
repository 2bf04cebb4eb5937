"""From a reading to the change of ln xi: validity, offset and floor, median, low-pass, logarithm, difference.

The change of ln xi from one usable reading to the next, times D_p, is the impulse of the virtual force between them,
whatever the time between them is: the quotient of L(2) would lose the more, the slower the sensor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .butterworth import Sections, SectionStates, advance_low_pass, fill_low_pass
from .median import MedianState, advance_median, fill_median
from .signals import Sample, Status

__all__ = ["Observation", "SensingNumbers", "SensingState", "observe", "start_sensing"]

DETECTING, STALE, LOST = int(Status.DETECTING), int(Status.STALE), int(Status.LOST)
SATURATED, INVALID, IMPLAUSIBLE = int(Status.SATURATED), int(Status.INVALID), int(Status.IMPLAUSIBLE)
_SAME_INSTANT = 1e-6  # of a period: two readings closer than that are one

_ANY_CHANGE = 1500.0  # of ln xi: more than any two numbers can differ


class SensingNumbers(NamedTuple):
    """What `observe` needs to know: see `Conditioning`."""

    period: float
    sensor_period: float
    offset: float
    floor: float
    log_floor: float
    saturation: float
    timeout: float
    largest_rate: float
    median_length: int
    sections: Sections


class SensingState(NamedTuple):
    """What `observe` remembers: age of the last usable reading, its level, ln(xi / floor) filtered, filters."""

    running: bool
    quiet: float
    measured: float
    level: float
    log_level: float
    median: MedianState
    low_pass: SectionStates


class Observation(NamedTuple):
    """What a law is told about the sensor.

    Args:
        change: change of ln xi since the usable reading before; 0 where there is none.
        log_level: ln(xi / floor) >= 0, after the filters.
        usable: a reading came that can be used.
        restarted: it is the first one, or the first one after the sensor was lost.
        detecting: xi is above the floor and the sensor is not lost.
        stale: a reading is due and has not come.
        lost: none has come for longer than the timeout.
        status: what is to be reported.
    """

    change: float
    log_level: float
    usable: bool
    restarted: bool
    detecting: bool
    stale: bool
    lost: bool
    status: int


def start_sensing(numbers: SensingNumbers) -> SensingState:
    """Return the state before the first reading: nothing is detected."""
    n = numbers
    return SensingState(
        running=False,
        quiet=0.0,
        measured=0.0,
        level=n.floor,
        log_level=0.0,
        median=fill_median(n.median_length, n.floor),
        low_pass=fill_low_pass(n.sections, n.floor),
    )


def observe(numbers: SensingNumbers, state: SensingState, sample: Sample) -> tuple[SensingState, Observation]:
    """Take in a sample: whether its reading can be used, and by how much ln xi has changed."""
    n, s = numbers, state
    quiet, measured = s.quiet + n.period, s.measured + n.period
    level = sample.reading - n.offset
    if not n.floor < level < math.inf:  # also for NaN
        level = n.floor
    fault = _fault(n, s, sample, level, measured)
    if sample.fresh and fault == 0:
        restarted = not s.running
        if restarted:
            median, low_pass = fill_median(n.median_length, level), fill_low_pass(n.sections, level)
            filtered = level
        else:
            median, middle = advance_median(n.median_length, s.median, level)
            low_pass, filtered = advance_low_pass(n.sections, s.low_pass, middle)
        log_level = max(math.log(max(filtered, n.floor)) - n.log_floor, 0.0)  # the low-pass may undershoot
        change = 0.0 if restarted else log_level - s.log_level
        detecting = log_level > 0.0
        used = SensingState(True, 0.0, sample.age, level, log_level, median, low_pass)
        status = DETECTING if detecting else 0
        return used, Observation(change, log_level, True, restarted, detecting, False, False, status)
    lost = quiet > n.timeout * (1 + _SAME_INSTANT)
    stale = quiet > n.sensor_period * (1 - _SAME_INSTANT)
    log_level = 0.0 if lost else s.log_level
    detecting = log_level > 0.0
    status = (DETECTING if detecting else 0) + (STALE if stale else 0) + (LOST if lost else 0) + fault
    quiet, measured = min(quiet, 2 * n.timeout), min(measured, 3 * n.timeout)  # from there on, longer is no news
    waiting = SensingState(s.running and not lost, quiet, measured, s.level, log_level, s.median, s.low_pass)
    return waiting, Observation(0.0, log_level, False, False, detecting, stale, lost, status)


def _fault(numbers: SensingNumbers, state: SensingState, sample: Sample, level: float, measured: float) -> int:
    """Return why a reading that came cannot be used, 0 if it can or if none came."""
    if not sample.fresh:
        return 0
    elapsed = measured - sample.age
    in_time = 0.0 <= sample.age <= numbers.timeout  # not for NaN
    in_order = elapsed > _SAME_INSTANT * numbers.period or not state.running
    if not (math.isfinite(sample.reading) and in_time and in_order):
        return INVALID
    if sample.reading >= numbers.saturation:
        return SATURATED
    believable = numbers.largest_rate * elapsed
    if state.running and believable < _ANY_CHANGE and abs(math.log(level / state.level)) > believable:
        return IMPLAUSIBLE
    return 0
