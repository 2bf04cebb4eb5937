"""Compute the largest force, acceleration, speed and excursion of the robot under the virtual drag.

The square w of l' obeys dw/dl = 2 (a_o + k g^2 w). Its derivative u by an input therefore obeys du/dl = 2 (k g^2 u +
h), where h is the derivative of a_o + k g^2 w at fixed w. Hence u e^q = u_0 - 2 int_l^{l_0} e^q h dl. The time changes
by -1/2 int u w^{-3/2} dl, and by 1/|l'| per unit of l_0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.polynomial import legendre

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value

from .drag_path import NODES, TO_TERMS, WEIGHTS, DragCells, DragPath, so_far
from .drag_request import DragRequest
from .layout import ContactStatus

_FINE: Final = np.linspace(-1.0, 1.0, 33)
_AT_FINE: Final[FloatArray] = legendre.legvander(_FINE, NODES - 1) @ TO_TERMS
_RATE: Final[FloatArray] = np.asarray(legendre.legder(TO_TERMS), dtype=np.float64)
_BEND: Final[FloatArray] = np.asarray(legendre.legder(TO_TERMS, 2), dtype=np.float64)
_CHANGE: Final[FloatArray] = legendre.legvander(legendre.leggauss(NODES)[0], NODES - 2) @ _RATE
"""Matrix from values at the nodes to derivatives at the nodes."""


class DragRun(Protocol):
    """Interface of an object with the solutions of several encounters under the virtual drag."""

    request: DragRequest
    path: DragPath
    lanes: IntArray
    begins: FloatArray

    def raw(self, name: str) -> FloatArray:
        """Return one quantity, such as the contact time, for all encounters as a one-dimensional array."""


class _State(NamedTuple):
    """State of several encounters under the virtual drag, evaluated at quadrature nodes.

    The fields are quantities of the bodies, t [s], l [m], |l'| [m/s] and k g^2 l'^2 [m/s^2].
    """

    bodies: dict[str, FloatArray]
    time: FloatArray
    distance: FloatArray
    speed: FloatArray
    rate: FloatArray


def largest_acceleration(c: DragRun) -> FloatArray:
    """Return the largest acceleration of the robot [m/s^2] in each encounter."""
    return _peaks(c, lambda s: s.bodies["r_a"] - s.rate, c.raw("acceleration")[:, None])[0]


def largest_force(c: DragRun) -> tuple[FloatArray, FloatArray]:
    """Return the largest virtual force [N] in each encounter, and the distance [m] at which it acts."""
    return _peaks(c, lambda s: s.bodies["mass"] * s.rate, c.raw("virtual_force")[:, None])


def largest_speed(c: DragRun) -> FloatArray:
    """Return the largest speed of the robot [m/s] in each encounter."""
    b = c.request.bodies
    waiting = b["u0"] + b["r_v"] + b["r_a"] * c.begins
    ends = np.stack([b["u0"] + b["r_v"], waiting, c.raw("velocity")], axis=1)
    return _peaks(c, lambda s: _obstacle_velocity(s.bodies, s.time) + s.speed, ends)[0]


def largest_travel(c: DragRun) -> FloatArray:
    """Return the largest distance of the robot from its start [m] in each encounter."""
    b = c.request.bodies
    turning = np.zeros(len(c.begins))  # turning point of the reference, while the plant moves with it
    np.divide(-(b["u0"] + b["r_v"]), b["r_a"], out=turning, where=b["r_a"] != 0)
    times = np.stack([np.clip(turning, 0.0, c.begins), c.begins], axis=1)
    moved = (b["u0"] + b["r_v"])[:, None] * times + b["r_a"][:, None] * times**2 / 2
    here = c.raw("position") - b["x0"] - b["r"]

    def travel(s: _State) -> FloatArray:
        b = s.bodies
        obstacle = b["p"] - b["x0"] + (b["v"] + b["r_v"] + (b["a"] + b["r_a"]) * s.time / 2) * s.time
        return np.asarray(obstacle - s.distance)

    return _peaks(c, travel, np.concatenate([moved, here[:, None]], axis=1))[0]


def _obstacle_velocity(b: dict[str, FloatArray], time: FloatArray) -> FloatArray:
    return np.asarray(b["v"] + b["r_v"] + (b["a"] + b["r_a"]) * time)


def _peaks(c: DragRun, quantity: Callable[[_State], Any], at_ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest magnitude of a quantity, such as the force, in each encounter under the virtual drag.

    Args:
        c: the solved encounters.
        quantity: function from the state at nodes to the quantity there.
        at_ends: values at start, end and other special times, shape (n, any).

    Returns:
        The maximum of its magnitude, and the distance at which it occurs [m], or the last distance for a maximum of
        `at_ends`; shape (n,) each.
    """
    largest, where = np.abs(at_ends).max(axis=1), c.raw("distance").copy()
    least = np.zeros(len(largest))
    for cells, values in _values(c, quantity):
        run = c.lanes[cells.lane]
        least[run] = np.maximum(least[run], np.abs(values).max(axis=1))
    for cells, values in _values(c, quantity):
        run = c.lanes[cells.lane]
        if (np.abs(values @ TO_TERMS.T).sum(axis=1) < least[run]).all():  # a bound of the polynomials
            continue
        for signed in (values, -values):
            maximum, z = _largest(signed)
            larger = maximum > largest[run]
            largest[run] = np.where(larger, maximum, largest[run])
            where[run] = np.where(larger, cells.start - cells.width * cells.share(z), where[run])
    return largest, where


