"""Compute how the state at contact depends on each input.

The derivatives are those with respect to all inputs of an encounter.

`gradient_rows` provides dt/dq and dl'/dq of time and relative velocity at contact. The other quantities follow:
x~ = x_o(t), since l = 0; x~' = x_o' - l'; F_p = D_p g(0) l'; and x~'' from the equation of motion. A parameter of the
sensor curve that changes ln xi by `output` ln xi + `shift` g + `stretch` l g + constant acts like a change of D_p, of
the recess, and of the unit of length. Derivatives by the other inputs already contain these three:

    change of output        D_p d/dD_p
    change of shift         d/dp, less the direct effect of p on l: 1 at a fixed time
    change of stretch       (p d/dp + x_0 d/dx_0 + v d/dv + u_0 d/du_0 + a d/da + D_p d/dD_p - 1) on any length
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol, cast

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel
from pretouch.sensors.sensitivity import CurveSensitivity, SlopeSensitivity, curve_sensitivity

from .gradient_rows import GradientRows, bend_at_contact
from .layout import RELATIVE_INPUTS, ContactStatus
from .scenario import input_units, sensor_inputs
from .solution import Solution

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
_LENGTHS: Final = (
    "x0",
    "u0",
    "p",
    "v",
    "a",
    "gain",
)  # inputs that are proportional to the unit of length, including D_p


class ContactSource(Protocol):
    """Interface of solved encounters for which `ContactGradients` computes derivatives."""

    request: Any

    @property
    def status(self) -> Any:
        """How each encounter ended, as the integer value of ContactStatus."""

    def raw(self, name: str) -> FloatArray:
        """Return one result quantity, such as the contact time, per encounter."""

    @property
    def settled_acceleration(self) -> FloatArray:
        """The robot's final acceleration relative to the reference position [m/s^2]."""

    def reference(self, derivative: int) -> FloatArray:
        """Return the final velocity or acceleration of the reference position.

        `derivative` is 1 for the velocity [m/s] and 2 for the acceleration [m/s^2].
        """


class ContactRows(Protocol):
    """Interface for computing derivatives of contact time and contact velocity.

    Attributes:
        degree: d if the force of the law is proportional to its number times s'^d, with s' = d(ln xi)/dt; 1 or 2.
        suspends_admittance: whether the law switches off damping and stiffness of the admittance during an approach.
    """

    degree: int
    suspends_admittance: bool

    def take(self, which: Sequence[int]) -> FloatArray:
        """Return the derivatives of contact time and velocity with respect to selected inputs.

        `which` holds indices of RELATIVE_INPUTS. The result has the shape (2, k, n).
        """

    def of_slope(self, name: str, slope: SlopeSensitivity) -> FloatArray:
        """Return the derivatives of contact time and velocity with respect to a sensor parameter.

        `slope` is dg/d(parameter). The result has the shape (2, n).
        """


def input_names(sensor: SensorModel) -> tuple[str, ...]:
    """Return the names of all inputs that affect a contact.

    The gain comes first, and sensor parameters come last.
    """
    return (*_RELATIVE, *sensor_inputs(sensor))


def gradients_of(columns: Any) -> Any:
    """Return the derivatives of the state at contact.

    The derivatives are None if the solver of the result computes none. The uniform motion has no derivatives, since it
    does not start from the given state. Encounters with a course have none either.
    """
    if not isinstance(columns, Solution):
        return getattr(columns, "gradients", None)
    request = columns.request
    differentiable = request.method != "uniform-motion" and not request.scenario.obstacle.course
    if columns.derivatives is None and differentiable:
        columns.derivatives = (
            ContactGradients(columns)
            if request.many is None
            else ManyGradients([ContactGradients(Solution(request.with_curve(i))) for i in range(len(request.many))])
        )
    return columns.derivatives


