"""From a reading to the change of ln xi: validity, offset and floor, median, low-pass, logarithm."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pretouch.control import Arrival, Sample, Status

from .filters import Pair, Readings, advance_low_pass, advance_median, fill_low_pass, fill_median

DETECTING, STALE, LOST = int(Status.DETECTING), int(Status.STALE), int(Status.LOST)
SATURATED, INVALID, IMPLAUSIBLE = int(Status.SATURATED), int(Status.INVALID), int(Status.IMPLAUSIBLE)
ROUNDING = 1e-9  # of a level
SAME_INSTANT = 1e-6  # of a period: two readings closer than that are one
ANY_CHANGE = 1500.0  # of ln xi: more than any two numbers can differ


class SensingState(NamedTuple):
    """Age of the last usable reading, its level before and after the filters, filters."""

    latest: int
    quiet: float
    measured: float
    level: float
    filtered: float
    log_level: float
    median: Readings
    low_pass: tuple[Pair, ...]


class Observation(NamedTuple):
    change: float
    log_level: float
    level: float
    elapsed: float
    usable: bool
    restarted: bool
    no_object: bool
    detecting: bool
    stale: bool
    lost: bool
    status: int


def _sections(n: Any) -> Any:
    return n.low_pass[: n.sections]


def start_sensing(n: Any) -> SensingState:
    """Nothing is detected before the first reading."""
    return SensingState(
        latest=Arrival.NOTHING,
        quiet=0.0,
        measured=0.0,
        level=n.floor,
        filtered=n.floor,
        log_level=0.0,
        median=fill_median(n.median_length, n.floor),
        low_pass=fill_low_pass(_sections(n), n.floor),
    )


def observe(n: Any, s: SensingState, sample: Sample) -> tuple[SensingState, Observation]:
    """Process a sample: decide whether its reading is usable, and return the change of ln xi."""
    quiet, measured = s.quiet + n.period, s.measured + n.period
    level = sample.reading - n.offset
    if not n.floor < level < math.inf:  # also for NaN
        level = n.floor
    fault = _fault(n, s, sample, level, measured)
    if sample.fresh == Arrival.NO_OBJECT and fault == 0:  # nothing has moved: no change, and a new start afterwards
        gone = s._replace(
            latest=Arrival.NO_OBJECT, quiet=0.0, measured=sample.age, level=n.floor, filtered=n.floor, log_level=0.0
        )
        return gone, Observation(0.0, 0.0, n.floor, 0.0, False, False, True, False, False, False, 0)
    if sample.fresh and fault == 0:
        restarted = s.latest != Arrival.READING
        if restarted:
            median, low_pass = fill_median(n.median_length, level), fill_low_pass(_sections(n), level)
            filtered = level
        else:
            median, middle = advance_median(s.median, level)
            low_pass, filtered = advance_low_pass(_sections(n), s.low_pass, middle)
        filtered = filtered if filtered > n.floor * (1 + ROUNDING) else n.floor  # undershoot, rounding
        log_level = math.log(filtered / n.floor)
        change = 0.0 if restarted else math.log(filtered / s.filtered)
        elapsed = 0.0 if restarted else measured - sample.age
        detecting = log_level > 0.0
        used = SensingState(Arrival.READING, 0.0, sample.age, level, filtered, log_level, median, low_pass)
        status = DETECTING if detecting else 0
        seen = Observation(
            change, log_level, filtered, elapsed, True, restarted, False, detecting, False, False, status
        )
        return used, seen
    lost = quiet > n.timeout * (1 + SAME_INSTANT)
    stale = quiet > n.sensor_period * (1 - SAME_INSTANT)
    log_level = 0.0 if lost else s.log_level
    detecting = log_level > 0.0
    status = (DETECTING if detecting else 0) + (STALE if stale else 0) + (LOST if lost else 0) + fault
    quiet, measured = min(quiet, 2 * n.timeout), min(measured, 3 * n.timeout)  # from there on, longer is no news
    latest = Arrival.NOTHING if lost else s.latest
    waiting = s._replace(latest=latest, quiet=quiet, measured=measured, log_level=log_level)
    return waiting, Observation(0.0, log_level, s.filtered, 0.0, False, False, False, detecting, stale, lost, status)


def _fault(n: Any, s: SensingState, sample: Sample, level: float, measured: float) -> int:
    """Return why a new reading is rejected; 0 if it is usable or if there is none."""
    if not sample.fresh:
        return 0
    elapsed = measured - sample.age
    in_time = 0.0 <= sample.age <= n.timeout  # not for NaN
    in_order = elapsed > SAME_INSTANT * n.period or s.latest == Arrival.NOTHING
    is_unseen = sample.fresh == Arrival.NO_OBJECT
    if not (in_time and in_order and (is_unseen or math.isfinite(sample.reading))):
        return INVALID
    if is_unseen:
        return 0
    if sample.reading >= n.saturation:
        return SATURATED
    # However long it took: an object that is seen again after a gap moves no more than one sensor period allows.
    most = n.largest_rate * min(elapsed, n.sensor_period)
    known = (s.level, s.filtered)
    if (
        s.latest == Arrival.READING
        and most < ANY_CHANGE
        and all(abs(math.log(level / before)) > most for before in known)
    ):
        return IMPLAUSIBLE
    return 0
