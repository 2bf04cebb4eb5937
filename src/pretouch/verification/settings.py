"""Express a changed task as settings of a scenario file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields
from typing import Any, Final, TypeAlias

from pretouch._core.fields import OUTPUT, OUTPUT_RATE
from pretouch._core.units import written_unit
from pretouch._core.vocabulary import unit_of
from pretouch.control import Controller
from pretouch.designs import Task
from pretouch.designs.robust.required import limits_of
from pretouch.motion import DAMPER, DRAG

Setting: TypeAlias = str | float | int | bool | None
"""New value of a key as in a scenario file; None if the key must be removed."""

_OBSTACLE: Final = {"position": "m", "velocity": "m/s"}
_BARE: Final = frozenset({"", OUTPUT, OUTPUT_RATE})  # units of values that are written as bare numbers
_NOISES: Final = frozenset({"chain.noise"})  # the default floor depends on it
_OTHER_DRAGS: Final = ("ratio", "excursion", "acceleration", "contact_speed", "impact_force", "largest_speed")


def settings_between(before: Task, after: Task) -> dict[str, Setting]:
    """Return the keys of a scenario file that turn one task into another.

    Tasks may differ in the start of the object, gain, loop, limits and number of runs.

    Args:
        before: the task that the file describes.
        after: the changed task.

    Returns:
        New values by key, such as `{"controller.gain": "-0.86 N*s"}`; None removes a key.
    """
    settings: dict[str, Setting] = {}
    for name, unit in _OBSTACLE.items():
        start, moved = (float(getattr(task.scenario.obstacle, name)) for task in (before, after))
        if not math.isclose(start, moved, rel_tol=1e-9):
            settings[f"obstacle.{name}"] = setting(moved, unit)
    if after.gain != before.gain and after.gain is not None:
        settings |= _gain(after)
    for old, new in zip(limits_of(before.constraints), limits_of(after.constraints), strict=True):
        if old.constraint.limit != new.constraint.limit:
            name = new.constraint.name
            settings[f"constraints.{name}"] = setting(new.constraint.limit, unit_of(new.constraint.quantity))
    settings |= dict(_loop(before.loop, after.loop))
    if after.verify.runs != before.verify.runs:
        settings["verify.runs"] = after.verify.runs
    return settings


def setting(value: Any, unit: str) -> Setting:
    """Write a value as in a scenario file, with all of its digits."""
    if value is None or isinstance(value, bool | int):
        return value
    return float(value) if unit in _BARE else f"{float(value)!r} {written_unit(unit)}"


def _gain(task: Task) -> dict[str, Setting]:
    """Return the key of the gain, which depends on the control law."""
    number = task.law.number
    value = setting(task.gain, number.unit)
    if task.law == DAMPER:
        return {"controller.gain": value}
    others = _OTHER_DRAGS if task.law == DRAG else ()
    return {f"law.{number.key}": value, **{f"law.{name}": None for name in others}}


def _loop(before: Any, after: Any) -> Iterator[tuple[str, Setting]]:
    """Yield the settings in which two loops differ."""
    if after is before:
        return
    chain = dict(_changed("chain", before.chain, after.chain))
    yield from chain.items()
    yield from _changed("robot", before.plant, after.plant)
    if after.horizon != before.horizon:
        yield "loop.horizon", setting(after.horizon, "s")
    if not (isinstance(before.law, Controller) and isinstance(after.law, Controller)):
        return
    if after.law.period != before.law.period:
        yield "controller.rate", setting(float(f"{1 / after.law.period:.12g}"), "Hz")
        yield "controller.period", None
    old, new = before.law.conditioning, after.law.conditioning
    # the file does not have the sensor period, because it is that of the chain
    yield from ((key, value) for key, value in _changed("controller", old, new) if key != "controller.sensor_period")
    for key, value in _changed("controller", before.law.limits, after.law.limits):
        yield key.replace(".", ".largest_"), value
    if _NOISES & set(chain) and new.floor == old.floor:
        yield "controller.floor", setting(new.floor, OUTPUT)


def _changed(section: str, before: Any, after: Any) -> Iterator[tuple[str, Setting]]:
    """Yield the settings of a section in which two values of the same class differ."""
    for f in fields(after) if type(after) is type(before) else ():
        old, new = getattr(before, f.name), getattr(after, f.name)
        if old != new and not (isinstance(new, float) and math.isnan(new)):
            yield f"{section}.{f.name}", setting(new, f.metadata.get("unit", ""))
