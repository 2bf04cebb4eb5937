"""Laws: what one is, the letter's, and the blocks of C that one of a user's own in Python is made of."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from ctypes import byref
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple, Protocol

from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import ONE_ROBOT, check_declared, flag, quantity
from pretouch._core.native import DOUBLE, POINTER, copy_of, entry, kernel, location, machine_code

from .components import Conditioning, VirtualAdmittance
from .structures import (
    DamperNumbers,
    DamperState,
    DragNumbers,
    DragState,
    DriveNumbers,
    DriveState,
    Observation,
    Output,
    Push,
    RawOutput,
    RawSample,
    Sample,
    SensingNumbers,
    SensingState,
)

PROTOTYPE: Final = ctypes.PYFUNCTYPE(None)
"""Of a step; it keeps the interpreter's lock: letting go of it takes as long as a step."""

_start_sensing: Final = kernel("start_sensing", POINTER, POINTER)
_start_drive: Final = kernel("start_drive", DOUBLE, DOUBLE, POINTER)
_observe: Final = kernel("observe", POINTER, POINTER, POINTER, POINTER)
_drag: Final = kernel("drag", POINTER, POINTER, POINTER, POINTER, POINTER)
_drive: Final = kernel("drive", POINTER, POINTER, POINTER, POINTER, POINTER, POINTER)


class Parts(NamedTuple):
    """Parameters or state of a controller whose law is a function of Python: those of sensing, drive and law.

    Args:
        sensing: what `observe` takes.
        drive: what `drive` takes; of a state, `drive.motion.position` [m] and `.velocity` [m/s] are the virtual
            object's, relative to its reference.
        law: what `Law.numbers` or `Law.start` returned, or the law's own next state.
    """

    sensing: Any
    drive: Any
    law: Any


class Setting(Protocol):
    """What a law's numbers may depend on: the `Controller` that it stands in, without its law."""

    @property
    def period(self) -> float:
        """T of the loop [s]."""

    @property
    def conditioning(self) -> Conditioning:
        """From raw readings to ln xi."""

    @property
    def admittance(self) -> VirtualAdmittance:
        """The virtual dynamics of L(1)."""


class SteppedLaw(Protocol):
    """What a controller runs: a law without a number to be chosen; see `Law`."""

    @property
    def step(self) -> Any:
        """The whole step of the controller with this law, of Python or compiled; run once per period."""

    def numbers(self, controller: Setting) -> Any:
        """Return the law's parameters in a controller; a ctypes structure where the step is compiled.

        Called whenever `Controller.parameters` is, before a run; a step finds them in `parameters.law`.
        """

    def start(self) -> Any:
        """Return the law's state before the first reading; a ctypes structure where the step is compiled.

        Called whenever `Controller.start` is; a step finds it in `state.law`. States are never changed in place: a
        step of Python returns the next one.
        """


class Law(SteppedLaw, Protocol):
    """What makes a force of ln xi and of the robot's own motion: a value with its numbers and the step that uses them.

    A new law is a dataclass with these six, and one function: in Python `state, output = step(parameters, state,
    sample)`, of `observe`, what the law itself does, and `drive`, between `Parts`; or compiled, see `CompiledStep`.
    docs/own-law.md makes one, from a force to a verdict.

    A law may smooth ln xi on the way to its impulse. Where that amounts, near an operating point, to one low-pass that
    takes in 1 - exp(-T/tau) of every reading, the sensor's period being T, the law tells tau [s] as an attribute
    `smoothing_time`, and limits of stability count it.
    """

    @property
    def continuous(self) -> Any:
        """The law in continuous time that it samples, by which it is predicted: a name, or a ContinuousLaw."""

    @property
    def value(self) -> float:
        """The one number that a design chooses, in the unit that `continuous` tells: of the damper a gain [N s]."""

    def with_value(self, value: float) -> Law:
        """Return the same law with another value of that number: called for each that a design tries."""


@dataclass(frozen=True, slots=True)
class CompiledStep:
    """A law's step as machine code, with the signature of `pretouch_law_step` in native/law/pretouch_law.h.

    Args:
        function: what is compiled, such as a scipy.LowLevelCallable; or the name of a step of the compiled core.
    """

    function: Any

    def located(self) -> int:
        """Return the address of the function in this process; one of Python has none, and is refused."""
        found = entry(self.function) if isinstance(self.function, str) else machine_code(self.function)
        if found is None:
            raise InvalidInputError(f"step: found {self.function!r}, expected a compiled function")
        return found

    def __call__(self, parameters: Any, state: Any, sample: Sample) -> tuple[Any, Output]:
        """Run one period: return the next state and the output; parameters and state are structures or arrays."""
        after, out = copy_of(state), RawOutput()
        places = (location(memory, name)[0] for memory, name in ((parameters, "parameters"), (after, "state")))
        PROTOTYPE(self.located())(*map(ctypes.c_void_p, places), ctypes.byref(raw_sample(sample)), ctypes.byref(out))
        return after, output_of(out)


def as_step(step: Any) -> Callable[[Any, Any, Sample], Any]:
    """Return a step, compiled or not, as a function of Python, `state, output = step(parameters, state, sample)`."""
    return step if isinstance(step, CompiledStep) or machine_code(step) is None else CompiledStep(step)


def start_sensing(numbers: SensingNumbers) -> SensingState:
    """Return the state of `observe` before the first reading, where nothing is detected; `Controller.start` calls it.

    Args:
        numbers: `parameters.sensing` of a controller, or `Conditioning.numbers` for a law without one.
    """
    state = SensingState()
    _start_sensing(byref(numbers), byref(state))
    return state


