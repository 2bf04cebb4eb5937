"""The exact derivatives of a contact under the virtual drag: quadratures beside those of the motion.

With dw/dl = 2 (a_o + k g^2 w), a change of w by an input follows du/dl = 2 (k g^2 u + h), h the change of the
right-hand side at fixed w, so u e^q = u_0 - 2 int_l^{l_0} e^q h dl; and t changes by -1/2 int u w^{-3/2} dl, and by
1/|l'| per unit of l_0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .drag_demands import DragRun
from .drag_path import WEIGHTS, so_far
from .layout import ContactStatus

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
    """The derivatives of quantities at contact by the inputs of an encounter: what `ContactResult.gradients` has.

    They are exact; NaN where a run does not end in contact, where it touches with l' = 0, and where it does not start
    with an approach.

    Args:
        columns: the encounters and their contacts.

    Attributes:
        quantities: what can be differentiated: `time`, `relative_velocity`, `displacement` (less the excursion).
        inputs: by what: `gain`, which is phi, `admittance.mass`, `obstacle.position` (the distance l_d),
            `obstacle.velocity` and `obstacle.acceleration`.
    """

    columns: DragRun
    quantities: tuple[str, ...] = field(init=False, default=tuple(_QUANTITIES))
    inputs: tuple[str, ...] = field(init=False, default=tuple(_INPUTS))

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a quantity at contact by an input.

        Args:
            quantity: one of `quantities`.
            by: one of `inputs`.

        Returns:
            The derivative in SI, of the shape of the result: a float for a single run.

        Raises:
            InvalidInputError: there is no such quantity or input.
        """
        if quantity not in _QUANTITIES or by not in _INPUTS:
            raise InvalidInputError(
                f"gradients: found {quantity!r} by {by!r}, expected one of {', '.join(_QUANTITIES)} by one of "
                f"{', '.join(_INPUTS)}"
            )
        shape = self.columns.request.shape
        found = _derivative(self.columns, quantity, by)
        return float(found[0]) if shape == () else found.reshape(shape)

    def unit(self, quantity: str, by: str) -> str:
        """Return the unit of a derivative."""
        return f"({_QUANTITIES[quantity]})/({_INPUTS[by]})"


def _derivative(c: DragRun, quantity: str, by: str) -> FloatArray:
    r, on = c.request, c.lanes
    time, square = (np.full(len(r.mass), np.nan) for _ in range(2))
    square[on], time[on] = _changes(c, by)
    speed = c.raw("relative_velocity")
    if quantity == "time":
        found = time
    elif quantity == "relative_velocity":
        found = square / (2 * np.where(speed == 0, np.nan, speed))
    else:
        t = c.raw("time")
        own = {"obstacle.position": 1.0, "obstacle.velocity": t, "obstacle.acceleration": t**2 / 2}.get(by, 0.0)
        found = own + (r.bodies["v"] + r.bodies["a"] * t) * time
    valid = (c.raw("status") == ContactStatus.CONTACT) & (r.velocity < 0) & (speed < 0)
    return np.where(valid, found, np.nan)


def _changes(c: DragRun, by: str) -> tuple[FloatArray, FloatArray]:
    """Return how w at the end of each approach, and its time, change by an input."""
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