@dataclass(frozen=True, slots=True, repr=False)
class ContactGradients(Value):
    """Exact derivatives of the state at contact with respect to the inputs.

    See `ContactResult.gradients`.

    They are exact, not finite differences, and computed when they are first read. They are those of the first contact,
    and NaN if a run does not end in contact. They are also NaN for a touch, l' = 0: there an arbitrarily small change
    of an input can prevent the contact, and the derivatives are unbounded.

    Args:
        solution: the encounters and their contacts.
        rows: the derivatives of time and l' at contact; None for the virtual damper.

    Attributes:
        quantities: names of the quantities: `time`, `position`, `velocity`, `acceleration`, `displacement`,
            `relative_velocity`, `virtual_force`, each as in ContactState.
        inputs: names of the inputs: `gain`, every field of the scenario such as `obstacle.velocity`, and `sensor.`
            with the name of each parameter of the curve.

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

    solution: ContactSource
    rows: ContactRows | None = field(default=None, compare=False)
    _rows: ContactRows = field(init=False, compare=False)
    quantities: tuple[str, ...] = field(init=False, default=tuple(_QUANTITIES))
    inputs: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        rows = self.rows or GradientRows(cast("Solution", self.solution))
        object.__setattr__(self, "_rows", rows)
        object.__setattr__(self, "inputs", input_names(self.solution.request.sensor))

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a contact quantity with respect to an input.

        Args:
            quantity: one of `quantities`.
            by: one of `inputs`; all others are held constant, and so is the horizon.

        Returns:
            The derivative in the SI unit that `unit` returns: a float, or an array of the broadcast shape. NaN without
            contact and at a touch.
        """
        self._check(quantity, by)
        derivative, shape = np.asarray(getattr(self._change(by), quantity)), self.solution.request.shape
        if shape == ():
            return float(derivative.reshape(-1)[0])
        derivative = derivative.reshape(shape)
        derivative.setflags(write=False)
        return derivative

    def unit(self, quantity: str, by: str) -> str:
        """Return the SI unit of a derivative of a contact quantity.

        Args:
            quantity: one of `quantities`.
            by: one of `inputs`.

        Returns:
            The unit of the quantity over that of the input.
        """
        self._check(quantity, by)
        units = {"gain": "N*s", **input_units(self.solution.request.sensor)}
        above, below = _QUANTITIES[quantity], units[by]
        return f"{_in_parentheses(above)}/{_in_parentheses(below)}" if below else above

    def __repr__(self) -> str:
        return f"<ContactGradients: {len(self.quantities)} quantities by {len(self.inputs)} inputs>"

    def _check(self, quantity: str, by: str) -> None:
        for argument, name, names in (("quantity", quantity, self.quantities), ("by", by, self.inputs)):
            if name not in names:
                raise InvalidInputError(**not_one_of(argument, name, names))

    def _change(self, by: str) -> _Change:
        solution = self.solution
        if by in _RELATIVE:
            inputs = _RELATIVE[by]
            time, speed = self._weighted_sum(inputs)
            return _Change(solution, self._rows, by, time, speed, inputs)
        sensor, name = solution.request.sensor, by.removeprefix("sensor.")
        change = curve_sensitivity(sensor, name)
        low, high = sensor.valid_range
        if not low <= 0 <= high:  # the curve does not include contact
            undefined = np.full(solution.request.size, np.nan)
            return _Change(solution, self._rows, by, undefined, undefined)
        factors = change if change.nearest or change.slope is None else CurveSensitivity()
        time, speed = self._by_factors(factors)
        if change.slope is None:
            slope = (factors.output + factors.stretch) * float(sensor.log_slope(0.0))
            slope += factors.shift * bend_at_contact(sensor) if factors.shift else 0.0
        else:
            slope = float(np.asarray(change.slope(np.zeros(1)))[0])
            r = solution.request.relative
            near = np.broadcast_to(r.p - r.x0, solution.request.size) < (change.nearest or np.inf)
            if near.any():
                time, speed = np.where(near, self._rows.of_slope(name, change.slope), [time, speed])
        return _Change(solution, self._rows, by, time, speed, slope=slope)

    def _weighted_sum(self, weights: dict[str, Any]) -> FloatArray:
        """Return a weighted sum of derivatives with respect to several inputs, shape (2, n)."""
        rows = self._rows.take([RELATIVE_INPUTS.index(name) for name in weights])
        if len(weights) == 1 and all(isinstance(w, float) and w == 1 for w in weights.values()):
            return rows[:, 0]
        return np.asarray(sum(weight * rows[:, i] for i, weight in enumerate(weights.values())))

    def _by_factors(self, change: CurveSensitivity) -> FloatArray:
        """Differentiate contact time and velocity with respect to the factors of the curve, see CurveSensitivity."""
        solution, relative = self.solution, self.solution.request.relative
        total = np.where(solution.status == ContactStatus.CONTACT, np.zeros((2, 1)), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):  # l' may be 0 without contact
            if change.output:
                total = total + change.output * self._rows.degree * self._weighted_sum({"gain": relative.gain})
            if change.shift:
                earlier = 1 / solution.raw("relative_velocity")
                bend = relative.a - solution.settled_acceleration
                total = total + change.shift * (self._weighted_sum({"p": 1.0}) + np.stack([earlier, bend * earlier]))
            if change.stretch:
                whole = self._weighted_sum({name: getattr(relative, name) for name in _LENGTHS})
                whole[1] -= solution.raw("relative_velocity")
                total = total + change.stretch * whole
        return total


