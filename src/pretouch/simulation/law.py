"""Interfaces of a sampled law that the simulated loop can run, and of a law with an adjustable gain."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class SampledLaw(Protocol):
    """What the loop asks of a law: `pretouch.control.Controller` is one, and so is any value with these four.

    Attributes:
        period: time between two steps [s].
        step: a function of Python, `state, output = step(parameters, state, sample)`, called back and slow; or a
            compiled one, `void (*)(const void *parameters, void *state, const pretouch_sample *, pretouch_output *)` of
            native/law/pretouch_law.h: a scipy.LowLevelCallable, a function of ctypes, a capsule of Cython, what
            numba.cfunc returns, or an address. It may be called on several threads at once, each with its own state.
    """

    @property
    def period(self) -> float:
        """The time between two steps [s]."""

    @property
    def step(self) -> Any:
        """The step of the law, of Python or compiled."""

    def parameters(self) -> Any:
        """Return the numbers of the law; for a compiled step a NumPy array or a ctypes structure."""

    def start(self, *, position: float, velocity: float) -> Any:
        """Return the state of the law for a plant at rest or in motion relative to its reference [m, m/s].

        For a compiled step that is a NumPy array or a ctypes structure, too, which each run gets a copy of.
        """


@runtime_checkable
class TunableLaw(SampledLaw, Protocol):
    """A law with one number to be chosen: `pretouch.control.Controller` is one."""

    def with_value(self, value: float) -> SampledLaw:
        """Return the same law with another value of that number, such as the gain of a damper [N s]."""
