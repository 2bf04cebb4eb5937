"""The controller of the letter's Fig. 1 as a value: what it is made of, its numbers, its first state, its step."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple, Protocol

from pretouch._core.declared import ONE_ROBOT, check_declared, quantity
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite
from pretouch._core.structures import Structure

from .admittance import VirtualAdmittance, discretize
from .blocks import start_drive, start_sensing
from .conditioning import Conditioning
from .limits import NO_LIMIT, Limits, stopping_distance
from .steps import Run, as_step, begin_run
from .structures import ControllerNumbers, ControllerState, DriveNumbers, MotionLimits

__all__ = ["Controller", "Law", "Parts"]


class Law(Protocol):
    """What makes a force of ln xi and of the robot's own motion: a value with its numbers and the step that uses them.

    A new law is a dataclass with these four, and one function, made of `observe`, of what the law itself does, and of
    `drive`: in Python `state, output = step(parameters, state, sample)`, or compiled, see `SampledLaw`.
    """

    @property
    def step(self) -> Any:
        """The whole step of the controller with this law, of Python or compiled."""
        ...

    def numbers(self, period: float) -> Any:
        """Return the law's parameters for the loop's period [s]; a ctypes structure where the step is compiled."""
        ...

    def start(self) -> Any:
        """Return the law's state before the first reading; a ctypes structure where the step is compiled."""
        ...

    def with_gain(self, gain: float) -> Law:
        """Return the same law with another gain [N s]."""
        ...


class Parts(NamedTuple):
    """Parameters or state of a controller whose law is a function of Python: those of sensing, drive and law."""

    sensing: Any
    drive: Any
    law: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller:
    """The sampled controller of the letter's Fig. 1: from readings to a reference for the robot's own controller.

    Args:
        period: T of the loop [s].
        conditioning: from raw readings to ln xi.
        law: what makes a force of it, such as `VirtualDamper`.
        admittance: the virtual dynamics of L(1).
        limits: of virtual force and motion.
        contact_gain: share of the measured contact force that acts in the admittance: 0 where an impedance controller
            follows, which feels it anyway; 1 where a position controller follows, which does not.
        contact_threshold: contact force [N] from which a contact is reported. Nothing is switched at it.

    Examples:
        >>> from pretouch.control import VirtualDamper
        >>> controller = Controller(
        ...     period=1e-3,
        ...     conditioning=Conditioning(floor=0.01),
        ...     law=VirtualDamper(gain=-0.7),
        ...     admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ... )
        >>> run = controller.begin()
        >>> _ = run.step(reading=0.100)
        >>> round(run.step(reading=0.101).virtual_force, 3)  # -0.7 N s x ln(0.101 / 0.100) in 1 ms
        -6.965
    """

    period: float = quantity("s", sign="positive")
    conditioning: Conditioning = field()
    law: Law = field()
    admittance: VirtualAdmittance = field()
    limits: Limits = field(default_factory=Limits)
    contact_gain: float = quantity("", 0.0, sign="nonnegative")
    contact_threshold: float = quantity("N", 1.0, sign="positive")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)
        if self.contact_gain > 1:
            raise InvalidInputError(f"contact_gain: found {self.contact_gain:g}, expected a share from 0 to 1")
        self.conditioning.numbers(self.period)  # its checks against the period

    @property
    def step(self) -> Callable[..., Any]:
        """The step as a function: parameters, state, sample in, next state and output out. `begin` is for robots."""
        return as_step(self.law.step)

    def begin(self, position: float = 0.0, velocity: float = 0.0) -> Run:
        """Begin a run, as a robot's loop needs it: it holds parameters and state, and steps in about a microsecond.

        Args:
            position: the plant's position relative to its reference [m].
            velocity: its velocity relative to the reference [m/s].

        Returns:
            The run; its `step` is called once per period.
        """
        return begin_run(self.step, self.parameters(), self.start(position, velocity))

    def parameters(self) -> Any:
        """Return all numbers that the step needs.

        Returns:
            Those of sensing, drive and law; with the letter's law, `pretouch_parameters` of native/law/pretouch_law.h.
        """
        sensing = self.conditioning.numbers(self.period)
        drive = DriveNumbers(
            hold=sensing.sensor_period,
            fade_step=self.conditioning.fade_step(self.period),
            largest_force=_limit(self.limits.force),
            contact_gain=self.contact_gain,
            contact_threshold=self.contact_threshold,
            admittance=discretize(self.admittance, self.period),
            limits=self._motion_limits(),
        )
        return _joined(ControllerNumbers, sensing, drive, self.law.numbers(self.period))

    def start(self, position: float = 0.0, velocity: float = 0.0) -> Any:
        """Return the state before the first step.

        Args:
            position: the plant's position relative to its reference [m].
            velocity: its velocity relative to the reference [m/s].

        Returns:
            The state: nothing detected, no force.

        Raises:
            InvalidInputError: from there, the limits can not be held.
        """
        x, v = finite(position, "position", "m"), finite(velocity, "velocity", "m/s")
        limits = self._motion_limits()
        ahead = x if v >= 0 else -x
        if (
            abs(v) > limits.speed
            or abs(x) > limits.excursion
            or (ahead + stopping_distance(limits, abs(v)) > limits.excursion)
        ):
            raise InvalidInputError(
                f"start: found {x:g} m and {v:g} m/s relative to the reference, from where the limits "
                f"({self.limits}) can not be held; start nearer to the reference or slower, or widen them"
            )
        sensing = start_sensing(self.conditioning.numbers(self.period))
        return _joined(ControllerState, sensing, start_drive(x, v), self.law.start())

    def with_gain(self, gain: float) -> Controller:
        """Return the same controller with another gain.

        Args:
            gain: D_p [N s].

        Returns:
            The controller.
        """
        return replace(self, law=self.law.with_gain(gain))

    def _motion_limits(self) -> MotionLimits:
        limits = self.limits
        return MotionLimits(self.period, _limit(limits.speed), _limit(limits.acceleration), _limit(limits.excursion))


def _joined(known: type[Structure], sensing: Structure, drive: Structure, law: Any) -> Any:
    """Put parts together: in one piece of memory where a compiled step reads them, with the law's own part behind."""
    if not isinstance(law, ctypes.Structure):
        return Parts(sensing, drive, law)
    kind = known if isinstance(law, dict(known._fields_)["law"]) else _with_law(known, type(law))
    return kind(sensing, drive, law)


@cache
def _with_law(known: type[Structure], law: type[ctypes.Structure]) -> type[Structure]:
    fields = [(name, law if name == "law" else kind) for name, kind in known._fields_]
    return type(known.__name__, (Structure,), {"_fields_": fields})


def _limit(value: float | None) -> float:
    return NO_LIMIT if value is None else value
