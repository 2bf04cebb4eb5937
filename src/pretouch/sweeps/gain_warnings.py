"""Warn of gains in a sweep that make the sampled loop oscillate, or that pull the robot toward the object."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch.designs import Task
from pretouch.simulation import ClosedLoop

if TYPE_CHECKING:
    import xarray as xr

CHANGE_THE_LIMIT: Final = ("admittance.", "sensor.", "obstacle.position", "plant.position")
"""Inputs, or the beginnings of their names, that change the stability limit of a loop."""

_USUAL_MARGIN: Final = 2.0  # gain margin without a required one, as in `verification`: 6 dB
_ROUNDING: Final = 1e-6  # relative; a design at the required margin is not below it
_MOST_READ: Final = 10**7  # largest number of designed gains that are read


def gain_warnings(task: Task, dataset: xr.Dataset) -> tuple[str, ...]:
    """Return warnings about gains that nobody should use on a robot.

    The encounters of a sweep are computed in continuous time, where every gain is stable. On a sampled loop, a gain
    beyond the stability limit oscillates.

    Args:
        task: the swept task; the stability limit is that of its loop.
        dataset: the sweep.

    Returns:
        A sentence for each kind of such gains; empty if there are none, or if the gains are not among the results.
    """
    if "gain" in dataset.variables:
        if dataset["gain"].size > _MOST_READ:
            return ()
        gains = np.asarray(dataset["gain"].values)
    elif task.gain is not None:
        gains = np.asarray(task.gain, dtype=np.float64)
    else:
        return ()
    return tuple(_warnings(task, gains, [str(name) for name in dataset.coords], int(np.prod(dataset["status"].shape))))


def _warnings(task: Task, gains: Any, inputs: list[str], encounters: int) -> Iterator[str]:
    number = task.law.number
    mitigating, repeats = number.sign * gains, encounters // gains.size
    chasing = repeats * int(np.sum(mitigating < 0))
    if chasing:
        yield (
            f"in {chasing:,} of {encounters:,} encounters, the {number.name} pulls the robot toward the object: "
            f"mitigating {number.name}s are {number.mitigating}."
        )
    if not isinstance(task.loop, ClosedLoop) or not np.any(mitigating > 0):
        return
    changing = [name for name in inputs if name.startswith(CHANGE_THE_LIMIT)]
    if changing:
        yield (
            f"the stability of the sampled loop is not checked, because its limit changes with {changing[0]}: check a "
            f"{number.name} with pretouch verify before you use it."
        )
        return
    strongest = _strongest(task)
    symbol, is_linear = number.symbol, math.isfinite(strongest) and task.law.degree == 1
    margin = task.stability_margin or _USUAL_MARGIN
    allowed = f"{symbol} = {number.text(strongest / margin)}"  # stronger gains have a smaller margin
    unstable = repeats * int(np.sum(mitigating > abs(strongest)))
    if unstable:
        remedy = (
            f"the strongest with a gain margin of {margin:g} is {allowed}" if is_linear else f"weaken the {number.name}"
        )
        yield (
            f"in {unstable:,} of {encounters:,} encounters, the {number.name} is beyond the stability limit of the "
            f"sampled loop, {symbol} = {number.text(strongest)}: on a robot, the loop would oscillate; {remedy}."
        )
    near = repeats * int(np.sum(mitigating > (1 + _ROUNDING) * abs(strongest) / margin)) - unstable
    if is_linear and near:
        yield (
            f"in {near:,} of {encounters:,} encounters, the gain margin of the sampled loop is below {margin:g}; the "
            f"strongest {number.name} with this margin is {allowed}."
        )


def _strongest(task: Task) -> float:
    """Return the strongest gain with a stable loop in the encounter of a task; infinite if it is unknown."""
    loop: Any = task.loop
    try:
        limit = loop.stability_limit(task.scenario, task.sensor, 0.0)
    except InvalidInputError:  # a law whose damping is unknown
        return math.inf
    if limit.law.degree == 1:
        return float(limit.strongest)
    try:  # with a stronger drag, the object approaches more slowly, which allows a stronger drag
        low, high = loop.stable_bounds((-math.inf, math.inf), task.scenario, task.sensor, 1.0)
    except InvalidInputError:  # no drag is stable
        return 0.0
    return float(low if limit.law.number.sign < 0 else high)
