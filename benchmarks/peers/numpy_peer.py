"""NumPy: the closed form over whole columns, in blocks that stay in the cache."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from . import closed_form
from .protocol import Job, Way
from .work import DISTANCE, MASS, POSITION_SCALE, RATE, VELOCITY_SCALE, Column, first_guess

_BLOCK = 4096
_ROUNDS = 6
_NODES = 10  # of the quadrature of a drag
_ROUNDING = 1e-14  # of df / d ln(-D_p): nothing is left to be gained


class NumPy:
    """Columns of doubles, no loop in Python but that over the blocks."""

    name = "NumPy"

    def available(self) -> str:
        """Return an empty reason: pretouch itself needs NumPy."""
        return ""

    def cases(self) -> Sequence[Way]:
        """Return its ways; without a closed form, only the drag is for columns."""
        on, power = partial(Way, sensor="exponential-1"), partial(Way, sensor="inverse-power")
        return (
            on(name="closed form, two evaluations", cases="B", make=_contacts, tolerance=1e-10, grows=True),
            on(name="closed form, secant of df/dD_p", cases="ACD", make=_designs, tolerance=1e-9),
            on(name="closed form", cases="F", make=_drag_closed, tolerance=1e-12),
            power(name="quadrature, 10 nodes", cases="F", make=_drag_quadrature, tolerance=1e-9),
        )


def _blocks(count: int) -> list[slice]:
    return [slice(i, i + _BLOCK) for i in range(0, count, _BLOCK)]


def _contacts(v: Column, gain: Column) -> Job:
    out = np.empty_like(v)

    def job() -> Column:
        for block in _blocks(len(v)):
            out[block] = closed_form.solve(np, v[block], gain[block])
        return out

    return job


def _steepness(log_gain: Column, t: Column, v: Column) -> tuple[Column, Column, Column]:
    """Improve t, and return it with df / d ln(-D_p) along the contact and dt / d ln(-D_p)."""
    gain = -np.exp(log_gain)
    t = closed_form.householder(np, t, v, gain)
    _, speed, bend, _ = closed_form.distance(np, t, v, gain)
    level_g, speed_g = closed_form.slopes(np, t, v, gain)
    t_g = -level_g / speed
    away = (DISTANCE + v * t) * v * t_g / POSITION_SCALE**2
    left = speed * (speed_g + bend * t_g) / VELOCITY_SCALE**2
    return t, 2 * gain * (away + left), gain * t_g


def _design_block(v: Column) -> Column:
    at = first_guess("exponential-1", -v, np.log)
    gain = -np.exp(at)
    t = closed_form.householder(np, closed_form.start(np, v, gain), v, gain)
    t, steep, t_u = _steepness(at, t, v)
    step = np.where(steep > 0, -0.05, 0.05)
    for _ in range(_ROUNDS):
        before, at = steep, at + step
        t, steep, t_u = _steepness(at, t + t_u * step, v)
        change = steep - before
        moved = np.abs(change) > _ROUNDING
        step = np.where(moved, np.clip(-steep * step / np.where(moved, change, 1.0), -0.5, 0.5), 0.0)
    return -np.exp(at + step)


def _designs(v: Column) -> Job:
    return lambda: np.concatenate([_design_block(v[block]) for block in _blocks(len(v))])


def _drag_closed(v: Column, drag: Column) -> Job:
    """Return contact times for a constant slope, (exp(a l_0) - 1) / (a |v|) with a = phi g^2 / M."""
    out = np.empty_like(v)

    def job() -> Column:
        for block in _blocks(len(v)):
            rate = drag[block] * (RATE * RATE / MASS)
            out[block] = np.expm1(rate * DISTANCE) / (rate * -v[block])
        return out

    return job


def _drag_quadrature(v: Column, drag: Column) -> Job:
    """Return contact times by Gauss-Legendre quadrature over the distance."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    growth = closed_form.squared_slope("inverse-power", DISTANCE * (nodes + 1) / 2) / MASS
    out = np.empty_like(v)

    def job() -> Column:
        for block in _blocks(len(v)):
            out[block] = np.exp(np.multiply.outer(drag[block], growth)) @ weights * (-DISTANCE / 2) / v[block]
        return out

    return job
