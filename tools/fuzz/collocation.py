"""A reference that shares nothing with the program: implicit collocation of L(1) in other variables, many at once.

With w = M x~' + D x~ - D_p ln xi, L(1) with L(2) is

    x~' = (w - D x~ + D_p ln xi(x_o - x~)) / M,      w' = -K x~.

So the reference reads ln xi alone, where the program reads only its slope; and it is solved by Radau's implicit method
of five stages, of order nine and damped at infinity, on meshes that are fine at the start and of twice as many steps
until two of them agree. What they still differ by is handed out, and goes into what is allowed.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from numpy.polynomial import Polynomial, legendre

from pretouch.sensors import SensorModel

STAGES = 5
_ITERATIONS = 12


@lru_cache(maxsize=1)
def _method() -> tuple[np.ndarray, np.ndarray]:
    """Radau's right nodes in [0, 1], roots of P_s - P_(s-1), and the integrals of their Lagrange polynomials."""
    series = np.zeros(STAGES + 1)
    series[STAGES - 1 :] = -1.0, 1.0
    nodes = (np.sort(np.real(legendre.legroots(series))) + 1) / 2
    nodes[-1] = 1.0
    weights = np.empty((STAGES, STAGES))
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        basis = Polynomial.fromroots(others) / np.prod(node - others)
        weights[:, j] = basis.integ()(nodes)
    return nodes, weights


