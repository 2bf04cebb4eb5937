"""Solve one encounter at a time by the most robust method.

This method is the fallback for the fast solvers. The uniform motion L(16)-(19) is one particular motion of the
second-order exponential curve. It is used only if it is selected as the method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.progress import note_solved
from pretouch.sensors import SensorModel

from .curve import LARGEST_START, curve_pieces, curve_tops
from .kernels import DragBalance, respond_many, solve_drag_courses, solve_linear, solve_series
from .layout import COLUMNS, DRAG_NODES, RELATIVE_INPUTS, ContactStatus, by_name
from .many_curves import ManyCurves
from .obstacle_path import path_sections
from .parallel import run_in_chunks
from .request import Request, Which

_BLOCK: Final = 16  # encounters per call of a kernel
_DISTANCE: Final = COLUMNS.index("distance")
_ACCELERATION: Final = RELATIVE_INPUTS.index("a")
_LEAST: Final = 512  # encounters that keep a thread busy for 10 ms
_MOST: Final = 16_384  # largest chunk


def solve_guaranteed(request: Request, which: IntArray | None = None) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve encounters one at a time by the most robust solver.

    It solves m encounters of a request, selected by indices, or all of them, by the method of the request.

    Returns:
        Table of layout.COLUMNS, shape (m, 15), and the numbers of ContactStatus, shape (m,).
    """
    if request.many is not None:
        return _curve_by_curve(request, request.many, np.arange(request.size) if which is None else which)
    count = request.size if which is None else len(which)
    rows, status = _unresolved(count)
    solve = _SOLVERS[request.method][0]

    def run(start: int, stop: int) -> None:
        part = slice(start, stop) if which is None else which[start:stop]
        solve(request, part, rows[start:stop], status[start:stop])

    run_in_chunks(run, count, least=_LEAST, most=_MOST)
    _mark_overflow(request, which, rows, status)
    return rows, status.astype(np.int8)


def _unresolved(count: int) -> tuple[FloatArray, IntArray]:
    """Create result arrays of unsolved encounters, filled with NaN."""
    rows, status = np.empty((count, len(COLUMNS))), np.empty(count, dtype=np.int64)
    rows.fill(np.nan)
    status.fill(ContactStatus.UNRESOLVED)
    return rows, status


def trace_guaranteed(request: Request, times: FloatArray, trace: FloatArray) -> None:
    """Sample the motions of encounters by the most robust method.

    The times [s] ascend, up to the end of each encounter. `trace` is filled with layout.TRACE_COLUMNS, shape (n, times,
    4).
    """
    _SOLVERS[request.method][1](request, times, trace)


