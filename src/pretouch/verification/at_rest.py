"""How far noise moves a robot that stands still near an object, and which floor of the readings keeps it still."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch.control import Controller
from pretouch.design import Task
from pretouch.motion import Obstacle, Scenario
from pretouch.simulation import IdealPlant

_REST: Final = 30.0  # s, at most
_STEPS: Final = 30_000  # of the law, at most: a quick controller rests for a shorter time
_RESTS: Final = 59  # runs: the largest of so many exceeds 95 % of all with a confidence of 95 %
_SCANS: Final = 5  # runs at each of some places, by which the worst is found
_DEVIATIONS: Final = np.array([-0.5, 0.0, 0.5, 1.0, 1.5, 2.5, 4.0, 8.0])  # of the noise above the floor, where to look
_STILL: Final = 1e-3  # m
_KEPT: Final = 0.9  # of that: what a lower floor aims at
_WORTH: Final = 0.95  # of a floor that is known to do: a lower one nearer to it is not tried
_QUIET: Final = 0.3  # of that: a mean below leaves no run of 20 above
_TRIES: Final = 4  # of a higher floor
_FARTHEST: Final = 2.0  # m
_PLACES: Final = 2001  # between contact and there


def creep_in_words(task: Task, gain: float) -> Iterator[str]:
    """Say how far noise moves a robot at rest near its detection limit, and which floor would keep it still."""
    law = task.loop.law
    if not isinstance(law, Controller) or not gain:
        return
    floor = law.conditioning.floor
    place, moved = _drift(task, gain, law, floor)
    if not moved > _STILL:
        return
    where, far, still = (format_quantity(x, "m", 3) for x in (place, moved, _STILL))
    text = (
        f"At rest before an object noise alone moves the robot, farthest at {where}, near where it is just detected: "
    )
    text += f"in 95 % of the runs by {far} at most within {_rest(law):g} s ({_RESTS} runs, 95 % confidence)"
    quiet = _quiet_floor(task, gain, law, moved)
    if quiet is None:
        yield f"{text}; no floor that was tried keeps it within {still}: less noise does, or a law with a dead zone."
        return
    sees = format_quantity(float(_places(task, law, quiet, np.zeros(1))[0]), "m", 3)
    yield f"{text}; with a floor of {quiet:g} it is {still} at most, and objects are detected from {sees} on."


def _rest(law: Controller) -> float:
    """Return for how long a robot is watched at rest [s]."""
    return float(f"{min(_REST, _STEPS * law.period):.3g}")


def _quiet_floor(task: Task, gain: float, law: Controller, moved: float) -> float | None:
    """Return a floor with which a robot at rest keeps still that moves so far [m] with its own; None if none does."""
    below = floor = law.conditioning.floor
    far = moved
    for _ in range(_TRIES):
        floor = float(f"{1.1 * floor * moved / _STILL:.2g}")
        _, moved = _drift(task, gain, law, floor)
        if moved <= _STILL:
            break
        below, far = floor, moved
    else:
        return None
    # a floor that is higher than need be costs distance: one between is tried, by a power law through both
    part = math.log(far / (_KEPT * _STILL)) / math.log(far / moved)
    between = float(f"{below * (floor / below) ** min(part, 1.0):.2g}")
    return between if below < between < _WORTH * floor and _drift(task, gain, law, between)[1] <= _STILL else floor


def _drift(task: Task, gain: float, law: Controller, floor: float) -> tuple[float, float]:
    """Return where noise moves a robot at rest farthest [m], and how far in 95 % of the runs at most [m].

    The largest of 59 runs exceeds 95 % of all with a confidence of 95 %, for 0.95^59 = 0.048. The places come from runs
    of their own. The robot is the virtual object, which it follows.
    """
    places = np.unique(_places(task, law, floor, _DEVIATIONS))
    places = places[places > 0]
    if not len(places):
        return 0.0, np.nan  # nothing is ever detected
    loop = replace(task.loop, law=replace(law, conditioning=replace(law.conditioning, floor=floor)))
    at_rest = replace(loop, plant=IdealPlant(), contact=None, horizon=_rest(law), seed=task.loop.seed + 1)

    def largest(places: FloatArray, count: int, first: int) -> FloatArray:
        here = Scenario(admittance=task.scenario.admittance, obstacle=Obstacle(position=np.repeat(places, count)))
        found = at_rest.after(first).run(here, task.sensor, gain).largest_excursion
        return np.asarray(found).reshape(len(places), count)

    scanned = largest(places, _SCANS, 0).mean(axis=1)
    worst = places[np.argsort(scanned)[-2:]]
    if not scanned.max() > _QUIET * _STILL:
        return float(worst[-1]), float(scanned.max())
    moved = largest(worst, _RESTS, len(places) * _SCANS).max(axis=1)
    return float(worst[moved.argmax()]), float(moved.max())


def _places(task: Task, law: Controller, floor: float, deviations: FloatArray) -> FloatArray:
    """Return the farthest distances at which readings exceed a floor by so many deviations of their noise [m], or 0."""
    sensor, chain = task.sensor, task.loop.chain
    low, high = sensor.valid_range
    places = np.linspace(max(low, 0.0), min(high, _FARTHEST), _PLACES)
    xi = np.exp(np.asarray(sensor.log_output(places)))
    level = xi + chain.crosstalk + chain.offset - law.conditioning.offset
    by_distance = np.abs(np.asarray(sensor.log_slope(places))) * chain.distance_noise
    noise = np.hypot(
        np.hypot(chain.noise, chain.resolution * 12**-0.5), xi * np.hypot(chain.relative_noise, by_distance)
    )
    seen = level >= floor + deviations[:, None] * noise
    return np.asarray(np.where(seen, places, 0.0).max(axis=1))
