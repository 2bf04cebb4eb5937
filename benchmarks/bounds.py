"""Check the bounds of the virtual drag on random encounters, integrated in time by a method that does not use them.

Run with `python -m benchmarks.bounds`; `--count` is the number of encounters, a thousand per drag.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import pretouch as pt
from pretouch.designs.drag import DragLimits, drag_by

SEED = 20261122
CHUNK = 1000  # encounters between one pair of rails
PIECES, PER_PIECE = 64, 25  # of an encounter: courses and schedules change from piece to piece, of so many steps
FINENESS = 0.05  # of a step, over the shortest time in which speed, distance or slope change by their own size
ROUNDING = 1e-6  # beyond which a bound counts as exceeded: what steps of that fineness are good to
MASS = 1.0


class Ends(NamedTuple):
    """Results of encounters, arrays of shape (n,).

    Args:
        speed: |l'| at contact [m/s]; NaN without a contact in the detection range.
        time: from l_d to contact [s].
        largest: the robot's largest acceleration until then [m/s^2].
        turned: whether the object turned back before contact.
    """

    speed: np.ndarray
    time: np.ndarray
    largest: np.ndarray
    turned: np.ndarray


Step = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def stepping(sensor: pt.sensors.SensorModel, strength: np.ndarray, acceleration: np.ndarray) -> Step:
    """Return a Runge-Kutta step of order 4 for l'' = a_o + (phi/M) g^2 l'^2 while l' < 0, else a_o."""

    def rate(l: np.ndarray, u: np.ndarray) -> np.ndarray:  # noqa: E741
        return acceleration + strength * sensor.log_slope(np.maximum(l, 0.0)) ** 2 * np.minimum(u, 0.0) ** 2

    def step(l: np.ndarray, u: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # noqa: E741
        f1 = rate(l, u)
        u2 = u + h / 2 * f1
        f2 = rate(l + h / 2 * u, u2)
        u3 = u + h / 2 * f2
        f3 = rate(l + h / 2 * u2, u3)
        u4 = u + h * f3
        f4 = rate(l + h * u3, u4)
        return l + h / 6 * (u + 2 * u2 + 2 * u3 + u4), u + h / 6 * (f1 + 2 * f2 + 2 * f3 + f4)

    return step


def follow(
    sensor: pt.sensors.SensorModel, distance: float, speed: np.ndarray, strength: np.ndarray, acceleration: np.ndarray
) -> Ends:
    """Integrate encounters until contact, until the object is out of range, or through all pieces.

    Args:
        sensor: the curve.
        distance: l_d [m].
        speed: of each encounter there [m/s], shape (n,).
        strength: phi/M [m], a row per piece.
        acceleration: a_o [m/s^2], a row per piece.

    Returns:
        The results.
    """
    count = len(speed)
    ends = Ends(*np.full((2, count), np.nan), np.zeros(count), np.zeros(count, dtype=bool))
    lane, l, u, time = np.arange(count), np.full(count, distance), -speed, np.zeros(count)  # noqa: E741
    push = np.sqrt(np.abs(acceleration).max(axis=0) / distance)
    for i in range(PIECES * PER_PIECE):
        k, a = strength[i // PER_PIECE, lane], acceleration[i // PER_PIECE, lane]
        step, slope = stepping(sensor, k, a), np.abs(sensor.log_slope(l))
        ends.largest[lane] = np.fmax(ends.largest[lane], k * slope**2 * np.minimum(u, 0.0) ** 2)
        h = FINENESS / (np.abs(u) * (1 / distance + slope + k * slope**2) + push[lane])
        l_next, u_next = step(l, u, h)
        hit = l_next <= 0
        for _ in range(4 * hit.any()):  # Newton's method for the part of the step that ends at contact
            h = np.where(hit, h - l_next / np.where(hit, u_next, 1.0), h)
            l_next, u_next = step(l, u, h)
        time = time + h
        ends.speed[lane[hit]], ends.time[lane[hit]] = -u_next[hit], time[hit]
        ends.turned[lane] |= u_next > 0
        on = ~hit & (l_next <= distance)
        lane, l, u, time = lane[on], l_next[on], u_next[on], time[on]  # noqa: E741
        if not lane.size:
            break
    return ends


def drawn_rails(rng: np.random.Generator) -> DragLimits:
    """Draw two drags for one curve and one distance: an inverse power, or an exponential in three of ten."""
    offset = 10 ** rng.uniform(-2.3, -0.9)
    exponent = rng.uniform(1.5, 5.0)
    power = pt.InversePower(scale=1.0, distance_offset=offset, exponent=exponent)
    flat = pt.ExponentialFirstOrder(scale=1.0, rate=-exponent / offset)
    sensor = flat if rng.random() < 0.3 else power
    distance = offset * 10 ** rng.uniform(-0.7, 0.5)
    ratio = rng.uniform(0.1, 0.9)
    weak, strong = (drag_by(sensor, distance, MASS, ratio=r) for r in (ratio, ratio ** rng.uniform(1.0, 2.5)))
    return DragLimits(weak=weak, strong=strong)


class Shares(NamedTuple):
    """The largest ratios of results to bounds, over encounters with contact; 1 is equality.

    Args:
        contacts: number of accelerated encounters with contact.
        turned: number of these that had turned back before.
        pushed: contact speed over bound (5), with a time-dependent schedule of the drag.
        steady: the same for the weak drag and a constantly pushed object, which reaches bound (5).
        slow: contact speed of an object with constant speed over that of the weak drag; (6).
        fast: contact speed of the strong drag over that contact speed.
        short: excursion of the weak drag over that excursion.
        long: that excursion over the excursion of the strong drag.
        sharp: largest acceleration over the limit of the rails.
    """

    contacts: int
    turned: int
    pushed: float
    steady: float
    slow: float
    fast: float
    short: float
    long: float
    sharp: float


def shares(rails: DragLimits, rng: np.random.Generator, count: int) -> Shares:
    """Integrate random encounters between rails: courses of both signs, at most A toward the robot, and schedules."""
    sensor, distance = rails.weak.sensor, rails.weak.detection_distance
    low, high = (np.log(1 / d.ratio) / d.slope_integral for d in (rails.weak, rails.strong))
    speed = 10 ** rng.uniform(-1.5, 0.5, count)
    most = speed**2 / distance * 10 ** rng.uniform(-1.5, 0.5, count)
    course = np.where(rng.random((PIECES, count)) < 0.3, -most, rng.uniform(-1, 1, (PIECES, count)) * most)
    schedule = low + (high - low) * np.clip(rng.uniform(-0.5, 1.5, (PIECES, count)), 0.0, 1.0)
    bound = rails.contact_speed_bound(speed, most)
    pushed = follow(sensor, distance, speed, schedule, course)
    steady = follow(sensor, distance, speed, np.full_like(schedule, low), np.broadcast_to(-most, course.shape))
    uniform = follow(sensor, distance, speed, schedule, np.zeros_like(course))
    came, excursion = np.isfinite(pushed.speed), speed * uniform.time - distance
    return Shares(
        int(came.sum()),
        int((came & pushed.turned).sum()),
        np.nanmax(pushed.speed / bound),
        np.max(steady.speed / bound),
        np.max(uniform.speed / speed) / rails.ratio[1],
        rails.ratio[0] / np.min(uniform.speed / speed),
        rails.excursion[0] / np.min(excursion),
        np.max(excursion) / rails.excursion[1],
        np.max(uniform.largest / speed**2) / rails.peak,
    )


def measure(count: int) -> tuple[list[str], list[str]]:
    """Return the printed lines and the exceeded bounds."""
    rng = np.random.default_rng(SEED)
    found = [shares(drawn_rails(rng), rng, CHUNK) for _ in range(max(1, count // CHUNK))]
    counts, largest = (list(zip(*found, strict=True))[part] for part in (slice(2), slice(2, None)))
    worst = Shares(*map(sum, counts), *map(max, largest))
    turned = f"{worst.turned:,} after turning back"
    said = {
        f"(5) contact speed, any course, any schedule ({worst.contacts:,} contacts, {turned})": worst.pushed,
        "(5) contact speed, pushed all along, weak drag": worst.steady,
        "(6) contact speed of a uniform approach, from above": worst.slow,
        "(6) the same, from below": worst.fast,
        "(6) excursion, from below": worst.short,
        "(6) the same, from above": worst.long,
        "(6) peak acceleration": worst.sharp,
    }
    lines = [f"{name:90s}{value:12.9f} of the bound at most, asked <= 1" for name, value in said.items()]
    return lines, [f"{name}: {value - 1:.1e} beyond it" for name, value in said.items() if not value <= 1 + ROUNDING]


def main() -> None:
    """Print all results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bounds", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000, help="how many encounters, in thousands")
    count = parser.parse_args().count
    lines, missed = measure(count)
    print(f"\nbounds of the drag over {count:,} encounters")
    print("\n".join(lines))
    print(f"exceeded: {len(missed)} of {len(lines)}", *missed, sep="\n")


if __name__ == "__main__":
    main()
