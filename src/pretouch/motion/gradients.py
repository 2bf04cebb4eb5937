"""The exact derivatives of a contact by everything that it depends on.

Time and relative velocity at contact change by dt/dq and dl'/dq (`gradient_rows`). What else is known there follows:
x~ = x_o(t), for l = 0; x~' = x_o' - l'; F_p = D_p g(0) l'; and x~'' by the equation of motion. A parameter of the
sensor curve that changes ln xi by `output` ln xi + `shift` g + `stretch` l g + constant is a change of D_p, of the
distance to the surface, or of the unit of length, each of which the derivatives by the other inputs already contain:

    d by a larger gain      D_p d/dD_p
    d by a shift            d/dp, less what p does to l itself: 1 at a fixed time
    d by a stretch          (p d/dp + x_0 d/dx_0 + v d/dv + u_0 d/du_0 + a d/da + D_p d/dD_p - 1) on any length
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel
from pretouch.sensors.change import CurveChange, curve_change

from .contact_algebra import DERIVATIVES, Change
from .curve_changes import bend_at_contact
from .gradient_rows import GradientRows
from .inputs import SCENARIO_INPUTS
from .layout import RELATIVE_INPUTS, ContactStatus
from .solution import Solution

__all__ = ["ContactGradients", "ManyGradients", "input_names"]

_QUANTITIES: Final = {
    "time": "s",
    "position": "m",
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "displacement": "m",
    "relative_velocity": "m/s",
    "virtual_force": "N",
}
_RELATIVE: Final[dict[str, dict[str, float]]] = {
    "gain": {"gain": 1.0},
    "admittance.mass": {"mass": 1.0},
    "admittance.damping": {"damping": 1.0},
    "admittance.stiffness": {"stiffness": 1.0},
    "obstacle.position": {"p": 1.0},
    "obstacle.velocity": {"v": 1.0},
    "obstacle.acceleration": {"a": 1.0},
    "plant.position": {"x0": 1.0},
    "plant.velocity": {"u0": 1.0},
    "reference.position": {"x0": -1.0, "p": -1.0},
    "reference.velocity": {"u0": -1.0, "v": -1.0},
    "reference.acceleration": {"a": -1.0},
}
_INPUTS: Final = {name: {"gain": "N*s", **SCENARIO_INPUTS}[name] for name in _RELATIVE}
_LENGTHS: Final = ("x0", "u0", "p", "v", "a", "gain")  # what grows with the unit of length, D_p among it


def input_names(sensor: SensorModel) -> tuple[str, ...]:
    """Return the names of everything that a contact depends on.

    Args:
        sensor: the curve, whose parameters are among them.

    Returns:
        The names, the gain first.
    """
    return (*_INPUTS, *(f"sensor.{name}" for name in sensor.parameter_units))


def gradients_of(columns: Any) -> Any:
    """Return the derivatives of what a result is made of.

    Args:
        columns: of a result.

    Returns:
        ContactGradients, or what has its members; None of the uniform motion, which is none of the equation of motion,
        and of columns that know no derivatives.
    """
    if not isinstance(columns, Solution):
        return getattr(columns, "gradients", None)
    if columns.derivatives is None and columns.request.method != "uniform-motion":
        many = columns.request.many
        columns.derivatives = (
            ContactGradients(columns)
            if many is None
            else ManyGradients([ContactGradients(Solution(columns.request.alone(i))) for i in range(len(many))])
        )
    return columns.derivatives


@dataclass(frozen=True, slots=True, repr=False)
class ContactGradients(Value):
    """The derivatives of quantities at contact by the inputs of an encounter: what `ContactResult.gradients` has.

    They are exact, not differences, and computed when they are first read; NaN where a run does not end in contact. The
    first contact is differentiated: a touch, which an arbitrarily small change of an input turns into none, has l' = 0
    and derivatives without bound, and these are NaN as well.

    Args:
        solution: the encounters and their contacts.

    Attributes:
        quantities: what can be differentiated: `time`, `position`, `velocity`, `acceleration`, `displacement`,
            `relative_velocity`, `virtual_force`, each as in ContactState.
        inputs: by what: `gain`, every field of the scenario such as `obstacle.velocity`, and `sensor.` with the name of
            each parameter of the curve.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle, Scenario, find_contact
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> gradients = find_contact(scenario, sensor, -0.7).gradients
        >>> round(gradients.of("relative_velocity", "obstacle.velocity"), 6)
        0.174501
        >>> gradients.unit("relative_velocity", "gain")
        '(m/s)/(N*s)'
    """

    solution: Solution
    _rows: GradientRows = field(init=False, compare=False)
    quantities: tuple[str, ...] = field(init=False, default=tuple(_QUANTITIES))
    inputs: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_rows", GradientRows(self.solution))
        object.__setattr__(self, "inputs", input_names(self.solution.request.sensor))

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a quantity at contact by an input.

        Args:
            quantity: one of `quantities`.
            by: one of `inputs`; all others stay as they are, and so does the horizon.

        Returns:
            The derivative in SI, as `unit` has it: a float, or an array of the broadcast shape; NaN without
            contact, and at a touch.

        """
        _known(quantity, self.quantities, "quantity")
        _known(by, self.inputs, "by")
        solution = self.solution
        change = self._change(by)
        found = np.asarray(DERIVATIVES[quantity](solution, by, change))
        shape = solution.request.shape
        if shape == ():
            return float(found.reshape(-1)[0])
        found = found.reshape(shape)
        found.setflags(write=False)
        return found

    def unit(self, quantity: str, by: str) -> str:
        """Return the SI unit of the derivative of a quantity by an input.

        Args:
            quantity: one of `quantities`.
            by: one of `inputs`.

        Returns:
            The unit of the quantity over that of the input.
        """
        _known(quantity, self.quantities, "quantity")
        _known(by, self.inputs, "by")
        solution = self.solution
        below = _INPUTS.get(by)
        if below is None:
            below = solution.request.sensor.parameter_units[by.removeprefix("sensor.")]
        above = _QUANTITIES[quantity]
        if not below:
            return above
        return f"{_bracketed(above)}/{_bracketed(below)}"

    def __repr__(self) -> str:
        return f"<ContactGradients: {len(self.quantities)} quantities by {len(self.inputs)} inputs>"

    def _change(self, by: str) -> Change:
        if by in _RELATIVE:
            inputs = _RELATIVE[by]
            time, speed = self._weighted(inputs)
            return Change(time, speed, inputs, 0.0)
        solution = self.solution
        name = by.removeprefix("sensor.")
        change = curve_change(solution.request.sensor, name)
        low, high = solution.request.sensor.valid_range
        if not low <= 0 <= high:  # never in contact
            nothing = np.full(solution.request.size, np.nan)
            return Change(nothing, nothing, {}, 0.0)
        factors = change if change.nearest or change.slope is None else CurveChange()
        time, speed = self._by_factors(factors)
        if change.slope is not None:
            near = _distance(solution) < (change.nearest or np.inf)
            if near.any():
                time, speed = np.where(near, self._rows.of_slope(name, change.slope), [time, speed])
        return Change(time, speed, {}, _slope_change(solution, factors, change))

    def _weighted(self, weights: dict[str, Any]) -> FloatArray:
        """Return the sum of derivatives of time and l', with weights, shape (2, n)."""
        found = self._rows.take([RELATIVE_INPUTS.index(name) for name in weights])
        if len(weights) == 1 and all(isinstance(w, float) and w == 1 for w in weights.values()):
            return found[:, 0]
        return np.asarray(sum(weight * found[:, i] for i, weight in enumerate(weights.values())))

    def _by_factors(self, change: CurveChange) -> FloatArray:
        """Return the derivatives of time and l' by a change of the curve that is known by its three factors."""
        solution = self.solution
        found = np.where(solution.status == ContactStatus.CONTACT, np.zeros((2, 1)), np.nan)
        relative = solution.request.relative
        with np.errstate(divide="ignore", invalid="ignore"):  # l' is 0 where a run ends without contact
            if change.output:
                found = found + change.output * self._weighted({"gain": relative.gain})
            if change.shift:
                speed = solution.raw("relative_velocity")
                earlier = 1 / speed
                found = found + change.shift * (
                    self._weighted({"p": 1.0}) + np.stack([earlier, _bend(solution) * earlier])
                )
            if change.stretch:
                whole = self._weighted({name: getattr(relative, name) for name in _LENGTHS})
                whole[1] -= solution.raw("relative_velocity")
                found = found + change.stretch * whole
        return found