def _curve_by_curve(request: Request, many: ManyCurves, which: IntArray) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve encounters with different sensor curves, one curve at a time."""
    rows, status = _unresolved(len(which))
    place, curve = np.divmod(which, len(many))
    for index in np.unique(curve):
        selected = np.flatnonzero(curve == index)
        rows[selected], status[selected] = solve_guaranteed(request.with_curve(int(index)), place[selected])
    return rows, status.astype(np.int8)


def _mark_overflow(request: Request, which: IntArray | None, rows: FloatArray, status: IntArray) -> None:
    """Mark encounters with infinite or NaN results as unresolved."""
    bad = np.flatnonzero(~np.isfinite(rows[:, _ALWAYS_FINITE]).all(axis=1))
    if len(bad):
        r = request.some(bad if which is None else which[bad])
        start = np.zeros((len(bad), len(COLUMNS)))
        end = by_name(start)
        end["distance"][:] = end["closest_distance"][:] = r.p - r.x0
        end["displacement"][:], end["displacement_velocity"][:], end["relative_velocity"][:] = r.x0, r.u0, r.v - r.u0
        end["largest_excursion"][:], end["largest_speed"][:] = np.abs(r.x0), np.abs(r.u0 + r.reference_velocity)
        end["settling_distance"][:] = np.inf
        rows[bad], status[bad] = start, ContactStatus.UNRESOLVED


_ALWAYS_FINITE: Final = [i for i, name in enumerate(COLUMNS) if name != "settling_distance"]


def _solve_closed_form(request: Request, which: Which, rows: FloatArray, status: IntArray) -> None:
    """Find contacts in closed form for a constant sensor slope.

    A contact is the first zero of the distance by the equations L(10)-(13).
    """
    values, gain = request.part(which)
    solve_linear(values, request.slope, gain, (request.horizon, *request.sensor.valid_range), rows, status=status)


def _trace_closed_form(request: Request, times: FloatArray, trace: FloatArray) -> None:
    r, rows = request.relative, np.empty((request.size, 7))
    coupling = request.slope * r.gain
    terms = (r.mass, r.damping + coupling, r.stiffness, r.x0, r.u0, coupling * r.v, coupling * r.a)
    for i, term in enumerate(terms):
        rows[:, i] = term
    respond_many(rows, times, trace[..., 1:])
    p, v, a = (x[:, None] for x in (r.p, r.v, r.a))
    trace[..., 0] = p + (v + a * times / 2) * times - trace[..., 1]


def _integrate(request: Request, which: Which, rows: FloatArray, status: IntArray) -> None:
    """Integrate the robot's motion under the virtual damper, or under the virtual drag.

    The equation of motion is L(1), and the virtual force of the damper is L(2). Encounters that leave the approximated
    part of the curve are repeated with a longer part.

    With the curves L(3), L(5) and L(6) this is L(4), L(7) and L(14). Encounters that start too far away stay
    unresolved.
    """
    values, gain, sections = columns = _inputs(request, which)
    solver = _solver(request)
    out, ended, again = rows, status, np.flatnonzero(_is_integrable(values))
    if len(again) < len(rows):
        if not len(again):
            return
        values, gain, sections = _select(columns, again)
        out, ended = _unresolved(len(again))
    for top, pieces, limits in _stages(request):
        for start in range(0, len(out), _BLOCK):  # an interrupt takes effect only between blocks
            part = slice(start, start + _BLOCK)
            path = None if sections is None else sections[part]
            solver(values[part], gain[part], pieces, limits, out[part], ended[part], sections=path)
            note_solved(len(out[part]))
        if out is not rows:
            rows[again], status[again] = out, ended
        if not limits[-1]:
            return
        again = again[(ended == ContactStatus.UNRESOLVED) & (out[:, _DISTANCE] >= top)]
        if not len(again):
            return
        values, gain, sections = _select(columns, again)
        out, ended = _unresolved(len(again))


def _solver(request: Request) -> Callable[..., None]:
    """Return the compiled solver for the law of a request."""
    return solve_drag_courses if request.degree == 2 else solve_series


def drag_impulses(request: Request) -> tuple[FloatArray, FloatArray]:
    """Return the impulses [N s] of the virtual drag and of the admittance in each encounter with a course.

    The impulse of the drag is computed from the sensor curve itself, at quadrature nodes of all integration steps.
    """
    size = request.size
    drag, admittance = np.zeros(size), np.zeros(size)
    if request.many is not None:
        curve_of = np.arange(size) % len(request.many)
        for index in range(len(request.many)):
            drag[curve_of == index], admittance[curve_of == index] = drag_impulses(request.with_curve(index))
        return drag, admittance
    which = np.flatnonzero(_is_integrable(_inputs(request, slice(None))[0]))
    for top, pieces, limits in _stages(request):
        again: list[IntArray] = []
        for start in range(0, len(which), _LEAST):
            part = which[start : start + _LEAST]
            values, gain, sections = _inputs(request, part)
            rows, status = _unresolved(len(part))
            balance = DragBalance(np.empty(len(part)), np.empty(len(part), dtype=np.int64))
            solve_drag_courses(values, gain, pieces, limits, rows, status, sections=sections, balance=balance)
            ends = np.cumsum(balance.steps)
            nodes = np.empty((int(ends[-1]), DRAG_NODES, 3))
            balance = balance._replace(first=ends - balance.steps, nodes=nodes)
            solve_drag_courses(values, gain, pieces, limits, rows, status, sections=sections, balance=balance)
            weight, distance, speed = np.moveaxis(nodes, -1, 0)
            slope = np.asarray(request.sensor.log_slope(np.clip(distance, *request.sensor.valid_range)))
            squares = (weight * (slope * np.minimum(speed, 0.0)) ** 2).sum(axis=1)
            owner = np.repeat(np.arange(len(part)), balance.steps)
            drag[part] = -gain * np.bincount(owner, squares, len(part))
            admittance[part] = balance.impulses
            again.append(part[(status == ContactStatus.UNRESOLVED) & (rows[:, _DISTANCE] >= top)])
        which = np.concatenate(again) if again and limits[-1] else np.zeros(0, dtype=np.int64)
        if not len(which):
            break
    return drag, admittance


_Inputs: TypeAlias = tuple[FloatArray, FloatArray, FloatArray | None]


def _inputs(request: Request, which: Which) -> _Inputs:
    """Return inputs, gains and later path sections, if the obstacle has a course, of selected encounters."""
    values, gain = request.part(which)
    if not request.scenario.obstacle.course:
        return values, gain, None
    values[:, _ACCELERATION], sections = path_sections(request, which)
    return values, gain, sections


def _select(inputs: _Inputs, which: IntArray) -> _Inputs:
    values, gain, sections = inputs
    return values[which], gain[which], None if sections is None else sections[which]


def _is_integrable(values: FloatArray) -> BoolArray:
    """Return True for encounters, with values of Scenario.relative of shape (n, 10), that start close enough."""
    followed: BoolArray = values[:, 5] - values[:, 3] <= LARGEST_START  # p - x~(0)
    return followed


def _trace_integration(request: Request, times: FloatArray, trace: FloatArray) -> None:
    values, _, _ = inputs = _inputs(request, slice(None))
    trace[..., 0], trace[..., 1] = (values[:, 5] - values[:, 3])[:, None], values[:, 3, None]
    trace[..., 2], trace[..., 3] = values[:, 4, None], 0.0
    which = np.flatnonzero(_is_integrable(values))
    trace[which] = np.nan
    if not len(which):
        return
    for _, pieces, limits in _stages(request):
        part = np.full((len(which), *trace.shape[1:]), np.nan)
        values, gain, sections = _select(inputs, which)
        _solver(request)(values, gain, pieces, limits, *_unresolved(len(which)), (times[which], part), sections)
        trace[which] = part
        which = which[np.isnan(part).any(axis=(1, 2))]  # other pieces would change the end of solved runs by rounding
        if not len(which):
            return


def _stages(request: Request) -> Iterator[tuple[float, FloatArray, tuple[float, bool, bool]]]:
    """Yield end distance [m], polynomials and limits for `solve_series` up to increasing distances."""
    r, sensor = request.relative, request.sensor
    low, bottom = sensor.valid_range[0], max(sensor.valid_range[0], 0.0)
    distance = r.p - r.x0
    farthest = float(np.max(distance, initial=0.0))
    if farthest > LARGEST_START:
        farthest = float(np.max(distance, initial=0.0, where=distance <= LARGEST_START))
    for top, goes_on in curve_tops(sensor, bottom, farthest, 2.0 ** math.ceil(math.log2(4 * farthest))):
        yield top, curve_pieces(sensor, bottom, top), (request.horizon, low <= 0, goes_on)


def _second_order_parameters(sensor: SensorModel) -> tuple[float, float]:
    """Return b_2 [1/m^2] and c_2 [1/m] of a second-order exponential curve; b_2 = 0 for a constant slope."""
    if sensor.constant_log_slope is not None:
        return 0.0, sensor.constant_log_slope
    low, high = sensor.valid_range
    ends = np.array([low, high if np.isfinite(high) else low + 1.0])
    probe = ends[0] + (ends[1] - ends[0]) * np.array([0.0, 0.21, 0.43, 0.77, 1.0])
    slope = np.asarray(sensor.log_slope(probe))
    bend, intercept = np.polyfit(probe, slope, 1)
    if np.abs(slope - bend * probe - intercept).max() > 1e-9 * np.abs(slope).max():
        raise InvalidInputError(
            "method: 'uniform-motion' needs a second-order exponential sensor curve, but this sensor has the "
            f"{sensor.name} curve; use method='integration' instead"
        )
    return float(bend) / 2, float(intercept)


def uniform_motion(
    values: FloatArray, curvature: float, rate: float, gain: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Compute the uniform motion, which has a constant relative velocity.

    The distance is l = A t + B. It solves the motion equation L(15), with A from L(17) and B from L(18).

    L(17) requires the root with 0 <= |A| <= |v_o| and the sign of v_o. With s = sqrt(1 + 8 b_2 D_p v_o / K_a) the roots
    are 2 v_o / (1 + s) and 2 v_o / (1 - s). Only the first can satisfy both conditions, and it becomes v_o for
    b_2 -> 0. For s >= 3 the second satisfies the bound on |A|, too, but it recedes.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        curvature: b_2 [1/m^2].
        rate: c_2 [1/m].
        gain: D_p [N s], shape (n,).

    Returns:
        A [m/s] and B [m], shape (n,) each; NaN if there is no such motion.

    Raises:
        InvalidInputError: the obstacle accelerates relative to the reference, or K_a is zero.
    """
    _, damping, stiffness, _, _, position, speed, acceleration, _, _ = values.T
    if np.any(acceleration != 0):
        raise InvalidInputError("method: the uniform motion L(16)-(19) needs an obstacle without acceleration")
    if np.any(stiffness == 0):
        raise InvalidInputError("method: the uniform motion L(16)-(19) needs a stiffness above 0 N/m")
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(1 + 8 * curvature * gain * speed / stiffness)
        a = 2 * speed / (1 + root)
        a = np.where((np.abs(a) <= np.abs(speed)) & (a < 0), a, np.nan)
        pull = damping * speed + stiffness * position - (rate * gain + damping) * a
        b = pull / (2 * curvature * gain * a + stiffness)
    return a, b


