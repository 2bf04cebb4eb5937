"""Compute how far sensor noise moves a robot at rest.

The module also finds the detection threshold that prevents this motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.progress import note_work
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.control import Controller
from pretouch.designs import Task
from pretouch.motion import Obstacle, Scenario
from pretouch.simulation import ClosedLoop, IdealPlant
from pretouch.simulation.detection import detection_distance

from .changed_loop import rounded_up, with_settings

_REST: Final = 30.0  # s: longest time at rest
_STEPS: Final = 30_000  # largest number of controller steps: a fast controller is simulated for a shorter time
_RESTS: Final = 59  # runs: the largest of 59 values exceeds the 95 % quantile with a confidence of 95 %
_SCANS: Final = 5  # runs at each distance, to find the worst distance
# Distances to try: those at which the mean reading exceeds the floor by these numbers of standard deviations of noise.
_DEVIATIONS: Final = np.array([-0.5, 0.0, 0.5, 1.0, 1.5, 2.5, 4.0, 8.0])
_STILL: Final = 1e-3  # m: a robot that moves less counts as still
_KEPT: Final = 0.7  # target for the motion with a lower floor, as a share of _STILL; fewer runs show smaller motions
_WORTH: Final = 0.95  # a lower floor is tried only if it is below this share of a floor that suffices
_QUIET: Final = 0.3  # share of _STILL: with a smaller mean, fewer than 1 run of 20 exceeds _STILL
_TRIES: Final = 4  # number of higher floors that are tried
_LEAST: Final = 1e-9  # m: a smaller motion counts as this motion in a power law
_FARTHEST: Final = 2.0  # m
_ROUNDING: Final = 1e-6  # relative error of a motion that ends at the object
_OF_THIS_GAIN: Final = (
    "It suffices for this gain. A gain that is designed for the nearer start can be larger and need a higher floor: "
    "design and verify again until this warning ends."
)


class _Scan(NamedTuple):
    """Simulated runs of a robot at rest at several distances."""

    loop: ClosedLoop  # the loop at rest
    places: FloatArray  # distances to the object [m]
    largest: FloatArray  # largest motion of each run [m], shape (places, runs)

    @property
    def mean(self) -> FloatArray:
        """Mean of the largest motion at each distance [m]."""
        return np.asarray(self.largest.mean(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class RestMotion(Value):
    """How far sensor noise moves a robot at rest.

    Robot and object are both at rest, so noise alone causes the motion. The values hold at the worst distance, in 95 %
    of the runs, with a confidence of 95 %. The robot follows the virtual object exactly.

    Args:
        distance: the distance to the object at which the motion is largest [m].
        motion: the largest motion [m].
        duration: the simulated time [s].
        quiet_floor: a floor with which the same gain keeps the motion below 1 mm; None if none was found.
        detected_from: the distance from which objects are detected with this floor [m]; None without a floor.
    """

    distance: float
    motion: float
    duration: float
    quiet_floor: float | None = None
    detected_from: float | None = None

    @property
    def reaches_object(self) -> bool:
        """True if noise moves a robot at rest up to the object."""
        return self.motion >= self.distance * (1 - _ROUNDING)

    @property
    def text(self) -> str:
        """Text on the largest motion due to noise."""
        far = format_quantity(self.motion, "m", 3)
        return f"Sensor noise alone moves a robot at rest by up to {far} within {self.duration:g} s"

    def remedy(self, law: Any) -> str:
        """Return advice against the motion of a robot at rest.

        It recommends a higher detection threshold. If none was found, it recommends less noise or a dead zone.
        """
        faster = ["or raise largest_rate"] if law.conditioning.largest_rate is not None else []
        faster += ["or raise release"] if getattr(law.law, "approach_only", False) else []
        if self.quiet_floor is None:
            return ", ".join(["reduce the noise of the sensor", *faster, "or use a control law with a dead zone"])
        higher = f"set floor = {self.quiet_floor:g} in [controller] (the detection threshold)"
        return ", ".join([higher, *faster, "and verify again"])


def motion_at_rest(task: Task, gain: float) -> RestMotion | None:
    """Compute how far noise moves a robot at rest.

    A detection threshold that prevents this motion is searched for, too.

    Returns:
        The motion; None if it is below 1 mm, if nothing is ever detected, or for laws whose floor is unknown.
    """
    law = task.loop.law
    if not isinstance(law, Controller) or not gain:
        return None
    scan = _scan(task, gain, law, law.conditioning.floor)
    if scan is None:  # nothing is ever detected
        return None
    worst, moved = _bound(task, gain, scan)
    if not moved > _STILL:
        return None
    quiet = _quiet_floor(task, gain, law, scan, moved)
    place = None if quiet is None else float(_places(task, law, quiet, np.zeros(1))[0])
    return RestMotion(distance=worst, motion=moved, duration=_duration(law), quiet_floor=quiet, detected_from=place)


def rest_in_words(rest: RestMotion | None, law: Any) -> Iterator[str]:
    """Yield a warning if noise moves a robot at rest."""
    if rest is None:
        return
    where, still = format_quantity(rest.distance, "m", 3), format_quantity(_STILL, "m", 3)
    place = (
        f"This motion is largest at a distance of {where} to an object. In at least 95 % of runs, the robot moves "
        f"less (95 % confidence, {_RESTS} runs)."
    )
    if rest.quiet_floor is None or rest.detected_from is None:
        text = f"{rest.text}: reduce the noise, or use a control law with a dead zone."
        cause = (
            f"No higher detection threshold (floor of the controller) limits this motion to {still} and still detects "
            "objects."
        )
        yield caution("PT406", f"{text} {cause} {place}")
        return
    yield caution(
        "PT406",
        f"{rest.text}: a controller floor of {rest.quiet_floor:g} instead of {law.conditioning.floor:g} limits this to "
        f"{still}, but detects objects only at {format_quantity(rest.detected_from, 'm', 3)}, where the encounter must "
        f"then start. The floor is the detection threshold above the offset. {_OF_THIS_GAIN} {place}",
    )


def _duration(law: Controller) -> float:
    """Return the simulated time at rest [s]."""
    return float(f"{min(_REST, _STEPS * law.period):.3g}")


def _quiet_floor(task: Task, gain: float, law: Controller, scan: _Scan, moved: float) -> float | None:
    """Find a floor that limits the motion at rest, which is `moved` [m] with the present floor."""
    below, full = law.conditioning.floor, law.conditioning.saturation
    for _ in range(_TRIES):
        floor = float(f"{1.1 * below * moved / _STILL:.2g}")
        if full is not None and law.conditioning.offset + floor >= full:  # nothing would ever be detected
            return None
        higher = _scan(task, gain, law, floor)
        if higher is None:
            return None
        # A floor that is too high reduces the detection distance. So a floor between both is tried first. It follows
        # from a power law, whose exponent is that of the runs that find the worst distances.
        fall = math.log(max(scan.largest.max(), _LEAST) / max(higher.largest.max(), _LEAST))
        part = min(math.log(moved / (_KEPT * _STILL)) / fall, 1.0) if fall > 0 else 1.0
        between = rounded_up(below * (floor / below) ** part)
        if below < between < _WORTH * floor:
            middle = _scan(task, gain, law, between)
            if middle is not None and _bound(task, gain, middle, until=_STILL)[1] <= _STILL:
                return between
        _, moved = _bound(task, gain, higher, until=_STILL)
        if moved <= _STILL:
            return floor
        below, scan = floor, higher
    return None


def _scan(task: Task, gain: float, law: Controller, floor: float) -> _Scan | None:
    """Simulate a robot at rest at several distances."""
    places = np.unique(_places(task, law, floor, _DEVIATIONS))
    places = places[places > 0]
    if not len(places):
        return None
    loop = with_settings(task.loop, conditioning={"floor": floor})
    at_rest = replace(loop, plant=IdealPlant(), contact=None, horizon=_duration(law), seed=task.loop.seed + 1)
    return _Scan(at_rest, places, _largest(task, gain, at_rest, places, _SCANS))


def _bound(task: Task, gain: float, scan: _Scan, until: float = math.inf) -> tuple[float, float]:
    """Return the distance with the largest motion, and this motion [m].

    The motion is an upper bound of the 95 % quantile. The largest of 59 runs exceeds the 95 % quantile with a
    confidence of 95 %, since 0.95^59 = 0.048. They are other runs than those that find the worst distances. The robot
    follows the virtual object exactly. If a run exceeds `until` [m], the motion of this run is returned, because
    further runs cannot reduce the bound.
    """
    order = np.argsort(scan.mean)[::-1]
    worst, most = float(scan.places[order[0]]), float(scan.mean.max())
    if not most > _QUIET * _STILL:
        return worst, most
    place, moved = np.unravel_index(scan.largest.argmax(), scan.largest.shape)[0], float(scan.largest.max())
    if moved > until:
        return float(scan.places[place]), moved
    loop, moved = scan.loop.after(scan.largest.size), 0.0
    for place in order[:2]:
        here = float(_largest(task, gain, loop, scan.places[[place]], _RESTS).max())
        worst, moved = (float(scan.places[place]), here) if here > moved else (worst, moved)
        if moved > until:
            break
        loop = loop.after(_RESTS)
    return worst, moved


def _largest(task: Task, gain: float, loop: ClosedLoop, places: FloatArray, count: int) -> FloatArray:
    """Simulate a robot at rest, and return its largest motions [m]."""
    note_work("simulating a robot at rest")
    here = Scenario(admittance=task.scenario.admittance, obstacle=Obstacle(position=np.repeat(places, count)))
    excursions = loop.run(here, task.sensor, gain).largest_excursion
    return np.asarray(excursions).reshape(len(places), count)


def _places(task: Task, law: Controller, floor: float, deviations: FloatArray) -> FloatArray:
    """Return the detection distance [m] for each margin, in standard deviations of the noise."""
    conditioning = replace(law.conditioning, floor=floor)
    found = [detection_distance(task.sensor, task.loop.chain, conditioning, deviations=d) for d in deviations.tolist()]
    return np.minimum(found, _FARTHEST)