@dataclass
class System:
    """Encounters of one curve: M, D, K, x~(0), x~'(0), p, v, a, each (n,), and D_p."""

    sensor: SensorModel
    columns: np.ndarray
    gain: np.ndarray

    def part(self, which: np.ndarray) -> System:
        return System(self.sensor, self.columns[:, which], self.gain[which])

    def path(self, t: np.ndarray) -> np.ndarray:
        p, v, a = self.columns[5:8]
        return p + (v + a * t / 2) * t

    def path_speed(self, t: np.ndarray) -> np.ndarray:
        return self.columns[6] + self.columns[7] * t

    def terms(self, t: np.ndarray) -> np.ndarray:
        """What l is the difference of, at most, until a time."""
        _, _, _, x0, u0, p, v, a = np.abs(self.columns)
        return p + x0 + (v + u0 + a * t / 2) * t

    def log_output(self, distance: np.ndarray) -> np.ndarray:
        """Return ln xi, as a tangent outside the valid range."""
        low, high = self.sensor.valid_range
        inside = np.clip(distance, max(low, 0.0), high)
        value = np.asarray(self.sensor.log_output(inside))
        out = distance != inside
        if out.any():
            value = value.copy()
            value[out] += (self.sensor.log_slope(inside) * (distance - inside))[out]
        return value

    def log_slope(self, distance: np.ndarray) -> np.ndarray:
        low, high = self.sensor.valid_range
        return np.asarray(self.sensor.log_slope(np.clip(distance, max(low, 0.0), high)))

    def start(self) -> tuple[np.ndarray, np.ndarray]:
        m, d, _, x0, u0, p = self.columns[:6]
        return x0.copy(), m * u0 + d * x0 - self.gain * self.log_output(p - x0)

    def speed(self, t: np.ndarray, x: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return l and l' of a state."""
        m, d = self.columns[:2]
        distance = self.path(t) - x
        return distance, self.path_speed(t) - (w - d * x + self.gain * self.log_output(distance)) / m

    def bend(self, t: np.ndarray, x: np.ndarray, distance: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return l''."""
        m, d, k = self.columns[:3]
        force = self.gain * self.log_slope(distance) * speed - d * (self.path_speed(t) - speed) - k * x
        return self.columns[7] - force / m

    def step(self, t: np.ndarray, x: np.ndarray, w: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, ...]:
        """Take a step; return x~ and w at its end, and l and l' at its stages, (stages, n)."""
        nodes, weights = _method()
        m, d, k = self.columns[:3]
        moments = t + nodes[:, None] * h
        way = self.path(moments)
        slope = (w - d * x + self.gain * self.log_output(way[:1] * 0 + (self.path(t) - x))[0]) / m
        stage = x + nodes[:, None] * h * slope
        low, high = self.sensor.valid_range
        stage = way - np.clip(way - stage, max(low, 0.0), max(high if np.isfinite(high) else np.inf, 0.0))
        eye, inverse, last = np.eye(STAGES), None, np.inf
        for iteration in range(_ITERATIONS):
            distance = way - stage
            momentum = w - h * k * (weights @ stage)
            rate = (momentum - d * stage + self.gain * self.log_output(distance)) / m
            residual = stage - x - h * (weights @ rate)
            if iteration in {0, 1, 3}:
                pull = -(d + self.gain * self.log_slope(distance)) / m  # (stages, n)
                inner = eye * pull.T[:, :, None] - (h * k / m)[:, None, None] * weights
                inverse = np.linalg.inv(eye - h[:, None, None] * (weights @ inner))
            change = np.einsum("nij,jn->in", inverse, residual)
            stage = stage - change
            size = np.abs(change) / (np.abs(stage) + np.abs(way) + 1e-300)
            worst = np.fmax.reduce(size, axis=None)
            if worst <= 1e-16 or (worst < 1e-14 and worst > 0.1 * last):  # rounding is all that changes
                break
            last = worst
        distance = way - stage
        momentum = w - h * k * (weights @ stage)
        rate = (momentum - d * stage + self.gain * self.log_output(distance)) / m
        return stage[-1], momentum[-1], distance, self.path_speed(moments) - rate


@dataclass
class Motion:
    """What the reference finds until an end: l and l' there, and how well; the least l before, and whether it holds."""

    distance: np.ndarray
    speed: np.ndarray
    error: np.ndarray
    speed_error: np.ndarray
    least: np.ndarray
    least_error: np.ndarray
    bend: np.ndarray


def _run(system: System, end: np.ndarray, steps: int) -> Motion:
    count = len(end)
    m, d, k = system.columns[:3]
    x, w = system.start()
    first, _ = system.speed(np.zeros(count), x, w)
    rate = (d + np.abs(system.gain * system.log_slope(first))) / m + np.sqrt(k / m)
    grade = np.clip(np.log1p(rate * end / 10), 0.3, 14.0)  # so that the first step is of the fastest decay
    mesh = end * np.expm1(grade * np.linspace(0, 1, steps + 1)[:, None]) / np.expm1(grade)
    mesh[-1] = end
    least = first.copy()
    before = system.speed(mesh[0], x, w)
    nodes, _ = _method()
    for i in range(steps):
        h = mesh[i + 1] - mesh[i]
        old = x, w
        x, w, distance, speed = system.step(mesh[i], x, w, h)
        if i < steps - 1:
            least = np.minimum(least, distance[-1])
        moments = mesh[i] + np.concatenate([[0.0], nodes])[:, None] * h
        vs = np.vstack([before[1][None], speed])
        stage, which = np.nonzero((vs[:-1] < 0) & (vs[1:] > 0))
        if len(which):
            found = _turn(
                system.part(which), mesh[i][which], (old[0][which], old[1][which]), h[which], vs, moments, stage, which
            )
            np.minimum.at(least, which, found)
        before = distance[-1], speed[-1]
    distance, speed = system.speed(end, x, w)
    unknown = np.full(count, np.inf)
    return Motion(distance, speed, unknown, unknown, least, unknown, system.bend(end, x, distance, speed))


def _turn(
    system: System,
    start: np.ndarray,
    state: tuple[np.ndarray, np.ndarray],
    step: np.ndarray,
    speeds: np.ndarray,
    moments: np.ndarray,
    stage: np.ndarray,
    which: np.ndarray,
) -> np.ndarray:
    """Return l where l' = 0 between two stages of a step, by steps of Newton's method in the length of the step."""
    left, right = speeds[stage, which], speeds[stage + 1, which]
    t0, t1 = moments[stage, which], moments[stage + 1, which]
    h = t0 + (t1 - t0) * left / (left - right) - start
    distance = np.zeros_like(h)
    for _ in range(4):
        x, w, _, _ = system.step(start, *state, h)
        t = start + h
        distance, speed = system.speed(t, x, w)
        bend = system.bend(t, x, distance, speed)
        with np.errstate(all="ignore"):
            change = np.where(bend > 0, speed / bend, 0.0)
        h = np.clip(h - change, 1e-3 * step, 1.05 * step)
    turned = np.abs(speed) <= 1e-6 * (np.abs(left) + np.abs(right))  # else the stages were not good enough
    return np.where(turned, distance, np.inf)


def follow(system: System, end: np.ndarray, wanted: np.ndarray, most: int = 2048) -> Motion:
    """Follow encounters to an end [s] until two meshes agree on l there to what is wanted [m], or as they do."""
    count = len(end)
    found = Motion(*(np.full(count, np.nan) for _ in range(7)))
    todo, steps = np.arange(count), 24
    coarse, last = _guarded(system, end, steps), np.full(count, np.inf)
    while len(todo) and steps < most:
        steps *= 2
        part = system.part(todo)
        fine = _guarded(part, end[todo], steps)
        error = np.abs(fine.distance - coarse.distance)
        by_chance = 0.1 if system.sensor.knots else 0.01  # two meshes may agree by chance; of order nine it is 0.002
        error = np.fmax(error, by_chance * np.minimum(last, 1.0))
        speed_error = np.abs(fine.speed - coarse.speed)
        for name in ("distance", "speed", "least", "bend"):
            getattr(found, name)[todo] = getattr(fine, name)
        found.error[todo], found.speed_error[todo] = error, speed_error
        found.least_error[todo] = np.abs(fine.least - coarse.least)
        with np.errstate(invalid="ignore"):
            stuck = (error > 0.25 * last) & (error <= 1e-12 * part.terms(end[todo]))  # at rounding
            open_ones = ~((error <= wanted[todo]) | stuck)
        last = error[open_ones]
        todo = todo[open_ones]
        coarse = Motion(*(getattr(fine, f.name)[open_ones] for f in fields(Motion)))
    return found


def _guarded(system: System, end: np.ndarray, steps: int) -> Motion:
    """Run a mesh; steps too long for an encounter may leave no number, and halving them tells."""
    with np.errstate(all="ignore"):
        return _run(system, end, steps)
