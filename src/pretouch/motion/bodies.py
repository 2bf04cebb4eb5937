"""Describe the obstacle, the robot and the reference position of an encounter."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch._core.numbers import float_or_array
from pretouch._core.values import Value


@dataclass(frozen=True, slots=True, kw_only=True)
class _Body(Value):
    """Base class of obstacle, robot and reference position in an encounter."""

    def __post_init__(self) -> None:
        check_declared(self, arrays=True, before=f"{type(self).__name__.lower()} ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch(_Body):
    """One section of the obstacle's motion, during which its acceleration is constant.

    Position and velocity are continuous between sections. An abrupt stop is a short stretch with a large acceleration;
    a thrown object has the acceleration of gravity.

    Args:
        until: end time of the stretch [s], from the start of the encounter; positive, and later than the previous one.
        acceleration: x_o'' during the stretch [m/s^2].
    """

    until: Any = quantity("s", sign="positive", example='"0.1 s"')
    acceleration: Any = quantity("m/s^2", 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle(_Body):
    """Motion of the object in front of the robot.

    Its acceleration is constant, or constant in each section of a `course`. Without a `course`, the obstacle moves as
    in L(9). Position and velocity are those of the object's contact surface.

    Args:
        position: x_o at t = 0 [m].
        velocity: x_o' at t = 0 [m/s]; negative for an approach.
        acceleration: x_o'' [m/s^2], constant; with a course, it applies after the end of the course.
        course: initial stretches of constant acceleration, the same number in all encounters. Their values broadcast as
            all fields do. In continuous time, the virtual damper solves a course by Taylor series, and other
            laws by numerical integration.

    Examples:
        >>> approaches_and_stops = Obstacle(
        ...     position=0.05,
        ...     velocity=-0.3,
        ...     course=(Stretch(until=0.1), Stretch(until=0.2, acceleration=3.0)),
        ... )
        >>> approaches_and_stops.velocity_at([0.0, 0.1, 0.15, 0.2, 1.0]).round(3)
        array([-0.3 , -0.3 , -0.15,  0.  ,  0.  ])
    """

    position: Any = quantity("m", example='"42.2 mm"')
    velocity: Any = quantity("m/s", 0.0)
    acceleration: Any = quantity("m/s^2", 0.0)
    course: tuple[Stretch, ...] = ()

    def __post_init__(self) -> None:
        _Body.__post_init__(self)
        stretches: Any = self.course
        if not isinstance(stretches, (tuple, list)) or not all(isinstance(s, Stretch) for s in stretches):
            raise InvalidInputError(
                f"obstacle course: found {stretches!r}, expected a list or tuple of Stretch objects, one for "
                "each section of the obstacle's motion",
                value=stretches,
            )
        object.__setattr__(self, "course", tuple(stretches))
        for before, after in pairwise(self.course):
            try:
                later = np.greater(after.until, before.until)
            except ValueError:
                return  # the shapes do not broadcast; the scenario reports this
            if not later.all():
                raise InvalidInputError(
                    "obstacle course: the end times of the Stretch objects must increase, but "
                    f"{_first(before.until, ~later):g} s is followed by {_first(after.until, ~later):g} s"
                )

    def velocity_at(self, time: Any) -> Any:
        """Return the obstacle's velocity [m/s] at given times [s].

        Time 0 is the start of the encounter. A contact does not change this motion.
        """
        t, since, velocity = np.asarray(time, dtype=np.float64), 0.0, self.velocity
        for stretch in self.course:
            velocity = velocity + stretch.acceleration * np.clip(t - since, 0.0, stretch.until - since)
            since = stretch.until
        remaining = t - since if not self.course else np.maximum(t - since, 0.0)
        return float_or_array(velocity + self.acceleration * remaining)

    def position_at(self, time: Any) -> Any:
        """Return the obstacle's position [m] at given times [s].

        Time 0 is the start of the encounter. A contact does not change this motion.
        """
        t, since, position, velocity = np.asarray(time, dtype=np.float64), 0.0, self.position, self.velocity
        for stretch in self.course:
            passed = np.clip(t - since, 0.0, stretch.until - since)
            position = position + (velocity + 0.5 * stretch.acceleration * passed) * passed
            velocity = velocity + stretch.acceleration * passed
            since = stretch.until
        remaining = t - since if not self.course else np.maximum(t - since, 0.0)
        return float_or_array(position + (velocity + 0.5 * self.acceleration * remaining) * remaining)

    def one_acceleration(self) -> Any:
        """Return the obstacle's acceleration [m/s^2] if it is constant.

        Raises:
            InvalidInputError: the obstacle has a course.
        """
        if self.course:
            raise InvalidInputError(
                f"obstacle course: found {len(self.course)} Stretch objects, expected none; use find_contact, "
                "design or simulate instead. This solver needs an obstacle with constant acceleration"
            )
        return self.acceleration


def _first(value: Any, which: Any) -> float:
    return float(np.broadcast_to(value, np.shape(which))[which].flat[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant(_Body):
    """Initial position and velocity of the robot's contact surface.

    Args:
        position: x at t = 0 [m].
        velocity: x' at t = 0 [m/s].
    """

    position: Any = quantity("m", 0.0)
    velocity: Any = quantity("m/s", 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference(_Body):
    """The reference position x_d of the robot's task.

    It may move with uniform acceleration.

    Args:
        position: x_d at t = 0 [m].
        velocity: x_d' at t = 0 [m/s].
        acceleration: x_d'' [m/s^2], constant.
    """

    position: Any = quantity("m", 0.0)
    velocity: Any = quantity("m/s", 0.0)
    acceleration: Any = quantity("m/s^2", 0.0)
