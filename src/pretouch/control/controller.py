"""Define the sampled controller and its control step.

The control step runs once in each period of the control loop.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from struct import Struct
from typing import Any, Final, cast

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
    format_output,
    stopping_distance,
)
from .laws import PROTOTYPE, CompiledStep, Law, Parts, SteppedLaw, as_step, start_drive, start_sensing
from .structures import (
    Arrival,
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
    """The sampled controller of the robot.

    It turns sensor readings into a reference motion of the robot.

    Args:
        period: period T of the control loop [s].
        conditioning: how raw readings become ln xi.
        law: how changes of ln xi become a force, such as `VirtualDamper`.
        admittance: the virtual dynamics of L(1).
        limits: limits of virtual force and motion.
        contact_gain: share of the measured contact force that acts in the admittance, 0 to 1. Use 0 if the robot's own
            controller is an impedance controller, which already responds to the contact force. Use 1 if it is a
            position controller, which does not.
        contact_threshold: contact force [N] from which a contact is reported. It only sets a status flag.

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
    law: Law = field(metadata={"takes": SteppedLaw})  # only a design needs the full Law
    admittance: VirtualAdmittance = field()
    limits: Limits = field(default_factory=Limits)
    contact_gain: float = quantity("", 0.0, sign="nonnegative")
    contact_threshold: float = quantity("N", 1.0, sign="positive")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)
        if self.contact_gain > 1:
            raise InvalidInputError(
                f"contact_gain: found {self.contact_gain:g}, expected a fraction between 0 and 1",
                value=self.contact_gain,
            )
        self.conditioning.numbers(self.period)  # checks the conditioning against the period

    @property
    def step(self) -> Callable[..., Any]:
        """The function that computes one control step.

        It computes next state and output from parameters, state and inputs. Robots use `begin` instead.
        """
        return as_step(self.law.step)

    def begin(self, position: float = 0.0, velocity: float = 0.0) -> Run:
        """Start a run of this controller.

        The run holds parameters and state, and a step takes about a microsecond.

        Args:
            position: the plant's position relative to its reference [m].
            velocity: its velocity relative to the reference [m/s].

        Returns:
            The run; call its `step` once per period. A start from which the limits cannot be kept is refused.
        """
        step = self.step
        run = Run if isinstance(step, CompiledStep) else _PythonRun
        return run(step, self.parameters(), self.start(position, velocity))

    def parameters(self) -> Any:
        """Return the parameters that the control step reads.

        One structure holds the parameters of the controller and of its control law. With the letter's law, the
        parameters are `pretouch_parameters` of pretouch_law.h.
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
        return _join_parts(ControllerNumbers, sensing, drive, self.law.numbers(self))

    def start(self, position: float = 0.0, velocity: float = 0.0) -> Any:
        """Return the initial state of the controller.

        No object is detected, and no virtual force acts. Position [m] and velocity [m/s] are relative to the reference.

        Raises:
            InvalidInputError: the robot cannot stay within its limits from this position and velocity.
        """
        x, v = finite(position, "position", "m"), finite(velocity, "velocity", "m/s")
        limits = self._motion_limits()
        ahead = x if v >= 0 else -x
        farthest = max(abs(x), ahead + stopping_distance(limits, abs(v)))
        if abs(v) > limits.speed or farthest > limits.excursion:
            raise InvalidInputError(
                f"start: the robot cannot stay within its limits from the position {x:g} m with the velocity {v:g} "
                "m/s. Start nearer to the reference, start slower, or widen the limits. The present limits are "
                f"{self.limits}"
            )
        sensing = start_sensing(self.conditioning.numbers(self.period))
        return _join_parts(ControllerState, sensing, start_drive(x, v), self.law.start())

    def with_value(self, value: float) -> Controller:
        """Return a copy of the controller with another law coefficient.

        Examples are the gain D_p [N s] and the drag phi [N s^2].
        """
        return replace(self, law=self.law.with_value(value))

    def scale_motion(self, factor: float) -> Controller:
        """Return the controller whose motion is `factor` times as large, for the same readings and forces.

        M x'' + D x' + K x = F with x = factor * s is M s'' + D s' + K s = F if the admittance is divided by the factor.
        A controller on a floating base moves its site by s relative to the base, and by less relative to an object.

        Args:
            factor: ratio of both motions > 0.
        """
        limits, a = self.limits, self.admittance
        scaled = {name: getattr(limits, name) for name in ("speed", "acceleration", "excursion")}
        own_advance = getattr(self.law, "own_advance", 0.0)  # of a drag, a force per own speed
        return replace(
            self,
            law=replace(cast("Any", self.law), own_advance=own_advance / factor) if own_advance else self.law,
            admittance=replace(a, mass=a.mass / factor, damping=a.damping / factor, stiffness=a.stiffness / factor),
            limits=replace(limits, **{name: None if v is None else factor * v for name, v in scaled.items()}),
        )

    def rows(self) -> Iterator[Row]:
        """Yield the controller parameters as table rows for a report.

        The parameters of the control law are included.
        """
        name = getattr(self.law, "continuous", None)  # a user-defined law is shown by its own name
        yield "law", name.replace("-", " ") if isinstance(name, str) else type(self.law).__name__
        yield "period", Measured(self.period, "s")
        law_rows = getattr(self.law, "rows", None)
        yield from law_rows() if law_rows is not None else ()
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
        yield "contact threshold", Measured(self.contact_threshold, "N")

    def _conditioning_rows(self) -> Iterator[Row]:
        """Yield the settings of the signal processing as table rows."""
        c, numbers = self.conditioning, self.conditioning.numbers(self.period)
        yield "nominal time between readings", Measured(numbers.sensor_period, "s")
        yield "subtracted offset", format_output(c.offset)
        yield "floor", f"{format_output(c.floor)}, below which nothing is detected"
        if c.saturation is not None:
            yield "saturation level", format_output(c.saturation)
        yield "running median", f"over {c.median_window} readings" if c.median_window > 1 else "none"
        if c.moving_average > 1:
            yield "moving average", f"over {c.moving_average} readings"
        if c.low_pass_order and c.cutoff is not None:
            yield "low-pass", f"Butterworth of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}"
        else:
            yield "low-pass", "none"
        yield "sensor counts as lost after", Measured(numbers.timeout, "s")
        if c.largest_rate is not None:
            yield "largest plausible |d ln \u03be/dt|", Measured(c.largest_rate, "1/s")

    def _motion_limits(self) -> MotionLimits:
        limits = self.limits
        return MotionLimits(self.period, _limit(limits.speed), _limit(limits.acceleration), _limit(limits.excursion))


def _join_parts(base: type[Structure], sensing: Structure, drive: Structure, law: Any) -> Any:
    """Join parts of sensing, motion and law; for a compiled step, in one block of memory with the law last."""
    if not isinstance(law, ctypes.Structure):
        return Parts(sensing, drive, law)
    kind = base if isinstance(law, dict(base._fields_)["law"]) else _with_law(base, type(law))
    return kind(sensing, drive, law)


@cache
def _with_law(base: type[Structure], law: type[ctypes.Structure]) -> type[Structure]:
    """Return a copy of a C structure type with another law type."""
    fields = [(name, law if name == "law" else kind) for name, kind in base._fields_]
    return type(base.__name__, (Structure,), {"_fields_": fields})


def _limit(value: float | None) -> float:
    return NO_LIMIT if value is None else value


class Run:
    """A running controller, which updates its state at each control step.

    `Controller.begin` makes one. Only one thread at a time may call `step`.

    Args:
        step: compiled step of the law. All pointers are prepared once, so a call only writes the sample, runs the
            step and reads its output.
        parameters: parameters of the controller.
        state: first state; it is copied.
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
        """A copy of the state of the controller after its latest step."""
        return copy_of(self._memory)

    def step(
        self,
        reading: float,
        fresh: bool | Arrival = True,
        age: float = 0.0,
        *,
        contact_force: float = 0.0,
        reference_position: float = 0.0,
        reference_velocity: float = 0.0,
        reference_acceleration: float = 0.0,
    ) -> Output:
        """Run one control step with a sensor reading.

        Returns:
            The reference motion of the robot for one period.
        """
        _pack_sample(
            *(self._sample, 0, reading, age, contact_force),
            *(reference_position, reference_velocity, reference_acceleration, int(fresh)),
        )
        self._law(*self._places)
        output: Output = _new(Output, _unpack_output(self._out))
        return output


class _PythonRun(Run):
    """A running controller with a control step in Python."""

    __slots__ = ("_parameters", "_state", "_step")

    def __init__(self, step: Any, parameters: Any, state: Any) -> None:
        self._step, self._parameters, self._state = step, parameters, state

    @property
    def state(self) -> Any:
        return self._state

    def step(self, reading: float, fresh: bool | Arrival = True, age: float = 0.0, **rest: float) -> Output:
        output: Output
        self._state, output = self._step(self._parameters, self._state, Sample(reading, fresh, age, **rest))
        return output
