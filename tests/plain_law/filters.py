"""The running median and the low-pass, as pure functions of tuples."""

from __future__ import annotations

from typing import Any, TypeAlias

Readings: TypeAlias = tuple[float, ...]
Pair: TypeAlias = tuple[float, float]


def fill_median(length: int, value: float) -> Readings:
    """Start a window in which every reading was `value`."""
    return (value,) * length


def advance_median(state: Readings, value: float) -> tuple[Readings, float]:
    """Add a reading and return the median of the window; for an even number the mean of the middle two."""
    arrived = (value, *state[:-1])
    ordered, length = sorted(arrived), len(arrived)
    return arrived, value if length == 1 else (ordered[(length - 1) // 2] + ordered[length // 2]) / 2


def fill_low_pass(sections: Any, value: float) -> tuple[Pair, ...]:
    """Start the filter as if its input had always been `value`, so that it begins without a transient."""
    states = []
    for n in sections:
        out = (n.b0 + n.b1 + n.b2) / (1.0 + n.a1 + n.a2) * value
        states.append((out - n.b0 * value, n.b2 * value - n.a2 * out))
        value = out
    return tuple(states)


def advance_low_pass(sections: Any, states: tuple[Pair, ...], value: float) -> tuple[tuple[Pair, ...], float]:
    """Filter a value by the transposed direct form II; return the next state and the filtered value."""
    after = []
    for n, (first, second) in zip(sections, states, strict=True):
        out = n.b0 * value + first
        after.append((n.b1 * value - n.a1 * out + second, n.b2 * value - n.a2 * out))
        value = out
    return tuple(after), value
