"""The loop in C++ (native/core/loop*.cpp): structures of native/core/pretouch.h, and the laws that it steps.

A law that is compiled is called by its address. For a law in Python the loop calls back, which costs some microseconds
a step; what such a law raises ends its runs and is raised here.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from ctypes import byref
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, kernel
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.structures import Structure, location, numbers
from pretouch.control import CompiledStep, Output, Sample
from pretouch.control.structures import RawOutput, RawSample

from .layout import CONTACT_COLUMNS, COURSE_COLUMNS, RESULT_COLUMNS, TRACE_COLUMNS
from .plant import COEFFICIENTS

__all__ = ["Laws", "Runs", "contact_step"]

_Step = ctypes.CFUNCTYPE(None, POINTER, POINTER, ctypes.POINTER(RawSample), ctypes.POINTER(RawOutput))
_INDEX: Final = np.dtype(np.int64)
_READING: Final = 3  # numbers of a reading on its way
_AT_ONCE: Final = 16  # encounters, between which an interrupt is heard
_JITTERS: Final = 16  # deviations by which a start is shifted at most; none of 2^53 draws is beyond 9

_run: Final = kernel("run_encounters", POINTER, POINTER, INTEGER, POINTER, POINTER, INTEGER)
_contact_step: Final = kernel("contact_step", POINTER, DOUBLE, DOUBLE, result=DOUBLE)


class _Plant(Structure):
    _fields_ = numbers(*COEFFICIENTS)


class _Contact(Structure):
    _fields_ = numbers("stiffness", "damping", "exponent", "grows", "inverse_mass")


class _Chain(Structure):
    _fields_ = (
        *numbers("rate", "phase", "exposure", "delay", "jitter", "noise", "relative_noise", "offset", "drift"),
        *numbers("lowest", "highest", "resolution", "dropout", "reports_distance", "distance_noise"),
        *numbers("distance_resolution", "random_phase", "misfit", "misfit_length"),
    )


class _Curve(Structure):
    _fields_ = (("table", POINTER), ("rows", INTEGER), *numbers("low", "step", "high"))


class _Laws(Structure):
    _fields_ = (
        *numbers("step", "parameters", "states", kind=POINTER),
        *numbers("parameters_size", "state_size", kind=INTEGER),
        *numbers("law_of", "start_of", kind=POINTER),
    )


class _Loop(Structure):
    _fields_ = (
        *(("laws", _Laws), ("plant", _Plant), ("contact", _Contact), ("chain", _Chain)),
        *numbers("curves", "curve_of", kind=POINTER),
        *numbers("period", "plant_step", "horizon", "follow"),
        *(("seed", ctypes.c_uint64), *numbers("scenes", "draws", "ends", "touches", kind=POINTER)),
        ("most_touches", INTEGER),
        *(("trace", POINTER), ("trace_rows", INTEGER), ("course", POINTER), ("course_rows", INTEGER)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Laws:
    """The laws of many encounters, which share one step.

    Args:
        step: as `as_step` returns it.
        parameters: of each law.
        states: first states.
        law_of: which parameters each encounter has.
        start_of: which state each encounter starts in.
    """

    step: Any
    parameters: Sequence[Any]
    states: Sequence[Any]
    law_of: IntArray
    start_of: IntArray


class Runs:
    """All encounters of a loop, ready to be run in stretches and on threads.

    Args:
        laws: the laws.
        plant: named by COEFFICIENTS.
        contact: stiffness, damping, exponent, whether damping grows with depth, 1 / mass of the obstacle (0: driven).
        chain: of the sensor, as SensorChain.numbers gives it.
        curves: table of ln xi, its first distance, its step, the largest distance, of each curve.
        curve_of: which of them each encounter meets.
        clock: period of the controller, step of the plant, horizon, time to follow a contact.
        seed: of the random numbers.
        scenes: position and velocity of the plant; position, velocity, acceleration of obstacle and reference; a row
            per encounter.
        draws: which run's noise each of all encounters meets.
        touches: how many contacts of each are told apart.
        rows: of the trace.
        course_rows: of the course of contacts.

    Attributes:
        ends: filled by RESULT_COLUMNS, a row per encounter.
        touches: filled by CONTACT_COLUMNS, a row per contact of each encounter.
        trace: filled by TRACE_COLUMNS, a row per period of the encounter that was run last, as far as it has rows.
        course: filled by COURSE_COLUMNS, a row per touch and per step in contact, as far as it has rows.
    """

    def __init__(
        self,
        *,
        laws: Laws,
        plant: tuple[float, ...],
        contact: tuple[float, ...],
        chain: tuple[float, ...],
        curves: Sequence[tuple[FloatArray, float, float, float]],
        curve_of: IntArray,
        clock: tuple[float, float, float, float],
        seed: int,
        scenes: FloatArray,
        draws: IntArray,
        touches: int,
        rows: int,
        course_rows: int,
    ) -> None:
        count = len(scenes)
        self.ends = np.zeros((count, len(RESULT_COLUMNS)))
        self.touches = np.full((count, touches, len(CONTACT_COLUMNS)), np.nan)
        self.trace = np.full((rows, len(TRACE_COLUMNS)), np.nan)
        self.course = np.full((course_rows, len(COURSE_COLUMNS)), np.nan)
        self._laws = laws
        self._compiled = laws.step.located() if isinstance(laws.step, CompiledStep) else None
        self._parameters = _together(laws.parameters, "parameters", self._compiled)
        self._states = _together(laws.states, "state", self._compiled)
        tables = [_Curve(address(table), len(table), *rest) for table, *rest in curves]
        self._curves = (_Curve * len(curves))(*tables)
        self._chain = _Chain(*chain)
        self._room = _power_of_two(self._waiting(clock[0]))
        self._held = scenes, draws, curve_of, curves
        self._loop = _Loop(
            self._laws_of(self._compiled or 0),
            *(_Plant(*plant), _Contact(*contact), self._chain, ctypes.addressof(self._curves)),
            *(_indices(curve_of, count), *clock, seed, address(scenes), _indices(draws, count)),
            *(address(self.ends), address(self.touches), touches),
            *(address(self.trace), rows, address(self.course), course_rows),
        )

    @property
    def compiled(self) -> bool:
        """Whether the step is compiled, so that threads need not wait for each other."""
        return self._compiled is not None

    def run(self, which: IntArray) -> None:
        """Run some of the encounters.

        Args:
            which: indices of them.
        """
        loop, called = self._loop, None
        if self._compiled is None:
            called = _Called(self._laws)
            loop = _Loop.from_buffer_copy(loop)
            loop.laws.step = called.address
        state = np.zeros(self._states.shape[1])
        waiting = np.empty((self._room, _READING))
        for start in range(0, len(which), _AT_ONCE):
            some = which[start : start + _AT_ONCE]
            _run(byref(loop), address(some, _INDEX), len(some), address(state), address(waiting), self._room)
            if called is not None and called.raised is not None:
                raise called.raised

    def _waiting(self, period: float) -> int:
        """Return how many readings can be on their way at once."""
        c = self._chain
        return int((c.delay + _JITTERS * c.jitter + c.exposure + period) * c.rate) + 8

    def _laws_of(self, step: int) -> _Laws:
        count = len(self.ends)
        return _Laws(
            *(step, address(self._parameters), address(self._states)),
            *(self._parameters.shape[1] * 8, self._states.shape[1] * 8),
            *(_indices(self._laws.law_of, count), _indices(self._laws.start_of, count)),
        )


class _Called:
    """A step in Python as the loop calls it: parameters and states are numbers there, and the objects here."""

    def __init__(self, laws: Laws) -> None:
        self._laws, self._state = laws, None
        self.raised: BaseException | None = None
        self._function = _Step(self._step)

    @cached_property
    def address(self) -> int:
        return ctypes.cast(self._function, POINTER).value or 0

    def _step(self, parameters: int, state: int, sample: Any, out: Any) -> None:
        # nothing may leave a function that is called from C: it would be printed, and vanish
        raw = out.contents
        try:
            if self.raised is None:
                place = DOUBLE.from_address(state)
                if place.value >= 0:  # a first state, and its number
                    self._state = self._laws.states[int(place.value)]
                    place.value = -1
                told = _told(sample.contents)
                now = self._laws.parameters[int(DOUBLE.from_address(parameters).value)]
                self._state, output = self._laws.step(now, self._state, told)
                for name in Output._fields:
                    setattr(raw, name, getattr(output, name))
                return
        except BaseException as error:  # raised again where the loop was called, an interrupt, too
            self.raised = error
        raw.position = raw.velocity = math.nan  # ends the run


def _told(raw: RawSample) -> Sample:
    return Sample(
        *(raw.reading, bool(raw.fresh), raw.age, raw.contact_force),
        *(raw.reference_position, raw.reference_velocity, raw.reference_acceleration),
    )


def _together(parts: Sequence[Any], name: str, compiled: int | None) -> FloatArray:
    """Put what a compiled step reads side by side, in rows that all begin at a multiple of 8; else their numbers."""
    if compiled is None:
        return np.arange(len(parts), dtype=np.float64)[:, None]
    places = [location(part, name) for part in parts]
    sizes = {size for _, size in places}
    if len(sizes) != 1:
        raise InvalidInputError(f"{name}: found sizes of {sorted(sizes)} octets among laws of one step, expected one")
    size = sizes.pop()
    rows = np.zeros((len(parts), max(-(-size // 8), 1)))
    for row, (place, _) in zip(rows, places, strict=True):
        ctypes.memmove(address(row), place, size)
    return rows


def _indices(array: IntArray, count: int) -> int:
    if array.shape != (count,):
        raise TypeError(f"the loop takes an index for each of {count} encounters, not an array of shape {array.shape}")
    return address(array, _INDEX)


def _power_of_two(least: int) -> int:
    return 1 << (least - 1).bit_length()


def contact_step(contact: tuple[float, ...], inverse_mass: float, speed: float) -> float:
    """Return a step [s] that resolves a contact that starts with a relative speed: 1/50 of its time scale.

    Args:
        contact: as ContactModel.numbers gives it.
        inverse_mass: 1 / the reduced mass of both bodies [1/kg].
        speed: the relative speed [m/s].

    Returns:
        The step.
    """
    return float(_contact_step(byref(_Contact(*contact)), inverse_mass, speed))
