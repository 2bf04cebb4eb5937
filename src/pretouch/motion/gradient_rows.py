"""How time and relative velocity of each contact depend on the relative inputs: by the fastest way that is exact.

An over-damped motion of constant slope has its derivatives in closed form; any approach has them beside its Taylor
steps in lanes; what neither can do is followed along the guaranteed path, one by one. Everything else at contact is
algebra on these two rows (`gradients`).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Picklable
from pretouch.sensors import SensorModel
from pretouch.sensors.change import SlopeChange

from .curve import (
    MIDDLE,
    TERMS,
    alone,
    curve_pieces,
    curve_reach,
    curve_tops,
    curve_windows,
    farthest,
    interpolate,
    reach_of,
)
from .kernels import OPEN, find_contacts, follow_gradients
from .layout import RELATIVE_INPUTS, ContactStatus
from .request import for_stretches
from .solution import STIFF, Solution, fill_by_lanes

_KEPT: Final = 1 << 20  # encounters up to which all rows are kept: 150 MB
_BLOCK: Final = 1 << 12  # encounters of which a kernel's whole output is held at a time
_LEAST_LINEAR: Final = 8192  # encounters that are worth a thread
_LEAST_FOLLOWED: Final = 16
_MOST_FOLLOWED: Final = 256
_STIFFEST: Final = 3e5  # fastest time constants in a motion: Taylor steps end before they have followed more
_TOLERANCE: Final = 1e-10  # of the largest change of slope: one taken by differences is not smoother
_HALVINGS: Final = 12
_SHRINKS: Final = 0.75  # of an error, by halving: that of rounding does not, that of a corner is halved
_IN_VAIN: Final = 3  # halvings
_ROUNDING: Final = 1e-3  # of the largest change: a larger error is one of the polynomial
_COUNT: Final = 10  # coefficients of a piece


class GradientRows(Picklable):
    """Derivatives of time and l' at contact by the relative inputs, found when they are first asked for."""

    __slots__ = ("_followed", "_rows", "_solution")

    def __init__(self, solution: Solution) -> None:
        self._solution = solution
        self._rows: FloatArray | None = None
        self._followed: dict[str, FloatArray] = {}

    def take(self, which: Sequence[int]) -> FloatArray:
        """Return the derivatives of time and l' by RELATIVE_INPUTS at places, (2, k, n); NaN where there are none."""
        if self._rows is None:
            everything = range(len(RELATIVE_INPUTS))
            kept = everything if self._solution.request.size <= _KEPT else which
            rows = self._find(list(kept))
            if kept is which:
                return rows
            self._rows = rows
        return self._rows[:, list(which)]

    def of_slope(self, name: str, slope: SlopeChange) -> FloatArray:
        """Return the derivatives of time and l', (2, n), by a parameter that changes the slope by a function of l."""
        if name not in self._followed:
            rows = np.full((2, self._solution.request.size), np.nan)
            where = np.flatnonzero(self._differentiable())
            rows[:, where] = self._follow(where, [len(RELATIVE_INPUTS)], slope)[:, 0]
            self._followed[name] = rows
        return self._followed[name]

    def _differentiable(self) -> BoolArray:
        """Tell which runs end in a contact that a small change leaves one: not in a touch, where l' = 0."""
        reached = self._solution.status == ContactStatus.CONTACT
        return np.asarray(reached & (self._solution.raw("relative_velocity") < 0))

    def _find(self, kept: list[int]) -> FloatArray:
        request = self._solution.request
        rows = np.full((2, len(kept), request.size), np.nan)
        left = self._differentiable()
        if request.method == "closed-form" and left.any():
            left = self._linear(kept, left, rows)
        decays = self._decays()
        if left.any():
            left = self._in_lanes(kept, left & (decays <= STIFF), rows) | (left & (decays > STIFF))
        rows[:, :, left] = np.nan
        where = np.flatnonzero(left & (decays <= _STIFFEST))
        if len(where):
            rows[:, :, where] = self._follow(where, kept)
        return rows

    def _decays(self) -> FloatArray:
        """Return how many times the fastest decay of each motion passes until its end."""
        request = self._solution.request
        r = request.relative
        held = r.damping + r.gain * request.sensor.log_slope(0.0)
        return np.asarray(held / r.mass * self._solution.raw("time"))

    def _linear(self, kept: list[int], left: BoolArray, rows: FloatArray) -> BoolArray:
        """Fill what has a closed form; return what is left."""
        request, time = self._solution.request, np.ascontiguousarray(self._solution.raw("time"))
        slope = request.slope
        r = request.relative
        total = r.damping + slope * r.gain
        over_damped = (total > 0) & (total * total >= 4 * r.mass * r.stiffness)
        status = np.where(left & over_damped & (r.a == 0), np.int8(0), np.int8(OPEN))

        def run(start: int, stop: int) -> None:
            out, part = np.empty((3, len(RELATIVE_INPUTS) + 1, stop - start)), slice(start, stop)
            find_contacts(
                request.some(part), slope, request.horizon, time[part], status[part], given=True, gradients=out
            )
            rows[:, :, part] = out[::2, kept]

        for_stretches(run, request.size, least=_LEAST_LINEAR, most=_BLOCK)
        return np.asarray(left & (status != 0))

    def _in_lanes(self, kept: list[int], left: BoolArray, rows: FloatArray) -> BoolArray:
        """Fill what Taylor steps in lanes prove; return what is left."""
        request = self._solution.request
        curves = alone(curve_windows(request.sensor, 0.0, farthest(request.scenario, request.sensor)))
        where = np.flatnonzero(left)
        which = None if len(where) == request.size else where

        def take(part: slice, _: FloatArray, out: FloatArray) -> None:
            rows[:, :, part if which is None else where[part]] = out[::2, kept]

        status = np.empty(len(where), dtype=np.int8)
        by = (3, len(RELATIVE_INPUTS))
        fill_by_lanes(request, which, curves, status, take, most=_BLOCK, gradients=by)
        left = left.copy()
        left[where] = np.isnan(rows[0, 0, where])  # OPEN, or its derivatives not smooth enough
        return left

    def _follow(self, where: IntArray, kept: list[int], slope: SlopeChange | None = None) -> FloatArray:
        """Follow some encounters along the guaranteed path; NaN where that does not come to the contact."""
        request = self._solution.request
        values, gain = request.part(where)
        sensor = request.sensor
        found = np.full((len(where), 2, len(RELATIVE_INPUTS) + (slope is not None)), np.nan)
        status = np.ones(len(where), dtype=np.int8)
        r = request.some(where)
        tops = curve_tops(sensor, 0.0, float(np.max(r.p - r.x0, initial=0.0)), 4 * reach_of(request.scenario))
        for top, _ in tops:  # a motion may have gone beyond the pieces, and come back
            pieces, terms = _changed_pieces(sensor, slope, top)
            open_ones = np.flatnonzero(status == 1)

            def run(start: int, stop: int, which: IntArray = open_ones, p: Any = pieces, t: Any = terms) -> None:
                part = which[start:stop]
                out, ended = np.empty((stop - start, *found.shape[1:])), np.empty(stop - start, dtype=np.int8)
                follow_gradients(values[part], gain[part], p, t, request.horizon, out, ended)
                found[part], status[part] = out, ended

            for_stretches(run, len(open_ones), least=_LEAST_FOLLOWED, most=_MOST_FOLLOWED)
            if (status != 1).all():
                break
        return found[:, :, kept].transpose(1, 2, 0)


