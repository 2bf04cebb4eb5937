"""Check the inputs of a sweep, and divide its grid into blocks.

The grid of inputs is divided into chunks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, OutOfRangeError
from pretouch._core.numbers import finite, positive
from pretouch.designs import OBSTACLE_SPEED, Task
from pretouch.designs.custom_objectives import CustomObjective
from pretouch.motion import DAMPER, DRAG
from pretouch.motion.scenario import scenario_with

from .axes import ENCOUNTER_INPUTS, Axes, Axis, inputs_of, make_axes
from .encounters import solve_encounters, task_at
from .grid import Columns, Grid, Region
from .record import inputs_of_task, spoken
from .results import STATUS, check_results, is_of_whole_motion, result_attributes

# Encounters per chunk, so that a chunk takes a fraction of a second on one core; by (designs, general curve, whole
# motion). The last digits of results may depend on the chunk, because the encounters of a call share series.
_CHUNK: Final = {
    (False, False, False): 1 << 20,
    (False, True, False): 1 << 20,
    (False, False, True): 1 << 20,
    (False, True, True): 1 << 17,
    (True, False, False): 1 << 17,
    (True, True, False): 1 << 16,
    (True, False, True): 1 << 16,
    (True, True, True): 1 << 16,
}
_CHUNK_OF_SCANS: Final = 16  # designs that no compiled search solves take up to 50 ms each
_CHUNK_OF_INTEGRATION: Final = 1 << 11  # contacts under custom laws or with a course take 0.5 ms each
_CHUNK_OF_DRAG: Final = 1 << 15  # contacts under a drag take 20 us each


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan(Grid):
    """A planned sweep with its task, varied inputs and results.

    Args:
        task: the task with the values of all inputs that are not on an axis.
    """

    task: Task

    @property
    def designs(self) -> bool:
        """True if the sweep designs gains.

        Otherwise the sweep computes contacts for given gains.
        """
        return self.task.objective is not None

    @property
    def subject(self) -> str:
        """Name of the computed results in titles, such as `contacts`."""
        return "optimal gains" if self.designs else "contacts"

    def evaluate(self, region: Region) -> Columns:
        """Compute all encounters in a part of the sweep grid.

        Returns:
            Arrays of status and results.
        """
        return solve_encounters(
            self.task, [axis.at(part) for axis, part in zip(self.axes, region, strict=True)], self.results
        )

    def inputs(self) -> dict[str, Any]:
        """Return the inputs that the sweep does not vary.

        The values are in SI units and suitable for JSON.
        """
        return inputs_of_task(self.task)

    def input_attributes(self, name: str) -> dict[str, Any]:
        """Return name and unit of a varied input as metadata."""
        number = self.task.law.number
        words = number.label if name == "gain" and self.task.law != DAMPER else spoken(name)
        return {"long_name": words, "units": inputs_of(self.task)[name] or "1"}

    def result_attributes(self, name: str) -> dict[str, Any]:
        """Return the metadata of a computed quantity for the dataset.

        They include its long name and its unit.
        """
        return result_attributes(name, designs=self.designs, law=self.task.law)


def make_plan(
    task: Task, axes: Axes, *, results: Sequence[str] | None, seed: int | None = None, chunk_size: int | None = None
) -> Plan:
    """Check the arguments of a sweep and return its plan.

    `chunk_size` is the largest number of encounters of a chunk; None for a default size.

    Returns:
        The plan, whose grid of encounters is divided into chunks of limited size.

    Raises:
        InvalidInputError: an argument is invalid.
    """
    if task.scenario.shape != ():
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {task.scenario.shape}, expected a single "
            "encounter; pass arrays as axes of the sweep"
        )
    checked = make_axes(axes, task)
    designs = task.objective is not None
    gains = [axis.name for axis in checked if "gain" in axis.columns]
    if not designs and (task.gain is None) == (not gains):
        what = "a gain and an axis of gains" if gains else "neither gain nor objective"
        raise InvalidInputError(
            f"gain: found {what}, expected exactly one source of gains. Give gain=..., or an axis 'gain', or "
            "objective=... with bounds=...",
        )
    names = check_results(results, designs=designs, impact=task.impact)
    clash = next((axis.name for axis in checked if axis.name in (*names, STATUS)), None)
    if clash is not None:
        raise InvalidInputError(
            f"axes: the axis name {clash!r} is already the name of a result; choose another name for the axis"
        )
    finite(0.0 if task.gain is None else task.gain, "gain", task.law.number.unit)
    positive(task.horizon, "horizon", "s")
    most = chunk_size or _chunk_size(task, names)
    shape = tuple(map(len, checked))
    plan = Plan(task=task, axes=checked, results=names, seed=seed, chunk=part_shape(shape, most))
    _check_values(plan)
    return plan


def _chunk_size(task: Task, results: tuple[str, ...]) -> int:
    law, course = task.law, task.scenario.obstacle.course
    if law != DAMPER or course or isinstance(task.objective, CustomObjective):
        if task.objective is not None:
            return _CHUNK_OF_SCANS
        return _CHUNK_OF_DRAG if law == DRAG and not course else _CHUNK_OF_INTEGRATION
    quantities = set(results)
    if task.objective is not None:
        quantities |= {term.quantity for term in task.goal.terms} | {c.quantity for c in task.limits}
    curved = task.sensor.constant_log_slope is None or task.method == "integration"
    whole = any(map(is_of_whole_motion, quantities))
    return _CHUNK[task.objective is not None, curved, whole]


def part_shape(shape: tuple[int, ...], most: int) -> tuple[int, ...]:
    """Choose the shape of the chunks of a sweep grid.

    A chunk contains at most `most` encounters. From the last axis to the first, an axis that fits stays whole. The
    first axis that does not fit is divided, and a chunk contains one value of each axis before.

    Returns:
        The shape of a chunk.

    Examples:
        >>> part_shape((100, 30, 10), 1000), part_shape((100, 30, 10), 100)
        ((3, 30, 10), (1, 10, 10))
    """
    chunk, remaining = [1] * len(shape), most
    for k in reversed(range(len(shape))):
        if shape[k] > remaining:
            chunk[k] = -(-shape[k] // -(-shape[k] // remaining))
            break
        chunk[k] = shape[k]
        remaining //= shape[k]
    return tuple(chunk)


def _check_values(plan: Plan) -> None:
    """Check all input values of a sweep before the sweep starts."""
    scenario = plan.task.scenario
    first = {n: float(v[0]) for axis in plan.axes for n, v in axis.columns.items() if n in ENCOUNTER_INPUTS}
    positions = {name: first[name] for name in ("obstacle.position", "plant.position") if name in first}
    for axis in plan.axes:
        # _check_distances checks all distances; here a large distance replaces them
        near = {"obstacle.position": 1.0, "plant.position": 0.0} if positions else {}
        columns = {n: v for n, v in axis.columns.items() if n in ENCOUNTER_INPUTS and n not in near}
        changed = {name: value for name, value in {**first, **columns, **near}.items() if name != "gain"}
        scenario_with(scenario, changed)
        for i in range(len(axis) if axis.looped else 0):
            task_at(plan.task, (axis,), (i,))
    _check_distances(plan)
    velocities = next((a.columns["obstacle.velocity"] for a in plan.axes if "obstacle.velocity" in a.columns), None)
    moving = bool(scenario.obstacle.velocity != 0 if velocities is None else np.all(velocities != 0))
    terms = plan.task.goal.terms if plan.designs else ()
    if not moving and any(term.scale == OBSTACLE_SPEED for term in terms):
        raise InvalidInputError(
            f"scale: found {OBSTACLE_SPEED!r}, but the speed of the obstacle is 0 m/s. A speed of 0 m/s cannot scale "
            "a term of the objective. As the scale, use a number in m/s",
            value=OBSTACLE_SPEED,
        )


def _check_distances(plan: Plan) -> None:
    """Check that all initial distances are positive and within sensor range."""
    scenario, sensors = plan.task.scenario, [a for a in plan.axes if any(n.startswith("sensor.") for n in a.columns)]
    low = high = 0.0
    for name, position, sign in (
        ("obstacle.position", scenario.obstacle.position, 1.0),
        ("plant.position", scenario.plant.position, -1.0),
    ):
        if not any(name in axis.columns for axis in plan.axes):
            low, high = low + sign * position, high + sign * position
    for axis in plan.axes:
        if axis not in sensors:
            part = _distance_part(axis)
            low, high = low + part.min(), high + part.max()
    parts = [_distance_part(axis) for axis in sensors]
    for index in product(*map(range, map(len, sensors))):
        shift = sum(float(part[i]) for part, i in zip(parts, index, strict=True))
        nearest, farthest = task_at(plan.task, sensors, index).sensor.valid_range
        for distance in (low + shift, high + shift):
            if not (distance > 0 and nearest <= distance <= farthest):
                raise OutOfRangeError(
                    f"obstacle position: an encounter starts at a distance of {distance:g} m. Expected a positive "
                    f"distance from {nearest:g} m to {farthest:g} m. This is the valid range of the "
                    f"{plan.task.sensor.name} curve"
                )


def _distance_part(axis: Axis) -> Any:
    zero = np.zeros(len(axis))
    return axis.columns.get("obstacle.position", zero) - axis.columns.get("plant.position", zero)
