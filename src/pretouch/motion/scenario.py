"""The encounter: obstacle, plant and reference, all absolute, from the moment the object enters the range."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pretouch._core.declared import check_declared, quantity
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

from .admittance import Admittance

__all__ = ["Obstacle", "Plant", "Reference", "Scenario"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Body(Value):
    def __post_init__(self) -> None:
        check_declared(self, arrays=True, before=f"{type(self).__name__.lower()} ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle(_Body):
    """The object's contact surface, uniformly accelerated, L(9).

    Args:
        position: x_o at t = 0 [m].
        velocity: x_o' at t = 0 [m/s]; negative where it approaches.
        acceleration: x_o'' [m/s^2], constant.
    """

    position: Any = quantity("m", example='"42.2 mm"')
    velocity: Any = quantity("m/s", 0.0)
    acceleration: Any = quantity("m/s^2", 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant(_Body):
    """The robot's contact surface at the start.

    Args:
        position: x at t = 0 [m].
        velocity: x' at t = 0 [m/s].
    """

    position: Any = quantity("m", 0.0)
    velocity: Any = quantity("m/s", 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference(_Body):
    """The task's reference x_d, uniformly accelerated.

    Args:
        position: x_d at t = 0 [m].
        velocity: x_d' at t = 0 [m/s].
        acceleration: x_d'' [m/s^2], constant.
    """

    position: Any = quantity("m", 0.0)
    velocity: Any = quantity("m/s", 0.0)
    acceleration: Any = quantity("m/s^2", 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario(Value):
    """One encounter, or an array of them: every field broadcasts with every other.

    Positions are absolute; x points away from the sensor, so the distance is l = x_o - x and an approach has
    l' < 0. Time starts when the object enters the detection range.

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

    def __post_init__(self) -> None:
        values = self._values()
        try:
            shape = () if all(type(v) is float for v in values) else np.broadcast_shapes(*map(np.shape, values))
        except ValueError:
            shapes = ", ".join(sorted({str(np.shape(v)) for v in values if np.ndim(v)}))
            raise InvalidInputError(f"scenario: the shapes {shapes} of its fields do not broadcast") from None
        object.__setattr__(self, "shape", shape)
        if not (self.distance > 0 if shape == () else np.all(self.distance > 0)):
            least = float(np.min(self.distance))
            raise InvalidInputError(
                f"obstacle position: found a distance of {least:g} m between obstacle and plant, "
                "which must be positive: the encounter starts before contact"
            )

    @property
    def distance(self) -> Any:
        """The distance l at t = 0 [m], epsilon in the letter's closed form."""
        return self.obstacle.position - self.plant.position

    @property
    def relative_velocity(self) -> Any:
        """The relative velocity l' at t = 0 [m/s], mu in the letter's closed form."""
        return self.obstacle.velocity - self.plant.velocity

    def relative_columns(self) -> tuple[Any, ...]:
        """Return the admittance, and plant and obstacle at t = 0 relative to the reference, as L(9) has them.

        Returns:
            M_a, D_a, K_a, x~(0), x~'(0), x_o - x_d at t = 0, its velocity and its acceleration, then velocity and
            acceleration of the reference itself: each a float or an array of its own shape.
        """
        a, o, p, r = self.admittance, self.obstacle, self.plant, self.reference
        return (
            a.mass,
            a.damping,
            a.stiffness,
            _less(p.position, r.position),
            _less(p.velocity, r.velocity),
            _less(o.position, r.position),
            _less(o.velocity, r.velocity),
            _less(o.acceleration, r.acceleration),
            r.velocity,
            r.acceleration,
        )

    def relative(self) -> FloatArray:
        """Return the columns of `relative_columns`, the quantities of L(9), as one array.

        Returns:
            The columns, stacked along a last axis of 10 over the broadcast shape.
        """
        return np.stack(np.broadcast_arrays(*self.relative_columns()), axis=-1).astype(np.float64)

    def _values(self) -> tuple[Any, ...]:
        a, o, p, r = self.admittance, self.obstacle, self.plant, self.reference
        return (
            *(a.mass, a.damping, a.stiffness),
            *(o.position, o.velocity, o.acceleration),
            *(p.position, p.velocity),
            *(r.position, r.velocity, r.acceleration),
        )


def _less(value: Any, reference: Any) -> Any:
    """Subtract the reference; without a copy where it is 0."""
    return value if isinstance(reference, float) and reference == 0 else value - reference
