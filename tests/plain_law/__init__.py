"""Reference implementation of native/law/pretouch_law.c in plain Python, written independently from the mathematics.

A step is pure: parameters, state and sample in, next state and output out. Parameters are those of `Controller`, as
nested tuples; states are tuples of plain numbers. The same sums in the same order: both forms are equal bit for bit.
"""

from __future__ import annotations

import ctypes
from types import SimpleNamespace
from typing import Any, NamedTuple

from pretouch.control import Output, Sample

from .damping import DamperState, damp
from .dragging import DragState, drag
from .driving import DriveState, drive, start_drive
from .sensing import SensingState, observe, start_sensing

__all__ = ["State", "plain", "start", "step"]


class State(NamedTuple):
    sensing: SensingState
    law: DamperState | DragState
    drive: DriveState


def plain(numbers: Any) -> Any:
    """The numbers of a C structure by name, as Python numbers."""
    if isinstance(numbers, ctypes.Array):
        return tuple(plain(n) for n in numbers)
    if not isinstance(numbers, ctypes.Structure):
        return numbers
    return SimpleNamespace(**{name: plain(getattr(numbers, name)) for name, _ in numbers._fields_})


def start(parameters: Any, position: float = 0.0, velocity: float = 0.0) -> State:
    law = DragState(0.0, 0.0, 0.0, 0.0) if hasattr(parameters.law, "drag") else DamperState(0.0, 0.0)
    return State(start_sensing(parameters.sensing), law, start_drive(position, velocity))


def step(parameters: Any, state: State, sample: Sample) -> tuple[State, Output]:
    """Run one period of the controller of the letter's Fig. 1: damper L(2) or drag, then the admittance L(1)."""
    sensing, seen = observe(parameters.sensing, state.sensing, sample)
    if isinstance(state.law, DragState):
        law, push = drag(parameters.law, state.law, seen, state.drive)
    else:
        law, push = damp(parameters.law, state.law, seen)
    driven, output = drive(parameters.drive, state.drive, seen, push, sample)
    return State(sensing, law, driven), output
