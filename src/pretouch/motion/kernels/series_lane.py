"""What the block kernel does for one lane at a time: find, enter and read the windows of the curve."""

from __future__ import annotations

import math
from typing import Any

from .compiler import kernel
from .series_gradient import carry_4, carry_12, carry_power
from .series_step import ORDER, Row, step_4, step_12, step_power

__all__ = ["carry_responses", "enter_window", "find_window", "level_part", "take_step", "window_slope"]

_EDGE, _LOW, _TOP, _SWITCH, _MIDDLE, _TERMS = range(6)  # columns of a window
END, EDGE, SWITCH, MIDDLE, TERMS = Row.END, Row.EDGE, Row.SWITCH, Row.MIDDLE, Row.TERMS


@kernel
def _step_power(work: Any) -> int:
    return step_power(work)


@kernel
def _step_4(work: Any) -> int:
    return step_4(work)


@kernel
def _step_12(work: Any) -> int:
    return step_12(work)


@kernel
def take_step(work: Any, degree: int) -> int:
    """Take a step; return which lanes moved and, LANES bits higher, which need another window."""
    if degree == 0:
        return _step_power(work)
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
def find_window(windows: Any, l: float, hint: int) -> int:  # noqa: E741
    """Return the lowest window whose TOP is not below l, -1 where there is none; quickly where the hint is right."""
    low, high = 0, windows.shape[0] - 1
    if not l <= windows[high, _TOP]:
        return -1
    if l <= windows[hint, _TOP] and (hint == 0 or l > windows[hint - 1, _TOP]):
        return hint
    while low < high:
        middle = (low + high) // 2
        if l <= windows[middle, _TOP]:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def enter_window(windows: Any, index: int, work: Any, lane: int) -> None:
    """Let a lane read another window."""
    work[EDGE, lane] = windows[index, _EDGE]
    work[SWITCH, lane] = windows[index, _SWITCH] if index > 0 else -math.inf
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