def _changed_pieces(sensor: SensorModel, slope: SlopeChange | None, high: float) -> tuple[FloatArray, FloatArray]:
    """Approximate the slope of a curve and a change of it on common pieces from l = 0 up to a distance [m].

    Returns:
        Pieces as `curve_pieces` has them, and the coefficients of the change in the same variable, shape (pieces, 1,
        10), or (pieces, 0, 10) where there is none; they meet the change to 1e-10 of its largest value, or as well as
        the change itself rounds.
    """
    pieces = curve_pieces(sensor, 0.0, high)
    if slope is None:
        return pieces, np.zeros((len(pieces), 0, _COUNT))

    def look(distance: FloatArray) -> FloatArray:
        return np.asarray(slope(np.clip(distance, *sensor.valid_range)), dtype=np.float64)[:, None]

    before, in_vain = np.full(len(pieces), np.inf), np.zeros(len(pieces))
    for halvings in range(_HALVINGS + 1):
        values, terms, errors = interpolate(look, pieces[:, 0], pieces[:, 1])
        error, largest = errors[:, 0], np.abs(values).max()
        in_vain += error > _SHRINKS * before
        rounded = (in_vain >= _IN_VAIN) & (error <= _ROUNDING * largest)
        poor = (error > _TOLERANCE * largest) & ~rounded
        if halvings == _HALVINGS or not poor.any():  # what still is poor is a corner, on a 4,096th of a piece
            break
        pieces, (before, in_vain) = _halved(pieces, poor, (error, in_vain))
    return pieces, np.ascontiguousarray(terms)


def _halved(
    pieces: FloatArray, poor: BoolArray, columns: tuple[FloatArray, ...]
) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Cut pieces in two, with columns that both halves inherit; their polynomials stay what they are."""
    old, parts = pieces[poor], [pieces[~poor]]
    for side in (-0.5, 0.5):
        change = np.array([[comb(j, i) * side ** (j - i) * 0.5**i for j in range(_COUNT)] for i in range(_COUNT)])
        parts.append(np.column_stack([old[:, 0] + side * old[:, 1], old[:, 1] / 2, old[:, 2:] @ change.T]))
    both = np.concatenate(parts)
    order = np.argsort(both[:, 0])
    return both[order], tuple(np.concatenate([c[~poor], c[poor], c[poor]])[order] for c in columns)


def bend_at_contact(sensor: SensorModel) -> float:
    """Return dg/dl [1/m^2] at l = 0 of a curve that is valid there.

    It is that of the polynomial that meets g beside the surface; good to some 1e-11 of g over the distance in which the
    curve changes.
    """
    if sensor.constant_log_slope is not None:
        return 0.0
    reach = min(1.0, sensor.valid_range[1])
    windows = curve_windows(sensor, 0.0, reach)
    if len(windows):
        z, terms = -windows[0, MIDDLE], windows[0, TERMS:]
        if len(terms) == 1:
            return float(-terms[0] / z**2)
        return float(sum(j * (j - 1) * terms[j] * z ** (j - 2) for j in range(2, len(terms))))
    piece = curve_pieces(sensor, 0.0, curve_reach(sensor, 0.0, 0.0, reach))[0]
    z = -piece[0] / piece[1]
    return float(sum(j * piece[2 + j] * z ** (j - 1) for j in range(1, _COUNT)) / piece[1])
