"""Simulate many encounters with many control laws at once, on the noisy sampled loop of `pt.ClosedLoop`.

The robot is ideal and follows a free virtual mass M. A sensor measures every T = 4 ms, and the controller uses a
reading on its next 1 ms tick after the delay. Between two ticks with readings, the acceleration c of the robot is
constant. Therefore the distance l and the closing speed w are exact. With b, the acceleration of the object toward the
robot:

    l(t) = l - w t + (c - b) t^2/2,      contact at t = 2 l/(w + sqrt(w^2 - 2 (c - b) l)).

The readings, the smoothing, and the dead zone are those of the sampled virtual drag (docs/explanation/control.md). A
control law turns what it reads into an impulse. tests/agreement/test_policies.py compares this loop with
`pt.ClosedLoop` for the drag.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDrag
from pretouch.designs.drag import drag_by

Array = np.ndarray
Memory = tuple[Array, ...]

MASS = 1.0  # M [kg]
RATIO = 0.15  # contact speed over approach speed of the drag on an ideal loop
START = 0.0422  # l_d [m] for which the drag is designed
SPEEDS, REFLECTANCES = (0.1, 0.5), (0.5, 2.0)  # m/s; relative to the calibration
SENSOR = pt.InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
NOISE, RELATIVE_NOISE, RESOLUTION, OFFSET, HIGHEST = 20.0, 3e-3, 4.0, 50.0, 65535.0
CHAIN = pt.SensorChain(
    rate=250.0,
    delay=2e-3,
    random_phase=True,
    offset=OFFSET,
    noise=NOISE,
    relative_noise=RELATIVE_NOISE,
    resolution=RESOLUTION,
    lowest=0.0,
    highest=HIGHEST,
)
PHI = drag_by(SENSOR, START, MASS, ratio=RATIO).drag  # N s^2
CONTROLLER = Controller(
    period=1e-3,
    conditioning=Conditioning(floor=100.0, sensor_period=CHAIN.period),
    law=VirtualDrag(drag=PHI, noise=NOISE, relative_noise=RELATIVE_NOISE, resolution=RESOLUTION),
    admittance=VirtualAdmittance(mass=MASS, damping=0.0, stiffness=0.0),
)
NUMBERS = CONTROLLER.law.numbers(CONTROLLER)  # of the sampled drag
READINGS = 600  # per encounter at most
T = CHAIN.period


class Encounters(NamedTuple):
    """Encounters, arrays of shape (n,).

    Args:
        speed: approach speed v [m/s].
        distance: l_d at which the sensor detects the object [m].
        reflectance: relative to the calibration.
        phase: time of the first reading [s].
        noise: standard normal numbers, a row per reading.
        push: acceleration of the object toward the robot [m/s^2].
    """

    speed: Array
    distance: Array
    reflectance: Array
    phase: Array
    noise: Array
    push: Array


def draw_encounters(rng: np.random.Generator, count: int, spread: float) -> Encounters:
    """Draw speed, reflectance and detection distance, all uniform in their logarithms.

    Args:
        rng: source of the random numbers.
        count: number of encounters.
        spread: the detection distance is between START/spread and START x spread.

    Returns:
        Encounters with objects of constant speed.
    """
    distances = (START / spread, START * spread)
    speed, distance, reflectance = (
        np.exp(rng.uniform(np.log(low), np.log(high), count)) for low, high in (SPEEDS, distances, REFLECTANCES)
    )
    noise = rng.standard_normal((READINGS, count))
    return Encounters(speed, distance, reflectance, rng.uniform(0.0, T, count), noise, np.zeros(count))


class Seen(NamedTuple):
    """What a control law can use at one reading, arrays of shape (lanes,).

    Args:
        number: of the reading; 0 is the first one.
        reading: xi with noise and offset [counts].
        rate: smoothed s' beyond its noise [1/s].
        rise: of the smoothed s beyond its dead zone since the last reading.
        total: rise of the smoothed s since the first reading.
        retreat: of the robot since the last reading, at the times of the readings [m].
        velocity: of the robot's retreat [m/s].
    """

    number: int
    reading: Array
    rate: Array
    rise: Array
    total: Array
    retreat: Array
    velocity: Array

    @property
    def time(self) -> float:
        """Time since the first reading [s]."""
        return self.number * T


class Law(Protocol):
    """A control law with numbers `theta`, one row per number and one column per lane."""

    def start(self, lanes: int) -> Memory:
        """Return the memory before the first reading."""

    def step(self, theta: Array, memory: Memory, seen: Seen) -> tuple[Array, Memory]:
        """Return the impulse away from the object [N s], and the next memory."""


class Outcome(NamedTuple):
    """Results, arrays of shape (laws, encounters).

    Args:
        ratio: contact speed over the approach speed v; 0 without contact.
        excursion: retreat at contact [m]; without contact, with the remaining distance added.
        acceleration: largest acceleration of the robot [m/s^2].
    """

    ratio: Array
    excursion: Array
    acceleration: Array


class _Lanes(NamedTuple):
    """State of the running encounters: which they are, motion, filters. `retreat` is that at the last reading."""

    number: Array
    which: Array
    speed: Array
    age: Array
    push: Array
    distance: Array
    closing: Array
    velocity: Array
    acceleration: Array
    excursion: Array
    largest: Array
    retreat: Array
    level: Array
    rate: Array
    mark: Array
    first: Array


def _start(encounters: Encounters, laws: int) -> _Lanes:
    """Return all lanes at the tick of the first reading; the robot rests until then."""
    which = np.tile(np.arange(len(encounters.speed)), laws)
    speed, distance, _, phase, push = (a[which] for a in (*encounters[:4], encounters.push))
    tick = np.ceil((phase + CHAIN.delay) / CONTROLLER.period) * CONTROLLER.period
    zero = np.zeros(len(which))
    ahead = distance - speed * tick - push * tick**2 / 2
    closing = speed + push * tick
    moving = (ahead, closing, zero, zero, zero, zero, zero)
    return _Lanes(np.arange(len(which)), which, speed, tick - phase, push, *moving, *(zero,) * 4)


def _read(lanes: _Lanes, encounters: Encounters, index: int) -> Array:
    """Return the readings [counts], which were measured `age` before the tick."""
    age = lanes.age
    distance = lanes.distance + lanes.closing * age + (lanes.acceleration - lanes.push) * age**2 / 2
    xi = encounters.reflectance[lanes.which] * SENSOR.scale * (distance + SENSOR.distance_offset) ** -SENSOR.exponent
    deviation = np.sqrt(NOISE**2 + (RELATIVE_NOISE * xi) ** 2)
    reading = np.clip(xi + OFFSET + deviation * encounters.noise[index, lanes.which], 0.0, HIGHEST)
    return np.maximum(RESOLUTION * np.rint(reading / RESOLUTION), CONTROLLER.conditioning.floor)


def _observe(lanes: _Lanes, reading: Array, index: int) -> tuple[_Lanes, Seen]:
    """Smooth ln xi and its rate as the sampled drag does."""
    s = np.log(reading / CONTROLLER.conditioning.floor)
    sigma = np.sqrt(NUMBERS.variance + NUMBERS.relative_variance * reading**2) / reading
    width, still = NUMBERS.width * sigma, NUMBERS.still * sigma
    if index == 0:
        lanes = lanes._replace(level=s, first=s, mark=s + width)
    missed = s - (lanes.level + lanes.rate * T)
    level = lanes.level + lanes.rate * T + NUMBERS.level_share * missed
    rate = lanes.rate + NUMBERS.rate_share * missed / T
    rise = np.maximum(level - lanes.mark, 0.0)
    mark = np.minimum(np.maximum(lanes.mark, level), level + width)
    fast = np.where(rate > still, np.sqrt(np.maximum(rate**2 - still**2, 0.0)), 0.0)
    retreat = lanes.excursion - lanes.velocity * lanes.age + lanes.acceleration * lanes.age**2 / 2
    seen = Seen(index, reading, fast, rise, level - lanes.first, retreat - lanes.retreat, lanes.velocity)
    return lanes._replace(level=level, rate=rate, mark=mark, retreat=retreat), seen


def _advance(lanes: _Lanes, acceleration: Array) -> tuple[_Lanes, Array, Array]:
    """Move to the next tick or to contact; return the lanes with contact and those that never get there."""
    l, w, relative = lanes.distance, lanes.closing, acceleration - lanes.push  # noqa: E741
    root = w**2 - 2 * relative * l
    down = w + np.sqrt(np.maximum(root, 0.0))
    time = np.divide(2 * l, down, out=np.full_like(l, np.inf), where=(root >= 0) & (down > 0))
    hit = time <= T
    t = np.minimum(time, T)
    moved = lanes._replace(
        distance=l - w * t + relative * t**2 / 2,
        closing=w - relative * t,
        velocity=lanes.velocity + acceleration * t,
        acceleration=acceleration,
        excursion=lanes.excursion + lanes.velocity * t + acceleration * t**2 / 2,
        largest=np.maximum(lanes.largest, acceleration),
    )
    return moved, hit, ~hit & (moved.closing <= 0) & (lanes.push <= 0)


def simulate(law: Law, theta: Array, encounters: Encounters) -> Outcome:
    """Simulate all encounters until contact, with a control law for each row of `theta`.

    An object of constant speed never makes contact once the robot is as fast as the object. Its encounter then ends.
    """
    lanes, memory = _start(encounters, len(theta)), law.start(len(theta) * len(encounters.speed))
    numbers = np.repeat(theta.T, len(encounters.speed), axis=1)
    ratio, excursion, largest = np.zeros((3, len(lanes.number)))
    for index in range(READINGS):
        lanes, seen = _observe(lanes, _read(lanes, encounters, index), index)
        impulse, memory = law.step(numbers, memory, seen)
        lanes, hit, gone = _advance(lanes, impulse / (MASS * T))
        done = hit | gone | (index == READINGS - 1)
        if not done.any():
            continue
        number = lanes.number[done]
        ratio[number] = np.where(hit, lanes.closing / lanes.speed, 0.0)[done]
        excursion[number] = np.where(hit, lanes.excursion, lanes.excursion + lanes.distance)[done]
        largest[number] = lanes.largest[done]
        lanes, memory = _Lanes(*(a[~done] for a in lanes)), tuple(a[~done] for a in memory)
        numbers = numbers[:, ~done]
        if not len(lanes.number):
            break
    return Outcome(*(a.reshape(len(theta), -1) for a in (ratio, excursion, largest)))
