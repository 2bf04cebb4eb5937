"""What an output does that no proximity sensor does: rise with distance, over all of its range or at the far end."""

from __future__ import annotations

from typing import Final

import numpy as np

from .averaging import MAD_TO_SIGMA, AveragedCurve, ReadingNoise

__all__ = ["end_of_falling", "is_rising"]

_RISEN: Final = 2.0  # times as much as it falls afterwards
_SURE: Final = 5.0  # standard deviations
_SMALL: Final = 0.01  # of the range of the output: a rise that is no second object
_SHARE: Final = 0.2  # of the rise: what is nearer to the lowest output than that may be part of it


def is_rising(curve: AveragedCurve, known: ReadingNoise) -> bool:
    """Tell whether the output grows with distance, rather than fall."""
    # A near-field peak is also risen to, but what follows it falls farther.
    steady = curve.steady
    peak = int(np.argmax(steady))
    risen, fallen = float(steady[peak] - steady[0]), float(steady[peak] - steady[-1])
    beyond_middle = curve.distance[peak] > 0.5 * (curve.distance[0] + curve.distance[-1])
    if risen <= _SURE * _error(curve, known) or risen <= 0.3 * float(np.ptp(steady)):
        return False
    return risen > _RISEN * fallen or (risen > fallen and bool(beyond_middle))


def end_of_falling(curve: AveragedCurve, known: ReadingNoise) -> int:
    """Return the index after the last point before the output rises again; all of them where it does not.

    What comes before it is free of most of the rise, too.
    """
    steady = curve.steady
    lowest = int(np.argmin(steady))
    later = steady[lowest + 1 :]
    if len(later) < 2:
        return len(steady)
    ahead = np.convolve(later, np.ones(2) / 2, mode="valid")
    rise = float(ahead.max() - steady[lowest])
    if rise <= max(_SURE * _error(curve, known), _SMALL * float(np.ptp(steady))):
        return len(steady)
    return int(np.argmax(steady <= steady[lowest] + _SHARE * rise)) + 1


def _error(curve: AveragedCurve, known: ReadingNoise) -> float:
    """Return the standard deviation of a mean in the flat part of the curve."""
    if known.sigma is not None:
        own = known.sigma / np.sqrt(float(np.median(curve.count)))
        return float(np.hypot(own, known.resolution / np.sqrt(12.0)))
    bend = np.abs(np.diff(curve.output, 2))
    flat = np.sort(bend)[: max(len(bend) // 2, 1)]
    return (
        float(MAD_TO_SIGMA * np.median(flat) / np.sqrt(6.0) * 2 + known.resolution / np.sqrt(12.0))
        if len(bend)
        else 0.0
    )
