"""Numbers that tell a good fit from a bad one."""

from __future__ import annotations

import math

import numpy as np

from pretouch._core.numbers import FloatArray

__all__ = ["corrected_akaike", "r_squared", "root_mean_square", "runs_p_value", "slope_error"]


def root_mean_square(values: FloatArray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def r_squared(measured: FloatArray, modelled: FloatArray) -> float:
    """Return 1 - (residual / total sum of squares) of xi, as the letter reports it."""
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1 - float(np.sum((measured - modelled) ** 2)) / total if total > 0 else 0.0


def slope_error(distance: FloatArray, residuals: FloatArray) -> float:
    """Return the RMS difference of the slopes of ln xi between neighbors, measured minus modelled [1/m]."""
    return root_mean_square(np.diff(residuals) / np.diff(distance))


def corrected_akaike(deviance: float, points: int, parameters: int) -> float | None:
    """Return AICc = -2 ln L + 2 k + 2 k (k + 1) / (N - k - 1); None where N is too small for it."""
    free = points - parameters - 1
    return None if free <= 0 else deviance + 2 * parameters + 2 * parameters * (parameters + 1) / free


def runs_p_value(residuals: FloatArray) -> float | None:
    """Return the one-sided chance of as few runs of equal signs or fewer in a random order; None without two signs.

    Wald & Wolfowitz, exact. Zeros have no sign and are passed over.
    """
    signs = np.sign(residuals[residuals != 0])
    plus, minus = int((signs > 0).sum()), int((signs < 0).sum())
    if not plus or not minus:
        return None
    runs = 1 + int((signs[1:] != signs[:-1]).sum())
    ways = 0
    for r in range(2, runs + 1):  # one sign has as many runs as the other, or one more
        for first, second in ((r // 2, (r + 1) // 2), ((r + 1) // 2, r // 2)):
            ways += math.comb(plus - 1, first - 1) * math.comb(minus - 1, second - 1)
    return ways / math.comb(plus + minus, plus)