class ManyGradients:
    """The derivatives of encounters with a sensor curve each, side by side along the last axis.

    Args:
        parts: those of each curve.

    Attributes:
        quantities: as in ContactGradients.
        inputs: likewise.
    """

    __slots__ = ("inputs", "parts", "quantities")

    def __init__(self, parts: list[ContactGradients]) -> None:
        self.parts, self.quantities, self.inputs = parts, parts[0].quantities, parts[0].inputs

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a quantity at contact by an input, as ContactGradients has it."""
        return np.stack([part.of(quantity, by) for part in self.parts], axis=-1)

    def unit(self, quantity: str, by: str) -> str:
        """Return the SI unit of the derivative of a quantity by an input, as ContactGradients has it."""
        return self.parts[0].unit(quantity, by)


def _known(name: str, names: Iterable[str], what: str) -> None:
    if name not in names:
        raise InvalidInputError(f"{what}: found {name!r}, expected one of {', '.join(names)}")


def _bracketed(unit: str) -> str:
    return f"({unit})" if "/" in unit or "*" in unit else unit


def _distance(solution: Solution) -> FloatArray:
    """Return l at the start of every run, shape (n,)."""
    return np.broadcast_to(solution.request.relative.p - solution.request.relative.x0, solution.request.size)


def _bend(solution: Solution) -> FloatArray:
    """Return l'' at the end of every run."""
    return np.asarray(solution.request.relative.a - solution.settled_acceleration)


def _slope_change(solution: Solution, factors: CurveChange, change: CurveChange) -> float:
    """Return the derivative of g(0) by a parameter of the curve."""
    sensor = solution.request.sensor
    if change.slope is not None:
        return float(np.asarray(change.slope(np.zeros(1)))[0])
    whole = (factors.output + factors.stretch) * float(sensor.log_slope(0.0))
    return whole + (factors.shift * bend_at_contact(sensor) if factors.shift else 0.0)
