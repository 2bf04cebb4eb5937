"""Define the interface through which a simulation calls a sampled controller."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class SampledLaw(Protocol):
    """Interface of a sampled controller that can be simulated, such as `pretouch.control.Controller`.

    Attributes:
        period: time between two steps [s].
        step: a slow Python callback, `state, output = step(parameters, state, sample)`, or a compiled function
            `void (*)(const void *parameters, void *state, const pretouch_sample *, pretouch_output *)` as in
            native/law/pretouch_law.h: a scipy.LowLevelCallable, a ctypes function, a Cython capsule, a numba.cfunc, or
            an address. It may be called by several threads at once, each with its own state.
    """

    @property
    def period(self) -> float:
        """The time between two controller steps [s]."""

    @property
    def step(self) -> Any:
        """The Python function or compiled function that computes one controller step."""

    def parameters(self) -> Any:
        """Return the parameters of the control law.

        For a compiled step, they are a NumPy array or a ctypes structure.
        """

    def start(self, *, position: float, velocity: float) -> Any:
        """Return the controller's initial state for a position and a velocity.

        Position [m] and velocity [m/s] are relative to the reference. For a compiled step, the state is a NumPy array
        or a ctypes structure, which is copied for each run.
        """


@runtime_checkable
class TunableLaw(SampledLaw, Protocol):
    """Interface of a sampled controller with an adjustable gain, such as `pretouch.control.Controller`."""

    def with_value(self, value: float) -> SampledLaw:
        """Return the same control law with another gain.

        For a virtual damper, the gain is D_p [N s].
        """
