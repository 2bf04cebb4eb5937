"""Random encounters of every curve and regime, each claim of the program against a reference that shares nothing.

    PYTHONPATH=tests:tools python -m fuzz.encounters --count 1000000 --seed 1

Encounters are drawn by the curve (`drawing`), solved by every method that applies, many at once and one by one, and
followed by collocation (`collocation`) to where the program says that they end. What is allowed there:

- in l the promise of 1e-9 in the time of contact, the resolution of 1e-12 of the terms of l, what the reference's own
  meshes differ by, times eight, and the rounding that a negative damping has made larger;
- in l' what these leave: 1e-7 of it, l'' times the error in time, the error in l over the fastest time constant, and at
  a touch the square root of twice l'' times the resolution;
- before the end no l below zero by more than the resolution, looked for at every stage and at every turn.

Where l follows alone from a formula (no gain, or a constant slope, about an object at rest; a plant that stays) the
status is that of the formula. A find is printed as the call that repeats it, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import Counter
from typing import Any

import numpy as np

from fuzz.collocation import System, follow
from fuzz.drawing import FAMILIES, REGIMES, draw_encounters, draw_sensor
from pretouch.motion import ContactResult, ContactStatus, Scenario, find_contact
from pretouch.motion.scenario import map_fields
from pretouch.sensors import MittagLeffler, SensorModel

CLAIM, RESOLUTION, HORIZON = 1e-9, 1e-12, 30.0
CONTACT, NEVER, LATE, LEFT, UNRESOLVED = (
    ContactStatus[n].value for n in ("CONTACT", "NEVER", "HORIZON", "LEFT_RANGE", "UNRESOLVED")
)
PER_SENSOR, ONE_BY_ONE = 2000, 500


def one_of(scenario: Scenario, i: int) -> Scenario:
    """Return one encounter of a batch."""
    return map_fields(scenario, lambda values: float(values[i]) if np.ndim(values) else values)


class Batch:
    """Encounters of one curve with what is known of them without solving."""

    def __init__(self, scenario: Scenario, sensor: SensorModel, gain: np.ndarray, regime: np.ndarray) -> None:
        self.scenario, self.sensor, self.gain, self.regime = scenario, sensor, gain, regime
        self.columns = np.ascontiguousarray(np.moveaxis(scenario.relative(), -1, 0)[:8])
        self.system = System(sensor, self.columns, gain)
        self.finds: list[tuple[int, str]] = []
        self.loose = 0
        self.bend = np.zeros(len(gain))

    def blame(self, where: np.ndarray, text: str, found: Any = 0.0, allowed: Any = 0.0) -> None:
        found, allowed = (np.broadcast_to(x, where.shape) for x in (found, allowed))
        self.finds += [(int(i), f"{text} ({found[i]:.3g}, {allowed[i]:.3g})") for i in np.flatnonzero(where)]

    def noise(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what the rounding of ln xi leaves of the reference's l' and, until a time, of its l."""
        inner = getattr(self.sensor, "sensor", self.sensor)
        start = self.columns[5] - self.columns[3]
        relative = 1e-13 if isinstance(inner, MittagLeffler) else 4e-16  # as its docstring promises
        near = np.array([max(self.sensor.valid_range[0], 0.0)])
        size = relative * (1 + np.abs(self.sensor.log_output(start)) + np.abs(self.sensor.log_output(near)))
        speed = np.abs(self.gain) * size / self.columns[0]
        slope = np.minimum(np.abs(self.sensor.log_slope(start)), np.abs(self.sensor.log_slope(near)))
        return speed, np.minimum(speed * t, size / np.maximum(slope, 1e-300))

    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the fastest rate of the motion and that at which rounding grows [1/s]."""
        m, d, k = self.columns[:3]
        low, high = self.sensor.valid_range
        reach = min(high, max(low, 0.0) + 2.0)
        steepest = np.abs(self.sensor.log_slope(np.linspace(max(low, 0.0), reach, 400))).max()
        pull = np.abs(self.gain) * steepest
        return (d + pull) / m + np.sqrt(k / m), np.where(self.gain > 0, np.maximum(pull - d, 0.0), 0.0) / m

    def check_motion(self, found: ContactResult) -> None:
        """Compare a result with the reference."""
        status, end = found.status, found.end
        t, speed, distance = end.time, end.relative_velocity, end.distance
        fast, growth = self.rates()
        solved = (status != UNRESOLVED) & (t > 0)
        low, high = self.sensor.valid_range
        terms = self.system.terms(t)
        promise = CLAIM * np.abs(speed) * t
        ref = follow(self.system, np.where(t > 0, t, 1e-9), np.maximum(0.1 * promise, 1e-13 * terms))
        rounding = 1e-14 * terms * np.exp(np.minimum(growth * t, 500.0))
        speed_noise, noise = self.noise(t)
        doubt = 8 * ref.error + rounding + 3 * noise
        self.bend = np.abs(ref.bend)
        with np.errstate(invalid="ignore"):
            known = (
                solved & np.isfinite(ref.distance) & (doubt < 1e-5 * terms)
            )  # else its meshes do not agree: it is counted as loose
            self.loose += int((solved & ~(doubt < 1e-8 * terms)).sum())
            allowed = promise + RESOLUTION * terms + doubt
            off = known & (np.abs(ref.distance - distance) > allowed)
            self.blame(off, "l at the end is not that of the reference", ref.distance - distance, allowed)
            rate = fast + 1 / np.maximum(t, 1e-300)
            slip = 1e-7 * np.abs(speed) + CLAIM * t * np.abs(ref.bend) + rate * (RESOLUTION * terms + doubt)
            slip = (
                slip
                + 8 * ref.speed_error
                + speed_noise
                + np.where(speed == 0, np.sqrt(4 * np.abs(ref.bend) * RESOLUTION * terms), 0)
            )
            wrong = known & (np.abs(ref.speed - speed) > slip)
            self.blame(wrong, "l' at the end is not that of the reference", ref.speed - speed, slip)
            before = known & (ref.least + ref.least_error < max(low, 0.0) - RESOLUTION * terms - doubt)
            self.blame(before, "l was zero before the end", ref.least, doubt)
            closest = np.asarray(found.closest_distance)
            free = known & (status != CONTACT)
            far = free & (closest > np.minimum(ref.least + ref.least_error, distance) + allowed)
            self.blame(far, "l came closer", closest - ref.least, allowed)
        self.blame((status == CONTACT) & ~((distance == 0) & (speed <= 0)), "no state of contact")
        self.blame((status == LATE) & (t != HORIZON), "the horizon is another")
        if np.isfinite(high):
            border = np.minimum(np.abs(distance - low), np.abs(distance - high))
            self.blame((status == LEFT) & (border > 1e-14 * np.abs(distance)), "the range is another")
        position = self.obstacle_at(t) - distance
        size = RESOLUTION * (np.abs(position) + terms + np.abs(self.obstacle_at(t))) + promise
        self.blame(np.abs(end.position - position) > size, "x is not x_o - l", end.position - position, size)
        with np.errstate(all="ignore"):  # where it has gone, a slope may be steeper than near the sensor
            away = np.abs(self.gain * self.sensor.log_slope(np.clip(distance, low, high))) / self.columns[0]
        stiff = ((fast + away) * np.maximum(t, 1e-3) > 1e4) | (growth * HORIZON > 20)
        self.blame((status == UNRESOLVED) & ~stiff & (fast * HORIZON < 1e5), "unresolved without need", fast * t, 5e4)
        with np.errstate(invalid="ignore"):
            held = (status == CONTACT) & known & (growth == 0) & (found.impulse_residual > 1e-8)
            held &= self.regime != "already near"  # ln xi rounds
        self.blame(held, "the impulse balance does not hold", found.impulse_residual, 1e-8)

    def obstacle_at(self, t: np.ndarray) -> np.ndarray:
        o = self.scenario.obstacle
        return o.position + (o.velocity + o.acceleration * t / 2) * t

    def check_never(self, found: ContactResult) -> None:
        """Follow what is never to be in contact ten times as far, and for forty of its slowest time constants."""
        where = np.flatnonzero((found.status == NEVER) & (self.gain <= 0))
        if not len(where):
            return
        part, t = self.system.part(where), found.end.time[where]
        m, d, k = part.columns[:3]
        pull = d + part.gain * part.log_slope(np.zeros(len(where)))
        with np.errstate(divide="ignore", invalid="ignore"):
            slow = np.where(k > 0, np.maximum(pull / k, 2 * m / np.maximum(pull, 1e-300)), m / np.maximum(pull, 1e-300))
        end = np.minimum(10 * t, t + 40 * np.minimum(slow, 1e3))
        terms = part.terms(end)
        ref = follow(part, end, 1e-12 * terms, most=400)
        with np.errstate(invalid="ignore"):
            late = ref.least + ref.least_error < -2 * RESOLUTION * terms - 8 * ref.error
        whole = np.zeros(len(self.gain), dtype=bool)
        whole[where[late & (ref.error < 1e-9 * terms)]] = True
        least = np.zeros(len(self.gain))
        least[where] = ref.least
        self.blame(whole, "never in contact, but later it is", least, found.end.time)

    def check_formula(self, found: ContactResult) -> None:
        """Compare statuses with formulas: of l alone about an object at rest at the reference, and of a still plant."""
        if self.sensor.valid_range[0] <= 0:
            with np.errstate(all="ignore"):
                self.check_alone(found.status)
                self.check_parabola(found.status)

    def check_alone(self, status: np.ndarray) -> None:
        m, d, k, x0, u0, p, v, a = self.columns
        c = d + self.gain * (self.sensor.constant_log_slope or 0.0)
        alone = (self.gain == 0) | (self.sensor.constant_log_slope is not None)
        alone &= (p == 0) & (v == 0) & (a == 0) & (k > 0) & (c >= 0) & (self.sensor.valid_range[1] == np.inf)
        square, z = c**2 - 4 * m * k, u0 / x0  # l' / l at the start
        root, sigma = np.sqrt(np.abs(square)) / (2 * m), c / (2 * m)
        fast, slow = sigma + root, sigma - root
        excess = -z / fast - 1
        apart = 2 * root
        passing = np.where(apart > 1e-6 * fast, np.log1p(apart / (fast * excess)) / apart, 1 / (fast * excess))
        over = square > 1e-12 * c**2
        over |= (np.abs(square) <= 1e-14 * c**2) & (apart <= 1e-6 * fast)
        swinging = np.arctan2(1.0, -(sigma + z) / root) / root  # l = l_0 (cos w t + (s + z) / w sin w t) exp(-s t)
        when = np.where(over, np.where(excess > 0, passing, np.inf), swinging)
        sure = alone & ((over & (np.abs(excess) > 1e-8)) | (square < -1e-12 * c**2))
        told = np.where(over, slow, sigma) * when < 500  # what comes to zero later is at rest before
        self.blame(sure & told & (when < 0.999 * HORIZON) & (status != CONTACT), "by a formula it is in contact")
        self.blame(sure & (when > 1.001 * HORIZON) & (status == CONTACT), "by a formula it is not in contact")

    def check_parabola(self, status: np.ndarray) -> None:
        _, _, _, x0, u0, p, v, a = self.columns
        stays = (self.gain == 0) & (x0 == 0) & (u0 == 0) & (a > 0) & (v < 0)
        wide = [np.asarray(z, dtype=np.longdouble) for z in (p, v, a)]
        least, when = np.asarray(wide[0] - wide[1] ** 2 / (2 * wide[2]), dtype=float), -v / a
        size = RESOLUTION * (np.abs(p) + (np.abs(v) + a / 2 * when) * when)
        stays &= when < 0.999 * HORIZON
        self.blame(stays & (least < 0.9 * size) & (status != CONTACT), "it touches or passes, by its parabola")
        self.blame(stays & (least > 1.1 * size) & (status == CONTACT), "it turns before contact, by its parabola")

    def compare(self, one: ContactResult, others: list[tuple[str, Any]]) -> None:
        """Compare results of other ways (status, time, l' and closest distance) with one that was checked."""
        t, speed = one.end.time, one.end.relative_velocity
        terms = self.system.terms(t)
        fast, growth = self.rates()
        wild = RESOLUTION * terms + 1e-14 * terms * np.exp(np.minimum(growth * np.minimum(t, HORIZON), 500.0))
        for name, (status, when, other_speed, closest) in others:
            with np.errstate(all="ignore"):
                differ = status != one.status
                differ &= ~(np.isin(status, [NEVER, LATE]) & np.isin(one.status, [NEVER, LATE]))
                near = np.maximum(np.abs(closest), np.abs(np.asarray(one.closest_distance))) < 4 * wild
                stiff = ((status == UNRESOLVED) | (one.status == UNRESOLVED)) & ((fast * HORIZON > 5e4) | (growth > 0))
                other = differ & ~(near & self.unclear()) & ~stiff
                self.blame(other, f"{name}: another status", status, one.status)
                both = (status == CONTACT) & (one.status == CONTACT)
                shift = 2 * CLAIM * t + 4 * wild / np.maximum(np.abs(speed), 1e-300)
                self.blame(both & (np.abs(when - t) > shift), f"{name}: another time", when - t, shift)
                bend = np.fmax(fast * np.abs(speed), self.bend) + 1e-300
                slip = 2e-7 * np.abs(speed) + bend * shift + 4 * fast * wild
                self.blame(
                    both & (np.abs(other_speed - speed) > slip), f"{name}: another l'", other_speed - speed, slip
                )

    def unclear(self) -> np.ndarray:
        """Tell where l may come so close to zero without passing it that any status will do: not in simple regimes."""
        return ~np.isin(self.regime, ["touching", "over-damped", "critical", "no gain"]) | (self.gain > 0)

    def call(self, i: int) -> str:
        """Return the call that repeats an encounter."""
        return (
            f"find_contact({one_of(self.scenario, i)!r}, {self.sensor!r}, {float(self.gain[i])!r}, horizon={HORIZON})"
        )


def read(result: ContactResult) -> tuple[Any, ...]:
    return result.status, result.end.time, result.end.relative_velocity, result.closest_distance


def check(rng: np.random.Generator, family: str, count: int, singles: int) -> tuple[Batch, np.ndarray]:
    """Draw, solve and check encounters of one curve."""
    sensor = draw_sensor(rng, family)
    scenario, gain, regime = draw_encounters(rng, sensor, count)
    batch = Batch(scenario, sensor, gain, regime)
    found = find_contact(batch.scenario, sensor, batch.gain, horizon=HORIZON)
    batch.check_motion(found)
    batch.check_never(found)
    batch.check_formula(found)
    methods = ["integration"] if sensor.constant_log_slope is None else ["closed-form", "integration"]
    others = []
    if len(methods) > 1:
        others.append(
            (
                "integration",
                read(find_contact(batch.scenario, sensor, batch.gain, method="integration", horizon=HORIZON)),
            )
        )
    for method in methods:
        rows = [
            read(find_contact(one_of(batch.scenario, i), sensor, float(batch.gain[i]), method=method, horizon=HORIZON))
            for i in range(min(singles, count))
        ]
        columns = [
            np.array(found.status),
            np.array(found.end.time),
            np.array(found.end.relative_velocity),
            np.array(found.closest_distance),
        ]
        for i, row in enumerate(rows):
            for column, value in zip(columns, row, strict=True):
                column[i] = value
        others.append((f"{method}, one by one", tuple(columns)))
    batch.compare(found, others)
    return batch, found.status


def main() -> int:
    """Search, and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20_000, help="how many encounters")
    parser.add_argument("--seed", type=int, default=None, help="of the generator; a new one each time by default")
    parser.add_argument("--families", nargs="*", default=FAMILIES, choices=FAMILIES)
    parser.add_argument("--first", type=int, default=0, help="the number of the first curve, to repeat a find")
    options = parser.parse_args()
    warnings.simplefilter("error")  # none reaches a user
    seed = int(np.random.SeedSequence().entropy % 2**32) if options.seed is None else options.seed
    print(f"{options.count} encounters, seed {seed}, regimes: {', '.join(REGIMES)}", flush=True)
    start, done, finds, loose = time.perf_counter(), 0, 0, 0
    statuses: Counter[str] = Counter()
    number = options.first
    said = start
    while done < options.count:
        family = options.families[number % len(options.families)]
        rng = np.random.default_rng([seed, number])
        batch, status = check(rng, family, min(PER_SENSOR, options.count - done), ONE_BY_ONE)
        for i, text in batch.finds:
            print(
                f"FOUND ({family}, {batch.regime[i]}, --seed {seed} --first {number}): {text}\n  {batch.call(i)}",
                flush=True,
            )
        finds, loose = finds + len(batch.finds), loose + batch.loose
        statuses.update(ContactStatus(int(s)).label for s in status)
        done, number = done + len(batch.gain), number + 1
        if time.perf_counter() - said > 60:
            said = time.perf_counter()
            print(f"{done} encounters, {finds} finds, {done / (said - start):.0f} a second", flush=True)
    spent = time.perf_counter() - start
    ends = ", ".join(f"{n} {name}" for name, n in statuses.most_common())
    print(f"{done} encounters in {spent:.0f} s, {done / spent:.0f} a second: {ends}")
    print(f"{loose} of them checked to no better than 1e-8; {finds} finds")
    return 1 if finds else 0


if __name__ == "__main__":
    sys.exit(main())
