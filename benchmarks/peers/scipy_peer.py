"""SciPy: root finding on the closed form, integration with an event, SLSQP as the letter's fmincon."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from . import closed_form
from .protocol import Job, Way, missing, one_by_one
from .work import (
    BOUNDS,
    DAMPING,
    DISTANCE,
    EXPONENT,
    MASS,
    OFFSET,
    POSITION_SCALE,
    RATE,
    STIFFNESS,
    VELOCITY_SCALE,
    Column,
    first_guess,
    latest,
)

_LOGS = (math.log(-BOUNDS[1]), math.log(-BOUNDS[0]))


class SciPy:
    """One at a time."""

    name = "SciPy"

    def available(self) -> str:
        """Return an empty reason where SciPy is installed."""
        return missing("scipy")

    def cases(self) -> Sequence[Way]:
        """Return its ways."""
        exponential, power = partial(Way, sensor="exponential-1"), partial(Way, sensor="inverse-power")
        lsoda, dop853 = partial(_integrate, method="LSODA"), partial(_integrate, method="DOP853")
        return (
            exponential(
                name="closed form, brentq", cases="B", make=partial(one_by_one, _brent), tolerance=1e-12, size=1000
            ),
            exponential(name="closed form, SLSQP with l = 0", cases="ACD", make=_slsqp, tolerance=1e-5, size=50),
            exponential(
                name="closed form, SLSQP with limits",
                cases="E",
                make=partial(_slsqp, limited=True),
                tolerance=1e-5,
                size=50,
            ),
            exponential(
                name="LSODA with event", cases="F", make=partial(_drag, "exponential-1"), tolerance=1e-8, size=50
            ),
            power(name="LSODA with event", cases="F", make=partial(_drag, "inverse-power"), tolerance=1e-8, size=50),
            power(name="LSODA with event, SLSQP", cases="E", make=_limited, tolerance=1e-4, size=5),
            exponential(
                name="closed form, bounded Brent",
                cases="AC",
                make=partial(_bounded, contact=_closed_contact),
                tolerance=1e-6,
                size=50,
            ),
            exponential(name="LSODA with event", cases="B", make=_times(lsoda, RATE), tolerance=1e-8, size=50),
            power(name="LSODA with event", cases="B", make=_times(lsoda, None), tolerance=1e-8, size=50, grows=True),
            power(name="DOP853 with event", cases="B", make=_times(dop853, None), tolerance=1e-7, size=50),
            power(
                name="LSODA with event, bounded Brent",
                cases="ACD",
                make=partial(_bounded, contact=partial(lsoda, rate=None)),
                tolerance=1e-6,
                size=5,
            ),
        )


def _brent(v: float, gain: float) -> float:
    from scipy.optimize import brentq  # noqa: PLC0415

    free = -DISTANCE / v
    late = free + RATE / STIFFNESS * gain
    return float(brentq(lambda t: closed_form.distance(math, t, v, gain)[0], free, late, xtol=1e-15, rtol=1e-14))


def _closed_contact(v: float, gain: float) -> tuple[float, float]:
    t = _brent(v, gain)
    return t, closed_form.distance(math, t, v, gain)[1]


def _integrate(v: float, gain: float, rate: float | None, method: str) -> tuple[float, float]:
    """Return t and l' at contact; rate is the slope of a curve that has one, None means the inverse power."""
    from scipy.integrate import solve_ivp  # noqa: PLC0415

    def motion(t: float, y: Column) -> tuple[float, float]:
        x, speed = y.tolist()
        slope = -EXPONENT / (DISTANCE + v * t - x + OFFSET) if rate is None else rate
        return speed, (gain * slope * (v - speed) - DAMPING * speed - STIFFNESS * x) / MASS

    def touch(t: float, y: Column) -> float:
        return DISTANCE + v * t - float(y[0])

    touch.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(motion, (0.0, 60.0), (0.0, 0.0), method=method, rtol=1e-11, atol=1e-13, events=touch)
    return float(found.t_events[0][0]), v - float(found.y_events[0][0][1])


def _times(contact: Callable[..., tuple[float, float]], rate: float | None) -> Callable[..., Job]:
    return partial(one_by_one, lambda v, gain: contact(v, gain, rate=rate)[0])


