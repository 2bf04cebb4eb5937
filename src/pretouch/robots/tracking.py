"""Define controllers that compute joint torques from reference motions.

The sensor sites of a robot then follow these motions.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value


@dataclass(frozen=True, slots=True)
class JointState:
    """State and reference of the driven joints at one moment.

    Args:
        position: q [rad or m], shape (n,).
        velocity: q' [rad/s or m/s], shape (n,).
        reference: q of the reference, shape (n,).
        reference_velocity: q' of the reference, shape (n,).
        reference_acceleration: q'' of the reference, shape (n,).
        inertia: inertia that the drives feel, shape (n, n).
        load: torques that keep the joints from accelerating, shape (n,).
        held: function that returns the Jacobian of all directions that the sites move along or hold, shape (k, n).
    """

    position: FloatArray
    velocity: FloatArray
    reference: FloatArray
    reference_velocity: FloatArray
    reference_acceleration: FloatArray
    inertia: FloatArray
    load: FloatArray
    held: Callable[[], FloatArray]


@dataclass(frozen=True, slots=True)
class JointFeedback:
    """Coefficients of a joint controller with inverse dynamics.

    The torques are scale (inertia (c_a q_r'' + c_v q_r' - c_d q' + c_p (q_r - q)) + load).

    Args:
        acceleration: c_a, share of the reference's acceleration.
        velocity: c_v, gain of the reference's velocity [1/s].
        damping: c_d, gain of the joint's velocity [1/s].
        stiffness: c_p, gain of the position error [1/s^2].
        scale: factor of the model of inertia and load.
        interval: time between two references that the controller takes [s]; 0 for every step of the simulation.
        delay: time from there until the controller follows a reference [s].
    """

    acceleration: float
    velocity: float
    damping: float
    stiffness: float
    scale: float = 1.0
    interval: float = 0.0
    delay: float = 0.0


class Tracking(ABC):
    """Base class of joint controllers that follow a reference."""

    __slots__ = ()

    kind: ClassVar[str] = ""
    """Its name in a scenario file; empty for a custom one, which a file cannot name."""

    def feedback(self) -> JointFeedback | None:
        """Return the coefficients with which compiled code computes the torques; None if it calls `torques`."""
        return None

    @abstractmethod
    def torques(self, state: JointState) -> FloatArray:
        """Return the torques [N m or N] of the driven joints.

        With these torques, the joints follow their reference. The shape is (n,).
        """


class FeedbackTracking(Tracking):
    """Base class of joint controllers with inverse dynamics, which `feedback` describes completely."""

    __slots__ = ()

    @abstractmethod
    def feedback(self) -> JointFeedback:
        """Return the coefficients with which compiled code computes the torques."""

    def torques(self, state: JointState) -> FloatArray:
        """Return the torques [N m or N] of the driven joints.

        With these torques, the joints follow their reference. The shape is (n,).
        """
        f = self.feedback()
        wanted = (
            f.acceleration * state.reference_acceleration
            + f.velocity * state.reference_velocity
            - f.damping * state.velocity
            + f.stiffness * (state.reference - state.position)
        )
        torques: FloatArray = f.scale * (state.inertia @ wanted + state.load)
        return torques


@dataclass(frozen=True, slots=True, kw_only=True)
class ComputedTorque(FeedbackTracking, Value):
    """Computed-torque control with feedback of position and velocity.

    It applies the inverse dynamics of the reference motion.

    Args:
        bandwidth: w / (2 pi) of the feedback in every joint [Hz].
        damping_ratio: damping ratio of the feedback.
        model_error: relative error of inertia and load in the controller's model, such as 0.3.
    """

    kind: ClassVar[str] = "computed-torque"

    bandwidth: float = quantity("Hz", 20.0, sign="positive")
    damping_ratio: float = quantity("", 1.0, sign="positive")
    model_error: float = quantity("", 0.0)

    def __post_init__(self) -> None:
        check_declared(self)
        if not self.model_error > -1:
            raise InvalidInputError(
                f"model_error: found {self.model_error:g}, expected more than -1", value=self.model_error
            )

    def feedback(self) -> JointFeedback:
        """Return the coefficients with which compiled code computes the torques."""
        w = 2 * math.pi * self.bandwidth
        damping = 2 * self.damping_ratio * w
        return JointFeedback(1.0, damping, damping, w * w, 1 + self.model_error)


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionControl(FeedbackTracking, Value):
    """A position-controlled robot: every joint follows its reference with a second-order lag.

    The joints obey q'' = w^2 (q_r - q) - 2 zeta w q', like a `PositionPlant`. The controller of an industrial arm takes
    a new position q_r at its own rate only, and follows it some time later. Between two of them, q_r stays constant.

    Args:
        bandwidth: w / (2 pi) of the position loop [Hz].
        damping_ratio: zeta of the position loop.
        rate: rate at which the controller takes positions [Hz], such as 125 Hz; None for every step of the simulation.
        delay: time until the controller follows a position [s].
    """

    kind: ClassVar[str] = "position"

    bandwidth: float = quantity("Hz", 20.0, sign="positive")
    damping_ratio: float = quantity("", 1.0, sign="positive")
    rate: float | None = quantity("Hz", None, sign="positive", example='"125 Hz"')
    delay: float = quantity("s", 0.0, sign="nonnegative", example='"8 ms"')

    def __post_init__(self) -> None:
        check_declared(self)

    def feedback(self) -> JointFeedback:
        """Return the coefficients with which compiled code computes the torques."""
        w = 2 * math.pi * self.bandwidth
        interval = 0.0 if self.rate is None else 1 / self.rate
        return JointFeedback(0.0, 0.0, 2 * self.damping_ratio * w, w * w, interval=interval, delay=self.delay)


@dataclass(frozen=True, slots=True, kw_only=True)
class OperationalSpace(Tracking, Value):
    """Operational-space impedance control of sensor sites.

    Springs and dampers act on the site. The null space holds the posture. Each direction that moves or is held has the
    same natural frequency and damping ratio. Its stiffness is its effective mass times w^2, so that directions in which
    the robot is heavy are stiffer.

    Args:
        bandwidth: w / (2 pi) of the impedance [Hz].
        damping_ratio: damping ratio of the impedance.
        null_bandwidth: w / (2 pi) with which the null space returns to its posture, critically damped [Hz].
        model_error: relative error of inertia and load in the controller's model, such as 0.3.
    """

    kind: ClassVar[str] = "impedance"

    bandwidth: float = quantity("Hz", 10.0, sign="positive")
    damping_ratio: float = quantity("", 1.0, sign="positive")
    null_bandwidth: float = quantity("Hz", 2.0, sign="positive")
    model_error: float = quantity("", 0.0)

    def __post_init__(self) -> None:
        check_declared(self)
        if not self.model_error > -1:
            raise InvalidInputError(
                f"model_error: found {self.model_error:g}, expected more than -1", value=self.model_error
            )

    def torques(self, state: JointState) -> FloatArray:
        """Return the torques [N m or N] of the driven joints.

        With these torques, the joints follow their reference. The shape is (n,).
        """
        inertia, held = state.inertia, state.held()
        inverse = np.linalg.solve(inertia, held.T)
        mobility = held @ inverse
        w, null = 2 * math.pi * self.bandwidth, 2 * math.pi * self.null_bandwidth
        error, rate = state.reference - state.position, state.reference_velocity - state.velocity
        wanted = (
            held @ state.reference_acceleration + 2 * self.damping_ratio * w * (held @ rate) + w * w * (held @ error)
        )
        force = np.linalg.pinv(mobility, rcond=1e-10, hermitian=True) @ wanted
        motion = state.reference_acceleration + 2 * null * rate + null * null * error
        rest = motion - inverse @ (np.linalg.pinv(mobility, rcond=1e-10, hermitian=True) @ (held @ motion))
        torques: FloatArray = (1 + self.model_error) * (held.T @ force + inertia @ rest + state.load)
        return torques


TRACKINGS: Final[dict[str, type[Tracking]]] = {
    cls.kind: cls for cls in (ComputedTorque, OperationalSpace, PositionControl)
}
"""The joint controllers that a scenario file can name, by kind."""
