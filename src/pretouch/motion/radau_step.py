"""Compute one integration step of many motions by Radau collocation.

The motions have a custom force law. Newton's method solves the collocation equations.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from .custom_force import ForceLaw
from .radau import POINTS, apply, tables

APPROACH, ALONG, RECEDE = -1, 0, 1
"""Whether the object approaches, keeps its distance or recedes on a piece of a motion."""

_TOLERANCE: Final = 1e-11  # of the last two Legendre coefficients of l', relative to its largest value in the step
_SOLVED: Final = 1e-13  # last correction of l' by Newton's method, relative to its largest value in the step
_ITERATIONS: Final = 10
_DERIVATIVES: Final = (0, 1, 2, 4)  # iterations in which the derivatives of the force are computed anew
_CHANGE: Final = 1e-7  # relative change for the derivatives of the force
_ROUNDING: Final = 16 * float(np.finfo(np.float64).eps)


class Start(NamedTuple):
    """Initial state and parameters of motions in an integration step.

    Each array has the shape (n,). The position and velocity of the obstacle are relative to the reference.
    """

    mass: FloatArray  # M [kg]
    damping: FloatArray  # D [N s/m]
    stiffness: FloatArray  # K [N/m]
    value: FloatArray  # the law's number
    course: IntArray  # APPROACH, ALONG or RECEDE
    position: FloatArray  # of the obstacle [m]
    velocity: FloatArray  # of the obstacle [m/s]
    push: FloatArray  # acceleration of the obstacle [m/s^2]
    distance: FloatArray  # l [m]
    speed: FloatArray  # l' [m/s]
    force: FloatArray  # F [N]

    def some(self, which: Any) -> Start:
        """Return the selected motions."""
        return Start._make(column[which] for column in self)

    def obstacle_after(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return position [m] and velocity [m/s] of the obstacles.

        The times [s] count from the start of the step.
        """
        velocity, push = self.velocity[:, None], self.push[:, None]
        return self.position[:, None] + (velocity + push * time / 2) * time, velocity + push * time

    def pull(self, time: FloatArray, distance: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the force [N] of the admittance's spring and damper.

        The times [s] count from the start of the step.
        """
        position, velocity = self.obstacle_after(time)
        return np.asarray(self.stiffness[:, None] * (position - distance) + self.damping[:, None] * (velocity - speed))

    def acting(self, pull: FloatArray, force: FloatArray, law: ForceLaw) -> FloatArray:
        """Return the admittance force [N] that acts on the virtual mass."""
        course = self.course[:, None]
        acts = np.where(course == APPROACH, np.maximum(pull, 0.0), pull) if law.suspends_admittance else pull
        return np.where(course == ALONG, force - (self.mass * self.push)[:, None], acts)

    def acceleration(self, law: ForceLaw) -> FloatArray:
        """Return the relative acceleration [m/s^2] at the start of the step."""
        force = self.force[:, None]
        pull = self.pull(np.zeros_like(force), self.distance[:, None], self.speed[:, None])
        return np.asarray(self.push - (force - self.acting(pull, force, law))[:, 0] / self.mass)


class Trial(NamedTuple):
    """Solutions of attempted integration steps with estimates of their errors.

    Arrays of distance, speed and force have the shape (n, POINTS + 1).
    """

    distance: FloatArray  # l [m]
    speed: FloatArray  # l' [m/s]
    force: FloatArray  # F [N]
    solved: BoolArray  # whether Newton's method converged, shape (n,)
    error: FloatArray  # estimated error divided by the largest allowed one, shape (n,)
    rounding: FloatArray  # error of l' by rounding [m/s], shape (n,)

    def some(self, which: Any) -> Trial:
        """Return the selected steps."""
        return Trial._make(column[which] for column in self)


class _Points(NamedTuple):
    """States of many motions at the collocation points.

    The arrays have the shape (n, POINTS).
    """

    distance: FloatArray
    speed: FloatArray
    force: FloatArray
    pull: FloatArray


def try_step(law: ForceLaw, start: Start, duration: FloatArray) -> Trial:
    """Solve one integration step for each motion."""
    # The duration is in s. The motions are solved independently of each other.
    first = start.acceleration(law)
    acceleration = np.repeat(first[:, None], POINTS, axis=1)
    nodes = [np.repeat(column[:, None], POINTS + 1, axis=1) for column in start[-3:]]
    rounding, solved = np.zeros(len(duration)), np.zeros(len(duration), dtype=bool)
    unsolved, matrix = np.arange(len(duration)), np.empty(0)
    for iteration in range(_ITERATIONS):
        some, h = start.some(unsolved), duration[unsolved, None]
        points = _points(law, some, h, acceleration[unsolved])
        acting = some.acting(points.pull, points.force, law)
        residual = acceleration[unsolved] - some.push[:, None] + (points.force - acting) / some.mass[:, None]
        if iteration in _DERIVATIVES:
            matrix = _matrix(law, some, h, points)
        correction = _solve(matrix, residual)
        acceleration[unsolved] -= correction
        change = h * apply(tables().integrals, correction)
        nodes[0][unsolved, 1:] = points.distance - h**2 * apply(tables().twice, correction)
        nodes[1][unsolved, 1:] = points.speed - change
        nodes[2][unsolved, 1:] = points.force
        fastest = np.maximum(np.abs(points.speed).max(axis=1), np.abs(some.speed))
        rounding[unsolved] = _ROUNDING * (fastest + h[:, 0] * _magnitudes(some, points))
        largest = np.abs(change).max(axis=1)
        solved[unsolved] = largest <= _SOLVED * fastest + rounding[unsolved]
        going = ~solved[unsolved] & np.isfinite(largest)
        unsolved, matrix = unsolved[going], matrix[going]
        if not len(unsolved):
            break
    error = np.abs(apply(tables().to_legendre[-2:], nodes[1])).sum(axis=1)
    # A corner of the force before the first point shows only in the acceleration at the start.
    error += np.abs(apply(tables().at_start[None], acceleration)[:, 0] - first) * duration * tables().nodes[1]
    allowed = _TOLERANCE * np.abs(nodes[1]).max(axis=1) + rounding
    return Trial(nodes[0], nodes[1], nodes[2], solved, error / allowed, rounding)


def _magnitudes(start: Start, points: _Points) -> FloatArray:
    """Return the sum of the absolute terms of the relative acceleration [m/s^2].

    The rounding error of the acceleration is proportional to this sum.
    """
    lengths = np.abs(start.position) + np.abs(points.distance).max(axis=1)
    speeds = np.abs(start.velocity) + np.abs(points.speed).max(axis=1)
    forces = np.abs(points.force).max(axis=1) + start.stiffness * lengths + start.damping * speeds
    return np.asarray(forces / start.mass + np.abs(start.push))


def _points(law: ForceLaw, start: Start, h: FloatArray, acceleration: FloatArray) -> _Points:
    """Compute the states at the collocation points from their accelerations."""
    time = h * tables().nodes[1:]
    speed = start.speed[:, None] + h * apply(tables().integrals, acceleration)
    change = start.speed[:, None] * time + h**2 * apply(tables().twice, acceleration)
    distance = start.distance[:, None] + change
    force = law.at(start.value[:, None], distance, speed, trial=True)
    return _Points(distance, speed, force, start.pull(time, distance, speed))


def _matrix(law: ForceLaw, start: Start, h: FloatArray, points: _Points) -> FloatArray:
    """Return the Jacobian matrix of the collocation equations."""
    distance, speed, force, pull = points
    (low, high), value, mass = law.valid_range, start.value[:, None], start.mass[:, None]
    farthest, fastest = (np.abs(values).max(axis=1)[:, None] for values in (distance, speed))
    step = _CHANGE * (np.abs(distance) + 1e-3 * farthest)
    step = np.where(distance + step > high, -step, step)
    by_distance = (law.at(value, distance + step, speed, trial=True) - force) / step
    by_distance = np.where((distance >= low) & (distance <= high), by_distance, 0.0)
    change = _CHANGE * np.where(fastest > 0, fastest, farthest / h)
    by_speed = (law.at(value, distance, speed + change, trial=True) - force) / change
    acts = (start.course[:, None] != APPROACH) | (pull > 0) if law.suspends_admittance else np.ones_like(pull)
    by_distance = (by_distance + start.stiffness[:, None] * acts) / mass
    by_speed = (by_speed + start.damping[:, None] * acts) / mass
    of_speed, of_distance = (by_speed * h)[:, :, None], (by_distance * h**2)[:, :, None]
    return np.asarray(np.eye(POINTS) + of_speed * tables().integrals + of_distance * tables().twice)


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve many systems of linear equations at once."""
    # The result of a singular system is NaN.
    try:
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.full_like(right, np.nan)
        return np.concatenate([_solve(matrix[i : i + 1], right[i : i + 1]) for i in range(len(matrix))])
