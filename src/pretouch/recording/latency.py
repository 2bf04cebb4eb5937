"""Estimate the latency between two recorded topics.

Both topics show the same motion. The estimate uses correlation and least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value

_LONGEST: Final = 1.0  # s, largest latency that is searched
_FEWEST: Final = 50  # readings of the slower topic that overlap
_LEAST: Final = 0.7  # correlation below which no latency is stated
_RIVAL: Final = 0.9  # of the largest correlation: another maximum above this is as likely
_DROP: Final = 0.5  # of the largest correlation, at which its main maximum ends
_KERNEL: Final = 0.14  # width of the smoothing kernel, in half-widths of the correlation
_LAGS: Final = 1.0  # lags of the autocorrelation, in half-widths of the correlation
_MISSING: Final = 3  # values in a row that are not finite, from which they are no single dropouts
_MOST_POINTS: Final = 5_000_000
_LIMIT: Final = 1.959963984540054  # standard deviations of a 95 % interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency(Value):
    """Estimated latency of one topic relative to another topic.

    Args:
        value: the latency [s]; None if it is unknown.
        low: lower end of its 95 % confidence interval [s].
        high: upper end [s].
        correlation: largest correlation of the two topics.
        reason: why the latency is unknown, in words; empty if it is known.
    """

    value: float | None
    low: float | None
    high: float | None
    correlation: float
    reason: str = ""


def estimate_latency(  # noqa: PLR0911 - one return for each reason
    time: FloatArray, signal: FloatArray, other_time: FloatArray, other: FloatArray, longest: float = _LONGEST
) -> Latency:
    """Estimate the latency between two signals that are sampled at irregular times.

    The other signal is interpolated, shifted and compared with the readings of the signal. First, a search over all
    shifts finds the largest correlation. Then least squares fit shift, scale and offset. The interval follows from the
    residuals, whose autocorrelation is included.

    Args:
        time: times of the signal [s], increasing.
        signal: its values; NaN is ignored.
        other_time: times of the other signal [s], increasing, from the same clock.
        other: its values; NaN is ignored.
        longest: largest latency that is searched [s], in both directions.

    Returns:
        The latency, or the reason why it cannot be determined: too few readings, no motion, weak correlation, or
        several shifts that fit almost equally well.
    """
    missing = _missing_spans(time, signal)
    time, signal = _finite(time, signal)
    other_time, other = _finite(other_time, other)
    if min(len(time), len(other_time)) < _FEWEST:
        return _unknown(np.nan, f"fewer than {_FEWEST} readings")
    longest = min(longest, 0.25 * float(time[-1] - time[0]))
    inside = (time >= other_time[0] + longest) & (time <= other_time[-1] - longest)
    time, signal = time[inside], signal[inside]
    if len(time) < _FEWEST:
        return _unknown(np.nan, f"the topics overlap in fewer than {_FEWEST} readings")
    if np.ptp(signal) == 0 or np.ptp(other) == 0:
        return _unknown(np.nan, "one of the topics is constant, so there is no motion to compare")
    step = min(np.median(np.diff(other_time)), np.median(np.diff(time))) / 2
    count = int(np.ceil(longest / max(step, longest / 2000)))
    shifts = np.linspace(-longest, longest, 2 * count + 1)
    correlations = np.array([_correlation(signal, np.interp(time - s, other_time, other)) for s in shifts])
    best = int(np.argmax(np.abs(correlations)))
    peak = float(abs(correlations[best]))
    if peak < _LEAST:
        return _unknown(
            peak, f"the correlation of the two topics is only {peak:.2f}, but a correlation of {_LEAST} is required"
        )
    if best in {0, len(shifts) - 1}:
        return _unknown(
            peak, f"the correlation is largest at a time shift of {longest:.3g} s, the limit of the search range"
        )
    if (rival := _rival(np.abs(correlations), best)) is not None:
        return _unknown(
            peak,
            f"the time shifts {1e3 * shifts[best]:.4g} ms and {1e3 * shifts[rival]:.4g} ms between the topics fit "
            "almost equally well; move the object irregularly",
        )
    half_width = _half_width(np.abs(correlations), best) * float(shifts[1] - shifts[0])
    # the smoothed signal shows an object that leaves before it has left, where the other one may have no readings
    kept = _apart(time, missing, half_width)
    kept = kept if kept.sum() >= _FEWEST else np.ones(len(time), dtype=bool)
    smooth = _smoothed(other_time, other, half_width)
    value, error = _refine(time[kept], signal[kept], smooth, float(shifts[best]), half_width)
    return Latency(value=value, low=value - _LIMIT * error, high=value + _LIMIT * error, correlation=peak)


def _unknown(correlation: float, reason: str) -> Latency:
    return Latency(value=None, low=None, high=None, correlation=correlation, reason=reason)


def _finite(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sort finite samples by time, and remove repeated times."""
    kept = np.isfinite(values) & np.isfinite(time)
    unique, index = np.unique(time[kept], return_index=True)
    return unique, values[kept][index]


