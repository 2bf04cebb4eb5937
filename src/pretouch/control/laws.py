"""Define the sampled virtual damper, and the interface for custom sampled control laws."""

from __future__ import annotations

import ctypes
import math
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
"""C signature of a step. It keeps the interpreter's lock, since releasing it takes as long as a step."""

_start_sensing: Final = kernel("start_sensing", POINTER, POINTER)
_start_drive: Final = kernel("start_drive", DOUBLE, DOUBLE, POINTER)
_observe: Final = kernel("observe", POINTER, POINTER, POINTER, POINTER)
_drag: Final = kernel("drag", POINTER, POINTER, POINTER, POINTER, POINTER)
_drive: Final = kernel("drive", POINTER, POINTER, POINTER, POINTER, POINTER, POINTER)


class Parts(NamedTuple):
    """Parameters or state of signal processing, robot motion and control law.

    The control law is a Python function.

    Args:
        sensing: parameters or state of `observe`.
        drive: parameters or state of `drive`; in a state, `drive.motion.position` [m] and `.velocity` [m/s] are the
            motion of the virtual object relative to its reference.
        law: the result of `Law.numbers` or `Law.start`, or the next state of the law.
    """

    sensing: Any
    drive: Any
    law: Any


class Setting(Protocol):
    """Interface of the controller settings that a control law reads.

    The control law computes its own parameters from these settings.
    """

    @property
    def period(self) -> float:
        """The period of the control loop [s]."""

    @property
    def conditioning(self) -> Conditioning:
        """The settings for processing the sensor readings."""

    @property
    def admittance(self) -> VirtualAdmittance:
        """The virtual mass, damping and stiffness of the controller's admittance."""


class SteppedLaw(Protocol):
    """Interface of any control law that a controller can run.

    Unlike a `Law`, it needs no number that a design chooses.
    """

    @property
    def step(self) -> Any:
        """The function for one control step with this law.

        It runs the whole step. It is written in Python or compiled.
        """

    def numbers(self, controller: Setting) -> Any:
        """Return the parameters of the control law.

        They are a ctypes structure if the control step is compiled. `Controller.parameters` calls this before a run.
        The step reads the result from `parameters.law`.
        """

    def start(self) -> Any:
        """Return the state of the law before the first reading.

        It is a ctypes structure if the control step is compiled. `Controller.start` calls this. The step reads the
        result from `state.law`. States are never changed in place: a step in Python returns the next state.
        """


class Law(SteppedLaw, Protocol):
    """Interface of a sampled control law.

    The law computes a force from the sensor output and the robot's own motion. A custom law is a dataclass with these
    six members and one function. In Python the function is `state, output = step(parameters, state, sample)`: it calls
    `observe`, computes the force of the law, and calls `drive`; parameters and state are `Parts`. It may also be
    compiled, see `CompiledStep`. docs/how-to/own-law.md builds one, from a force to a verdict.

    A law may smooth ln xi before it computes an impulse. This may equal, near an operating point, one low-pass that
    weights every new reading by 1 - exp(-T/tau), with the sensor's period T. Then the law reports tau [s] as the
    attribute `smoothing_time`. The limits of stability then include it.
    """

    @property
    def continuous(self) -> Any:
        """The continuous-time law that this sampled law approximates.

        Predictions use the continuous-time law. It is a name or a ContinuousLaw.
        """

    @property
    def value(self) -> float:
        """The design coefficient of the control law.

        A design computes it. An example is the gain of a virtual damper [N s]. `continuous` defines its unit.
        """

    def with_value(self, value: float) -> Law:
        """Return a copy of the control law with another coefficient."""


@dataclass(frozen=True, slots=True)
class CompiledStep:
    """A control step in machine code.

    It has the signature of the C function type `pretouch_law_step`. The C header native/law/pretouch_law.h declares
    this type.

    Args:
        function: the compiled function, such as a scipy.LowLevelCallable; or the name of a step of the compiled core.
    """

    function: Any

    def located(self) -> int:
        """Return the memory address of the compiled function.

        Raises:
            InvalidInputError: the function is not compiled.
        """
        address = entry(self.function) if isinstance(self.function, str) else machine_code(self.function)
        if address is None:
            raise InvalidInputError(f"step: found {self.function!r}, expected a compiled function", value=self.function)
        return address

    def __call__(self, parameters: Any, state: Any, sample: Sample) -> tuple[Any, Output]:
        """Run one control period with the compiled step.

        Returns:
            The next state and the output.
        """
        after, out = copy_of(state), RawOutput()
        places = (location(memory, name)[0] for memory, name in ((parameters, "parameters"), (after, "state")))
        PROTOTYPE(self.located())(*map(ctypes.c_void_p, places), ctypes.byref(raw_sample(sample)), ctypes.byref(out))
        return after, output_of(out)


