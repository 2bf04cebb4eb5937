"""Compute the distance at which the controller detects an object, and compare it with the start of an encounter.

The control law acts from this distance on. A design in continuous time acts from the start of the encounter. So both
must agree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.control import Conditioning
from pretouch.motion import ContactResult, Scenario
from pretouch.motion.bodies import Stretch
from pretouch.sensors import SensorModel

from .chain import SensorChain

BRIGHTER: Final = 2.0  # signal of a brighter object, relative to the object of the scenario
AGREES: Final = 0.05  # share of the start distance: a smaller difference of both distances counts as agreement
NOTICED: Final = 0.03  # relative change of speed or excursion at contact that is noticed
_FARTHEST: Final = 100.0  # m: farther detections count as detections at any distance
_NEAREST: Final = 1e-5  # m: first distance of the geometric scan
_PLACES: Final = 801  # distances of each scan
_ROUNDS: Final = 4  # scans, each in the interval that the one before found
_SIGMAS: Final = 3.0  # a floor below this number of standard deviations of the noise detects noise


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionRange(Value):
    """Where the controller detects an object, next to where the encounter starts.

    At the detection distance, half of the readings are above the floor.

    Args:
        start: distance at the start of the encounter [m].
        distance: detection distance of the object of the scenario [m]; 0 if it is never detected, infinite if the
            controller detects at any distance. It is at most the distance at which an accelerated object was at rest.
        is_beyond_curve: whether the signal is still clearly above the floor where the sensor curve ends.
        brighter: detection distance of an object with twice the signal [m].
        reaches: farthest distance of the sensor curve [m]. If `distance` equals it, the true one may be larger.
        floor: the detection threshold of the controller [output unit].
        floor_at_start: the threshold with which the object is detected at the start [output unit]; None if that would
            be less than three standard deviations of the noise.
        moved: the encounter that starts at the detection distance; None if the object never is there.
        velocity: velocity of the object at the start [m/s].
    """

    start: float
    distance: float
    is_beyond_curve: bool
    brighter: float
    reaches: float
    floor: float
    floor_at_start: float | None
    moved: Scenario | None
    velocity: float

    @property
    def is_early(self) -> bool:
        """True if the controller detects the object clearly before the encounter starts."""
        return self.distance > (1 + AGREES) * self.start or self.is_beyond_curve

    @property
    def is_late(self) -> bool:
        """True if the controller detects the object clearly after the encounter has started."""
        return 0 < self.distance < (1 - AGREES) * self.start

    @property
    def place(self) -> str:
        """The detection distance in words, such as `at 165 mm`."""
        if math.isinf(self.distance):
            return "at any distance"
        return f"{'beyond' if self.is_beyond_curve else 'at'} {_length(self.distance)}"

    @property
    def cures(self) -> str:
        """Both ways to make the distances agree, as a request.

        They can be copied into the scenario file.
        """
        start = floor = ""
        if self.moved is not None and not self.is_beyond_curve:
            here = self.moved.obstacle
            start = f'set position = "{_length(float(here.position))}"'
            if abs(float(here.velocity) - self.velocity) > AGREES * abs(self.velocity):
                start += f' and velocity = "{format_quantity(float(here.velocity), "m/s", 3)}"'
            start += " in [obstacle]"
        if self.floor_at_start is not None:
            floor = f"set floor = {float(f'{self.floor_at_start:.3g}'):g} in [controller]"
        other = "calibrate at larger distances" if self.is_beyond_curve else "subtract the offset of the readings"
        cures = [cure for cure in (start, floor) if cure]
        return ", or ".join(cures if start else [*cures, other] if self.is_early else cures) or "use a stronger signal"


def detection_distance(
    sensor: SensorModel,
    chain: SensorChain,
    conditioning: Conditioning,
    *,
    deviations: float = 0.0,
    signal: float = 1.0,
) -> float:
    """Return the largest distance at which readings exceed the detection threshold.

    At this distance, the mean reading is at the floor. Offset, crosstalk, quantization and clipping are included.

    Args:
        sensor: the sensor curve.
        chain: the sensor chain.
        conditioning: the controller's offset and floor.
        deviations: margin above the floor in standard deviations of a reading; at 0, half of the readings exceed it.
        signal: factor on the signal, such as 2 for a brighter object.

    Returns:
        The distance [m]; 0 if no distance is detected, infinite if the controller detects at any distance. It is the
        end of the sensor curve if the signal is above the floor there.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> curve = InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
        >>> chain = SensorChain(rate=250.0, crosstalk=150.0)
        >>> round(detection_distance(curve, chain, Conditioning(floor=100.0, offset=150.0)), 3)
        0.165
    """
    low, high = max(sensor.valid_range[0], 0.0), sensor.valid_range[1]
    least = _least_signal(chain, conditioning)
    if least <= 0 and not deviations:
        return high if math.isfinite(high) else math.inf
    end = min(high, _FARTHEST)
    places = low + np.concatenate([[0.0], np.geomspace(_NEAREST, end - low, _PLACES - 1)])
    places[-1] = end
    for _ in range(_ROUNDS):
        with np.errstate(over="ignore"):
            xi = signal * np.exp(np.asarray(sensor.log_output(places)))
        needed = least + deviations * noise_of_reading(sensor, chain, places, xi) if deviations else least
        above = np.flatnonzero(xi >= needed)
        if not len(above):
            return 0.0
        last = int(above[-1])
        if last == len(places) - 1:
            return high if end == high or places[-1] < end else math.inf
        places = np.linspace(places[last], places[last + 1], _PLACES)
    return float(places[0])


def _least_signal(chain: SensorChain, conditioning: Conditioning) -> float:
    """Return the mean signal above which half of the readings exceed the floor [output unit]."""
    edge = conditioning.offset + conditioning.floor
    if chain.resolution > 0:  # the smallest step above the edge is reached half a step below
        edge = chain.resolution * (math.floor(edge / chain.resolution) + 0.5)
    if edge > chain.highest:
        return math.inf
    return -math.inf if edge < chain.lowest else edge - chain.offset - chain.crosstalk


def noise_of_reading(sensor: SensorModel, chain: SensorChain, places: FloatArray, xi: FloatArray) -> FloatArray:
    """Return the standard deviation of single readings at some distances [output unit]."""
    by_distance = np.abs(np.asarray(sensor.log_slope(places))) * chain.distance_noise
    return np.asarray(
        np.hypot(np.hypot(chain.noise, chain.resolution * 12**-0.5), xi * np.hypot(chain.relative_noise, by_distance))
    )


def detection_range(
    scenario: Scenario, sensor: SensorModel, chain: SensorChain, conditioning: Conditioning
) -> DetectionRange:
    """Compare the detection distance with the start of one encounter."""
    start = float(scenario.distance)
    found, brighter = (detection_distance(sensor, chain, conditioning, signal=factor) for factor in (1.0, BRIGHTER))
    moved = None
    if math.isfinite(found) and found > 0:
        time = float(time_at(scenario, found))
        moved = moved_on(scenario, time) if math.isfinite(time) else None  # an object at rest is never farther away
        if found > start:  # an object at rest does not come from farther away
            found = start if moved is None else float(moved.distance)
    return DetectionRange(
        start=start,
        distance=found,
        is_beyond_curve=found >= sensor.valid_range[1] and detects_beyond_curve(sensor, chain, conditioning),
        brighter=brighter,
        reaches=sensor.valid_range[1],
        floor=conditioning.floor,
        floor_at_start=floor_at(sensor, chain, conditioning, start),
        moved=moved,
        velocity=float(scenario.obstacle.velocity),
    )


def detects_beyond_curve(sensor: SensorModel, chain: SensorChain, conditioning: Conditioning) -> bool:
    """Return True if the signal is still clearly above the floor where the sensor curve ends."""
    end = sensor.valid_range[1]
    if not math.isfinite(end):
        return False
    floor = floor_at(sensor, chain, conditioning, end)
    return floor is not None and floor > (1 + AGREES) * conditioning.floor


def floor_at(sensor: SensorModel, chain: SensorChain, conditioning: Conditioning, distance: float) -> float | None:
    """Return the floor with which the controller detects the object at a distance [output unit].

    None if the signal is lost in the noise there.
    """
    place = np.array([distance])
    xi = float(np.exp(np.asarray(sensor.log_output(place)))[0])
    floor = xi + chain.offset + chain.crosstalk - conditioning.offset
    noise = chain.additive_noise
    return floor if floor > 0 and floor >= _SIGMAS * noise * (1 - AGREES) else None


def time_at(scenario: Scenario, distance: Any) -> FloatArray:
    """Return the time at which a robot that does not react has a distance to the object [s].

    The time is negative for distances beyond the start. An accelerated object that was at rest nearer than this
    distance is at rest at this time. NaN if the object never has this distance, or does not approach. The encounters
    may be an array.
    """
    o = scenario.obstacle
    first = o.course[0].acceleration if o.course else o.acceleration
    velocity, acceleration = np.broadcast_arrays(
        np.asarray(scenario.relative_velocity, dtype=np.float64), np.asarray(first - scenario.reference.acceleration)
    )
    change = np.asarray(distance - scenario.distance, dtype=np.float64)
    square = velocity**2 + 2 * acceleration * change
    with np.errstate(invalid="ignore", divide="ignore"):
        at_rest = np.where(change > 0, -velocity / acceleration, np.nan)
        time = np.where(square < 0, at_rest, 2 * change / (velocity - np.sqrt(np.maximum(square, 0.0))))
    return np.asarray(np.where(velocity > 0, np.nan, np.where(change == 0, 0.0, time)))


def moved_on(scenario: Scenario, time: Any) -> Scenario:
    """Return the encounter as it is some time later or earlier, if the robot only follows its reference.

    Before its start, the object has its first acceleration. The time may be an array [s].
    """
    o, r, p = scenario.obstacle, scenario.reference, scenario.plant
    first = o.course[0].acceleration if o.course else o.acceleration
    moved, gained = (r.velocity + 0.5 * r.acceleration * time) * time, r.acceleration * time
    early, late = np.minimum(time, 0.0), np.maximum(time, 0.0)
    position = o.position_at(late) + (o.velocity + 0.5 * first * early) * early
    velocity = o.velocity_at(late) + first * early
    course = tuple(replace(s, until=_plain(s.until - time)) for s in o.course if np.all(s.until > time))
    return replace(
        scenario,
        obstacle=replace(o, position=_plain(position), velocity=_plain(velocity), course=course),
        reference=replace(r, position=_plain(r.position + moved), velocity=_plain(r.velocity + gained)),
        plant=replace(p, position=_plain(p.position + moved), velocity=_plain(p.velocity + gained)),
    )


def begun_before(scenario: Scenario, time: FloatArray) -> Scenario:
    """Return encounters that begin some time before their start [s].

    Until the start, the object keeps its velocity at the start.
    """
    o, r, p = scenario.obstacle, scenario.reference, scenario.plant
    moved, gained = -(r.velocity - 0.5 * r.acceleration * time) * time, -r.acceleration * time
    course = tuple(replace(s, until=s.until + time) for s in o.course)
    if course or np.any(np.asarray(o.acceleration) != 0):
        course = (Stretch(until=np.maximum(time, _INSTANT)), *course)
    return replace(
        scenario,
        obstacle=replace(o, position=o.position - o.velocity * time, course=course),
        reference=replace(r, position=r.position + moved, velocity=r.velocity + gained),
        plant=replace(p, position=p.position + moved, velocity=p.velocity + gained),
    )


_INSTANT: Final = 1e-12  # s: the stretch of an encounter that begins at its start


def start_in_words(
    detection: DetectionRange | None, scenario: Scenario, predict: Callable[[Scenario], ContactResult] | None
) -> Iterator[str]:
    """Yield a warning if the controller does not detect the object where the encounter starts.

    There is no warning if this changes neither the predicted speed at contact nor the largest excursion noticeably.

    Args:
        detection: the detection distance; None if it is unknown.
        scenario: the encounter.
        predict: function that predicts the contact of an encounter with the gain; None without a gain.
    """
    d = detection
    if d is None or not (d.is_early or d.is_late):
        return
    effect = _Effect.none()
    if predict is not None and d.moved is not None:
        effect = _Effect.of(predict(scenario), predict(d.moved))
        if effect.is_small and not d.is_beyond_curve:
            return
    start, only = _length(d.start), "only " if d.is_late else ""
    where = f"detects the object {only}{d.place}, but the encounter starts at {start}"
    text = f"The floor of {d.floor:g} {where}: {d.cures}, and design again."
    if d.is_early:
        why = (
            "The law acts as soon as the controller detects the object. The design assumes that it acts from the start."
        )
    else:
        why = (
            "Before detection, there is no virtual force. The design assumes that the law acts from the start. If the "
            f'object comes from farther away than it is detected, add start_distance = "{start}" to [loop].'
        )
    bright = "" if math.isinf(d.brighter) else f"An object with twice the signal is detected at {_length(d.brighter)}."
    yield caution("PT421", " ".join(filter(None, [text, effect.text, why, bright])))


class _Effect(NamedTuple):
    """Predicted contact for an encounter from the start and one from the detection distance."""

    speeds: tuple[float, float]
    excursions: tuple[float, float]

    @classmethod
    def none(cls) -> _Effect:
        return cls((math.nan, math.nan), (math.nan, math.nan))

    @classmethod
    def of(cls, start: ContactResult, detected: ContactResult) -> _Effect:
        results = start, detected
        speeds = (abs(float(r.end.relative_velocity)) if r.reached.all() else math.nan for r in results)
        first, second = speeds
        return cls((first, second), (float(start.end.largest_excursion), float(detected.end.largest_excursion)))

    @property
    def is_small(self) -> bool:
        """True if speed and excursion change little."""
        return all(abs(after - before) <= NOTICED * before for before, after in (self.speeds, self.excursions))

    @property
    def text(self) -> str:
        first, second = self.speeds
        if math.isnan(first) or math.isnan(second):
            return ""
        before, after = (format_quantity(speed, "m/s", 3) for speed in (first, second))
        retreat = " and ".join(format_quantity(x, "m", 3) for x in self.excursions)
        return (
            f"Predicted from the detection distance, contact is at {after} instead of {before}. The largest excursions "
            f"from the start and from there are {retreat}."
        )


def _length(distance: float) -> str:
    return format_quantity(distance, "m", 4 if distance >= 0.1 else 3)


def _plain(value: Any) -> Any:
    return value if np.ndim(value) else float(value)
