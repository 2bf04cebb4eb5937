"""What the loop asks of a law, and of one whose gain is to be chosen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

__all__ = ["SampledLaw", "TunableLaw"]


@runtime_checkable
class SampledLaw(Protocol):
    """What the loop asks of a law: `pretouch.control.Controller` is one, and so is any value with these four.

    Attributes:
        period: time between two steps [s].
        step: a plain function `state, output = step(parameters, state, sample)` that Numba can compile.
    """

    @property
    def period(self) -> float:
        """The time between two steps [s]."""

    @property
    def step(self) -> Callable[[Any, Any, Any], Any]:
        """The step of the law."""

    def parameters(self) -> Any:
        """Return the numbers of the law."""

    def start(self, *, position: float, velocity: float) -> Any:
        """Return the state of the law for a plant at rest or in motion relative to its reference [m, m/s]."""


@runtime_checkable
class TunableLaw(SampledLaw, Protocol):
    """A law with one gain to be chosen: `pretouch.control.Controller` is one."""

    def with_gain(self, gain: float) -> SampledLaw:
        """Return the same law with another gain [N s]."""
