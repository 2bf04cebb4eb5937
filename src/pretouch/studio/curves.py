"""Describe a sensor curve as a JSON object for the page of the studio."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from pretouch.motion.curve import LARGEST_START, approach_windows, curve_pieces, curve_tops, reach_to
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel

IN_THE_PAGE: Final[tuple[type[SensorModel], ...]] = (InversePower, ExponentialFirstOrder, ExponentialSecondOrder)
"""The sensor curves that the page computes from their parameters."""

_RANGE: Final = 256.0  # range of the polynomials, relative to the initial distance, because the object may recede first
_PROBES: Final = 257


def describe_curve(sensor: SensorModel, distance: float) -> dict[str, Any]:
    """Describe a sensor curve as a JSON object for the page.

    The function `sensorCurve` of page/core.js reads this object. The page computes some curves from their parameters.
    Piecewise polynomials describe all other curves.

    Args:
        sensor: the curve, which must be valid down to contact.
        distance: the distance at which the encounter starts [m].

    Returns:
        The model and its parameters, or the polynomials of the curve.
    """
    curve, recess = sensor.bare
    low, high = sensor.valid_range
    largest = None if math.isinf(high) else high
    if type(curve) in IN_THE_PAGE:
        return {"model": curve.name, "recess": recess, "maximum_distance": largest, **curve.parameters}
    if distance > LARGEST_START or low > 0:
        if low > 0:
            reason = f"the page needs a sensor curve that is valid down to contact, but this curve starts at {low:g} m"
        else:
            reason = (
                f"the encounter starts at a distance of {distance:g} m, but the page allows at most {LARGEST_START:g} m"
            )
        return {"model": curve.name, "unusable": reason}
    reach = min(reach_to(distance), high)
    top, open_ended = next(curve_tops(sensor, max(low, 0.0), reach, _RANGE * reach))
    windows = approach_windows(sensor, 0.0, reach)
    return {
        "model": curve.name,
        "low": low,
        "high": largest,
        "top": top,
        "open": open_ended,
        "falling": bool((np.asarray(sensor.log_slope(np.linspace(0.0, reach, _PROBES))) < 0).all()),
        "pieces": curve_pieces(sensor, max(low, 0.0), top).tolist(),
        "windows": windows.tolist(),
    }
