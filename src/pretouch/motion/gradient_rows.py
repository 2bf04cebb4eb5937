"""Compute exact derivatives of contact time and velocity for many encounters.

Each run uses the fastest applicable method. Over-damped motions with a constant slope have a closed form. Approaches on
other curves get their derivatives from Taylor steps, with several encounters computed side by side. The module
`guaranteed` solves the other runs, one at a time. The derivatives of all other contact quantities follow from these two
by algebra (`gradients`).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Picklable
from pretouch.sensors import SensorModel
from pretouch.sensors.sensitivity import SlopeSensitivity

from .curve import (
    MIDDLE,
    TERMS,
    curve_pieces,
    curve_reach,
    curve_tops,
    curve_windows,
    farthest,
    interpolate,
    reach_of,
    shared_curve,
)
from .kernels import OPEN, find_contacts, follow_gradients
from .layout import RELATIVE_INPUTS, ContactStatus
from .parallel import run_in_chunks
from .solution import STIFF, Solution, fill_by_lanes

_KEPT: Final = 1 << 20  # largest number of encounters for which all rows are stored: 150 MB
_BLOCK: Final = 1 << 12  # encounters per kernel call
_LEAST_LINEAR: Final = 8192  # encounters that are worth a thread
_LEAST_FOLLOWED: Final = 16
_MOST_FOLLOWED: Final = 256
_STIFFEST: Final = 3e5  # duration over the fastest time constant; Taylor steps cannot integrate stiffer motions
_TOLERANCE: Final = 1e-10  # relative to the largest change of slope; numerical derivatives are not smoother
_HALVINGS: Final = 12
_SHRINKS: Final = 0.75  # error ratio by halving that counts as progress; 1 for rounding, 1/2 for a corner
_IN_VAIN: Final = 3  # halvings without progress after which the error counts as rounding
_ROUNDING: Final = 1e-3  # relative to the largest change; larger errors are not rounding
_COUNT: Final = 10  # coefficients of a piece


class GradientRows(Picklable):
    """Derivatives of contact time and velocity with respect to the inputs.

    They are computed on first access. The inputs are relative to the reference.
    """

    __slots__ = ("_followed", "_rows", "_solution")

    degree = 1
    suspends_admittance = False

    def __init__(self, solution: Solution) -> None:
        self._solution = solution
        self._rows: FloatArray | None = None
        self._followed: dict[str, FloatArray] = {}

    def take(self, which: Sequence[int]) -> FloatArray:
        """Return the derivatives of contact time and velocity with respect to selected inputs.

        `which` holds indices of RELATIVE_INPUTS. The result has the shape (2, k, n).
        """
        if self._rows is None:
            everything = range(len(RELATIVE_INPUTS))
            indices = everything if self._solution.request.size <= _KEPT else which
            rows = self._find(list(indices))
            if indices is which:
                return rows
            self._rows = rows
        return self._rows[:, list(which)]

    def of_slope(self, name: str, slope: SlopeSensitivity) -> FloatArray:
        """Return the derivatives of contact time and velocity with respect to a sensor parameter.

        `slope` is dg/d(parameter). The result has the shape (2, n).
        """
        if name not in self._followed:
            rows = np.full((2, self._solution.request.size), np.nan)
            where = np.flatnonzero(self._differentiable())
            rows[:, where] = self._by_guaranteed_path(where, [len(RELATIVE_INPUTS)], slope)[:, 0]
            self._followed[name] = rows
        return self._followed[name]

    def _differentiable(self) -> BoolArray:
        """Return True for encounters with contact at nonzero speed."""
        reached = self._solution.status == ContactStatus.CONTACT
        return np.asarray(reached & (self._solution.raw("relative_velocity") < 0))

    def _find(self, indices: list[int]) -> FloatArray:
        request = self._solution.request
        rows = np.full((2, len(indices), request.size), np.nan)
        pending = self._differentiable()
        if request.method == "closed-form" and pending.any():
            pending = self._linear(indices, pending, rows)
        decays = self._decays()
        if pending.any():
            pending = self._in_lanes(indices, pending & (decays <= STIFF), rows) | (pending & (decays > STIFF))
        rows[:, :, pending] = np.nan
        where = np.flatnonzero(pending & (decays <= _STIFFEST))
        if len(where):
            rows[:, :, where] = self._by_guaranteed_path(where, indices)
        return rows

    def _decays(self) -> FloatArray:
        """Return the duration of each motion divided by its fastest time constant."""
        request = self._solution.request
        r = request.relative
        damping = r.damping + r.gain * request.sensor.log_slope(0.0)
        return np.asarray(damping / r.mass * self._solution.raw("time"))

    def _linear(self, indices: list[int], pending: BoolArray, rows: FloatArray) -> BoolArray:
        """Compute derivatives by closed form, and return which encounters remain unsolved."""
        request, time = self._solution.request, np.ascontiguousarray(self._solution.raw("time"))
        slope = request.slope
        r = request.relative
        total = r.damping + slope * r.gain
        over_damped = (total > 0) & (total * total >= 4 * r.mass * r.stiffness)
        status = np.where(pending & over_damped & (r.a == 0), np.int8(0), np.int8(OPEN))

        def run(start: int, stop: int) -> None:
            out, part = np.empty((3, len(RELATIVE_INPUTS) + 1, stop - start)), slice(start, stop)
            find_contacts(
                request.some(part), slope, request.horizon, time[part], status[part], solved=True, gradients=out
            )
            rows[:, :, part] = out[::2, indices]

        run_in_chunks(run, request.size, least=_LEAST_LINEAR, most=_BLOCK)
        return np.asarray(pending & (status != 0))

    def _in_lanes(self, indices: list[int], pending: BoolArray, rows: FloatArray) -> BoolArray:
        """Compute derivatives by a Taylor-series solver, and return which encounters remain unsolved."""
        request = self._solution.request
        curves = shared_curve(curve_windows(request.sensor, 0.0, farthest(request.scenario, request.sensor)))
        where = np.flatnonzero(pending)
        which = None if len(where) == request.size else where

        def take(part: slice, _: FloatArray, out: FloatArray) -> None:
            rows[:, :, part if which is None else where[part]] = out[::2, indices]

        status = np.empty(len(where), dtype=np.int8)
        by = (3, len(RELATIVE_INPUTS))
        fill_by_lanes(request, which, curves, status, take, most=_BLOCK, gradients=by)
        pending = pending.copy()
        pending[where] = np.isnan(rows[0, 0, where])  # OPEN, or the derivatives are not smooth enough
        return pending

    def _by_guaranteed_path(
        self, where: IntArray, indices: list[int], slope: SlopeSensitivity | None = None
    ) -> FloatArray:
        """Compute derivatives of selected encounters by the most robust solver."""
        request = self._solution.request
        values, gain = request.part(where)
        sensor = request.sensor
        derivatives = np.full((len(where), 2, len(RELATIVE_INPUTS) + (slope is not None)), np.nan)
        status = np.ones(len(where), dtype=np.int8)
        r = request.some(where)
        tops = curve_tops(sensor, 0.0, float(np.max(r.p - r.x0, initial=0.0)), 4 * reach_of(request.scenario))
        for top, _ in tops:  # a motion may leave the approximated range and come back
            pieces, terms = _changed_pieces(sensor, slope, top)
            open_ones = np.flatnonzero(status == 1)

            def run(start: int, stop: int, which: IntArray = open_ones, p: Any = pieces, t: Any = terms) -> None:
                part = which[start:stop]
                out, ended = np.empty((stop - start, *derivatives.shape[1:])), np.empty(stop - start, dtype=np.int8)
                follow_gradients(values[part], gain[part], p, t, request.horizon, out, ended)
                derivatives[part], status[part] = out, ended

            run_in_chunks(run, len(open_ones), least=_LEAST_FOLLOWED, most=_MOST_FOLLOWED)
            if (status != 1).all():
                break
        return derivatives[:, :, indices].transpose(1, 2, 0)


def _changed_pieces(sensor: SensorModel, slope: SlopeSensitivity | None, high: float) -> tuple[FloatArray, FloatArray]:
    """Approximate the sensor slope and its parameter derivative by polynomials.

    Both use the same intervals, from l = 0 up to the distance `high` [m].

    Returns:
        Pieces as from `curve_pieces`, and the coefficients of the change in the same variable, shape (pieces, 1, 10),
        or (pieces, 0, 10) without a change. Their error is 1e-10 of the largest change, or at the rounding level of
        the change.
    """
    pieces = curve_pieces(sensor, 0.0, high)
    if slope is None:
        return pieces, np.zeros((len(pieces), 0, _COUNT))

    def evaluate(distance: FloatArray) -> FloatArray:
        return np.asarray(slope(np.clip(distance, *sensor.valid_range)), dtype=np.float64)[:, None]

    before, in_vain = np.full(len(pieces), np.inf), np.zeros(len(pieces))
    for halvings in range(_HALVINGS + 1):
        values, terms, errors = interpolate(evaluate, pieces[:, 0], pieces[:, 1])
        error, largest = errors[:, 0], np.abs(values).max()
        in_vain += error > _SHRINKS * before
        rounded = (in_vain >= _IN_VAIN) & (error <= _ROUNDING * largest)
        poor = (error > _TOLERANCE * largest) & ~rounded
        if halvings == _HALVINGS or not poor.any():  # the remaining pieces, 1/4096 of the first ones, contain corners
            break
        pieces, (before, in_vain) = _halve(pieces, poor, (error, in_vain))
    return pieces, np.ascontiguousarray(terms)


def _halve(
    pieces: FloatArray, poor: BoolArray, columns: tuple[FloatArray, ...]
) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Split inaccurate polynomials in the middle of their intervals; both halves of a piece inherit its columns."""
    old, parts = pieces[poor], [pieces[~poor]]
    for side in (-0.5, 0.5):
        change = np.array([[comb(j, i) * side ** (j - i) * 0.5**i for j in range(_COUNT)] for i in range(_COUNT)])
        parts.append(np.column_stack([old[:, 0] + side * old[:, 1], old[:, 1] / 2, old[:, 2:] @ change.T]))
    both = np.concatenate(parts)
    order = np.argsort(both[:, 0])
    return both[order], tuple(np.concatenate([c[~poor], c[poor], c[poor]])[order] for c in columns)


def bend_at_contact(sensor: SensorModel) -> float:
    """Return the derivative of the sensor slope at contact, dg/dl [1/m^2].

    It is the derivative of a polynomial that approximates g next to the surface. Its error is about 1e-11 of g over
    the length on which the curve changes.
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
    # The pieces next to contact may be so short that the rounding of g hides its change: among the polynomials from
    # contact to the end of each piece, the one whose derivative has the smallest error counts.
    half = curve_pieces(sensor, 0.0, curve_reach(sensor, 0.0, 0.0, reach))[:, :2].sum(axis=1) / 2
    values, terms, error = interpolate(lambda distance: np.asarray(sensor.log_slope(distance)), half, half)
    best = int(np.argmin((error + np.finfo(np.float64).eps * np.abs(values).max(axis=1)) / half))
    return float(sum(j * terms[best, j] * (-1.0) ** (j - 1) for j in range(1, _COUNT)) / half[best])
