"""The Butterworth low-pass: SciPy designs it, second-order sections in transposed direct form II run it."""

from __future__ import annotations

from importlib import import_module
from typing import TypeAlias

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import positive

__all__ = ["HIGHEST_ORDER", "SectionStates", "Sections", "advance_low_pass", "design_low_pass", "fill_low_pass"]

HIGHEST_ORDER = 8
Section: TypeAlias = tuple[float, float, float, float, float]
Sections: TypeAlias = tuple[Section, Section, Section, Section]
Pair: TypeAlias = tuple[float, float]
SectionStates: TypeAlias = tuple[Pair, Pair, Pair, Pair]
_THROUGH: Section = (1.0, 0.0, 0.0, 0.0, 0.0)


def design_low_pass(order: object, cutoff: float | None, rate: float) -> Sections:
    """Design the low-pass for a sensor's rate.

    Args:
        order: 0 (no filter) to 8; the letter takes 5.
        cutoff: frequency at which half of the power is left [Hz], below half of the rate; None for order 0.
        rate: readings per second [Hz].

    Returns:
        Four sections (b_0, b_1, b_2, a_1, a_2); those that the order does not need let everything through.

    Raises:
        InvalidInputError: the order is none, or the cutoff is missing or not below half of the rate.
    """
    if not isinstance(order, int) or isinstance(order, bool) or not 0 <= order <= HIGHEST_ORDER:
        raise InvalidInputError(
            f"low_pass_order: found {order!r}, expected a whole number from 0 (no filter) to {HIGHEST_ORDER}"
        )
    if order == 0:
        return (_THROUGH,) * 4
    if cutoff is None:
        raise InvalidInputError(f"cutoff: missing, and a low-pass of order {order} needs one; give it in Hz")
    frequency = positive(cutoff, "cutoff", "Hz")
    if not frequency < rate / 2:
        raise InvalidInputError(
            f"cutoff: found {frequency:g} Hz, which must be below {rate / 2:g} Hz, half of the sensor's rate"
        )
    designed = import_module("scipy.signal").butter(order, frequency, fs=rate, output="sos")
    made = [(float(r[0]), float(r[1]), float(r[2]), float(r[4]), float(r[5])) for r in designed]
    first, second, third, fourth = made + [_THROUGH] * (4 - len(made))
    return first, second, third, fourth


def fill_low_pass(sections: Sections, value: float) -> SectionStates:
    """Start the filter as if its input had always been `value`, so that it begins without a transient."""
    a, value_a = _settled(sections[0], value)
    b, value_b = _settled(sections[1], value_a)
    c, value_c = _settled(sections[2], value_b)
    d, _ = _settled(sections[3], value_c)
    return a, b, c, d


def advance_low_pass(sections: Sections, states: SectionStates, value: float) -> tuple[SectionStates, float]:
    """Take in a value; return the next state and the filtered value."""
    a, value_a = _advance(sections[0], states[0], value)
    b, value_b = _advance(sections[1], states[1], value_a)
    c, value_c = _advance(sections[2], states[2], value_b)
    d, value_d = _advance(sections[3], states[3], value_c)
    return (a, b, c, d), value_d


def _advance(section: Section, state: Pair, value: float) -> tuple[Pair, float]:
    b0, b1, b2, a1, a2 = section
    out = b0 * value + state[0]
    return (b1 * value - a1 * out + state[1], b2 * value - a2 * out), out


def _settled(section: Section, value: float) -> tuple[Pair, float]:
    b0, b1, b2, a1, a2 = section
    out = (b0 + b1 + b2) / (1.0 + a1 + a2) * value
    return (out - b0 * value, b2 * value - a2 * out), out
