"""The Butterworth low-pass, as second-order sections that the law in C runs.

SciPy designs the same filter (a test compares them), but its package of signals takes longer to load than a verdict.
"""

from __future__ import annotations

import math

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import positive

from .structures import FilterSection

__all__ = ["HIGHEST_ORDER", "design_low_pass"]

HIGHEST_ORDER = 8


def design_low_pass(order: object, cutoff: float | None, rate: float) -> tuple[FilterSection, ...]:
    """Design the low-pass for a sensor's rate.

    Args:
        order: 0 (no filter) to 8; the letter takes 5.
        cutoff: frequency at which half of the power is left [Hz], below half of the rate; None for order 0.
        rate: readings per second [Hz].

    Returns:
        As many sections as the order needs, the most damped first, each with a gain of one at rest.

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
    warped = math.tan(math.pi * frequency / rate)
    sections = [] if order % 2 == 0 else [_first_order(warped)]
    dampings = [math.sin(math.pi * (2 * k + 1) / (2 * order)) for k in range(order // 2)]
    return tuple(sections + [_second_order(warped, damping) for damping in reversed(dampings)])


def _first_order(warped: float) -> FilterSection:
    """Return the section of the real pole, by the bilinear transform."""
    b = warped / (1 + warped)
    return FilterSection(b, b, 0.0, (warped - 1) / (1 + warped), 0.0)


def _second_order(warped: float, damping: float) -> FilterSection:
    """Return the section of a pair of poles on the unit circle, by the bilinear transform."""
    square = warped * warped
    size = 1 + 2 * damping * warped + square
    b = square / size
    return FilterSection(b, 2 * b, b, 2 * (square - 1) / size, (1 - 2 * damping * warped + square) / size)