def _values(c: DragRun, quantity: Callable[[_State], Any]) -> Iterator[tuple[DragCells, FloatArray]]:
    """Yield all distance intervals with the values of a quantity, such as the force, at their quadrature nodes."""
    for cells, nodes in c.path.walk():
        run = c.lanes[cells.lane]
        b = {name: column[run, None] for name, column in c.request.bodies.items()}
        time = cells.time[:, None] + so_far(nodes.pace)
        rate = c.request.strength[run, None] * nodes.slope**2 * nodes.square
        yield cells, np.asarray(quantity(_State(b, time, nodes.distance, np.sqrt(nodes.square), rate)))


def _largest(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return value and position of the maximum of an interpolating polynomial on each distance interval."""
    fine = values @ _AT_FINE.T
    best = fine.argmax(axis=1)
    z = _FINE[best]
    low, high = np.maximum(z - 0.0625, -1.0), np.minimum(z + 0.0625, 1.0)
    rate, bend = values @ _RATE.T, values @ _BEND.T
    for _ in range(4):
        slope = np.einsum("ij,ij->i", legendre.legvander(z, NODES - 2), rate)
        curve = np.einsum("ij,ij->i", legendre.legvander(z, NODES - 3), bend)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(curve < 0, np.clip(z - slope / curve, low, high), z)
    there = np.einsum("ij,ij->i", legendre.legvander(z, NODES - 1), values @ TO_TERMS.T)
    best_z, best_value = _FINE[best], fine.max(axis=1)
    return np.maximum(best_value, there), np.where(there > best_value, z, best_z)


def impulse_residual(c: DragRun) -> FloatArray:
    """Return the relative residual of the impulse balance under the virtual drag, which measures the error."""
    # The result is the larger residual of M l' = M l'(0) + M a_o t + phi int s' ds and of the moment of this equation.
    r = c.request
    impulse, moment = np.zeros(len(c.begins)), np.zeros(len(c.begins))
    for cells, nodes in c.path.walk():
        run = c.lanes[cells.lane]
        log_output = np.asarray(r.sensor.log_output(nodes.distance))
        rise = (log_output - log_output[:, :1]) @ _CHANGE.T  # ds/dz
        force = -r.strength[run, None] * nodes.slope * np.sqrt(nodes.square) * rise
        impulse[run] += force @ WEIGHTS
        moment[run] += (force * (cells.time[:, None] + so_far(nodes.pace))) @ WEIGHTS
    t, v, a = c.raw("time"), r.velocity, r.acceleration
    speeds = np.stack([-c.raw("relative_velocity"), v, a * t, impulse])
    lengths = np.stack([-c.raw("distance"), r.distance, v * t, a * t**2 / 2, impulse * t, -moment])
    residuals = [np.abs(x.sum(axis=0)) / np.maximum(np.abs(x).max(axis=0), math.ulp(0.0)) for x in (speeds, lengths)]
    return np.asarray(np.maximum(*residuals))


_QUANTITIES: Final = {"time": "s", "relative_velocity": "m/s", "displacement": "m"}
_INPUTS: Final = {
    "gain": "N*s^2",
    "admittance.mass": "kg",
    "obstacle.position": "m",
    "obstacle.velocity": "m/s",
    "obstacle.acceleration": "m/s^2",
}


@dataclass(frozen=True, slots=True, repr=False)
class DragGradients(Value):
    """Exact derivatives of the state at contact under the virtual drag, with respect to the inputs of an encounter.

    See `ContactResult.gradients`.

    They are exact. They are NaN if a run does not end in contact, if it touches with l' = 0, and if it does not start
    with an approach.

    Args:
        columns: the encounters and their contacts.

    Attributes:
        quantities: names of the quantities: `time`, `relative_velocity`, `displacement` (minus the excursion).
        inputs: names of the inputs: `gain`, which is phi, `admittance.mass`, `obstacle.position` (the distance l_d),
            `obstacle.velocity` and `obstacle.acceleration`.
    """

    columns: DragRun
    quantities: tuple[str, ...] = field(init=False, default=tuple(_QUANTITIES))
    inputs: tuple[str, ...] = field(init=False, default=tuple(_INPUTS))

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a contact quantity, such as the contact time, with respect to an input.

        Args:
            quantity: one of `quantities`.
            by: one of `inputs`.

        Returns:
            The derivative in SI, of the shape of the result: a float for a single run.

        Raises:
            InvalidInputError: the quantity or input is unknown.
        """
        if quantity not in _QUANTITIES or by not in _INPUTS:
            raise InvalidInputError(
                f"gradients: the derivative of {quantity!r} with respect to {by!r} is not available; available "
                f"are the derivatives of {', '.join(_QUANTITIES)} with respect to {', '.join(_INPUTS)}"
            )
        shape = self.columns.request.shape
        derivative = _derivative(self.columns, quantity, by)
        return float(derivative[0]) if shape == () else derivative.reshape(shape)

    def unit(self, quantity: str, by: str) -> str:
        """Return the SI unit of the derivative of a contact quantity with respect to an input."""
        return f"({_QUANTITIES[quantity]})/({_INPUTS[by]})"


def _derivative(c: DragRun, quantity: str, by: str) -> FloatArray:
    """Return the derivative of a contact quantity with respect to one input, for every encounter."""
    r, on = c.request, c.lanes
    time, square = (np.full(len(r.mass), np.nan) for _ in range(2))
    square[on], time[on] = _changes(c, by)
    speed = c.raw("relative_velocity")
    if quantity == "time":
        derivative = time
    elif quantity == "relative_velocity":
        derivative = square / (2 * np.where(speed == 0, np.nan, speed))
    else:
        t = c.raw("time")
        direct = {"obstacle.position": 1.0, "obstacle.velocity": t, "obstacle.acceleration": t**2 / 2}.get(by, 0.0)
        derivative = direct + (r.bodies["v"] + r.bodies["a"] * t) * time
    valid = (c.raw("status") == ContactStatus.CONTACT) & (r.velocity < 0) & (speed < 0)
    return np.where(valid, derivative, np.nan)


def _changes(c: DragRun, by: str) -> tuple[FloatArray, FloatArray]:
    """Return derivatives of the squared speed and of the duration of each approach with respect to one input."""
    r, on = c.request, c.lanes
    k, a, v = r.strength[on], r.acceleration[on], r.velocity[on]
    square, time = np.zeros(len(on)), np.zeros(len(on))
    if by == "obstacle.velocity":
        square += 2 * v
    elif by == "obstacle.position":
        square -= 2 * (a + k * np.asarray(r.sensor.log_slope(r.farthest[on])) ** 2 * v**2)
        np.divide(1.0, np.abs(v), out=time, where=v < 0)
    factor = {"gain": 1 / r.mass, "admittance.mass": -r.strength / r.mass}.get(by)
    for cells, nodes in c.path.walk():
        lane = cells.lane
        grown = nodes.grown
        if factor is not None:
            push = grown * nodes.slope**2 * nodes.square * factor[on[lane], None]
        else:
            push = grown if by == "obstacle.acceleration" else np.zeros_like(grown)
        along = np.exp(-nodes.growth) * (square[lane, None] - 2 * so_far(push))
        with np.errstate(divide="ignore", invalid="ignore"):
            time[lane] -= (nodes.pace * along / nodes.square) @ WEIGHTS / 2
        square[lane] = np.exp(-nodes.whole_growth) * (square[lane] - 2 * (push @ WEIGHTS))
    return square, time
