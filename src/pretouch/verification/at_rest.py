"""Compute how far sensor noise moves a robot at rest, and the noise floor that keeps the robot still."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.progress import note_work
from pretouch._core.units import format_quantity
from pretouch.control import Controller
from pretouch.design import Task
from pretouch.motion import Obstacle, Scenario
from pretouch.simulation import IdealPlant

_REST: Final = 30.0  # s: longest time at rest
_STEPS: Final = 30_000  # largest number of controller steps: a fast controller is simulated for a shorter time
_RESTS: Final = 59  # runs: the largest of 59 values exceeds the 95 % quantile with a confidence of 95 %
_SCANS: Final = 5  # runs at each distance, to find the worst distance
# Distances to try: those at which the mean reading exceeds the floor by these numbers of standard deviations of noise.
_DEVIATIONS: Final = np.array([-0.5, 0.0, 0.5, 1.0, 1.5, 2.5, 4.0, 8.0])
_STILL: Final = 1e-3  # m: a robot that moves less counts as still
_KEPT: Final = 0.9  # target for the drift with a lower floor, as a share of _STILL
_WORTH: Final = 0.95  # a lower floor is tried only if it is below this share of a floor that suffices
_QUIET: Final = 0.3  # share of _STILL: with a smaller mean, fewer than 1 run of 20 exceeds _STILL
_TRIES: Final = 4  # number of higher floors that are tried
_FARTHEST: Final = 2.0  # m
_PLACES: Final = 2001  # number of distances from contact to _FARTHEST


def creep_in_words(task: Task, gain: float) -> Iterator[str]:
    """Yield a sentence on how far noise moves a robot at rest near an object, and which signal floor prevents this."""
    law = task.loop.law
    if not isinstance(law, Controller) or not gain:
        return
    floor = law.conditioning.floor
    worst, moved = _drift(task, gain, law, floor)
    if not moved > _STILL:
        return
    where, far, still = (format_quantity(x, "m", 3) for x in (worst, moved, _STILL))
    text = f"Sensor noise alone moves a robot at rest by up to {far} within {_rest(law):g} s"
    place = f"These values hold at the worst distance, {where}, in 95 % of the runs ({_RESTS} runs, 95 % confidence)."
    quiet = _quiet_floor(task, gain, law, moved)
    if quiet is None:
        yield (
            f"{text}: no tried floor of the controller keeps this motion within {still}, so reduce the "
            f"noise, or use a law with a dead zone. {place}"
        )
        return
    sees = format_quantity(float(_places(task, law, quiet, np.zeros(1))[0]), "m", 3)
    yield (
        f"{text}: a controller floor of {quiet:g} instead of {floor:g} (unit of the readings) keeps this motion "
        f"within {still}, but objects are then detected only from {sees} on. {place}"
    )


def _rest(law: Controller) -> float:
    """Return the time [s] for which the motion of a robot at rest is simulated."""
    return float(f"{min(_REST, _STEPS * law.period):.3g}")


def _quiet_floor(task: Task, gain: float, law: Controller, moved: float) -> float | None:
    """Return a signal floor with which noise does not move a robot at rest; None if no such floor is found."""
    # With the present floor, the robot moves by `moved` [m].
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
    # A floor that is too high reduces the detection distance. So a floor between the last two is tried, by a power law.
    part = math.log(far / (_KEPT * _STILL)) / math.log(far / moved)
    between = float(f"{below * (floor / below) ** min(part, 1.0):.2g}")
    return between if below < between < _WORTH * floor and _drift(task, gain, law, between)[1] <= _STILL else floor


def _drift(task: Task, gain: float, law: Controller, floor: float) -> tuple[float, float]:
    """Return the distance [m] at which noise moves a robot at rest most, and a 95 % bound of this motion [m].

    The largest of 59 runs exceeds the 95 % quantile with a confidence of 95 %, since 0.95^59 = 0.048. Separate runs
    find the worst distances. The robot follows the virtual object exactly.
    """
    places = np.unique(_places(task, law, floor, _DEVIATIONS))
    places = places[places > 0]
    if not len(places):
        return 0.0, np.nan  # nothing is ever detected
    loop = replace(task.loop, law=replace(law, conditioning=replace(law.conditioning, floor=floor)))
    at_rest = replace(loop, plant=IdealPlant(), contact=None, horizon=_rest(law), seed=task.loop.seed + 1)

    def largest(places: FloatArray, count: int, first: int) -> FloatArray:
        note_work("simulating a robot at rest")
        here = Scenario(admittance=task.scenario.admittance, obstacle=Obstacle(position=np.repeat(places, count)))
        excursions = at_rest.after(first).run(here, task.sensor, gain).largest_excursion
        return np.asarray(excursions).reshape(len(places), count)

    scanned = largest(places, _SCANS, 0).mean(axis=1)
    worst = places[np.argsort(scanned)[-2:]]
    if not scanned.max() > _QUIET * _STILL:
        return float(worst[-1]), float(scanned.max())
    moved = largest(worst, _RESTS, len(places) * _SCANS).max(axis=1)
    return float(worst[moved.argmax()]), float(moved.max())


def _places(task: Task, law: Controller, floor: float, deviations: FloatArray) -> FloatArray:
    """Return the farthest distance [m] at which the mean reading exceeds a floor, for several noise margins."""
    # A noise margin is a number of standard deviations of the noise.
    sensor, chain = task.sensor, task.loop.chain
    low, high = sensor.valid_range
    places = np.linspace(max(low, 0.0), min(high, _FARTHEST), _PLACES)
    xi = np.exp(np.asarray(sensor.log_output(places)))
    level = xi + chain.crosstalk + chain.offset - law.conditioning.offset
    by_distance = np.abs(np.asarray(sensor.log_slope(places))) * chain.distance_noise
    noise = np.hypot(
        np.hypot(chain.noise, chain.resolution * 12**-0.5), xi * np.hypot(chain.relative_noise, by_distance)
    )
    detected = level >= floor + deviations[:, None] * noise
    return np.asarray(np.where(detected, places, 0.0).max(axis=1))
