"""The uniform motion L(16)-(19) of the second-order exponential curve: one particular motion, offered by name."""

from __future__ import annotations

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch.sensors import SensorModel

from .layout import COLUMNS, ContactStatus, named
from .request import Request, Which

__all__ = ["solve_uniform_motion", "trace_uniform_motion", "uniform_motion"]


def _second_order_parameters(sensor: SensorModel) -> tuple[float, float]:
    """Read b_2 [1/m^2] and c_2 [1/m] from a curve whose slope is linear in the distance; a constant one has b_2 = 0."""
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
    _, damping, stiffness, _, _, position, speed, acceleration, _, _ = values.T
    if np.any(acceleration != 0):
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


def solve_uniform_motion(request: Request, which: Which, rows: FloatArray, status: IntArray) -> None:
    """Fill rows and statuses of some encounters, up to their contact l = 0."""
    curvature, rate = _second_order_parameters(request.sensor)
    values, gain = request.part(which)
    a, b = uniform_motion(values, curvature, rate, gain)
    _, _, _, x0, _, position, speed, _, drift, pull = values.T
    exists = np.isfinite(a) & (b >= 0)
    a, b = np.where(exists, a, 1.0), np.where(exists, b, 0.0)
    time, start = -b / a, position - b
    displacement, own_speed = position + speed * time, speed - a
    steepest = np.maximum(np.abs(rate), np.abs(rate + 2 * curvature * b))
    found = {
        "time": time,
        "displacement": displacement,
        "displacement_velocity": own_speed,
        "relative_velocity": a,
        "virtual_force": gain * rate * a,
        "largest_excursion": np.maximum(np.abs(start), np.abs(displacement)),
        "largest_travel": np.abs(displacement - start + (drift + pull * time / 2) * time),
        "largest_speed": np.maximum(np.abs(own_speed + drift), np.abs(own_speed + drift + pull * time)),
        "largest_acceleration": np.abs(pull),
        "largest_virtual_force": np.abs(gain * a) * steepest,
        "settling_distance": np.full(len(values), np.inf),
    }
    nothing, end = np.zeros(len(values)), named(rows)
    for name in COLUMNS:
        end[name][:] = np.where(exists, found.get(name, nothing), 0.0)
    for name in ("distance", "closest_distance"):
        end[name][~exists] = (position - x0)[~exists]
    status[:] = np.where(exists, ContactStatus.CONTACT, ContactStatus.NO_UNIFORM_MOTION)


def trace_uniform_motion(request: Request, times: FloatArray, trace: FloatArray) -> None:
    """Fill trace with distance and speed of l = A t + B, or of a start at rest where there is none."""
    r = request.relative
    values, gain = request.part(slice(None))
    a, b = (x[:, None] for x in uniform_motion(values, *_second_order_parameters(request.sensor), gain))
    trace[...] = 0.0
    trace[..., 0] = np.where(np.isnan(a), (r.p - r.x0)[:, None], b) + np.nan_to_num(a) * times
    trace[..., 2] = r.v[:, None] - np.nan_to_num(a)
