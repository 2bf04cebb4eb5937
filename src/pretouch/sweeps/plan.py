"""Plan a sweep: check the inputs, and divide the grid of inputs into chunks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError, OutOfRangeError
from pretouch._core.numbers import finite, positive
from pretouch.design import OBSTACLE_SPEED, Task
from pretouch.design.custom_objectives import CustomObjective
from pretouch.motion import DAMPER, DRAG
from pretouch.motion.scenario import scenario_with

from .axes import ENCOUNTER_INPUTS, Axes, Axis, make_axes, with_input
from .results import STATUS, check_results, is_of_whole_motion

Region: TypeAlias = tuple[slice, ...]
"""A part of the grid: one slice per axis."""

# Encounters per chunk, so that a chunk takes a fraction of a second on one core; by (designs, general curve, whole
# motion). The last digits of results may depend on the chunk, because the encounters of a call share series.
_CHUNK: Final = {
    (False, False, False): 1 << 20,
    (False, True, False): 1 << 20,
    (False, False, True): 1 << 20,
    (False, True, True): 1 << 17,
    (True, False, False): 1 << 17,
    (True, True, False): 1 << 15,
    (True, False, True): 1 << 14,
    (True, True, True): 1 << 12,
}
_CHUNK_OF_SCANS: Final = 16  # designs that no compiled search solves take up to 50 ms each
_CHUNK_OF_INTEGRATION: Final = 1 << 11  # contacts under custom laws or with a course take 0.5 ms each
_CHUNK_OF_DRAG: Final = 1 << 15  # contacts under a drag take 20 us each


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """A planned sweep: a grid of encounters, and the results to compute for each encounter.

    Args:
        task: the task with the values of all inputs that are not on an axis.
        axes: the axes, in the order of the dimensions.
        results: names of the results; the status is always added.
        seed: seed of the random number generator that made the values, for the record; None if there is none.
        chunk: shape of a chunk, which is computed by one call of the solver and stored in one file.
    """

    task: Task
    axes: tuple[Axis, ...]
    results: tuple[str, ...]
    seed: int | None
    chunk: tuple[int, ...]

    @property
    def designs(self) -> bool:
        """True if the sweep designs gains; False if the sweep computes contacts for given gains."""
        return self.task.objective is not None

    @property
    def dims(self) -> tuple[str, ...]:
        """The names of the dimensions of the grid."""
        return tuple(axis.name for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """The lengths of the dimensions of the grid."""
        return tuple(map(len, self.axes))

    @property
    def size(self) -> int:
        """The number of encounters in the sweep."""
        return math.prod(self.shape)

    @property
    def chunk_grid(self) -> tuple[int, ...]:
        """The number of chunks along each dimension of the grid."""
        return tuple(-(-n // c) for n, c in zip(self.shape, self.chunk, strict=True))

    @property
    def chunk_count(self) -> int:
        """The number of chunks into which the grid is divided."""
        return math.prod(self.chunk_grid)

    def region(self, index: int) -> Region:
        """Return the part of the grid that a chunk contains."""
        # Chunks are numbered along the last dimension first.
        place = zip(np.unravel_index(index, self.chunk_grid), self.chunk, self.shape, strict=True)
        return tuple(slice(int(i) * c, min((int(i) + 1) * c, n)) for i, c, n in place)

    def thinned(self, most: int) -> Plan:
        """Return a small trial sweep with a few evenly spaced values of each axis."""
        # It has one chunk with at most `most` encounters.
        axes: list[tuple[int, Axis]] = []
        room = most
        for position, axis in sorted(enumerate(self.axes), key=lambda item: len(item[1])):
            count = max(1, min(len(axis), int(room ** (1 / (len(self.axes) - len(axes))) + 1e-9)))
            room //= count
            axes.append((position, axis.at(np.linspace(0, len(axis) - 1, count).astype(np.int64))))
        kept = tuple(axis for _, axis in sorted(axes, key=lambda item: item[0]))
        return replace(self, axes=kept, chunk=tuple(map(len, kept)))


def make_plan(
    task: Task, axes: Axes, *, results: Sequence[str] | None, seed: int | None = None, chunk_size: int | None = None
) -> Plan:
    """Check the request for a sweep, and divide its grid into chunks of limited size."""
    # `chunk_size` is the largest number of encounters of a chunk; None for a default size.
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
            f"gain: found {what}, but a sweep needs exactly one source of gains: gain=..., an axis 'gain', or "
            "objective=... with bounds=..."
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
    """Return the shape of the blocks into which a grid is divided, so that no block has too many encounters.

    The last axes are taken whole, and the first axis that does not fit is divided.

    Returns:
        The shape of a part, with at most `most` encounters.

    Examples:
        >>> part_shape((100, 30, 10), 1000), part_shape((100, 30, 10), 100)
        ((3, 30, 10), (1, 10, 10))
    """
    chunk, room = [1] * len(shape), most
    for k in reversed(range(len(shape))):
        if shape[k] > room:
            chunk[k] = -(-shape[k] // -(-shape[k] // room))
            break
        chunk[k] = shape[k]
        room //= shape[k]
    return tuple(chunk)


def _check_values(plan: Plan) -> None:
    """Check all input values of a sweep before the sweep starts."""
    scenario = plan.task.scenario
    first = {n: float(v[0]) for axis in plan.axes for n, v in axis.columns.items() if n in ENCOUNTER_INPUTS}
    positions = {name: first[name] for name in ("obstacle.position", "plant.position") if name in first}
    for axis in plan.axes:
        # all distances are checked below; here a large distance is used
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
            f"scale: found {OBSTACLE_SPEED!r}, which cannot scale the speed of an obstacle at rest, because this "
            "speed is 0; use a number in m/s"
        )


def task_at(task: Task, axes: Sequence[Axis], index: Sequence[int]) -> Task:
    """Return the task at one point of the sweep grid, for inputs whose values cannot be passed as arrays."""
    for axis, i in zip(axes, index, strict=True):
        for name, values in axis.columns.items():
            if name not in ENCOUNTER_INPUTS:
                task = with_input(task, name, float(values[i]))
    return task


def _check_distances(plan: Plan) -> None:
    """Check that all initial distances are positive and within the distance range of the sensor."""
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
                    f"obstacle position: an encounter starts at a distance of {distance:g} m, expected more than "
                    f"0 m and from {nearest:g} m to {farthest:g} m, where the {plan.task.sensor.name} curve is "
                    "valid"
                )


def _distance_part(axis: Axis) -> Any:
    zero = np.zeros(len(axis))
    return axis.columns.get("obstacle.position", zero) - axis.columns.get("plant.position", zero)
