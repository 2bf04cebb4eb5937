"""The Butterworth low-pass: SciPy designs it, as second-order sections that the law in C runs."""

from __future__ import annotations

from importlib import import_module

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import positive

from .structures import Section

__all__ = ["HIGHEST_ORDER", "design_low_pass"]

HIGHEST_ORDER = 8


def design_low_pass(order: object, cutoff: float | None, rate: float) -> tuple[Section, ...]:
    """Design the low-pass for a sensor's rate.

    Args:
        order: 0 (no filter) to 8; the letter takes 5.
        cutoff: frequency at which half of the power is left [Hz], below half of the rate; None for order 0.
        rate: readings per second [Hz].

    Returns:
        As many sections as the order needs.

    Raises:
        InvalidInputError: the order is none, or the cutoff is missing or not below half of the rate.
    """
    if not isinstance(order, int) or isinstance(order, bool) or not 0 <= order <= HIGHEST_ORDER:
        raise InvalidInputError(
            f"low_pass_order: found {order!r}, expected a whole number from 0 (no filter) to {HIGHEST_ORDER}"
        )
    if order == 0:
        return ()
    if cutoff is None:
        raise InvalidInputError(f"cutoff: missing, and a low-pass of order {order} needs one; give it in Hz")
    frequency = positive(cutoff, "cutoff", "Hz")
    if not frequency < rate / 2:
        raise InvalidInputError(
            f"cutoff: found {frequency:g} Hz, which must be below {rate / 2:g} Hz, half of the sensor's rate"
        )
    designed = import_module("scipy.signal").butter(order, frequency, fs=rate, output="sos")
    return tuple(Section(r[0], r[1], r[2], r[4], r[5]) for r in designed)
