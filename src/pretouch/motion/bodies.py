"""The bodies of an encounter and how each moves by itself: obstacle, robot, and the task's reference."""

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
    def __post_init__(self) -> None:
        check_declared(self, arrays=True, before=f"{type(self).__name__.lower()} ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch(_Body):
    """A stretch of an obstacle's course, from the end of the one before, or from the start: uniformly accelerated.

    Position and velocity go on without a jump, as those of a body do: one that stops at once has a short, strong
    stretch, one that is thrown has gravity.

    Args:
        until: time at which it ends [s], from the start of the encounter; positive, and later than the one before.
        acceleration: x_o'' until then [m/s^2].
    """

    until: Any = quantity("s", sign="positive", example='"0.1 s"')
    acceleration: Any = quantity("m/s^2", 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle(_Body):
    """The object's contact surface, uniformly accelerated, L(9), or by stretches.

    Args:
        position: x_o at t = 0 [m].
        velocity: x_o' at t = 0 [m/s]; negative where it approaches.
        acceleration: x_o'' [m/s^2], constant; behind a course from its end on.
        course: stretches of constant acceleration that come first, as many in all encounters; their numbers broadcast
            as all fields do. The sampled loop follows a course; the motion of L(9) knows none.

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
        given: Any = self.course
        if not isinstance(given, (tuple, list)) or not all(isinstance(s, Stretch) for s in given):
            raise InvalidInputError(f"obstacle course: found {given!r}, expected a sequence of Stretch")
        object.__setattr__(self, "course", tuple(given))
        for before, after in pairwise(self.course):
            try:
                later = np.greater(after.until, before.until)
            except ValueError:
                return  # shapes that do not broadcast, which the scenario refuses
            if not later.all():
                raise InvalidInputError(
                    f"obstacle course: found a stretch until {_first(after.until, ~later):g} s behind one until "
                    f"{_first(before.until, ~later):g} s, expected each to end later than the one before"
                )

    def velocity_at(self, time: Any) -> Any:
        """Return x_o' [m/s] at times [s] that broadcast with the fields, while nothing has touched it."""
        t, since, velocity = np.asarray(time, dtype=np.float64), 0.0, self.velocity
        for stretch in self.course:
            velocity = velocity + stretch.acceleration * np.clip(t - since, 0.0, stretch.until - since)
            since = stretch.until
        left = t - since if not self.course else np.maximum(t - since, 0.0)
        return float_or_array(velocity + self.acceleration * left)

    def one_acceleration(self) -> Any:
        """Return x_o'' [m/s^2] where it is constant.

        Raises:
            InvalidInputError: there is a course.
        """
        if self.course:
            raise InvalidInputError(
                f"obstacle course: found one of {len(self.course)} stretches, of which the motion with the uniform "
                "acceleration of L(9) knows nothing: run it on the sampled loop, by simulate or ClosedLoop.run"
            )
        return self.acceleration


def _first(value: Any, which: Any) -> float:
    return float(np.broadcast_to(value, np.shape(which))[which].flat[0])


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
