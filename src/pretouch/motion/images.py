"""Curves that are one curve on other scales of distance: ln xi_i(l) = ln xi(s_i l + t_i) + constant.

A sensor behind the surface is its curve shifted. A parameter whose derivative is `stretch` l g, with the product of
stretch and parameter the same number k wherever it is looked at, scales the distance: d ln xi / d ln p = k l g has the
solution ln xi(p^k l). The rate of a Mittag-Leffler curve is one with k = 1, the width of a Gaussian one with k = -1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import SensorModel
from pretouch.sensors.change import curve_change

__all__ = ["Images", "find_images"]

_SAME: Final = 1e-12  # of k: what rounding leaves of it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Images:
    """How many curves are one.

    Args:
        sensor: the one curve.
        scale: s of each, shape (n,).
        shift: t of each [m], shape (n,).
    """

    sensor: SensorModel
    scale: FloatArray
    shift: FloatArray


def find_images(sensor: SensorModel, values: Mapping[str, FloatArray]) -> Images | None:
    """Find the one curve of which many are images.

    Args:
        sensor: a sensor.
        values: its parameters that differ, without `sensor.`, shape (n,) each, in SI.

    Returns:
        The images; None where a parameter changes more than scale and shift.
    """
    curve, own = sensor.bare
    recess = np.atleast_1d(values.get("recess", own))
    values = {name: value for name, value in values.items() if name != "recess"}
    scale, count = np.ones(1), len(next(iter(values.values()), recess))
    for name, value in values.items():
        power = _power_of_stretch(curve, name, value)
        if power is None:
            return None
        if power != 0:
            scale = scale * (value / getattr(curve, name)) ** power
    if (scale != 1).any():
        curve = replace(curve, maximum_distance=np.inf)  # where an image ends is said by its own range
    scale = np.broadcast_to(scale, (count,))
    return Images(sensor=curve, scale=scale, shift=np.asarray(scale * recess))


def _power_of_stretch(sensor: SensorModel, name: str, values: FloatArray) -> float | None:
    """Return k of a parameter that scales the distance, 0 for one without effect; None for any other."""
    own = float(getattr(sensor, name))
    powers = []
    for value in (float(values.min()), own, float(values.max())):
        change = curve_change(replace(sensor, **{name: value}), name)
        if change.slope is not None or change.output or change.shift:
            return None
        powers.append(change.stretch * value)
    power = powers[1]
    if not any(powers):
        return 0.0
    if not (np.all(values * own > 0) and np.ptp(powers) <= _SAME * abs(power)):
        return None
    return float(np.round(power)) if abs(power - np.round(power)) <= _SAME else power
