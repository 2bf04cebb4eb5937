"""The controller of the letter's Fig. 1 as a value: what it is made of, its numbers, its first state, its runs."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from struct import Struct
from typing import Any, Final

from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import ONE_ROBOT, check_declared, quantity
from pretouch._core.native import Structure, copy_of, location
from pretouch._core.numbers import finite
from pretouch._core.units import format_quantity

from .components import (
    NO_LIMIT,
    Conditioning,
    Limits,
    VirtualAdmittance,
    discretize,
    output_in_words,
    stopping_distance,
)
from .laws import PROTOTYPE, CompiledStep, Law, Parts, SteppedLaw, as_step, start_drive, start_sensing
from .structures import (
    ControllerNumbers,
    ControllerState,
    DriveNumbers,
    MotionLimits,
    Output,
    RawOutput,
    RawSample,
    Sample,
)

Row = tuple[str, Cell]

_pack_sample: Final = Struct("6di").pack_into
_unpack_output: Final = Struct("5di").unpack_from
_new: Final[Any] = tuple.__new__


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
    law: Law = field(metadata={"takes": SteppedLaw})  # a design needs the rest of a Law
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
            The run; its `step` is called once per period. From where the limits can not be held, none is begun.
        """
        step = self.step
        run = Run if isinstance(step, CompiledStep) else _PythonRun
        return run(step, self.parameters(), self.start(position, velocity))

    def parameters(self) -> Any:
        """Return all numbers of the step: with the letter's law, `pretouch_parameters` of native/law/pretouch_law.h."""
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
        return _joined(ControllerNumbers, sensing, drive, self.law.numbers(self))

    def start(self, position: float = 0.0, velocity: float = 0.0) -> Any:
        """Return the state before the first step, nothing detected and no force; arguments as in `begin`."""
        x, v = finite(position, "position", "m"), finite(velocity, "velocity", "m/s")
        limits = self._motion_limits()
        ahead = x if v >= 0 else -x
        farthest = max(abs(x), ahead + stopping_distance(limits, abs(v)))
        if abs(v) > limits.speed or farthest > limits.excursion:
            raise InvalidInputError(
                f"start: found {x:g} m and {v:g} m/s relative to the reference, from where the limits "
                f"({self.limits}) can not be held; start nearer to the reference or slower, or widen them"
            )
        sensing = start_sensing(self.conditioning.numbers(self.period))
        return _joined(ControllerState, sensing, start_drive(x, v), self.law.start())

    def with_gain(self, gain: float) -> Controller:
        """Return the same controller with another gain D_p [N s], of a law that is a damper."""
        law: Any = self.law
        if not hasattr(law, "with_gain"):
            raise InvalidInputError(f"gain: found a law ({type(law).__name__}) that has none; use with_value")
        return replace(self, law=law.with_gain(gain))

    def with_value(self, value: float) -> Controller:
        """Return the same controller with another value of its law's one number: of a damper D_p [N s]."""
        return replace(self, law=self.law.with_value(value))

    def rows(self) -> Iterator[Row]:
        """Yield what a page says of the controller: its parameters, those of its law that it tells itself."""
        yield "law", type(self.law).__name__
        yield "period", Measured(self.period, "s")
        own = getattr(self.law, "rows", None)
        yield from own() if own is not None else ()
        yield from self._conditioning_rows()
        a = self.admittance
        yield "virtual mass M_a", Measured(a.mass, "kg")
        yield "virtual damping D_a", Measured(a.damping, "N*s/m")
        yield "virtual stiffness K_a", Measured(a.stiffness, "N/m")
        limits = (
            ("largest virtual force", self.limits.force, "N"),
            ("largest speed", self.limits.speed, "m/s"),
            ("largest acceleration", self.limits.acceleration, "m/s^2"),
            ("largest excursion", self.limits.excursion, "m"),
        )
        if all(value is None for _, value, _ in limits):
            yield "limits", "none"
        yield from ((f"limit: {label}", Measured(value, unit)) for label, value, unit in limits if value is not None)
        yield "share of the contact force in the admittance", Measured(self.contact_gain)
        yield "reports a contact from", Measured(self.contact_threshold, "N")

    def _conditioning_rows(self) -> Iterator[Row]:
        """Yield what is done to a reading before its logarithm is differenced."""
        c, used = self.conditioning, self.conditioning.numbers(self.period)
        yield "expects a reading every", Measured(used.sensor_period, "s")
        yield "offset taken off", output_in_words(c.offset)
        yield "floor", f"{output_in_words(c.floor)}, below which nothing is seen"
        if c.saturation is not None:
            yield "saturated from", output_in_words(c.saturation)
        yield "running median", f"over {c.median_window} readings" if c.median_window > 1 else "none"
        if c.low_pass_order and c.cutoff is not None:
            yield "low-pass", f"Butterworth of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}"
        else:
            yield "low-pass", "none"
        yield "sensor lost after", Measured(used.timeout, "s")
        if c.largest_rate is not None:
            yield "largest |d ln \u03be/dt| that is believed", Measured(c.largest_rate, "1/s")

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


class Run:
    """A controller at work: it holds parameters and state, and goes on from step to step.

    `Controller.begin` makes one. One thread at a time may step it.

    Args:
        step: of the law, compiled: everything that a call needs lies ready, so that writing a sample, the step and
            reading its output are all there is.
        parameters: of the law.
        state: the first one; it stays as it is.
    """

    __slots__ = ("_held", "_law", "_memory", "_out", "_places", "_sample")

    def __init__(self, step: Any, parameters: Any, state: Any) -> None:
        self._memory, self._sample, self._out = copy_of(state), RawSample(), RawOutput()
        self._held = step, parameters
        self._law = PROTOTYPE(step.located())
        self._places = (
            ctypes.c_void_p(location(parameters, "parameters")[0]),
            ctypes.c_void_p(location(self._memory, "state")[0]),
            ctypes.byref(self._sample),
            ctypes.byref(self._out),
        )

    @property
    def state(self) -> Any:
        """The state after the last step; a copy, as `Controller.step` takes it."""
        return copy_of(self._memory)

    def step(
        self,
        reading: float,
        fresh: bool = True,
        age: float = 0.0,
        *,
        contact_force: float = 0.0,
        reference_position: float = 0.0,
        reference_velocity: float = 0.0,
        reference_acceleration: float = 0.0,
    ) -> Output:
        """Run one period: a sample as `Sample` says it comes in, what the robot is to do over the period comes out."""
        _pack_sample(
            *(self._sample, 0, reading, age, contact_force),
            *(reference_position, reference_velocity, reference_acceleration, 1 if fresh else 0),
        )
        self._law(*self._places)
        output: Output = _new(Output, _unpack_output(self._out))
        return output


class _PythonRun(Run):
    """The same for a step in Python."""

    __slots__ = ("_parameters", "_state", "_step")

    def __init__(self, step: Any, parameters: Any, state: Any) -> None:
        self._step, self._parameters, self._state = step, parameters, state

    @property
    def state(self) -> Any:
        return self._state

    def step(self, reading: float, fresh: bool = True, age: float = 0.0, **rest: float) -> Output:
        output: Output
        self._state, output = self._step(self._parameters, self._state, Sample(reading, fresh, age, **rest))
        return output
