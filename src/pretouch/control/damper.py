"""The letter's law: a virtual damper between plant and object, F_p = D_p d(ln xi)/dt, L(2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pretouch._core.declared import ONE_ROBOT, check_declared, flag, quantity
from pretouch._core.errors import InvalidInputError

from .steps import CompiledStep
from .structures import DamperNumbers, DamperState

__all__ = ["VirtualDamper"]

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
        >>> VirtualDamper(gain=-0.7).numbers(1e-4)
        DamperNumbers(gain=-0.7, release=0.0, ramp_step=1.0, approach_only=0)
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
    def step(self) -> CompiledStep:
        """The controller's step with this law: `pretouch_step` of native/law/pretouch_law.c."""
        return _STEP

    def numbers(self, period: float) -> DamperNumbers:
        """Return the parameters as plain numbers, for the loop's period [s]."""
        ramp_step = min(period / self.ramp_time, 1.0) if self.ramp_time > 0 else 1.0
        return DamperNumbers(self.gain, self.release, ramp_step, bool(self.approach_only))

    def with_gain(self, gain: float) -> VirtualDamper:
        """Return the same law with another gain [N s]."""
        return replace(self, gain=gain)

    def start(self) -> DamperState:
        """Return the law's state before the first reading."""
        return DamperState(0.0, 0.0)
