"""The uniform motion L(16)-(19) of the second-order exponential curve: one particular motion, offered by name."""

from __future__ import annotations

from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch.sensors import SensorModel

from .layout import COLUMNS
from .status import ContactStatus

__all__ = ["second_order_parameters", "solve_uniform_motion", "uniform_motion"]


def second_order_parameters(sensor: SensorModel) -> tuple[float, float]:
    """Read b_2 and c_2 from a curve whose slope is linear in the distance.

    Args:
        sensor: the curve; one with constant slope has b_2 = 0.

    Returns:
        b_2 [1/m^2] and c_2 [1/m].

    Raises:
        InvalidInputError: the slope is not linear in the distance.
    """
    if sensor.constant_log_slope is not None:
        return 0.0, sensor.constant_log_slope
    low, high = sensor.valid_range
    ends = np.array([low, high if np.isfinite(high) else low + 1.0])
    probe = ends[0] + (ends[1] - ends[0]) * np.array([0.0, 0.21, 0.43, 0.77, 1.0])
    slope = np.asarray(sensor.log_slope(probe))
    bend, intercept = np.polyfit(probe, slope, 1)
    if np.abs(slope - bend * probe - intercept).max() > 1e-9 * np.abs(slope).max():
        raise InvalidInputError(
            f"method: the uniform motion L(16)-(19) holds for the second-order exponential curve L(6) only, "
            f"not for the {sensor.name} curve; use method='integration'"
        )
    return float(bend) / 2, float(intercept)


def uniform_motion(
    values: FloatArray, curvature: float, rate: float, gain: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Solve L(15) for the uniform motion l = A t + B of L(16): A by L(17), B by L(18).

    The root of L(17) is the one with 0 <= |A| <= |v_o| that approaches as the obstacle does. With
    s = sqrt(1 + 8 b_2 D_p v_o / K_a) the roots are 2 v_o / (1 + s) and 2 v_o / (1 - s): only the first is ever one,
    and in this form it goes over into v_o as b_2 -> 0. (For s >= 3 the second meets the bound on |A| as well, but
    recedes.)

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        curvature: b_2 [1/m^2].
        rate: c_2 [1/m].
        gain: D_p [N s], shape (n,).

    Returns:
        A [m/s] and B [m], shape (n,) each; NaN where there is no such motion.

    Raises:
        InvalidInputError: the obstacle accelerates relative to the reference, or K_a is zero.
    """
    damping, stiffness = values[:, 1], values[:, 2]
    position, speed = values[:, 5], values[:, 6]
    if np.any(values[:, 7] != 0):
        raise InvalidInputError("method: the uniform motion L(16)-(19) needs an obstacle without acceleration")
    if np.any(stiffness == 0):
        raise InvalidInputError("method: the uniform motion L(16)-(19) needs a stiffness above 0 N/m")
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(1 + 8 * curvature * gain * speed / stiffness)
        a = 2 * speed / (1 + root)
        a = np.where((np.abs(a) <= np.abs(speed)) & (a < 0), a, np.nan)
        pull = damping * speed + stiffness * position - (rate * gain + damping) * a
        b = pull / (2 * curvature * gain * a + stiffness)
    return a, b


def solve_uniform_motion(
    values: FloatArray, sensor: SensorModel, gain: FloatArray, rows: FloatArray, status: IntArray
) -> tuple[Any, Any]:
    """Fill the columns of the encounter by the uniform motion L(16)-(19), up to its contact l = 0; return A and B.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        sensor: a curve whose slope is linear in the distance.
        gain: D_p [N s], shape (n,).
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,).

    Returns:
        A [m/s] and B [m].
    """
    curvature, rate = second_order_parameters(sensor)
    a, b = uniform_motion(values, curvature, rate, gain)
    position, speed = values[:, 5], values[:, 6]
    exists = np.isfinite(a) & (b >= 0)
    a_safe, b_safe = np.where(exists, a, 1.0), np.where(exists, b, 0.0)
    time = -b_safe / a_safe
    columns = dict.fromkeys(COLUMNS, np.zeros(len(values)))
    columns["time"] = time
    columns["displacement"] = position + speed * time
    columns["displacement_velocity"] = speed - a_safe
    columns["relative_velocity"] = a_safe
    columns["virtual_force"] = gain * rate * a_safe
    start = position - b_safe
    columns["largest_excursion"] = np.maximum(np.abs(start), np.abs(columns["displacement"]))
    reference = values[:, 8]
    columns["largest_travel"] = np.abs(columns["displacement"] - start + (reference + values[:, 9] * time / 2) * time)
    speeds = np.abs(columns["displacement_velocity"] + reference)
    columns["largest_speed"] = np.maximum(
        speeds, np.abs(columns["displacement_velocity"] + reference + values[:, 9] * time)
    )
    columns["largest_acceleration"] = np.abs(values[:, 9])
    slopes = np.maximum(np.abs(rate), np.abs(rate + 2 * curvature * b_safe))
    columns["largest_virtual_force"] = np.abs(gain * a_safe) * slopes
    columns["settling_distance"] = np.full(len(values), np.inf)
    rows[:] = np.column_stack([np.where(exists, columns[name], 0.0) for name in COLUMNS])
    rows[~exists, COLUMNS.index("distance")] = values[~exists, 5] - values[~exists, 3]
    rows[~exists, COLUMNS.index("closest_distance")] = values[~exists, 5] - values[~exists, 3]
    status[:] = np.where(exists, ContactStatus.CONTACT, ContactStatus.NO_UNIFORM_MOTION)
    return a, b