def as_step(step: Any) -> Callable[[Any, Any, Sample], Any]:
    """Return a step that Python can call as `state, output = step(parameters, state, sample)`."""
    return step if isinstance(step, CompiledStep) or machine_code(step) is None else CompiledStep(step)


def start_sensing(numbers: SensingNumbers) -> SensingState:
    """Return the initial state of the signal processing.

    No sensor reading has arrived, and no object is detected. `Controller.start` calls this.

    Args:
        numbers: `parameters.sensing` of a controller, or `Conditioning.numbers` for a law without one.
    """
    state = SensingState()
    _start_sensing(byref(numbers), byref(state))
    return state


def start_drive(position: float, velocity: float) -> DriveState:
    """Return the initial state of the admittance.

    No virtual force acts. `Controller.start` calls this.

    Args:
        position: position of the plant relative to its reference [m].
        velocity: velocity of the plant relative to its reference [m/s].
    """
    state = DriveState()
    _start_drive(position, velocity, byref(state))
    return state


def observe(numbers: SensingNumbers, state: SensingState, sample: Sample) -> tuple[SensingState, Observation]:
    """Check and filter a sensor reading.

    The change of ln(sensor output) since the previous reading is computed, too.

    Args:
        numbers: `parameters.sensing` of the controller.
        state: `state.sensing`; it is not changed.
        sample: the sample of this period, with or without a new reading.

    Returns:
        The next state, and the observation of ln xi on which the law acts.
    """
    after, observation = copy_of(state), Observation()
    _observe(byref(numbers), byref(after), byref(raw_sample(sample)), byref(observation))
    return after, observation


def push_by_drag(
    numbers: DragNumbers, state: DragState, observation: Observation, drive_state: DriveState
) -> tuple[DragState, Push]:
    """Compute the force of the virtual drag in one step.

    Custom control laws may use this function. It is called after `observe` and before `drive`.

    Without `own_advance` the impulse is proportional to phi. A law that chooses phi at each reading therefore calls
    this with a drag of 1 N s^2 and multiplies the impulse.

    Args:
        numbers: the result of `VirtualDrag.numbers`.
        state: the result of `VirtualDrag.start` or of the last call; it is not changed.
        observation: the result of `observe`.
        drive_state: `state.drive` before this step.

    Returns:
        The next state, whose `rate` is the smoothed s' [1/s], and the push of the drag.
    """
    after, push = copy_of(state), Push()
    _drag(byref(numbers), byref(after), byref(observation), byref(drive_state), byref(push))
    return after, push


def drive(
    numbers: DriveNumbers, state: DriveState, observation: Observation, push: Push, sample: Sample
) -> tuple[DriveState, Output]:
    """Apply the control law's force to the admittance.

    The result is the robot's reference motion for one period. This is the last block of a step.

    Args:
        numbers: `parameters.drive` of the controller.
        state: `state.drive`; it is not changed.
        observation: the result of `observe` in this step.
        push: the push of the law.
        sample: the sample of this step.

    Returns:
        The next state and the output.
    """
    after, out = copy_of(state), RawOutput()
    _drive(byref(numbers), byref(after), byref(observation), byref(push), byref(raw_sample(sample)), byref(out))
    return after, output_of(out)


def raw_sample(sample: Any) -> RawSample:
    """Convert the inputs of a control step to a C structure."""
    s, fresh = sample, int(sample.fresh)
    return RawSample(
        s.reading, s.age, s.contact_force, s.reference_position, s.reference_velocity, s.reference_acceleration, fresh
    )


def output_of(raw: RawOutput) -> Output:
    """Convert the C output of a control step to a tuple."""
    return Output(*(getattr(raw, name) for name in Output._fields))


_STEP = CompiledStep("step_damper")


