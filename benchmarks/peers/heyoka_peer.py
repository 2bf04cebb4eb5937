"""heyoka: compiled expressions for the closed form, Taylor series in lanes for the motion over the distance.

While l' < 0 the distance replaces time: with s = 1 - l / l(0) the contact ends the interval, without event.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np

from . import closed_form
from .protocol import Job, Way, missing, one_by_one
from .work import (
    DAMPING,
    DISTANCE,
    EXPONENT,
    MASS,
    OFFSET,
    POSITION_SCALE,
    STIFFNESS,
    VELOCITY_SCALE,
    Column,
    first_guess,
    processors,
)

_LANES = 16  # two vectors of eight doubles, or four of four
_TOLERANCE = 1e-12
_STEPS = 4
_MOST = 8
_SMALL = 1e-5  # a step of the secant method: what is left after it is about its 1.6th power


class Heyoka:
    """Just-in-time compiled, vectorized over lanes."""

    name = "heyoka"

    def available(self) -> str:
        """Return an empty reason where heyoka is installed."""
        return missing("heyoka")

    def cases(self) -> Sequence[Way]:
        """Return its ways."""
        exponential, power = partial(Way, sensor="exponential-1"), partial(Way, sensor="inverse-power")
        return (
            exponential(name="compiled, two evaluations", cases="B", make=_compiled, tolerance=1e-10, grows=True),
            exponential(name="compiled Newton of the optimum", cases="ACD", make=_optimum, tolerance=1e-9),
            power(name="series over distance, lanes", cases="B", make=_lanes, tolerance=1e-11, grows=True),
            power(name="series with event", cases="B", make=_with_event, tolerance=1e-11, size=500),
            power(name="variational series, one by one", cases="AD", make=_design_single, tolerance=1e-9, size=100),
            power(name="variational series, lanes", cases="C", make=_design_lanes, tolerance=1e-9),
        )


def _compiled(v: Column, gain: Column) -> Job:
    import heyoka as hy  # noqa: PLC0415

    speed, strength = hy.make_vars("v", "gain")
    solve = hy.cfunc([closed_form.solve(hy, speed, strength)], [speed, strength], parallel_mode=processors() > 1)
    inputs, out = np.vstack([v, gain]), np.empty((1, len(v)))
    return lambda: solve(inputs=inputs, outputs=out)[0]


def _optimum(v: Column) -> Job:
    """Newton on both conditions, l = 0 and df/dD_p = 0, in t and ln(-D_p); second derivatives are heyoka's."""
    import heyoka as hy  # noqa: PLC0415

    t, log_gain, speed = hy.make_vars("t", "log_gain", "v")
    gain = -hy.exp(log_gain)
    level, rate, _, _ = closed_form.distance(hy, t, speed, gain)
    value = closed_form.merit(t, speed, rate)
    by_t, by_gain = hy.diff(level, t), hy.diff(level, log_gain)
    steep = hy.diff(value, log_gain) * by_t - hy.diff(value, t) * by_gain
    steep_t, steep_gain = hy.diff(steep, t), hy.diff(steep, log_gain)
    scale = 1 / (by_t * steep_gain - by_gain * steep_t)
    better = [t - (level * steep_gain - by_gain * steep) * scale, log_gain - (by_t * steep - level * steep_t) * scale]
    improve = hy.cfunc(better, [t, log_gain, speed])
    first_gain = first_guess("exponential-1", -speed, hy.log)
    guess = -hy.exp(first_gain)
    first_t = closed_form.householder(hy, closed_form.start(hy, speed, guess), speed, guess)
    begin = hy.cfunc([first_t, first_gain], [speed])
    inputs, state, other = v[None, :].copy(), np.empty((3, len(v))), np.empty((3, len(v)))
    state[2] = other[2] = v

    def job() -> Column:
        begin(inputs=inputs, outputs=state[:2])
        for _ in range(_STEPS // 2):
            improve(inputs=state, outputs=other[:2])
            improve(inputs=other, outputs=state[:2])
        return -np.exp(state[1])

    return job


def _over_distance(hy: Any, gain: Any) -> list[Any]:
    """Return dt/ds and dq/ds with q = -l'; parameter 0 is v."""
    t, q = hy.make_vars("t", "q")
    v, distance = hy.par[0], DISTANCE * (1 - hy.time)
    force = -DAMPING * (v + q) - STIFFNESS * (DISTANCE + v * t - distance)
    return [(t, DISTANCE / q), (q, DISTANCE / MASS * (force / q + gain * EXPONENT / (distance + OFFSET)))]


@lru_cache(maxsize=2)
def _integrator(lanes: int) -> Any:
    import heyoka as hy  # noqa: PLC0415

    system = _over_distance(hy, hy.par[1])
    if lanes == 1:
        return hy.taylor_adaptive(system, [0.0, 0.3], pars=[-0.3, -0.7], tol=_TOLERANCE)
    state, parameters = np.outer([0.0, 0.3], np.ones(lanes)), np.outer([-0.3, -0.7], np.ones(lanes))
    return hy.taylor_adaptive_batch(system, state, pars=parameters, tol=_TOLERANCE)


def _lanes(v: Column, gain: Column) -> Job:
    """Sort encounters by D_p / v, so that those with equal numbers of steps run in parallel."""
    if len(v) < _LANES // 2:
        return one_by_one(_contact, v, gain)
    motion, count = _integrator(_LANES), len(v)

    def job() -> Column:
        order = np.argsort(gain / v)
        rows = np.resize(order, -(-count // _LANES) * _LANES).reshape(-1, _LANES)
        speeds, strengths, times = v[rows], gain[rows], np.empty(rows.shape)
        for i in range(len(rows)):
            motion.set_time(0.0)
            motion.state[0], motion.state[1] = 0.0, -speeds[i]
            motion.pars[0], motion.pars[1] = speeds[i], strengths[i]
            motion.propagate_until(1.0)
            times[i] = motion.state[0]
        out = np.empty(count)
        out[rows.ravel()] = times.ravel()
        return out

    return job


def _contact(v: float, gain: float) -> float:
    motion = _integrator(1)
    motion.time = 0.0
    motion.state[:] = 0.0, -v
    motion.pars[:] = v, gain
    motion.propagate_until(1.0)
    return float(motion.state[0])


def _with_event(v: Column, gain: Column) -> Job:
    """Integrate over time with a terminal event at l = 0, as in the manual."""
    import heyoka as hy  # noqa: PLC0415

    x, u = hy.make_vars("x", "u")
    distance = DISTANCE + hy.par[0] * hy.time - x
    force = -DAMPING * u - STIFFNESS * x - hy.par[1] * EXPONENT / (distance + OFFSET) * (hy.par[0] - u)
    motion = hy.taylor_adaptive(
        [(x, u), (u, force / MASS)], [0.0, 0.0], pars=[-0.3, -0.7], tol=_TOLERANCE, t_events=[hy.t_event(distance)]
    )

    def solve(velocity: float, strength: float) -> float:
        motion.time = 0.0
        motion.state[:] = 0.0
        motion.pars[:] = velocity, strength
        motion.reset_cooldowns()
        motion.propagate_until(60.0)
        return float(motion.time)

    return one_by_one(solve, v, gain)


@lru_cache(maxsize=2)
def _variational(lanes: int) -> Any:
    """Return (t, q) and their derivatives by ln(-D_p) as one integrator; parameters are v and ln(-D_p)."""
    import heyoka as hy  # noqa: PLC0415

    state, changed, log_gain = hy.make_vars("t", "q"), hy.make_vars("t1", "q1"), hy.make_vars("log_gain")
    right = [f for _, f in _over_distance(hy, -hy.exp(log_gain))]
    for f in tuple(right):
        moved = hy.diff(f, log_gain)
        for y, y1 in zip(state, changed, strict=True):
            moved += hy.diff(f, y) * y1
        right.append(moved)
    system = list(zip([*state, *changed], hy.subs(right, {log_gain: hy.par[1]}), strict=True))
    start, parameters = np.array([0.0, 0.3, 0.0, 0.0]), np.array([-0.3, -0.3])
    if lanes == 1:
        return hy.taylor_adaptive(system, start, pars=parameters, tol=_TOLERANCE)
    columns = np.ones(lanes)
    return hy.taylor_adaptive_batch(
        system, np.outer(start, columns), pars=np.outer(parameters, columns), tol=_TOLERANCE
    )


def _steepness(state: Any, v: Any) -> tuple[Any, Any]:
    """Return half of df / d ln(-D_p) and the part of half its derivative that first derivatives give."""
    t, q, t1, q1 = state
    away, left = 1 / POSITION_SCALE**2, 1 / VELOCITY_SCALE**2
    return (DISTANCE + v * t) * v * t1 * away + q * q1 * left, (v * t1) ** 2 * away + q1 * q1 * left


def _design_single(v: Column) -> Job:
    motion = _variational(1)

    def steepness(velocity: float, at: float) -> tuple[float, float]:
        motion.time = 0.0
        motion.state[:] = 0.0, -velocity, 0.0, 0.0
        motion.pars[:] = velocity, at
        motion.propagate_until(1.0)
        return _steepness(motion.state.tolist(), velocity)

    def solve(velocity: float) -> float:
        at = first_guess("inverse-power", -velocity)
        steep, bend = steepness(velocity, at)
        step = -steep / bend
        for _ in range(_MOST):
            if abs(step) < _SMALL:
                break
            at += step
            before, steep = steep, steepness(velocity, at)[0]
            step *= steep / (before - steep)
        return -math.exp(at + step)

    return one_by_one(solve, v)


def _design_lanes(v: Column) -> Job:
    motion, count = _variational(_LANES), len(v)

    def steepness(speeds: Column, at: Column) -> tuple[Column, Column]:
        motion.set_time(0.0)
        motion.state[:] = 0.0
        motion.state[1] = -speeds
        motion.pars[0], motion.pars[1] = speeds, at
        motion.propagate_until(1.0)
        return _steepness(motion.state, speeds)

    def solve(speeds: Column) -> Column:
        at = first_guess("inverse-power", -speeds, np.log)
        steep, bend = steepness(speeds, at)
        step = -steep / bend
        for _ in range(_MOST):
            if np.abs(step).max() < _SMALL:
                break
            at += step
            before, steep = steep, steepness(speeds, at)[0]
            change = before - steep
            step *= steep / np.where(change == 0, 1.0, change)
        return at + step

    def job() -> Column:
        rows = np.resize(np.argsort(v), -(-count // _LANES) * _LANES).reshape(-1, _LANES)
        found = np.array([solve(v[row]) for row in rows])
        out = np.empty(count)
        out[rows.ravel()] = found.ravel()
        return -np.exp(out)

    return job
