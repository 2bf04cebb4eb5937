"""A step's polynomial of l, on [0, tau]: its values, and what its coefficients prove of it.

A step counts only where one of three things is proved: l is monotone, so that its value at the end decides whether it
passed a border; l stays between two borders, since the sum of all moves is too small to reach one; or l'' has one sign,
so that l turns at most once, and its values there and at the end decide. The last is what a touch needs: next to it the
other two hold on ever shorter steps only.
"""

from __future__ import annotations

from typing import Any

from .compiler import kernel
from .endings import resolution

__all__ = ["ORDER", "accepted_step", "horner", "horner_slope", "level_time"]

ORDER = 20
_SHORTEST = 1e-14


@kernel
def horner(c: Any, order: int, tau: float) -> float:
    """Return a polynomial at tau."""
    value = c[order]
    for k in range(order - 1, -1, -1):
        value = value * tau + c[k]
    return value


@kernel
def horner_slope(c: Any, order: int, tau: float) -> float:
    """Return the derivative of a polynomial at tau."""
    value = order * c[order]
    for k in range(order - 1, 0, -1):
        value = value * tau + k * c[k]
    return value


@kernel
def _certified(c: Any, low: float, high: float, tau: float) -> Any:
    """Tell whether l is proved monotone on [0, tau], to stay in (low, high), and to bend one way only."""
    rest, bend, turn, power = 0.0, 0.0, 0.0, 1.0
    for k in range(1, ORDER + 1):
        if k > 1:
            bend += k * abs(c[k]) * power
        if k > 2:
            turn += k * (k - 1) * abs(c[k]) * power
        power *= tau
        rest += abs(c[k]) * power
    return abs(c[1]) > bend, c[0] - rest > low and c[0] + rest < high, 2 * abs(c[2]) * tau > turn


@kernel
def level_time(c: Any, level: float, left: float, right: float) -> float:
    """Find where a series that is monotone between two times passes a level there."""
    tau, t = right, right
    rising = horner(c, ORDER, right) > level
    for _ in range(100):
        value = horner(c, ORDER, t) - level
        if (value > 0) == rising:
            right = t
        else:
            left = t
        step = t - value / horner_slope(c, ORDER, t)
        if abs(step - t) <= 4e-16 * tau:
            return t
        t = step if left <= step <= right else 0.5 * (left + right)
    return t


@kernel
def _turn_time(c: Any, tau: float) -> float:
    """Find where the slope of a series, monotone on [0, tau], changes its sign; tau where it does not."""
    rising = c[1] < 0
    if (horner_slope(c, ORDER, tau) < 0) == rising or c[1] == 0:
        return tau
    left, right, t = 0.0, tau, 0.5 * tau
    for _ in range(100):
        value, bend = ORDER * c[ORDER], 0.0
        for k in range(ORDER - 1, 0, -1):
            bend = bend * t + value
            value = value * t + k * c[k]
        if (value < 0) == rising:
            left = t
        else:
            right = t
        step = t - value / bend
        if abs(step - t) <= 4e-16 * tau:
            return t
        t = step if left <= step <= right else 0.5 * (left + right)
    return t


@kernel
def accepted_step(values: Any, c: Any, borders: Any, moment: Any, tau: float) -> Any:
    """Shorten a step until what l does on it is proved, and end it at the border that l passes first, if any.

    Args:
        values: relative quantities of Scenario.relative.
        c: the coefficients of l in tau.
        borders: the lower and the upper border [m], and where l comes into contact, at or below the lower one.
        moment: the time at tau = 0 and the unit of tau [s].
        tau: the longest step.

    Returns:
        The step, l at its end, -1 or 1 where that is the lower or the upper border and 0 elsewhere, whether the contact
        is only touched, and since when l is monotone.
    """
    low, high, contact = borders
    monotone, inside, bent = _certified(c, low, high, tau)
    while not (monotone or inside or bent) and tau > _SHORTEST:
        tau *= 0.5
        monotone, inside, bent = _certified(c, low, high, tau)
    end = horner(c, ORDER, tau)
    if inside:
        return tau, end, 0, False, 0.0
    since, touched = 0.0, False
    turn = _turn_time(c, tau) if bent and not monotone else tau
    if turn < tau:
        peak = horner(c, ORDER, turn)
        touched = c[1] < 0 and abs(peak - contact) <= resolution(values, moment[0] + moment[1] * turn)
        if touched or (peak <= low if c[1] < 0 else peak >= high):
            tau, end = turn, peak
        else:
            since = turn
    if touched:
        return tau, contact, -1, True, 0.0
    if end <= low:
        return level_time(c, low, since, tau), low, -1, False, since
    if end >= high:
        return level_time(c, high, since, tau), high, 1, False, since
    return tau, end, 0, False, since
