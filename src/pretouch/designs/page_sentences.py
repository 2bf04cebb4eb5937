"""Format sentences that the reports of several designs share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

from pretouch._core.units import format_quantity
from pretouch.motion import Scenario
from pretouch.motion.page_sections import approach_step

from .relaxation import Relaxation, relaxations_in_words
from .task import Task

_WIDER: Final = 100.0  # factor on the ends of the bounds of a gain
_STARTS: Final = (0.75, 0.5, 1.5, 2.0, 1 / 3, 1 / 4, 1 / 6, 1 / 8)  # factors on the start distance
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


def step_without_gain(
    task: Task,
    *,
    contact: bool,
    relaxations: Sequence[Relaxation] = (),
    design: Callable[[Task], float | None] | None = None,
) -> str:
    """Return the recommended next step after a search that found no gain.

    Args:
        task: the task.
        contact: whether any gain within the bounds ends in contact.
        relaxations: the limits that must be raised, and to what values.
        design: function that returns the designed gain of a changed task, or None; other bounds and other starts are
            recommended only if a gain exists with them.
    """
    if contact:
        changes = [] if design is None else list(_helpful_changes(task, design))
        return ", or ".join([*relaxations_in_words(relaxations), *changes]) or "relax a limit"
    if step := approach_step(task.scenario):
        return step
    before = task.law.contact(task.scenario, task.sensor, 0.0, horizon=task.horizon)
    if not before.reached.all():
        nearest = format_quantity(float(before.closest_distance), "m", 3)
        return f"check the motion of the object: even without mitigation, it comes no nearer than {nearest}"
    return "check the motion of the object, or allow weaker gains: no gain within the bounds ends in contact"


def _helpful_changes(task: Task, design: Callable[[Task], float | None]) -> Iterator[str]:
    """Yield changes of the bounds and of the start with which a gain meets all limits."""
    number, o, bounds = task.law.number, task.scenario.obstacle, task.bounds
    if task.evaluate is not None or bounds is None:
        return
    low, high = bounds
    if low * high > 0:
        # the end near 0 moves toward it, the other one away from it
        low, high = (end * (_WIDER if abs(end) == max(abs(low), abs(high)) else 1 / _WIDER) for end in bounds)
        if design(task.replace(bounds=(low, high))) is not None:
            yield f"widen the bounds of the {number.name} to {number.text(low)} to {number.text(high)}"
    if task.scenario.shape or o.course or o.acceleration:
        return
    plant = float(task.scenario.plant.position)
    for factor in _STARTS:
        distance = float(f"{factor * float(task.scenario.distance):.3g}")
        if not task.sensor.valid_range[0] <= distance <= task.sensor.valid_range[1]:
            continue
        moved = replace(task.scenario, obstacle=replace(o, position=plant + distance))
        if design(task.replace(scenario=moved)) is not None:
            where, floor = format_quantity(distance, "m", 3), _floor_for(task, moved)
            yield f"let the law act from a distance of {where} on (start of the encounter, and {floor})"
            return


def _floor_for(task: Task, moved: Scenario) -> str:
    """Name the floor of the controller with which it detects the object where another encounter starts."""
    detect = getattr(task.loop, "detection", None)  # a custom loop may have no such method
    detection = None if detect is None else detect(moved, task.sensor)
    if detection is None:
        return "floor of the controller"
    if detection.floor_at_start is None:
        return "less noise, because the controller does not detect the object there"
    return f"floor = {detection.floor_at_start:.3g} in [controller]"


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