_RELEASE: Final = 1.5  # > ln(1 + 10/3): the range of noise whose standard deviation is a third of the floor
_WIDEST: Final = 5.0  # standard deviations: noise exceeds them in one of 1.7 million readings


def release_for_noise(floor: float, noise: float, relative_noise: float = 0.0) -> float:
    """Return a `release` of the virtual damper that noise does not exceed.

    It is the largest range of ln xi, at any distance, of noise within five standard deviations to both sides. Readings
    below the floor count as the floor, which limits the range at large distances.

    Args:
        floor: the detection threshold [unit of xi].
        noise: standard deviation of a reading without a signal [unit of xi].
        relative_noise: additional standard deviation relative to xi.

    Returns:
        The release, a change of ln xi.

    Examples:
        >>> round(release_for_noise(100.0, 20.0), 2), round(release_for_noise(1800.0, 20.0, 0.002), 2)
        (1.1, 0.11)
    """
    far = floor + _WIDEST * noise
    sigma = math.hypot(noise, relative_noise * far)
    near = 2 * math.atanh(min(_WIDEST * relative_noise, 0.9))  # ln (1 + 5 s) / (1 - 5 s), where only this noise counts
    return max(math.log((far + _WIDEST * sigma) / max(far - _WIDEST * sigma, floor)), near)


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualDamper:
    """Sampled virtual damper with the force F_p = D_p xi'/xi.

    The force is equation L(2) of the published letter, with the sensor output xi. It is applied as one impulse per
    reading. The impulses D_p d(ln xi) are exact at any sampling rate.

    Args:
        gain: D_p [N s]; negative gains mitigate the impact.
        approach_only: act during approaches only, so that the robot does not follow a receding object.
        release: with `approach_only`, the fall of ln xi after which a rise counts as a new approach. If it is smaller
            than the range of the noise of ln xi, each rise of the noise pushes the robot away, and no fall returns it.
            The default exceeds the noise at a floor of three standard deviations; see `release_for_noise`.
        ramp_time: time [s] in which the gain rises from 0 after detection, and returns to 0 when the object is gone.

    Examples:
        >>> VirtualDamper(gain=-0.7).with_value(-0.5)
        VirtualDamper(gain=-0.5, approach_only=False, release=1.5, ramp_time=0.0)
    """

    gain: float = quantity("N*s", example='"-0.7 N*s"')
    approach_only: bool = flag(False)
    release: float = quantity("", _RELEASE, sign="nonnegative")
    ramp_time: float = quantity("s", 0.0, sign="nonnegative")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)
        if not abs(self.gain) <= 1e6:
            raise InvalidInputError(
                f"gain: found {self.gain:g} N*s, expected a gain between -1e6 and 1e6 N*s", value=self.gain
            )

    @property
    def continuous(self) -> str:
        """The name of the continuous-time law that this sampled virtual damper approximates."""
        return "virtual-damper"

    @property
    def value(self) -> float:
        """The gain D_p of the virtual damper [N s].

        A design computes it.
        """
        return self.gain

    @property
    def step(self) -> CompiledStep:
        """The compiled control step with the virtual damper.

        It is the function `pretouch_step_damper` in pretouch_law.c.
        """
        return _STEP

    def numbers(self, controller: Setting) -> DamperNumbers:
        """Return the parameters of the virtual damper as a C structure."""
        ramp_step = min(controller.period / self.ramp_time, 1.0) if self.ramp_time > 0 else 1.0
        return DamperNumbers(self.gain, self.release, ramp_step, bool(self.approach_only))

    def rows(self) -> Iterator[tuple[str, Cell]]:
        """Yield the settings of the virtual damper as table rows.

        The gain is not included.
        """
        if self.approach_only:
            yield (
                "acts",
                "the force acts only while an object approaches. After ln ξ, the logarithm of the sensor output, has "
                f"fallen by {self.release:.4g}, its next rise counts as a new approach",
            )
        if self.ramp_time:
            yield "ramp of the gain", Measured(self.ramp_time, "s")

    def with_value(self, value: float) -> VirtualDamper:
        """Return a copy of the virtual damper with another gain.

        The gain is D_p [N s].
        """
        return replace(self, gain=value)

    def start(self) -> DamperState:
        """Return the state of the virtual damper before the first reading."""
        return DamperState(0.0, 0.0)
