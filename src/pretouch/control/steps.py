"""Steps of laws as machine code: called from Python like any step, or in place by a run that holds all it needs."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import entry
from pretouch._core.structures import copy_of, location, machine_code

from .blocks import output_of, raw_sample
from .signals import Output, Sample
from .structures import RawOutput, RawSample

__all__ = ["CompiledStep", "Run", "as_step", "begin_run"]

_prototype: Final = ctypes.PYFUNCTYPE(None)  # keeps the interpreter's lock: letting go of it takes as long as a step
_pack_sample: Final = Struct("6di").pack_into
_unpack_output: Final = Struct("5di").unpack_from
_new: Final[Any] = tuple.__new__


@dataclass(frozen=True, slots=True)
class CompiledStep:
    """A law's step as machine code, with the signature of `pretouch_law_step` in native/law/pretouch_law.h.

    Args:
        function: what is compiled, such as a scipy.LowLevelCallable; or the name of a step of the compiled core.
    """

    function: Any

    def located(self) -> int:
        """Return the address of the function.

        Returns:
            The address, that of this process.

        Raises:
            InvalidInputError: it is a function of Python.
        """
        found = entry(self.function) if isinstance(self.function, str) else machine_code(self.function)
        if found is None:
            raise InvalidInputError(f"step: found {self.function!r}, expected a compiled function")
        return found

    def __call__(self, parameters: Any, state: Any, sample: Sample) -> tuple[Any, Output]:
        """Run one period; the state that is given stays as it was.

        Args:
            parameters: those of the law, a ctypes structure or a NumPy array.
            state: of the step before, the same.
            sample: what is known at the start of the period.

        Returns:
            The next state and the output.
        """
        after, out = copy_of(state), RawOutput()
        places = (location(memory, name)[0] for memory, name in ((parameters, "parameters"), (after, "state")))
        _prototype(self.located())(*map(ctypes.c_void_p, places), ctypes.byref(raw_sample(sample)), ctypes.byref(out))
        return after, output_of(out)


def as_step(step: Any) -> Callable[[Any, Any, Sample], Any]:
    """Return the step of a law as a function of Python, `state, output = step(parameters, state, sample)`.

    Args:
        step: such a function, or a compiled one as `SampledLaw` describes it.

    Returns:
        The function.
    """
    if isinstance(step, CompiledStep):
        return step
    return step if machine_code(step) is None else CompiledStep(step)


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

    def __init__(self, step: CompiledStep, parameters: Any, state: Any) -> None:
        self._memory, self._sample, self._out = copy_of(state), RawSample(), RawOutput()
        self._held = step, parameters
        self._law = _prototype(step.located())
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
        """Run one period.

        Args:
            reading: the sensor's raw output [its unit].
            fresh: whether this reading came since the step before.
            age: how long ago it was measured [s].
            contact_force: force of the object on the plant along x [N].
            reference_position: x_d at the start of the period [m].
            reference_velocity: x_d' there [m/s].
            reference_acceleration: x_d'' [m/s^2], taken as constant over the period.

        Returns:
            What the robot is to do over the period.
        """
        _pack_sample(
            *(self._sample, 0, reading, age, contact_force),
            *(reference_position, reference_velocity, reference_acceleration, 1 if fresh else 0),
        )
        self._law(*self._places)
        output: Output = _new(Output, _unpack_output(self._out))
        return output


def begin_run(step: Callable[..., Any], parameters: Any, state: Any) -> Run:
    """Begin a run of a law.

    Args:
        step: of the law, as `as_step` returns it.
        parameters: of the law.
        state: the first one; it stays as it is.

    Returns:
        The run: in place where the step is machine code.
    """
    if isinstance(step, CompiledStep):
        return Run(step, parameters, state)
    return _PythonRun(step, parameters, state)


class _PythonRun(Run):
    """The same for a step in Python."""

    __slots__ = ("_parameters", "_state", "_step")

    def __init__(self, step: Callable[..., Any], parameters: Any, state: Any) -> None:
        self._step, self._parameters, self._state = step, parameters, state

    @property
    def state(self) -> Any:
        return self._state

    def step(self, reading: float, fresh: bool = True, age: float = 0.0, **rest: float) -> Output:
        output: Output
        self._state, output = self._step(self._parameters, self._state, Sample(reading, fresh, age, **rest))
        return output
