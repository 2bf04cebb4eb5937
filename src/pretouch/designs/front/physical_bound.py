"""Compute the smallest possible excursion and contact speed.

They hold for every controller of a robot with limited acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite, float_or_array, nonnegative, positive
from pretouch._core.values import Value
from pretouch.motion import Scenario

_ROUNDING: Final = 1e-9  # relative rounding error of a time


# An obstacle at distance l0 approaches with the velocity v + a t. The robot is at rest, can accelerate by at most A,
# and retreats without first moving toward the obstacle. Contact is after an excursion d, with the contact speed w.
#
#     1. The obstacle passes -d with the speed |v_T| = sqrt(v^2 - 2 a (l0 + d)), for every motion of the robot.
#     2. After its last moment at rest, the robot gains s^2 / 2 = -int x'' dx <= A d, so its speed is s <= sqrt(2 A d).
#     3. w = |v_T| - s, and the robot needs at least the time sqrt(2 d / A) to be there.
#
# So w >= |v_T(d)| - sqrt(2 A d), which falls with d. A robot that waits and then retreats by A reaches equality, so
# this is the best motion. With y = sqrt(2 d), the smallest excursion for a contact speed w solves
#
#     (A + a) y^2 + 2 w sqrt(A) y + w^2 - (v^2 - 2 a l0) = 0,
#
# which for a = 0 is d = (|v| - w)^2 / (2 A). Retreating by A from the start gives the smallest contact speed,
# w^2 = v^2 - 2 (A + a) l0, or zero. docs/how-to/trade-offs.md has the whole derivation, also with a speed limit.
@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicalBound(Value):
    """The smallest excursion and contact speed of any controller.

    The ideal robot is at rest at its reference when the object is detected. From then on it knows distance and speed of
    the object. It retreats without first moving toward the object, and accelerates without delay up to its limit.

    Args:
        distance: distance l0 > 0 at detection [m].
        velocity: velocity of the obstacle at detection [m/s], negative.
        acceleration: constant acceleration of the obstacle [m/s^2].
        acceleration_limit: A > 0, the largest acceleration of the robot [m/s^2]; a number or an array.
        speed_limit: largest speed of the robot > 0 [m/s]; infinite for none.

    Examples:
        >>> bound = PhysicalBound(distance=0.0422, velocity=-0.3, acceleration_limit=2.0)
        >>> bound.least_contact_speed
        0.0
        >>> round(bound.excursion(0.0), 6), round(bound.excursion(0.1), 6)
        (0.0225, 0.01)
    """

    distance: float
    velocity: float
    acceleration: float = 0.0
    acceleration_limit: Any
    speed_limit: float = math.inf

    def __post_init__(self) -> None:
        check_types(self)
        positive(self.distance, "distance", "m")
        if not finite(self.velocity, "velocity", "m/s") < 0:
            raise InvalidInputError(
                f"velocity: found {self.velocity:g} m/s, expected a negative number. With a negative velocity, the "
                "obstacle approaches the robot",
                value=self.velocity,
            )
        finite(self.acceleration, "acceleration", "m/s^2")
        object.__setattr__(self, "acceleration_limit", positive(self.acceleration_limit, "acceleration_limit", "m/s^2"))
        if not (self.speed_limit > 0):
            raise InvalidInputError(
                f"speed_limit: found {self.speed_limit:g} m/s, expected a positive number", value=self.speed_limit
            )

    @property
    def least_contact_speed(self) -> Any:
        """The smallest possible contact speed [m/s].

        There is one value for each limit of the robot's acceleration.
        """
        a, limit, v, room = self.acceleration, np.asarray(self.acceleration_limit), self.velocity, self.distance
        free = np.sqrt(np.maximum(v**2 - 2 * (limit + a) * room, 0.0))
        if math.isinf(self.speed_limit):
            return float_or_array(free)
        top = self.speed_limit
        time = top / limit  # time until the robot is at its largest speed
        distance = room + v * time + (a + limit) * time**2 / 2
        approach = v + a * time + top
        early = _arrival(room, v, a + limit) <= time  # contact before that time
        if a <= 0:
            late = np.maximum(np.sqrt(v**2 - 2 * a * (room + top**2 / (2 * limit))) - top, 0.0)
        else:
            late = np.where(approach < 0, np.sqrt(np.maximum(approach**2 - 2 * a * distance, 0.0)), 0.0)
        return float_or_array(np.where(early, free, late))

    def excursion(self, contact_speed: ArrayLike) -> Any:
        """Return the smallest possible excursion for a contact speed.

        Args:
            contact_speed: w = |l'| >= 0 at contact [m/s]; it broadcasts with the acceleration limit.

        Returns:
            The excursion [m]: 0 if the robot may stay at rest, NaN if no robot with this limit reaches that speed.
        """
        w = np.asarray(nonnegative(contact_speed, "contact_speed", "m/s"))
        limit, a = np.asarray(self.acceleration_limit), self.acceleration
        arrival = (
            self.velocity**2 - 2 * a * self.distance
        )  # square of the obstacle's speed at the robot's rest position
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(w**2 * limit + (limit + a) * (arrival - w**2))
            y = (arrival - w**2) / (w * np.sqrt(limit) + root)
            needed = np.where(arrival <= w**2, 0.0, y**2 / 2)
            if math.isfinite(self.speed_limit):
                needed = np.where(np.sqrt(2 * limit * needed) > self.speed_limit, self._slow(w), needed)
            in_time = self._duration(needed) <= self._time(needed) * (1 + _ROUNDING)
        return float_or_array(np.where(in_time, needed, np.nan))

    def time(self, contact_speed: ArrayLike) -> Any:
        """Return the time to contact with the smallest excursion [s].

        NaN if the contact speed is out of reach.
        """
        return float_or_array(self._time(np.asarray(self.excursion(contact_speed))))

    def least_acceleration(self, contact_speed: ArrayLike) -> Any:
        """Return the smallest necessary acceleration for a contact speed.

        The acceleration is in m/s^2, the contact speed in m/s. For every excursion, it is (v^2 - w^2) / (2 l0) - a.
        """
        w = np.asarray(nonnegative(contact_speed, "contact_speed", "m/s"))
        return float_or_array(np.maximum((self.velocity**2 - w**2) / (2 * self.distance) - self.acceleration, 0.0))

    def _slow(self, w: FloatArray) -> FloatArray:
        """Return the excursion at which a braking obstacle reaches top speed plus contact speed; NaN otherwise."""
        if self.acceleration <= 0:
            return np.full(np.shape(w), np.nan)
        return np.asarray((self.velocity**2 - (w + self.speed_limit) ** 2) / (2 * self.acceleration) - self.distance)

    def _time(self, excursion: FloatArray) -> FloatArray:
        """Return the time at which the obstacle reaches the retreated robot."""
        return _arrival(self.distance + excursion, self.velocity, self.acceleration)

    def _duration(self, excursion: FloatArray) -> FloatArray:
        """Return the shortest time for a given excursion of the robot."""
        limit, top = np.asarray(self.acceleration_limit), self.speed_limit
        short = np.sqrt(2 * excursion / limit)
        if math.isinf(top):
            return np.asarray(short)
        return np.asarray(np.where(short * limit <= top, short, top / limit + (excursion - top**2 / 2 / limit) / top))


@check_arguments
def find_physical_bound(
    scenario: Scenario, *, acceleration_limit: ArrayLike, speed_limit: float = math.inf
) -> PhysicalBound:
    """Find the smallest excursion and contact speed of any controller.

    Args:
        scenario: one encounter, with the plant at rest at its reference; the admittance has no effect.
        acceleration_limit: the largest acceleration of the robot > 0 [m/s^2]; a number or an array.
        speed_limit: largest speed of the robot > 0 [m/s].

    Returns:
        The bound.

    Raises:
        InvalidInputError: the plant is not at rest at its reference, or the obstacle does not approach.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> round(find_physical_bound(scenario, acceleration_limit=1.0).least_contact_speed, 4)
        0.0748
    """
    reason = why_no_bound(scenario)
    if reason:
        raise InvalidInputError(f"scenario: {reason}")
    return PhysicalBound(
        distance=float(scenario.distance),
        velocity=float(scenario.obstacle.velocity),
        acceleration=float(scenario.obstacle.acceleration),
        acceleration_limit=acceleration_limit,
        speed_limit=speed_limit,
    )


def why_no_bound(scenario: Scenario) -> str:
    """Return why the physical bound is not valid.

    The text is empty if the bound is valid for the encounter.
    """
    moving = (scenario.plant.velocity, scenario.reference.velocity, scenario.reference.acceleration)
    if any(np.ndim(v) for v in (scenario.distance, scenario.relative_velocity, scenario.obstacle.acceleration)):
        return "found an array of encounters, expected one"
    if any(np.any(np.asarray(v) != 0) for v in moving) or scenario.plant.position != scenario.reference.position:
        return "found a plant that is not at rest at its reference, expected one that is"
    if scenario.obstacle.course:
        return "found an obstacle with a course, expected a constant acceleration"
    if not scenario.obstacle.velocity < 0:
        return "found an obstacle that does not approach, expected a negative velocity"
    return ""


def _arrival(distance: Any, velocity: Any, acceleration: Any) -> FloatArray:
    """Return the time to cover a distance at constant acceleration.

    Infinite if the object never covers the distance. It solves distance + velocity t + acceleration t^2 / 2 = 0 for a
    velocity below 0.
    """
    square = np.asarray(velocity**2 - 2 * acceleration * distance)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(square >= 0, 2 * distance / (np.sqrt(np.maximum(square, 0)) - velocity), np.inf))
