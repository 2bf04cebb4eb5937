"""Describe an encounter of robot and obstacle, and change its inputs by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, check_types, quantity, units_of_fields
from pretouch._core.numbers import FloatArray, float_or_array, nonnegative, positive
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .bodies import Obstacle, Plant, Reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Admittance(Value):
    """Virtual mass, damping and stiffness of the admittance controller.

    They are the parameters of L(1). Each is a number or an array.

    Args:
        mass: M_a > 0 [kg], the virtual mass; the inertia of the robot does not matter here.
        damping: D_a >= 0 [N s/m].
        stiffness: K_a >= 0 [N/m].

    Examples:
        >>> Admittance(mass=1.0, damping=10.0, stiffness=25.0).damping_ratio
        1.0
    """

    mass: Any = quantity("kg", sign="positive", example='"1 kg"')
    damping: Any = quantity("N*s/m", sign="nonnegative", example='"10 N*s/m"')
    stiffness: Any = quantity("N/m", sign="nonnegative", example='"25 N/m"')

    def __post_init__(self) -> None:
        check_declared(self, arrays=True)

    @classmethod
    def from_natural_frequency(
        cls, *, mass: ArrayLike, natural_frequency: ArrayLike, damping_ratio: ArrayLike = 1.0
    ) -> Admittance:
        """Create an admittance from natural frequency and damping ratio.

        The default damping ratio is 1, which is critical damping.

        Args:
            mass: M_a > 0 [kg].
            natural_frequency: sqrt(K_a / M_a) >= 0 [rad/s].
            damping_ratio: D_a / (2 sqrt(M_a K_a)) >= 0.

        Returns:
            The admittance.

        Examples:
            >>> Admittance.from_natural_frequency(mass=1.0, natural_frequency=5.0)
            Admittance(mass=1.0, damping=10.0, stiffness=25.0)
        """
        m = np.asarray(positive(mass, "mass", "kg"))
        omega = np.asarray(nonnegative(natural_frequency, "natural_frequency", "rad/s"))
        zeta = np.asarray(nonnegative(damping_ratio, "damping_ratio"))
        return cls(mass=m, damping=2 * zeta * omega * m, stiffness=omega**2 * m)

    @property
    def natural_frequency(self) -> Any:
        """The undamped natural frequency of the admittance, sqrt(K_a / M_a) [rad/s]."""
        return float_or_array(np.sqrt(np.asarray(self.stiffness) / self.mass))

    @property
    def damping_ratio(self) -> Any:
        """The damping ratio of the admittance, D_a / (2 sqrt(M_a K_a)).

        Raises:
            InvalidInputError: the stiffness is zero.
        """
        if np.any(np.asarray(self.stiffness) == 0):
            raise InvalidInputError("damping_ratio: not defined for a stiffness of 0 N/m; use the damping")
        return float_or_array(np.asarray(self.damping) / (2 * np.sqrt(np.asarray(self.stiffness) * self.mass)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario(Described, Value):
    """One or several encounters of robot and object.

    If inputs are arrays, the scenario is an array of encounters. Positions are absolute; x points away from the sensor,
    so the distance is l = x_o - x and an approach has l' < 0. Time starts when the object enters the detection range.

    Args:
        admittance: the virtual dynamics of L(1).
        obstacle: the object's contact surface.
        plant: the robot's contact surface at the start; at rest at 0 m by default.
        reference: the task's reference x_d; at rest at 0 m by default.

    Attributes:
        shape: the broadcast shape of all fields; `()` for one encounter.

    Examples:
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> scenario.distance, scenario.relative_velocity
        (0.0422, -0.3)
    """

    admittance: Admittance
    obstacle: Obstacle
    plant: Plant = field(default_factory=Plant)
    reference: Reference = field(default_factory=Reference)
    shape: tuple[int, ...] = field(init=False, repr=False, compare=False)

    __str__ = object.__str__  # its fields, not its page

    def __post_init__(self) -> None:
        check_types(self)
        values = self._values()
        try:
            shape = () if all(type(v) is float for v in values) else np.broadcast_shapes(*map(np.shape, values))
        except ValueError:
            shapes = ", ".join(sorted({str(np.shape(v)) for v in values if np.ndim(v)}))
            raise InvalidInputError(
                f"scenario: the array arguments have the shapes {shapes}. These shapes do not broadcast together; use "
                "arrays of equal shape"
            ) from None
        object.__setattr__(self, "shape", shape)
        if not (self.distance > 0 if shape == () else np.all(self.distance > 0)):
            least = float(np.min(self.distance))
            raise InvalidInputError(
                f"obstacle position: the distance between obstacle and robot is {least:g} m, but must be "
                "positive at the start of an encounter"
            )

    @property
    def distance(self) -> Any:
        """The distance between robot and object at the start [m]."""
        return self.obstacle.position - self.plant.position

    @property
    def relative_velocity(self) -> Any:
        """The object's initial velocity relative to the robot [m/s].

        It is negative for an approach.
        """
        return self.obstacle.velocity - self.plant.velocity

    def relative_columns(self, *, with_course: bool = False) -> tuple[Any, ...]:
        """Return the inputs of the encounter relative to the reference position.

        The motions are those of L(9).

        Args:
            with_course: whether the obstacle may have a course; its acceleration is then the one after the course.

        Returns:
            M_a, D_a, K_a, x~(0), x~'(0); x_o - x_d at t = 0, its velocity and its acceleration; velocity and
            acceleration of the reference itself. Each is a float, or an array with the shape of its field.
        """
        a, o, p, r = self.admittance, self.obstacle, self.plant, self.reference
        _check_rounding("position [m]", o.position, p.position, r.position)
        _check_rounding("velocity [m/s]", o.velocity, p.velocity, r.velocity)
        return (
            a.mass,
            a.damping,
            a.stiffness,
            _relative_to(p.position, r.position),
            _relative_to(p.velocity, r.velocity),
            _relative_to(o.position, r.position),
            _relative_to(o.velocity, r.velocity),
            _relative_to(o.acceleration if with_course else o.one_acceleration(), r.acceleration),
            r.velocity,
            r.acceleration,
        )

    def relative(self) -> FloatArray:
        """Return the inputs, relative to the reference position, in one array.

        Returns:
            The columns, stacked along a last axis of 10 over the broadcast shape.
        """
        return np.stack(np.broadcast_arrays(*self.relative_columns()), axis=-1).astype(np.float64)

    def _values(self) -> tuple[Any, ...]:
        a, o, p, r = self.admittance, self.obstacle, self.plant, self.reference
        return (
            *(a.mass, a.damping, a.stiffness),
            *(o.position, o.velocity, o.acceleration),
            *(number for stretch in o.course for number in (stretch.until, stretch.acceleration)),
            *(p.position, p.velocity),
            *(r.position, r.velocity, r.acceleration),
        )


def _check_rounding(quantity_and_unit: str, obstacle: Any, plant: Any, reference: Any) -> None:
    """Raise an error if a large reference value causes rounding errors."""
    if isinstance(reference, float) and reference == 0:
        return
    difference = np.subtract(obstacle, plant)
    lost = np.abs((np.subtract(obstacle, reference) - np.subtract(plant, reference)) - difference)
    wrong = ~(lost <= _LOST * np.abs(difference))
    if np.any(wrong):
        name, unit = quantity_and_unit.removesuffix("]").split(" [")
        first = float(np.broadcast_to(reference, np.shape(wrong))[wrong].flat[0])
        raise InvalidInputError(
            f"reference {name}: found the value {first:g} {unit}, expected a smaller value. For so large a value, "
            "rounding hides the difference between obstacle and robot. Choose another origin for the "
            f"{name} of obstacle, robot and reference",
            value=first,
        )


def _relative_to(value: Any, reference: Any) -> Any:
    """Subtract a reference value, unless it is 0."""
    return value if isinstance(reference, float) and reference == 0 else value - reference


_LOST: Final = 1e-6
"""Largest relative rounding error of the initial distance and relative velocity."""

_PARTS: Final = {"admittance": Admittance, "obstacle": Obstacle, "plant": Plant, "reference": Reference}
_FREQUENCY: Final = {"admittance.natural_frequency": "rad/s", "admittance.damping_ratio": ""}
SCENARIO_INPUTS: Final[dict[str, str]] = {
    name: unit
    for part, cls in _PARTS.items()
    for name, unit in (
        *((f"{part}.{name}", unit) for name, unit in units_of_fields(cls).items()),
        *(_FREQUENCY.items() if part == "admittance" else ()),
    )
}
"""The inputs of a scenario with their SI units; each may differ between the encounters of one call."""

_OF_DAMPING: Final = {"admittance.damping", "admittance.stiffness"}


def sensor_inputs(sensor: SensorModel) -> dict[str, str]:
    """Return the SI units of a sensor curve's parameters.

    The keys are input names such as `sensor.exponent`.
    """
    return {f"sensor.{name}": unit for name, unit in sensor.parameter_units.items()}


def input_units(sensor: SensorModel) -> dict[str, str]:
    """Return the SI units of all inputs of encounter and sensor.

    The keys are input names such as `obstacle.velocity`.
    """
    return {**SCENARIO_INPUTS, **sensor_inputs(sensor)}


def sensor_with(sensor: SensorModel, values: Mapping[str, float]) -> SensorModel:
    """Return a copy of a sensor curve with new parameter values.

    The values are in SI units.
    """
    return sensor.with_parameters(values)


def map_fields(scenario: Scenario, change: Callable[[Any], Any]) -> Scenario:
    """Apply a function to every number or array of an encounter."""

    def changed(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(changed, value))
        if is_dataclass(value) and not isinstance(value, type):
            return replace(value, **{f.name: changed(getattr(value, f.name)) for f in fields(value)})
        return change(value)

    return replace(scenario, **{part: changed(getattr(scenario, part)) for part in _PARTS})


def scenario_with(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """Return a copy of an encounter with new input values.

    The values may be arrays. Changing mass, damping or stiffness keeps the other two. Changing natural frequency or
    damping ratio keeps the other one of these and the mass.

    Args:
        scenario: one encounter.
        values: values in SI by input name, keys of SCENARIO_INPUTS.

    Returns:
        The encounters.

    Examples:
        >>> from pretouch.motion import Obstacle
        >>> still = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.04)
        ... )
        >>> scenario_with(still, {"obstacle.velocity": -0.3, "admittance.natural_frequency": 10.0}).admittance
        Admittance(mass=1.0, damping=20.0, stiffness=100.0)
    """
    changes: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        part, _, rest = name.partition(".")
        changes.setdefault(part, {})[rest] = value
    parts: dict[str, Any] = {}
    for part, new in changes.items():
        if part == "admittance":
            parts[part] = _admittance_with(scenario.admittance, new)
        else:
            parts[part] = replace(getattr(scenario, part), **new)
    return replace(scenario, **parts) if parts else scenario


def _admittance_with(admittance: Admittance, values: dict[str, Any]) -> Admittance:
    """Return a copy of an admittance with new parameter values."""
    names = {f"admittance.{name}" for name in values}
    if not names & _FREQUENCY.keys():
        return replace(admittance, **values)
    if names & _OF_DAMPING:
        conflicting = ", ".join(sorted(names - {"admittance.mass"}))
        raise InvalidInputError(
            f"inputs: the inputs {conflicting} conflict; give either damping and stiffness, or natural frequency "
            "and damping ratio"
        )
    if "damping_ratio" in values:
        ratio = values["damping_ratio"]
    elif np.all(np.asarray(admittance.stiffness) > 0):
        ratio = admittance.damping_ratio
    else:
        raise InvalidInputError(
            "inputs: found admittance.natural_frequency for a stiffness of 0 N/m, whose damping ratio is not defined; "
            "also give admittance.damping_ratio"
        )
    return Admittance.from_natural_frequency(
        mass=values.get("mass", admittance.mass),
        natural_frequency=values.get("natural_frequency", admittance.natural_frequency),
        damping_ratio=ratio,
    )
