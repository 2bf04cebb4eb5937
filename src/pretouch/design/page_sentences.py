"""Format sentences that the reports of several designs share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pretouch._core.units import format_quantity
from pretouch.motion.page_sections import approach_step

from .relaxation import Relaxation, relaxations_in_words
from .task import Task

_NO_RESERVE: Final = 1e-3  # share of a limit; at a smaller distance from it, the limit is active


def limit_in_words(quantity: str, value: float | None, limit: float, unit: str, *, met: bool) -> str:
    """Say whether a quantity meets its limit.

    Returns:
        A sentence with the value and the limit.
    """
    allowed = format_quantity(limit, unit, 3)
    if value is None:
        return f"{quantity}: no contact, limit {allowed}"
    how = "met" if value < limit * (1 - _NO_RESERVE) else "met without reserve, so real scatter exceeds it"
    return f"{quantity} {format_quantity(value, unit, 3)}, limit {allowed}: {how if met else 'exceeded'}"


def step_without_gain(task: Task, *, contact: bool, relaxations: Sequence[Relaxation] = ()) -> str:
    """Return the recommended next step after a search that found no gain.

    Args:
        task: the task.
        contact: whether any gain within the bounds ends in contact.
        relaxations: the limits that must be raised, and to what values.
    """
    if contact:
        relaxed = ", or ".join(relaxations_in_words(relaxations)) or "relax a limit"
        return f"{relaxed}, widen the bounds of the gain, or detect the object earlier (a sensor with a longer range)"
    if step := approach_step(task.scenario):
        return step
    before = task.law.contact(task.scenario, task.sensor, 0.0, horizon=task.horizon)
    if not before.reached.all():
        nearest = format_quantity(float(before.closest_distance), "m", 3)
        return f"check the motion of the object: even without mitigation, it comes no nearer than {nearest}"
    return "check the motion of the object, or allow weaker gains: no gain within the bounds ends in contact"


def verify_step(task: Task, gain: float | None = None) -> str:
    """Recommend the command that verifies a gain on the sampled loop.

    Args:
        task: the task.
        gain: the gain, if `pretouch verify` would otherwise verify another one.

    Returns:
        The recommendation.
    """
    number, command = task.law.number, "`pretouch verify`"
    if gain is not None:
        command = f'{command} with --gain "{number.text(gain)}"'
    step = f"run {command} to check the {number.name} on the sampled loop"
    return step if task.loop is not None else f"describe sensor chain and controller, then {step}"