def _bounded(v: Column, contact: Callable[[float, float], tuple[float, float]]) -> Job:
    """Bounded Brent over ln(-D_p): a local search; a minimum is located to half of the digits only."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415

    def solve(velocity: float) -> float:
        def objective(log_gain: float) -> float:
            t, speed = contact(velocity, -math.exp(log_gain))
            return float(closed_form.merit(t, velocity, speed))

        found = minimize_scalar(objective, bounds=_LOGS, method="bounded", options={"xatol": 1e-9})
        return -math.exp(found.x)

    return one_by_one(solve, v)


def _slsqp(v: Column, limited: bool = False) -> Job:
    """D_p and t are the unknowns, l(t, D_p) = 0 an equality, as in the letter's use of fmincon; exact gradients."""
    from scipy.optimize import minimize  # noqa: PLC0415

    def value(y: Any, velocity: float) -> tuple[float, Any]:
        gain, t = y.tolist()
        _, speed, bend, _ = closed_form.distance(math, t, velocity, gain)
        _, speed_g = closed_form.slopes(math, t, velocity, gain)
        by_speed = 2 * speed / VELOCITY_SCALE**2
        by_t = 2 * (DISTANCE + velocity * t) * velocity / POSITION_SCALE**2 + by_speed * bend
        return closed_form.merit(t, velocity, speed), np.array([by_speed * speed_g, by_t])

    def constraint(velocity: float) -> dict[str, Any]:
        return {
            "type": "eq",
            "fun": lambda y: closed_form.distance(math, float(y[1]), velocity, float(y[0]))[0],
            "jac": lambda y: np.array(
                [
                    closed_form.slopes(math, float(y[1]), velocity, float(y[0]))[0],
                    closed_form.distance(math, float(y[1]), velocity, float(y[0]))[1],
                ]
            ),
        }

    def solve(velocity: float) -> float:
        guess = -math.exp(first_guess("exponential-1", -velocity))
        found = minimize(
            value,
            (guess, closed_form.start(math, velocity, guess)),
            args=(velocity,),
            jac=True,
            method="SLSQP",
            bounds=(BOUNDS, (1e-6, latest(velocity) if limited else None)),
            constraints=constraint(velocity),
            options={"ftol": 1e-14, "maxiter": 100},
        )
        return float(found.x[0])

    return one_by_one(solve, v)


def _limited(v: Column) -> Job:
    """SLSQP over ln(-D_p) with both limits, and differences of integrated contacts."""
    from scipy.optimize import minimize  # noqa: PLC0415

    def solve(velocity: float) -> float:
        seen: dict[float, tuple[float, float]] = {}

        def contact(u: float) -> tuple[float, float]:
            if u not in seen:
                seen[u] = _integrate(velocity, -math.exp(u), None, "LSODA")
            return seen[u]

        def merit(u: Column) -> float:
            t, speed = contact(float(u[0]))
            return 100 * float(closed_form.merit(t, velocity, speed))

        slack = {"type": "ineq", "fun": lambda u: latest(velocity) - contact(float(u[0]))[0]}
        start = [first_guess("inverse-power", -velocity)]
        options = {"ftol": 1e-13, "eps": 1e-6}
        found = minimize(merit, start, method="SLSQP", bounds=[_LOGS], constraints=slack, options=options)
        return -math.exp(found.x[0])

    return one_by_one(solve, v)


def _drag(sensor: str, v: Column, drag: Column) -> Job:
    """Integrate l'' = phi / M (g l')^2 until contact."""
    from scipy.integrate import solve_ivp  # noqa: PLC0415

    def slope_at(distance: float) -> float:
        return RATE if sensor == "exponential-1" else -EXPONENT / (distance + OFFSET)

    def solve(velocity: float, strength: float) -> float:
        def motion(_: float, y: Column) -> tuple[float, float]:
            distance, speed = y.tolist()
            return speed, strength / MASS * (slope_at(distance) * speed) ** 2

        def touch(_: float, y: Column) -> float:
            return float(y[0])

        touch.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(
            motion, (0.0, 600.0), (DISTANCE, velocity), method="LSODA", rtol=1e-11, atol=1e-13, events=touch
        )
        return float(found.t_events[0][0])

    return one_by_one(solve, v, drag)
