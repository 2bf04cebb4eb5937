"""What the block kernel does for one lane at a time: find, enter and read the windows of the curve."""

from __future__ import annotations

import math
from typing import Any

from .compiler import kernel
from .lanes import LANES
from .series_gradient import carry_4, carry_12, carry_power
from .series_step import MOST_STEPS, ORDER, Row, step_1, step_4, step_12, step_power

__all__ = [
    "carry_responses",
    "cut_steps",
    "enter_window",
    "find_window",
    "level_part",
    "pass_turn",
    "take_step",
    "window_slope",
]

_EDGE, _LOW, _TOP, _SWITCH, _MIDDLE, _TERMS = range(6)  # columns of a window
_TURN = 24  # steps that one is counted as: some forty are enough, a swing that goes on for long is for solve_series
END, EDGE, SWITCH, MIDDLE, TERMS = Row.END, Row.EDGE, Row.SWITCH, Row.MIDDLE, Row.TERMS
POSITION, VELOCITY, ACCELERATION, HORIZON = Row.POSITION, Row.VELOCITY, Row.ACCELERATION, Row.HORIZON
TIME, DISTANCE, SPEED, INTEGRAL, ERROR = Row.TIME, Row.DISTANCE, Row.SPEED, Row.INTEGRAL, Row.ERROR
CAP, LENGTH, STEPS, WEAKEST, MOVED = Row.CAP, Row.LENGTH, Row.STEPS, Row.WEAKEST, Row.MOVED
STIFFNESS, START, FINAL_TIME = Row.STIFFNESS, Row.START, Row.FINAL_TIME


@kernel
def _step_power(work: Any) -> int:
    return step_power(work)


@kernel
def _step_1(work: Any) -> int:
    return step_1(work)


@kernel
def _step_4(work: Any) -> int:
    return step_4(work)


@kernel
def _step_12(work: Any) -> int:
    return step_12(work)


@kernel
def take_step(work: Any, degree: int) -> int:
    """Take a step; return which lanes moved and, LANES bits higher, which need another window."""
    if degree <= 1:
        return _step_1(work) if degree else _step_power(work)
    return _step_4(work) if degree == 4 else _step_12(work)


@kernel
def _carry_power(work: Any) -> int:
    return carry_power(work)


@kernel
def _carry_4(work: Any) -> int:
    return carry_4(work)


@kernel
def _carry_12(work: Any) -> int:
    return carry_12(work)


@kernel
def carry_responses(work: Any, degree: int) -> int:
    """Carry the responses over the step that was taken."""
    if degree == 0:
        return _carry_power(work)
    return _carry_4(work) if degree == 4 else _carry_12(work)


@kernel
def window_slope(windows: Any, index: int, l: float) -> float:  # noqa: E741
    """Return g inside a window."""
    z, last = l - windows[index, _MIDDLE], windows.shape[1] - 1
    if last == _TERMS:
        return windows[index, _TERMS] / z
    value = 0.0
    for j in range(last - _TERMS, 0, -1):
        value = value * z + j * windows[index, _TERMS + j]
    return value


@kernel
def find_window(windows: Any, first: int, last: int, l: float, hint: int) -> int:  # noqa: E741
    """Return the lowest window from first to before last whose TOP is not below l, -1 where there is none.

    It is quick where the hint is right, and none of the worse where not.
    """
    low, high = first, last - 1
    if not l <= windows[high, _TOP]:
        return -1
    if low <= hint <= high and l <= windows[hint, _TOP] and (hint == low or l > windows[hint - 1, _TOP]):
        return hint
    while low < high:
        middle = (low + high) // 2
        if l <= windows[middle, _TOP]:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def enter_window(windows: Any, first: int, index: int, work: Any, lane: int) -> None:
    """Let a lane read another window of its curve, whose lowest is the first."""
    work[EDGE, lane] = windows[index, _EDGE]
    work[SWITCH, lane] = windows[index, _SWITCH] if index > first else -math.inf
    work[MIDDLE, lane] = windows[index, _MIDDLE]
    for j in range(windows.shape[1] - _TERMS):
        work[TERMS + j, lane] = windows[index, _TERMS + j]


@kernel
def level_part(work: Any, lane: int, level: float) -> float:
    """Return the part of a step at which l passes a level, where Newton's method finds it, else one half."""
    s = (work[0, lane] - level) / (work[0, lane] - work[END, lane])
    for _ in range(8):
        value, slope = work[ORDER, lane], 0.0
        for k in range(ORDER - 1, -1, -1):
            slope = slope * s + value
            value = value * s + work[k, lane]
        change = (value - level) / slope
        s = min(max(s - change, 0.0), 1.0)
        if abs(change) < 1e-9:
            return s
    return 0.5


@kernel
def pass_turn(work: Any, lane: int, low: float, top: float) -> bool:
    """Move a lane over a step on which l need not fall, where its coefficients prove that l stays between two levels.

    Returns:
        Whether that is proved, the step ends within the horizon, and it is none too many.
    """
    if not work[STEPS, lane] < MOST_STEPS:
        return False
    below, above, area, speed = 0.0, 0.0, 0.0, 0.0
    for k in range(1, ORDER + 1):
        b = work[k, lane]
        below += min(b, 0.0)
        above += max(b, 0.0)
        speed += k * b
        area += b / (k + 1)
    time, length, l = work[TIME, lane], work[LENGTH, lane], work[0, lane]  # noqa: E741
    moved = time + length
    if not (l + below > low and l + above < top and moved < work[HORIZON, lane] and length > 1e-12 * moved):
        return False
    p, v, a = work[POSITION, lane], work[VELOCITY, lane], work[ACCELERATION, lane]
    path = p + (v + a / 2 * time) * time + ((v + a * time) / 2 + a / 6 * length) * length
    held, tail = work[WEAKEST, lane], abs(work[ORDER, lane])
    lever = 1 / max(held, math.sqrt(max(work[STIFFNESS, lane], 0.0)), 0.3 / moved) / length
    error = work[ERROR, lane] * math.exp(min(max(-held * length, 0.0), 50.0))
    work[ERROR, lane] = error + tail + ORDER * tail * lever + 2e-16 * l
    work[INTEGRAL, lane] += (path - l - area) * length
    work[TIME, lane], work[DISTANCE, lane], work[SPEED, lane] = moved, l + below + above, speed / length
    work[CAP, lane], work[MOVED, lane] = 1e300, 1.0
    work[STEPS, lane] += _TURN
    return True


@kernel
def cut_steps(queue: Any, count: int) -> None:
    """Let the steps end with the contacts that were found in them."""
    for lane in range(LANES):
        s = (queue[FINAL_TIME, lane] - queue[TIME, lane]) / queue[LENGTH, lane]
        power = 1.0
        for k in range(1, ORDER + 1):
            power *= s
            queue[k, lane] *= power
        queue[LENGTH, lane] *= s
        queue[START, lane], queue[MOVED, lane] = queue[TIME, lane], 1.0 if lane < count else 0.0
