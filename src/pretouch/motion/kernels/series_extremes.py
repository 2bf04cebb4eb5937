"""What one step of the guaranteed path adds to the largest demands, the smallest distance and the integral of x~."""

from __future__ import annotations

from typing import Any

from .compiler import kernel
from .polynomial import ORDER, horner, horner_slope

__all__ = ["integral", "keep_extremes"]


@kernel
def _peak(c: Any, order: int, shift: float, tilt: float, tau: float, so_far: float) -> float:
    """Return the larger of so_far and max |p(s) + shift + tilt s| over s in [0, tau]."""
    best = max(so_far, abs(c[0] + shift), abs(horner(c, order, tau) + shift + tilt * tau))
    rest, power = abs(c[0] + shift), 1.0
    for k in range(1, order + 1):
        power *= tau
        rest += (abs(c[k]) if k > 1 else abs(c[1] + tilt)) * power
    if rest <= best:
        return best
    parts = 8
    left, slope_left = 0.0, c[1] + tilt
    if slope_left == 0.0:  # from rest: the way that it bends
        slope_left = c[2]
    for i in range(1, parts + 1):
        right = tau * i / parts
        slope_right = horner_slope(c, order, right) + tilt
        if slope_left * slope_right < 0:
            a, b = left, right
            for _ in range(30):  # the peak is flat: 1e-9 in its place is 1e-18 in its height
                middle = 0.5 * (a + b)
                if (horner_slope(c, order, middle) + tilt) * slope_left > 0:
                    a = middle
                else:
                    b = middle
            best = max(best, abs(horner(c, order, a) + shift + tilt * a))
        left, slope_left = right, slope_right
    return best


@kernel
def keep_extremes(values: Any, gain: float, work: Any, time: float, unit: float, tau: float, row: Any) -> None:
    """Raise the largest and lower the smallest quantities of a row over one step."""
    c, v, force = work[0], work[1], work[2]
    x = work[3]  # the powers are no longer needed: reuse their first two rows
    a = work[4]
    position = values[5] + (values[6] + values[7] * time / 2) * time
    for k in range(ORDER + 1):
        x[k] = -c[k]
        a[k] = -(k + 1) * v[k + 1] / unit if k < ORDER else 0.0
    x[0] += position
    x[1] += (values[6] + values[7] * time) * unit
    x[2] += values[7] / 2 * unit * unit
    a[0] += values[7]
    row[7] = _peak(x, ORDER, 0.0, 0.0, tau, row[7])
    row[10] = _peak(a, ORDER - 1, values[9], 0.0, tau, row[10])
    row[11] = max(row[11], abs(gain) * _peak(force, ORDER - 1, 0.0, 0.0, tau, row[11] / max(abs(gain), 1e-300)))
    for k in range(ORDER + 1):
        a[k] = -v[k]
    a[0] += values[6] + values[7] * time
    a[1] += values[7] * unit
    row[9] = _peak(a, ORDER, values[8] + values[9] * time, values[9] * unit, tau, row[9])
    x[0] += (values[8] + values[9] * time / 2) * time - values[3]
    x[1] += (values[8] + values[9] * time) * unit
    x[2] += values[9] / 2 * unit * unit
    row[8] = _peak(x, ORDER, 0.0, 0.0, tau, row[8])
    far, power = 0.0, 1.0
    for k in range(ORDER + 1):
        x[k] = -c[k]
        far += abs(c[k]) * power
        power *= tau
    row[12] = min(row[12], far - _peak(x, ORDER, far, 0.0, tau, 0.0))


@kernel
def integral(values: Any, c: Any, time: float, unit: float, tau: float) -> float:
    """Integrate x~ over one step."""
    x0, x1, x2 = values[5] + (values[6] + values[7] * time / 2) * time, values[6] + values[7] * time, values[7]
    step = unit * tau
    total = c[ORDER] / (ORDER + 1)
    for k in range(ORDER - 1, -1, -1):
        total = total * tau + c[k] / (k + 1)
    return (x0 + (x1 / 2 + x2 / 6 * step) * step) * step - unit * tau * total
