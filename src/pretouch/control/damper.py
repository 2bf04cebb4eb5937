"""The letter's law: a virtual damper between plant and object, F_p = D_p d(ln xi)/dt, L(2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite, nonnegative

from .drive import Push, drive
from .log_slope import Observation, observe
from .signals import Output, Sample
from .state import ControllerNumbers, ControllerState

__all__ = ["DamperNumbers", "DamperState", "VirtualDamper", "damp", "step_damper"]


class DamperNumbers(NamedTuple):
    """Gain [N s], whether only approaches are damped, width of the release, rise of the ramp per period."""

    gain: float
    approach_only: bool
    release: float
    ramp_step: float


class DamperState(NamedTuple):
    """Share of the gain in force, 0 to 1, and the mark that ln xi has to exceed where only approaches are damped."""

    ramp: float
    mark: float


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
        DamperNumbers(gain=-0.7, approach_only=False, release=0.0, ramp_step=1.0)
    """

    gain: float
    approach_only: bool = False
    release: float = 0.0
    ramp_time: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (
            ("gain", finite(self.gain, "gain", "N*s")),
            ("release", nonnegative(self.release, "release")),
            ("ramp_time", nonnegative(self.ramp_time, "ramp_time", "s")),
        ):
            if not isinstance(value, float):
                raise InvalidInputError(f"{name}: found an array, expected one number: a controller runs one robot")
            object.__setattr__(self, name, value)
        if not abs(self.gain) <= 1e6:
            raise InvalidInputError(f"gain: found {self.gain:g} N*s, which must be within 1e6 N*s")

    @property
    def step(self) -> Callable[..., Any]:
        """The controller's step with this law."""
        return step_damper

    def numbers(self, period: float) -> DamperNumbers:
        """Return the parameters as plain numbers, for the loop's period [s]."""
        ramp_step = min(period / self.ramp_time, 1.0) if self.ramp_time > 0 else 1.0
        return DamperNumbers(self.gain, bool(self.approach_only), self.release, ramp_step)

    def with_gain(self, gain: float) -> VirtualDamper:
        """Return the same law with another gain [N s]."""
        return replace(self, gain=gain)

    def start(self) -> DamperState:
        """Return the law's state before the first reading."""
        return DamperState(0.0, 0.0)


def damp(numbers: DamperNumbers, state: DamperState, seen: Observation) -> tuple[DamperState, Push]:
    """Return the impulse of L(2), D_p times the change of ln xi [N s].

    Where only approaches are damped, a mark follows ln xi upwards at once and downwards at a distance, the release:
    only a rise of the mark counts.
    """
    n = numbers
    ramp = min(state.ramp + n.ramp_step, 1.0) if seen.detecting else max(state.ramp - n.ramp_step, 0.0)
    share = ramp if seen.detecting else state.ramp  # the change to the floor still belongs to the object
    before = seen.log_level if seen.restarted else state.mark
    mark = min(max(before, seen.log_level), seen.log_level + n.release) if seen.usable else before
    change = max(mark - before, 0.0) if n.approach_only else seen.change
    return DamperState(ramp, mark), Push(n.gain * share * change, 0.0)


def step_damper(
    parameters: ControllerNumbers, state: ControllerState, sample: Sample
) -> tuple[ControllerState, Output]:
    """Run one period of the controller of the letter's Fig. 1: L(2), then L(1).

    Args:
        parameters: from `Controller.parameters`.
        state: from `Controller.start`, then from the step before.
        sample: what is known at the start of the period.

    Returns:
        The next state and the output.
    """
    sensing, seen = observe(parameters.sensing, state.sensing, sample)
    law, push = damp(parameters.law, state.law, seen)
    driven, output = drive(parameters.drive, state.drive, seen, push, sample)
    return ControllerState(sensing, law, driven), output