def _solve_uniform_motion(request: Request, which: Which, rows: FloatArray, status: IntArray) -> None:
    """Approximate encounters by the letter's uniform motion. The equations of this motion are L(16)-(19)."""
    curvature, rate = _second_order_parameters(request.sensor)
    values, gain = request.part(which)
    a, b = uniform_motion(values, curvature, rate, gain)
    _, _, _, x0, _, position, speed, _, drift, pull = values.T
    exists = np.isfinite(a) & (b >= 0)
    a, b = np.where(exists, a, 1.0), np.where(exists, b, 0.0)
    time, start = -b / a, position - b
    displacement, own_speed = position + speed * time, speed - a
    steepest = np.maximum(np.abs(rate), np.abs(rate + 2 * curvature * b))
    quantities = {
        "time": time,
        "displacement": displacement,
        "displacement_velocity": own_speed,
        "relative_velocity": a,
        "virtual_force": gain * rate * a,
        "largest_excursion": np.maximum(np.abs(start), np.abs(displacement)),
        "largest_travel": np.abs(displacement - start + (drift + pull * time / 2) * time),
        "largest_speed": np.maximum(np.abs(own_speed + drift), np.abs(own_speed + drift + pull * time)),
        "largest_acceleration": np.abs(pull),
        "largest_virtual_force": np.abs(gain * a) * steepest,
        "settling_distance": np.full(len(values), np.inf),
    }
    zeros, end = np.zeros(len(values)), by_name(rows)
    for name in COLUMNS:
        end[name][:] = np.where(exists, quantities.get(name, zeros), 0.0)
    for name in ("distance", "closest_distance"):
        end[name][~exists] = (position - x0)[~exists]
    status[:] = np.where(exists, ContactStatus.CONTACT, ContactStatus.NO_UNIFORM_MOTION)


def _trace_uniform_motion(request: Request, times: FloatArray, trace: FloatArray) -> None:
    """Sample distance and speed of the uniform motion; without it, the distance is constant."""
    r = request.relative
    values, gain = request.part(slice(None))
    a, b = (x[:, None] for x in uniform_motion(values, *_second_order_parameters(request.sensor), gain))
    trace[...] = 0.0
    trace[..., 0] = np.where(np.isnan(a), (r.p - r.x0)[:, None], b) + np.nan_to_num(a) * times
    trace[..., 2] = r.v[:, None] - np.nan_to_num(a)


_SOLVERS: Final = {
    "closed-form": (_solve_closed_form, _trace_closed_form),
    "integration": (_integrate, _trace_integration),
    "uniform-motion": (_solve_uniform_motion, _trace_uniform_motion),
}
"""The function that solves encounters and the function that samples motions, by method."""
