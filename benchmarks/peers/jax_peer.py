"""JAX: the closed form compiled and mapped over columns; the optimum by JAX derivatives and by optimistix."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from . import closed_form
from .protocol import Job, Way, missing
from .work import Column, first_guess

_STEPS = 5


class Jax:
    """Just-in-time compiled through XLA, in double precision."""

    name = "JAX"

    def available(self) -> str:
        """Return an empty reason where JAX is installed."""
        return missing("jax", "optimistix")

    def cases(self) -> Sequence[Way]:
        """Return its ways."""
        on = partial(Way, sensor="exponential-1")
        return (
            on(name="jit, closed form, two evaluations", cases="B", make=_contacts, tolerance=1e-10, grows=True),
            on(name="jit, vmap, Newton of the optimum", cases="AC", make=_designs, tolerance=1e-9),
            on(
                name="jit, Newton of the optimum in a loop",
                cases="D",
                make=partial(_designs, loop=True),
                tolerance=1e-9,
            ),
            on(name="optimistix Newton, vmap", cases="AC", make=_optimistix, tolerance=1e-9),
        )


def numerics() -> Any:
    """Load jax.numpy in double precision."""
    import jax  # noqa: PLC0415

    jax.config.update("jax_enable_x64", True)
    return jax.numpy


def job_of(function: Any, *columns: Column) -> Job:
    """Compile a function of columns, and return a job that calls it."""
    import numpy as np  # noqa: PLC0415

    jnp = numerics()
    import jax  # noqa: PLC0415

    compiled = jax.jit(function)
    inputs = [jnp.asarray(column) for column in columns]
    return lambda: np.asarray(compiled(*inputs))


def _contacts(v: Column, gain: Column) -> Job:
    return job_of(partial(closed_form.solve, numerics()), v, gain)


def _conditions(y: Any, v: Any) -> Any:
    """Return l and the steepness of the objective along l = 0, at t and ln(-D_p)."""
    jnp = numerics()
    import jax  # noqa: PLC0415

    def level(y: Any) -> Any:
        return closed_form.distance(jnp, y[0], v, -jnp.exp(y[1]))[0]

    def value(y: Any) -> Any:
        return closed_form.merit(y[0], v, closed_form.distance(jnp, y[0], v, -jnp.exp(y[1]))[1])

    by_level, by_value = jax.grad(level)(y), jax.grad(value)(y)
    return jnp.stack([level(y), by_value[1] * by_level[0] - by_value[0] * by_level[1]])


def _begin(v: Any) -> Any:
    jnp = numerics()
    log_gain = first_guess("exponential-1", -v, jnp.log)
    gain = -jnp.exp(log_gain)
    return jnp.stack([closed_form.householder(jnp, closed_form.start(jnp, v, gain), v, gain), log_gain])


def _designs(v: Column, loop: bool = False) -> Job:
    """Newton on both conditions; a loop is slower to run and faster to compile than its steps one after another."""
    jnp = numerics()
    import jax  # noqa: PLC0415

    def design(speed: Any) -> Any:
        def improve(_: Any, y: Any) -> Any:
            f, slope = _conditions(y, speed), jax.jacfwd(_conditions)(y, speed)
            determinant = slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]
            step = jnp.stack([f[0] * slope[1, 1] - slope[0, 1] * f[1], slope[0, 0] * f[1] - f[0] * slope[1, 0]])
            return y - step / determinant

        return -jnp.exp(jax.lax.fori_loop(0, _STEPS, improve, _begin(speed), unroll=not loop)[1])

    return job_of(jax.vmap(design), v)


def _optimistix(v: Column) -> Job:
    jnp = numerics()
    import jax  # noqa: PLC0415
    import optimistix as optx  # noqa: PLC0415

    solver = optx.Newton(rtol=1e-10, atol=1e-10)

    def design(speed: Any) -> Any:
        found = optx.root_find(_conditions, solver, _begin(speed), args=speed, max_steps=30, throw=False)
        return -jnp.exp(found.value[1])

    return job_of(jax.vmap(design), v)
