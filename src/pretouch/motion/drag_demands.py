"""Compute peak force, acceleration, speed and travel under the virtual drag.

Travel is the distance of the robot from its start.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

from .drag_path import DragPath
from .drag_request import DragRequest


class DragRun(Protocol):
    """Interface of solved encounters under the virtual drag."""

    request: DragRequest
    path: DragPath
    lanes: IntArray
    begins: FloatArray

    def raw(self, name: str) -> FloatArray:
        """Return one result quantity, such as the contact time, per encounter."""


def largest_acceleration(c: DragRun) -> FloatArray:
    """Return the largest acceleration of the robot [m/s^2] in each encounter."""
    reference, peaks = c.request.bodies["r_a"][c.lanes], c.path.peaks
    on_path = np.abs(reference - np.stack([peaks["largest_rate"], peaks["smallest_rate"]])).max(axis=0)
    return _raised(c, on_path, np.abs(c.raw("acceleration")))


def largest_force(c: DragRun) -> tuple[FloatArray, FloatArray]:
    """Return the largest virtual force [N] in each encounter.

    The second result is the distance [m] at which the force acts.
    """
    force, on = np.abs(c.raw("virtual_force")), c.lanes
    on_path, where = c.request.mass[on] * c.path.peaks["largest_rate"], c.raw("distance").copy()
    where[on] = np.where(on_path > force[on], c.path.peaks["rate_distance"], where[on])
    return _raised(c, on_path, force), where


def largest_speed(c: DragRun) -> FloatArray:
    """Return the largest speed of the robot [m/s] in each encounter."""
    b = c.request.bodies
    start = b["u0"] + b["r_v"]
    ends = np.abs(np.stack([start, start + b["r_a"] * c.begins, c.raw("velocity")])).max(axis=0)
    return _raised(c, _largest_magnitude(c, "velocity"), ends)


def largest_travel(c: DragRun) -> FloatArray:
    """Return the robot's largest distance [m] from its start position."""
    b = c.request.bodies
    turning = np.zeros(len(c.begins))  # turning point of the reference, while the plant moves with it
    np.divide(-(b["u0"] + b["r_v"]), b["r_a"], out=turning, where=b["r_a"] != 0)
    times = np.stack([np.clip(turning, 0.0, c.begins), c.begins])
    moved = (b["u0"] + b["r_v"]) * times + b["r_a"] * times**2 / 2
    here = c.raw("position") - b["x0"] - b["r"]
    return _raised(c, _largest_magnitude(c, "travel"), np.abs([*moved, here]).max(axis=0))


def _largest_magnitude(c: DragRun, name: str) -> FloatArray:
    peaks = c.path.peaks
    return np.maximum(np.abs(peaks[f"largest_{name}"]), np.abs(peaks[f"smallest_{name}"]))


def _raised(c: DragRun, on_path: FloatArray, at_ends: FloatArray) -> FloatArray:
    """Return each encounter's largest value during approach, start and end."""
    largest = at_ends.copy()
    largest[c.lanes] = np.fmax(largest[c.lanes], np.where(np.isfinite(on_path), on_path, -np.inf))
    return largest


def impulse_residual(c: DragRun) -> FloatArray:
    """Return the relative residual of the drag's impulse balance.

    It measures the error of the computed motion. The result is the larger residual of M l' = M l'(0) + M a_o t + phi
    int s' ds and of the moment of this equation.
    """
    r = c.request
    impulse, moment = np.zeros(len(c.begins)), np.zeros(len(c.begins))

    def log_output(distance: FloatArray, which: IntArray) -> Any:
        return r.at_curves(lambda sensor, d: sensor.log_output(d), distance, c.lanes[which])

    impulse[c.lanes], moment[c.lanes] = c.path.balance(log_output).T
    t, v, a = c.raw("time"), r.velocity, r.acceleration
    speeds = np.stack([-c.raw("relative_velocity"), v, a * t, impulse])
    lengths = np.stack([-c.raw("distance"), r.distance, v * t, a * t**2 / 2, impulse * t, -moment])
    residuals = [np.abs(x.sum(axis=0)) / np.maximum(np.abs(x).max(axis=0), math.ulp(0.0)) for x in (speeds, lengths)]
    return np.asarray(np.maximum(*residuals))