def start_drive(position: float, velocity: float) -> DriveState:
    """Return the state of `drive` at the start: no force, the plant where it is; `Controller.start` calls it.

    Args:
        position: of the plant, relative to its reference [m].
        velocity: of the plant, relative to its reference [m/s].
    """
    state = DriveState()
    _start_drive(position, velocity, byref(state))
    return state


def observe(numbers: SensingNumbers, state: SensingState, sample: Sample) -> tuple[SensingState, Observation]:
    """Take in a sample, the first block of a step: check, filter and difference what was read.

    Args:
        numbers: `parameters.sensing` of the controller.
        state: `state.sensing`; it stays as it is.
        sample: what the step was given, once per period, with a new reading or without.

    Returns:
        The next state, and what the law is told of ln xi.
    """
    after, seen = copy_of(state), Observation()
    _observe(byref(numbers), byref(after), byref(raw_sample(sample)), byref(seen))
    return after, seen


def push_by_drag(
    numbers: DragNumbers, state: DragState, seen: Observation, driven: DriveState
) -> tuple[DragState, Push]:
    """Do what a virtual drag does between `observe` and `drive`: rate, dead zone and hold-off, for laws that are one.

    The impulse without `own_advance` is in proportion to phi, so a law that chooses phi at each reading takes a drag of
    1 N s^2 and multiplies.

    Args:
        numbers: what `VirtualDrag.numbers` returned.
        state: what `VirtualDrag.start` returned, or the last call; it stays as it is.
        seen: what `observe` returned.
        driven: `state.drive`, as it was before this step.

    Returns:
        The next state, whose `rate` is s' [1/s] as it is smoothed, and what the drag gives.
    """
    after, push = copy_of(state), Push()
    _drag(byref(numbers), byref(after), byref(seen), byref(driven), byref(push))
    return after, push


def drive(
    numbers: DriveNumbers, state: DriveState, seen: Observation, push: Push, sample: Sample
) -> tuple[DriveState, Output]:
    """Move the virtual object over one period, the last block of a step: deliver, limit, integrate L(1).

    Args:
        numbers: `parameters.drive` of the controller.
        state: `state.drive`; it stays as it is.
        seen: what `observe` returned in this step.
        push: what the law gives.
        sample: what the step was given.

    Returns:
        The next state and the output.
    """
    after, out = copy_of(state), RawOutput()
    _drive(byref(numbers), byref(after), byref(seen), byref(push), byref(raw_sample(sample)), byref(out))
    return after, output_of(out)


def raw_sample(sample: Any) -> RawSample:
    """Return a sample as C takes it."""
    s, fresh = sample, bool(sample.fresh)
    return RawSample(
        s.reading, s.age, s.contact_force, s.reference_position, s.reference_velocity, s.reference_acceleration, fresh
    )


def output_of(raw: RawOutput) -> Output:
    """Return an output of C as a tuple."""
    return Output(*(getattr(raw, name) for name in Output._fields))


_STEP = CompiledStep("step_damper")


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualDamper:
    """Virtual force F_p = D_p xi'/xi, L(2), as impulses: D_p times the change of ln xi, exact at any sample time.

    Args:
        gain: D_p [N s]; negative to mitigate.
        approach_only: damp approaches alone, and let the object recede without being followed.
        release: with `approach_only`, by how much ln xi must fall before a rise counts anew; wider than the noise of
            ln xi, it keeps noise from being taken for approaches.
        ramp_time: time [s] in which the gain rises from 0 once an object is detected, and falls when it is gone.

    Examples:
        >>> VirtualDamper(gain=-0.7).with_value(-0.5)
        VirtualDamper(gain=-0.5, approach_only=False, release=0.0, ramp_time=0.0)
    """

    gain: float = quantity("N*s", example='"-0.7 N*s"')
    approach_only: bool = flag(False)
    release: float = quantity("", 0.0, sign="nonnegative")
    ramp_time: float = quantity("s", 0.0, sign="nonnegative")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)
        if not abs(self.gain) <= 1e6:
            raise InvalidInputError(f"gain: found {self.gain:g} N*s, which must be within 1e6 N*s")

    @property
    def continuous(self) -> str:
        """The law that it samples, L(2)."""
        return "virtual-damper"

    @property
    def value(self) -> float:
        """The gain D_p [N s]: that is the number that a design chooses."""
        return self.gain

    @property
    def step(self) -> CompiledStep:
        """The controller's step with this law: `pretouch_step` of native/law/pretouch_law.c."""
        return _STEP

    def numbers(self, controller: Setting) -> DamperNumbers:
        """Return the parameters as plain numbers, for the controller's period."""
        ramp_step = min(controller.period / self.ramp_time, 1.0) if self.ramp_time > 0 else 1.0
        return DamperNumbers(self.gain, self.release, ramp_step, bool(self.approach_only))

    def rows(self) -> Iterator[tuple[str, Cell]]:
        """Yield what a page says of the law beside its gain."""
        if self.approach_only:
            yield "damps", f"approaches alone, with a release of {self.release:.4g} in ln \u03be"
        if self.ramp_time:
            yield "ramp of the gain", Measured(self.ramp_time, "s")

    def with_gain(self, gain: float) -> VirtualDamper:
        """Return the same law with another gain [N s]."""
        return replace(self, gain=gain)

    def with_value(self, value: float) -> VirtualDamper:
        """Return the same law with another gain [N s]."""
        return self.with_gain(value)

    def start(self) -> DamperState:
        """Return the law's state before the first reading."""
        return DamperState(0.0, 0.0)
