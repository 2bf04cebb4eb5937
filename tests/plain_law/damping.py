"""The virtual damper L(2): the impulse is D_p times the change of ln xi."""

from __future__ import annotations

from typing import Any, NamedTuple

from .sensing import Observation


class DamperState(NamedTuple):
    """Active share of the gain, 0 to 1, and the level that ln xi has to exceed if the law acts on approaches only."""

    ramp: float
    mark: float


class Push(NamedTuple):
    """Impulse of a new reading [N s], delivered over one sensor period, and force of this period [N]."""

    impulse: float
    force: float


def damp(numbers: Any, state: DamperState, seen: Observation) -> tuple[DamperState, Push]:
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
