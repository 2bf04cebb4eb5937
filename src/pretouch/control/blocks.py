"""The blocks of the law in C, to be called one by one: what a law of a user's own in Python is put between.

Each takes a state and returns the next one; the state that it is given stays as it was.
"""

from __future__ import annotations

from ctypes import byref
from typing import Any, Final

from pretouch._core.native import DOUBLE, POINTER, kernel
from pretouch._core.structures import copy_of

from .signals import Output, Sample
from .structures import (
    DriveNumbers,
    DriveState,
    Observation,
    Push,
    RawOutput,
    RawSample,
    SensingNumbers,
    SensingState,
)

__all__ = ["Push", "drive", "observe", "output_of", "raw_sample", "start_drive", "start_sensing"]

_start_sensing: Final = kernel("start_sensing", POINTER, POINTER)
_start_drive: Final = kernel("start_drive", DOUBLE, DOUBLE, POINTER)
_observe: Final = kernel("observe", POINTER, POINTER, POINTER, POINTER)
_drive: Final = kernel("drive", POINTER, POINTER, POINTER, POINTER, POINTER, POINTER)


def start_sensing(numbers: SensingNumbers) -> SensingState:
    """Return the state before the first reading: nothing is detected."""
    state = SensingState()
    _start_sensing(byref(numbers), byref(state))
    return state


def start_drive(position: float, velocity: float) -> DriveState:
    """Return the state at the start: no force, the plant where it is relative to its reference [m, m/s]."""
    state = DriveState()
    _start_drive(position, velocity, byref(state))
    return state


def observe(numbers: SensingNumbers, state: SensingState, sample: Sample) -> tuple[SensingState, Observation]:
    """Take in a sample: whether its reading can be used, and by how much ln xi has changed.

    Args:
        numbers: `parameters.sensing` of the controller.
        state: of the step before.
        sample: what is known at the start of the period.

    Returns:
        The next state and what the law is told.
    """
    after, seen = copy_of(state), Observation()
    _observe(byref(numbers), byref(after), byref(raw_sample(sample)), byref(seen))
    return after, seen


def drive(
    numbers: DriveNumbers, state: DriveState, seen: Observation, push: Push, sample: Sample
) -> tuple[DriveState, Output]:
    """Move the virtual object over one period.

    Args:
        numbers: `parameters.drive` of the controller.
        state: of the step before.
        seen: what the sensor said.
        push: what the law gives.
        sample: contact force and reference.

    Returns:
        The next state and the output.
    """
    after, out = copy_of(state), RawOutput()
    _drive(byref(numbers), byref(after), byref(seen), byref(push), byref(raw_sample(sample)), byref(out))
    return after, output_of(out)


def raw_sample(sample: Any) -> RawSample:
    """Return a sample as C takes it."""
    return RawSample(
        sample.reading,
        sample.age,
        sample.contact_force,
        sample.reference_position,
        sample.reference_velocity,
        sample.reference_acceleration,
        bool(sample.fresh),
    )


def output_of(raw: RawOutput) -> Output:
    """Return an output of C as a tuple."""
    return Output(*(getattr(raw, name) for name in Output._fields))