class ManyGradients:
    """Derivatives at contact for encounters with different sensor curves.

    The members are those of ContactGradients.
    """

    __slots__ = ("inputs", "parts", "quantities")

    def __init__(self, parts: list[ContactGradients]) -> None:
        self.parts, self.quantities, self.inputs = parts, parts[0].quantities, parts[0].inputs

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a contact quantity with respect to an input."""
        return np.stack([part.of(quantity, by) for part in self.parts], axis=-1)

    def unit(self, quantity: str, by: str) -> str:
        """Return the SI unit of a derivative of a contact quantity."""
        return self.parts[0].unit(quantity, by)


@dataclass(frozen=True, slots=True)
class _Change:
    """Derivatives of all contact quantities with respect to one input.

    All but those of time and l' follow from these two by algebra.

    Args:
        solution: the encounters and their contacts.
        rows: the derivatives of time and l'.
        by: the name of the input q.
        time: dt/dq of each run.
        relative_velocity: dl'/dq.
        inputs: derivatives of the relative inputs of L(9) by q, by their names.
        slope: dg(0)/dq.
    """

    solution: ContactSource
    rows: ContactRows
    by: str
    time: FloatArray
    relative_velocity: FloatArray
    inputs: dict[str, float] = field(default_factory=dict)
    slope: float = 0.0

    @property
    def displacement(self) -> Any:
        """The displacement at contact, differentiated with respect to the input.

        At contact, the displacement equals the obstacle position x_o(t).
        """
        time, r, i = self.solution.raw("time"), self.solution.request.relative, self.inputs
        direct = i.get("p", 0.0) + (i.get("v", 0.0) + i.get("a", 0.0) * time / 2) * time
        return (r.v + r.a * time) * self.time + direct

    @property
    def displacement_velocity(self) -> Any:
        """The displacement velocity at contact, differentiated with respect to the input.

        The relative velocity at contact gives x~' = x_o' - l'.
        """
        direct = self.inputs.get("v", 0.0) + self.inputs.get("a", 0.0) * self.solution.raw("time")
        return direct + self.solution.request.relative.a * self.time - self.relative_velocity

    @property
    def virtual_force(self) -> Any:
        """The virtual force at contact, differentiated with respect to the input.

        At contact, F_p = D_p g(0) l' for the damper, and F = -phi (g(0) l')^2 for the drag.
        """
        s = self.solution
        slope, number, speed = (
            float(s.request.sensor.log_slope(0.0)),
            s.request.relative.gain,
            s.raw("relative_velocity"),
        )
        rate, change = slope * speed, slope * self.relative_velocity + self.slope * speed
        direct = self.inputs.get("gain", 0.0) * rate
        return direct + number * change if self.rows.degree == 1 else -(direct + 2 * number * change) * rate

    @property
    def displacement_acceleration(self) -> Any:
        """The displacement acceleration at contact, differentiated with respect to the input.

        The admittance gives x~'' = (F_p - D x~' - K x~) / M.
        """
        s, r = self.solution, self.solution.request.relative
        total = self.virtual_force
        if "mass" in self.inputs:
            total = total - s.settled_acceleration
        if self.rows.suspends_admittance:
            return total / r.mass
        total = total - r.damping * self.displacement_velocity - r.stiffness * self.displacement
        if "damping" in self.inputs:
            total = total - s.raw("displacement_velocity")
        if "stiffness" in self.inputs:
            total = total - s.raw("displacement")
        return total / r.mass

    @property
    def position(self) -> Any:
        """The robot's absolute position at contact, differentiated with respect to the input."""
        time = self.solution.raw("time")
        direct = {"reference.position": 1.0, "reference.velocity": time, "reference.acceleration": time**2 / 2}
        return self.displacement + self.solution.reference(1) * self.time + direct.get(self.by, 0.0)

    @property
    def velocity(self) -> Any:
        """The robot's absolute velocity at contact, differentiated with respect to the input."""
        direct = {"reference.velocity": 1.0, "reference.acceleration": self.solution.raw("time")}
        return self.displacement_velocity + self.solution.reference(2) * self.time + direct.get(self.by, 0.0)

    @property
    def acceleration(self) -> Any:
        """The robot's absolute acceleration at contact, differentiated with respect to the input."""
        return self.displacement_acceleration + (1.0 if self.by == "reference.acceleration" else 0.0)


def _in_parentheses(unit: str) -> str:
    return f"({unit})" if "/" in unit or "*" in unit else unit
