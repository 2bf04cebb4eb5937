"""diffrax: the motion of any curve, over time with an event, and over the distance without one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from .jax_peer import job_of, numerics
from .protocol import Job, Way, missing
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
)

_LANES = 256  # that run until the last of them is done
_ROUNDS = 6


class Diffrax:
    """Runge-Kutta of order 8 with adaptive steps, compiled through XLA, in lanes sorted by their stiffness."""

    name = "diffrax"

    def available(self) -> str:
        """Return an empty reason where diffrax is installed."""
        return missing("jax", "diffrax", "optimistix")

    def cases(self) -> Sequence[Way]:
        """Return its ways."""
        on = partial(Way, sensor="inverse-power")
        return (
            on(name="Dopri8 with event", cases="B", make=partial(_contacts, event=True), tolerance=1e-8, size=20_000),
            on(
                name="Dopri8 over distance", cases="B", make=partial(_contacts, event=False), tolerance=1e-9, grows=True
            ),
            on(name="Dopri8, secant of df/dD_p", cases="ACD", make=_designs, tolerance=1e-7, size=2_000),
        )


def _in_time(v: Any, gain: Any) -> Any:
    """Return the contact time by an event."""
    import diffrax as dfx  # noqa: PLC0415
    import optimistix as optx  # noqa: PLC0415

    def motion(t: Any, y: Any, args: Any) -> Any:  # noqa: ARG001
        x, u = y
        slope = -EXPONENT / (DISTANCE + v * t - x + OFFSET)
        return u, (gain * slope * (v - u) - DAMPING * u - STIFFNESS * x) / MASS

    def touch(t: Any, y: Any, args: Any, **_: Any) -> Any:  # noqa: ARG001
        return DISTANCE + v * t - y[0]

    found = dfx.diffeqsolve(
        dfx.ODETerm(motion),
        dfx.Dopri8(),
        t0=0.0,
        t1=60.0,
        dt0=None,
        y0=(0.0 * v, 0.0 * v),
        stepsize_controller=dfx.PIDController(rtol=1e-11, atol=1e-13),
        event=dfx.Event(touch, optx.Newton(1e-12, 1e-12)),
        saveat=dfx.SaveAt(t1=True),
    )
    return found.ts[0]


def _over_distance(v: Any, log_gain: Any, varied: bool) -> Any:
    """Return t and q = -l' at contact, and, if requested, their derivatives by ln(-D_p)."""
    import diffrax as dfx  # noqa: PLC0415

    jnp = numerics()
    import jax  # noqa: PLC0415

    def motion(s: Any, y: Any, log_gain: Any) -> Any:
        t, q = y
        distance = DISTANCE * (1 - s)
        force = -DAMPING * (v + q) - STIFFNESS * (DISTANCE + v * t - distance)
        pull = -jnp.exp(log_gain) * EXPONENT / (distance + OFFSET)
        return DISTANCE / q, DISTANCE / MASS * (force / q + pull)

    def both(s: Any, y: Any, log_gain: Any) -> Any:
        value, change = jax.jvp(partial(motion, s), (y[:2], log_gain), (y[2:], jnp.ones_like(log_gain)))
        return *value, *change

    zero, tolerance = 0.0 * v, 1e-8 if varied else 1e-10  # a gain is asked for to 1e-7, a time to 1e-9
    found = dfx.diffeqsolve(
        dfx.ODETerm(both if varied else motion),
        dfx.Dopri8(),
        t0=0.0,
        t1=1.0,
        dt0=None,
        y0=(zero, -v, zero, zero) if varied else (zero, -v),
        args=log_gain,
        stepsize_controller=dfx.PIDController(rtol=tolerance, atol=tolerance / 100),
        saveat=dfx.SaveAt(t1=True),
    )
    return [column[0] for column in found.ys]


def _mapped(function: Any, order: Column, *columns: Column) -> Job:
    """Run a function over sorted columns in lanes, and restore the order of the results."""
    import jax  # noqa: PLC0415

    if len(order) == 1:
        run = job_of(function, *(column[0] for column in columns))
        return lambda: run()[None]
    lanes = min(_LANES, len(order))
    run = job_of(
        lambda *inputs: jax.lax.map(lambda row: function(*row), inputs, batch_size=lanes),
        *(column[order] for column in columns),
    )
    back = np.argsort(order)
    return lambda: run()[back]


def _contacts(v: Column, gain: Column, event: bool) -> Job:
    if event:
        numerics()
        return _mapped(_in_time, np.argsort(gain / v), v, gain)
    return _mapped(lambda v, u: _over_distance(v, u, varied=False)[0], np.argsort(gain / v), v, np.log(-gain))


def _steepness(v: Any, log_gain: Any) -> Any:
    t, q, t_u, q_u = _over_distance(v, log_gain, varied=True)
    return 2 * ((DISTANCE + v * t) * v * t_u / POSITION_SCALE**2 + q * q_u / VELOCITY_SCALE**2)


def _designs(v: Column) -> Job:
    jnp = numerics()
    import jax  # noqa: PLC0415

    def design(speed: Any) -> Any:
        at = first_guess("inverse-power", -speed, jnp.log)

        def improve(k: Any, carry: Any) -> Any:
            at, step, before = carry
            steep = _steepness(speed, at)
            change = steep - before
            moved = (k > 0) & (jnp.abs(change) > 1e-13)
            secant = jnp.clip(-steep * step / jnp.where(moved, change, 1.0), -0.5, 0.5)
            first = jnp.where(steep > 0, -0.05, 0.05)
            step = jnp.where(k == 0, first, jnp.where(moved, secant, 0.0))
            return at + step, step, steep

        return -jnp.exp(jax.lax.fori_loop(0, _ROUNDS, improve, (at, 0.0 * at, 0.0 * at))[0])

    return _mapped(design, np.argsort(v), v)