def _missing_spans(time: FloatArray, values: FloatArray) -> list[tuple[float, float]]:
    """Return the begin and end of each longer time without a finite value [s]."""
    unusable = ~np.isfinite(values)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], unusable.astype(np.int8), [0]])))
    runs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(float(time[a]), float(time[b - 1])) for a, b in runs if b - a >= _MISSING]


def _apart(time: FloatArray, spans: list[tuple[float, float]], margin: float) -> BoolArray:
    """Return which times are farther than a margin from all spans."""
    apart = np.ones(len(time), dtype=bool)
    for begin, end in spans:
        apart &= (time < begin - margin) | (time > end + margin)
    return apart


def _correlation(a: FloatArray, b: FloatArray) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = np.sqrt((a @ a) * (b @ b))
    return float(a @ b / size) if size > 0 else 0.0


def _half_width(correlations: FloatArray, best: int) -> int:
    """Return the half-width of the correlation peak, in search steps."""
    below = np.flatnonzero(correlations < _DROP * correlations[best])
    return int(np.abs(below - best).min()) if len(below) else max(best, len(correlations) - 1 - best)


def _rival(correlations: FloatArray, best: int) -> int | None:
    """Return the index of a second high correlation peak, or None."""
    below = correlations < _DROP * correlations[best]
    left, right = np.flatnonzero(below[:best]), np.flatnonzero(below[best:])
    outside = np.ones(len(correlations), dtype=bool)
    outside[(left[-1] if len(left) else 0) : (best + right[0] if len(right) else len(correlations))] = False
    if not outside.any():
        return None
    second = int(np.argmax(np.where(outside, correlations, -1.0)))
    return second if correlations[second] > _RIVAL * correlations[best] else None


def _smoothed(time: FloatArray, values: FloatArray, half_width: float) -> tuple[FloatArray, FloatArray]:
    """Smooth a signal without a shift, so that its noise does not make the residual a jagged function of it."""
    width = _KERNEL * half_width
    step = min(width / 5, float(np.median(np.diff(time))) / 2)
    count = min(int((time[-1] - time[0]) / step), _MOST_POINTS)
    grid = np.linspace(time[0], time[-1], max(count, 2))
    reach = int(np.ceil(4 * width / (grid[1] - grid[0])))
    kernel = np.exp(-0.5 * ((grid[1] - grid[0]) * np.arange(-reach, reach + 1) / width) ** 2)
    from scipy.signal import fftconvolve  # noqa: PLC0415 - slow to import

    padded = np.pad(np.interp(grid, time, values), reach, mode="edge")
    return grid, fftconvolve(padded, kernel / kernel.sum(), mode="valid")


def _refine(
    time: FloatArray, signal: FloatArray, other: tuple[FloatArray, FloatArray], shift: float, half_width: float
) -> tuple[float, float]:
    """Return the least-squares time shift and its standard error [s] by Newey and West."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - slow to import

    least = minimize_scalar(
        lambda s: 1 - _correlation(signal, np.interp(time - s, *other)) ** 2,
        bounds=(shift - half_width / 2, shift + half_width / 2),
        method="bounded",
        options={"xatol": 1e-5 * half_width},
    )
    shift = float(least.x)
    shifted = np.interp(time - shift, *other)
    slope = np.interp(time - shift, other[0], np.gradient(other[1], other[0]))
    design = np.column_stack([np.ones_like(shifted), shifted])
    coefficients, *_ = np.linalg.lstsq(design, signal, rcond=None)
    rest = signal - design @ coefficients
    jacobian = np.column_stack([design, -coefficients[1] * slope])
    bread = np.linalg.pinv(jacobian.T @ jacobian)
    scores = jacobian * rest[:, None]
    lags = min(int(np.ceil(_LAGS * half_width / float(np.median(np.diff(time))))) + 1, len(time) // 4)
    meat = scores.T @ scores
    for lag in range(1, lags + 1):
        part = scores[lag:].T @ scores[:-lag]
        meat += (1 - lag / (lags + 1)) * (part + part.T)
    return shift, float(np.sqrt(max((bread @ meat @ bread)[2, 2], 0.0)))
