"""How well g is known where it matters: from the nearest usable distance to where the signal is a tenth of that there.

The virtual force gives the impulse D_p ln(xi / xi_0) until xi has grown from xi_0 to xi. Where xi is a tenth of its
value at contact, a factor of ten is still to come, ln 10 = 2.3 of ln xi: most of what any motion makes use of.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pretouch._core.units import format_quantity

from .averaging import slope_weights
from .knowledge import SlopeKnowledge
from .preparation import Prepared
from .result import SensorFit

__all__ = ["slope_knowledge", "slope_reservations"]

KNOWN: Final = 0.15
"""Relative error of g up to which a sensor is usable without reservation."""

_DECISIVE: Final = 0.1  # of the signal at the nearest distance
_PLACES: Final = 25
_FALL: Final = 0.5  # of ln xi, over which slopes of readings and curve are compared
_FEWEST: Final = 4
_SURE: Final = 4.0  # standard errors
_NORMAL: Final = 1.959964


def slope_knowledge(prepared: Prepared) -> SlopeKnowledge | None:
    """Tell how well all curves that the readings allow agree about g; None where there are too few readings."""
    courses, used, offset = prepared.courses, prepared.used, prepared.offset
    if courses is None or offset is None:
        return None
    signal = used.output - offset.value
    inside = np.flatnonzero(signal >= _DECISIVE * signal[0])
    last = float(used.distance[max(int(inside[-1]), 1)])
    places = np.linspace(float(used.distance[0]), last, _PLACES)
    log_slope, error = courses.slope(places)
    worst = int(error.argmax())
    return SlopeKnowledge(
        distances=places,
        slope=-np.exp(log_slope),
        uncertainty=np.expm1(_NORMAL * np.minimum(error, 10.0)),
        worst_at=float(places[worst]),
    )


def slope_reservations(prepared: Prepared, best: SensorFit, known: SlopeKnowledge | None) -> list[str]:
    """Say where g is not known well enough, and what would tell it."""
    if known is None:
        return []
    found = []
    worst = float(known.uncertainty.max())
    if worst > KNOWN:
        offset = prepared.offset
        remedy = "read more distances, each several times, where the signal is strong"
        if offset is not None and offset.kind == "fitted":
            used = prepared.used.output - offset.value
            remedy = "record the output with no object, or measure out to where it no longer changes"
            if prepared.reaches_last:
                left = f"{100 * used[-1] / used[0]:.2g} %"
                remedy += f" (the readings end where the signal still is {left} of its largest)"
        elif offset is not None and best.slope_shift > 0.5 * KNOWN / _NORMAL:
            remedy = "record the output with no object more often: its uncertainty moves the slope"
        size = f"{100 * worst:.0f} %" if worst < 1 else f"a factor of {1 + worst:.2g}"
        near, far = (format_quantity(float(d), "m", 3) for d in known.distances[[0, -1]])
        found.append(
            f"g is known to {size} only (at {format_quantity(known.worst_at, 'm', 3)}, of the part from {near} to "
            f"{far} in which the virtual force is given), and {100 * KNOWN:.0f} % is what a design can rely on: "
            f"{remedy}."
        )
    gap = _largest_gap(prepared, best, float(known.distances[-1]))
    if gap is not None:
        share, near, far = gap[0], *(format_quantity(d, "m", 3) for d in gap[1:])
        found.append(
            f"From {near} to {far} the readings are {100 * abs(share):.0f} % {'flatter' if share > 0 else 'steeper'} "
            f"than {best.model}, the best model: the curve has another shape; the table follows it."
        )
    return found


def _largest_gap(prepared: Prepared, best: SensorFit, last: float) -> tuple[float, float, float] | None:
    """Find where the local slope of the readings differs most from that of a fit, if surely and by too much."""
    used, noise = prepared.used, prepared.noise
    if noise is None or best.model == "table" or len(used.distance) < _FEWEST + 1:
        return None
    signal = used.output - best.offset.value
    own = np.hypot(noise.output, noise.relative * signal) / np.sqrt(used.count) / signal
    log, worst = np.log(signal), None
    for k in range(len(log) - _FEWEST + 1):
        if used.distance[k] > last:
            break
        stop = k + _FEWEST
        while stop < len(log) and log[k] - log[stop - 1] < _FALL:
            stop += 1
        if log[k] - log[stop - 1] < _FALL:  # the last readings, over which nothing falls by so much
            break
        part = slice(k, stop)
        line = slope_weights(used.distance[part], own[part] ** 2 + 1e-12)
        size, error = float(line @ best.residuals[part]), math.sqrt(float(line**2 @ own[part] ** 2))
        g = -float(np.mean(np.asarray(best.sensor.log_slope(used.distance[part]))))
        if abs(size) > max(_SURE * error, KNOWN * g) and (worst is None or abs(size / g) > abs(worst[0])):
            worst = (size / g, float(used.distance[k]), float(used.distance[stop - 1]))
    return worst
