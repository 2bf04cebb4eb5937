"""Check the arguments of the compiled solvers of encounters, and call the solvers.

Curves of constant slope use the closed form L(10)-(13): vectorized, or one encounter at a time in a form that is
accurate for every damping and for K -> 0. Other curves use vectorized Taylor steps, or guaranteed steps on pieces of
the curve. The vectorized kernels prove that a contact is the first one. Encounters without such a proof are left to the
slower solvers.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import POINTER as POINTER_TO
from ctypes import Structure, byref
from struct import pack
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pretouch._core.native import DOUBLE, INTEGER, POINTER, address, columns, kernel, numbers, rows_of, shaped
from pretouch._core.numbers import FloatArray, IntArray

from .curve import HIGH_DEGREE, LOW_DEGREE, TERMS, Curves
from .layout import COLUMNS, DRAG_NODES, DRAG_PEAKS, DRAG_ROWS, INPUTS, PEAKS, SECTION_COLUMNS, STATES, TRACE_COLUMNS

CONTACT: Final = 0
"""The status of an encounter whose first contact is proved."""

OPEN: Final = -1
"""The status of all other encounters, which other methods must solve."""

_SHORT: Final = np.dtype(np.int8)
_INDEX: Final = np.dtype(np.int64)
_WIDTHS: Final = frozenset(TERMS + 1 + degree for degree in (0, 1, LOW_DEGREE, HIGH_DEGREE))
_DRAG_INPUTS: Final = 8
_WIDEST: Final = 12  # middle, half width and ten coefficients of a piece


class _CurvesOfCore(Structure):
    """C structure with the sensor curves of several encounters."""

    _fields_ = (
        ("windows", POINTER),
        ("rows", INTEGER),
        ("width", INTEGER),
        ("starts", POINTER),
        ("curve_of", POINTER),
        ("stride", INTEGER),
    )


class _PiecesOfCore(Structure):
    """C structure with one sensor curve as polynomials on adjacent intervals."""

    _fields_ = (
        ("pieces", POINTER),
        ("count", INTEGER),
        ("width", INTEGER),
        ("ends_in_contact", INTEGER),
        ("open_ended", INTEGER),
    )


class _ApproachesOfCore(Structure):
    """C structure with the output arrays of the compiled drag solver."""

    _fields_ = (
        *numbers("rows", "status", "cells", "peaks", "gradients", "nodes", "balance", kind=POINTER),
        *numbers("first", "changes", "log_outputs", "times", kind=POINTER),
        ("m", INTEGER),
        ("trace", POINTER),
    )


class _DragCoursesOfCore(Structure):
    """C structure with further inputs and the outputs of the compiled solver for drags and courses."""

    _fields_ = (
        *numbers("rows", "status", "impulses", "steps", "first", "nodes", "times", kind=POINTER),
        ("m", INTEGER),
        *numbers("trace", "sections", kind=POINTER),
        ("section_count", INTEGER),
    )


_ALONE: Final = (POINTER, INTEGER, POINTER, POINTER_TO(_PiecesOfCore))
_linear_contacts = kernel("linear_contacts", POINTER, INTEGER, DOUBLE, DOUBLE, POINTER)
_linear = kernel("solve_linear", POINTER, INTEGER, DOUBLE, POINTER, DOUBLE, DOUBLE, DOUBLE, POINTER, POINTER)
_respond = kernel("respond", POINTER, INTEGER, POINTER, INTEGER, POINTER, INTEGER, INTEGER, INTEGER)
_contacts = kernel("series_contacts", POINTER, POINTER, INTEGER, POINTER_TO(_CurvesOfCore), DOUBLE, *[POINTER] * 4)
_series = kernel("solve_series", *_ALONE, DOUBLE, POINTER, POINTER, POINTER, INTEGER, POINTER, POINTER, INTEGER)
_approaches = kernel(
    "drag_approaches", POINTER, INTEGER, POINTER_TO(_CurvesOfCore), DOUBLE, POINTER_TO(_ApproachesOfCore)
)
_drag_courses = kernel("solve_drag_courses", *_ALONE, DOUBLE, POINTER_TO(_DragCoursesOfCore))
_follow = kernel("follow_gradients", *_ALONE, POINTER, DOUBLE, POINTER, POINTER)


def find_contacts(
    inputs: Sequence[FloatArray],
    slope: float,
    horizon: float,
    time: FloatArray,
    status: NDArray[np.int8],
    *,
    solved: bool = False,
    approach: FloatArray | None = None,
    states: FloatArray | None = None,
    gradients: FloatArray | None = None,
    peaks: FloatArray | None = None,
) -> None:
    """Find first contacts by the closed form for constant sensor slope.

    The motions solve M x~'' + (D + c) x~' + K x~ = c (v + a t) with c = slope gain and l = p + v t + a t^2 / 2 - x~.

    If the status is OPEN, the other results are NaN.

    Args:
        inputs: the first nine columns of layout.Relative, or all eleven for peaks; shape (n,) or (1,), contiguous.
        slope: g [1/m], one number.
        horizon: latest time of contact [s].
        time: filled with the times of contact [s], shape (n,).
        status: filled with 0 (proved to be the first contact, with a relative error of the time of 2e-11) or OPEN;
            shape (n,), int8.
        solved: whether time and status are results of an earlier call; then only the other outputs are filled.
        approach: optional output, l' [m/s] at contact, shape (n,).
        states: optional output, layout.STATES without the time, shape (5, n); its last axis must be contiguous.
        gradients: optional output, derivatives of time, x~ and l' at contact by the nine inputs and g in SI, shape
            (3, 10, n).
        peaks: optional output, layout.PEAKS, shape (5, n), as states; NaN if a peak is not determined.

    Raises:
        TypeError: an array has the wrong shape, type or layout.
    """
    n, expected = time.size, INPUTS if peaks is None else INPUTS + 2
    if len(inputs) < expected:
        raise TypeError(f"a kernel takes {expected} columns, not {len(inputs)}")
    wanted = pack(
        "10q",
        shaped(time, (n,)),
        shaped(status, (n,), _SHORT),
        solved,
        0 if approach is None else shaped(approach, (n,)),
        *((0, 0) if states is None else rows_of(states, (len(STATES) - 1, n))),
        *((0, 0) if gradients is None else (shaped(gradients, (3, INPUTS + 1, n)), n)),
        *((0, 0) if peaks is None else rows_of(peaks, (len(PEAKS), n))),
    )
    _linear_contacts(columns(inputs[:expected], n), n, slope, horizon, wanted)


def solve_linear(
    values: FloatArray,
    slope: float,
    gains: FloatArray,
    limits: tuple[float, float, float],
    rows: FloatArray,
    *,
    status: IntArray,
) -> None:
    """Solve encounters in closed form for a constant sensor slope.

    The closed form solves the motion equation L(7), for one encounter at a time.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        slope: g [1/m].
        gains: D_p [N s], shape (n,).
        limits: horizon [s], smallest and largest valid distance [m].
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,), int64.
    """
    n = len(values)
    encounters = shaped(values, (n, 10)), n, slope, shaped(gains, (n,))
    _linear(*encounters, *limits, shaped(rows, (n, len(COLUMNS))), shaped(status, (n,), _INDEX))


def respond_many(rows: FloatArray, times: FloatArray, out: FloatArray) -> None:
    """Compute the motions y(t) of several damped oscillators.

    They obey M y'' + D y' + K y = f_0 + f_1 t.

    Args:
        rows: M, D, K, y(0), y'(0), f_0, f_1 in SI units, shape (n, 7).
        times: t [s], shape (n, m).
        out: filled with the first k of y, y', y'', y''' and the integral of y, shape (n, m, k); its last axis must be
            contiguous.
    """
    n, m = times.shape
    count = min(out.shape[-1], 5)
    into = rows_of(out, (n, m, count))
    _respond(shaped(rows, (n, 7)), n, address(times), m, *into, count)


def contact_times(
    inputs: Sequence[FloatArray],
    curves: Curves,
    horizon: float,
    out: FloatArray,
    status: NDArray[np.int8],
    *,
    gradients: FloatArray | None = None,
    peaks: FloatArray | None = None,
    wanted: Sequence[str] = PEAKS,
) -> None:
    """Find first contacts by the compiled Taylor-series solver.

    A contact counts only if the solver proves that no earlier contact exists. Other encounters stay open.

    Args:
        inputs: the first nine columns of layout.Relative, or all eleven for peaks; shape (n,) or (1,), contiguous.
        curves: the curves from l = 0 upward.
        horizon: latest time of contact [s].
        out: filled with layout.STATES, shape (6, n); NaN if open.
        status: filled with CONTACT or OPEN, shape (n,).
        gradients: optional output, derivatives of time, x~ and l' at contact by the nine inputs, shape (3, 9, n); NaN
            if open.
        peaks: optional output without gradients, the wanted peaks, shape (k, n); NaN if open or not determined.
        wanted: the k peaks to compute, of layout.PEAKS.

    Raises:
        TypeError: there are too few columns.
    """
    n = len(status)
    filled = (
        shaped(out, (len(STATES), n)),
        None if gradients is None else shaped(gradients, (3, INPUTS, n)),
        None if peaks is None else _peak_rows(peaks, wanted, n),
        address(status, _SHORT),
    )
    if len(inputs) < INPUTS + (0 if peaks is None else 2):
        raise TypeError(
            f"the compiled solver needs {INPUTS} input columns, and two additional columns to compute peak values, but "
            f"received {len(inputs)} columns"
        )
    reference = None if peaks is None else columns(inputs[INPUTS:], n)
    _contacts(columns(inputs[:INPUTS], n), reference, n, byref(of_core(curves, n)), horizon, *filled)


def _peak_rows(peaks: FloatArray, wanted: Sequence[str], n: int) -> bytes:
    """Pack the addresses of the rows of the wanted peaks, and 0 for the others, in the order of layout.PEAKS."""
    first = shaped(peaks, (len(wanted), n))
    return pack(f"{len(PEAKS)}q", *(first + 8 * n * wanted.index(name) if name in wanted else 0 for name in PEAKS))


class ValuesAtNodes(NamedTuple):
    """Values at the quadrature nodes of approaches under the virtual drag.

    Args:
        first: index of the first distance interval of each approach, shape (n,).
        nodes: output, the distances [m], shape (intervals, DRAG_NODES); or None.
        changes: dg/d(parameter) of the curve, of the same shape, for gradients; or None.
        log_outputs: ln xi, of the same shape, for the impulse balance; or None.
    """

    first: IntArray
    nodes: FloatArray | None = None
    changes: FloatArray | None = None
    log_outputs: FloatArray | None = None


def drag_approaches(
    inputs: Sequence[FloatArray],
    curves: Curves,
    horizon: float,
    rows: FloatArray,
    status: IntArray,
    cells: IntArray,
    *,
    peaks: FloatArray | None = None,
    gradients: FloatArray | None = None,
    balance: FloatArray | None = None,
    at_nodes: ValuesAtNodes | None = None,
    course: tuple[FloatArray, FloatArray] | None = None,
) -> None:
    """Integrate approaches under the virtual drag.

    An approach ends in contact, at rest, or at the longest allowed time.

    Args:
        inputs: k = phi / M [m], a_o, l, l'^2 and t at the start, position, velocity and acceleration of the obstacle at
            t = 0 relative to the robot's start; contiguous, shape (n,) each.
        curves: the curves, from the smallest distance upward.
        horizon: longest time [s].
        rows: filled with DRAG_ROWS, shape (n, 6).
        status: filled with the numbers of ContactStatus, shape (n,).
        cells: filled with the number of distance intervals, shape (n,).
        peaks: optional output, DRAG_PEAKS, shape (n, 7).
        gradients: optional output, derivatives of l'^2 and t at the end by k, a_o, l and l'^2 at the start, and by the
            parameter of the curve, shape (n, 2, 5).
        balance: optional output, k int s' ds and its moment, shape (n, 2).
        at_nodes: outputs and inputs at the quadrature nodes.
        course: ascending times [s], shape (n, m), and the output l and |l'| at those times that lie in the approach,
            shape (n, m, 2).

    Raises:
        TypeError: there are too few columns, or an array has the wrong shape, type or layout.
    """
    n = len(status)
    names: dict[str, int | None] = {"rows": shaped(rows, (n, len(DRAG_ROWS)))}
    names |= {"status": shaped(status, (n,), _INDEX), "cells": shaped(cells, (n,), _INDEX)}
    optional = ((peaks, (n, len(DRAG_PEAKS))), (gradients, (n, 2, 5)), (balance, (n, 2)))
    for name, (array, shape) in zip(("peaks", "gradients", "balance"), optional, strict=True):
        names[name] = None if array is None else shaped(array, shape)
    if at_nodes is not None:
        names["first"] = shaped(at_nodes.first, (n,), _INDEX)
        for name, array in zip(ValuesAtNodes._fields[1:], at_nodes[1:], strict=True):
            names[name] = None if array is None else shaped(array, (len(array), DRAG_NODES))
    if course is not None:
        m = course[0].shape[1]
        names |= {"times": shaped(course[0], (n, m)), "m": m, "trace": shaped(course[1], (n, m, 2))}
    if len(inputs) != _DRAG_INPUTS or not len(curves[0]):
        raise TypeError(
            f"the compiled drag solver received {len(inputs)} input columns, expected {_DRAG_INPUTS}. The solver also "
            f"received {len(curves[0])} polynomials of sensor curves, expected at least one"
        )
    wanted = _ApproachesOfCore(**names)
    _approaches(columns(inputs, n), n, byref(of_core(curves, n)), horizon, byref(wanted))


def of_core(curves: Curves, n: int) -> _CurvesOfCore:
    """Return the C structure for the sensor curves of n encounters. The arrays must outlive it."""
    windows, starts, curve_of = curves
    rows, width = windows.shape
    shared = len(curve_of) == 1
    if width not in _WIDTHS or not (shared or len(curve_of) == n):
        raise ValueError(
            f"windows: found a table with {width} columns, expected one of these numbers of columns: "
            f"{sorted(_WIDTHS)}. The number of assigned sensor curves is {len(curve_of)}. The expected number is {n}, "
            "one per encounter, or 1 for all encounters"
        )
    if not (_is_valid(starts, curve_of, rows) if shared else _are_valid(starts, curve_of, rows)):
        raise ValueError("curves: an encounter refers to a curve whose windows are not in the table")
    at = address(windows), address(starts, _INDEX), address(curve_of, _INDEX)
    return _CurvesOfCore(at[0], rows, width, at[1], at[2], 0 if shared else 1)


def _is_valid(starts: IntArray, curve_of: IntArray, rows: int) -> bool:
    """Return True if the indices of the shared sensor curve are valid, without the overhead of NumPy functions."""
    which = int(curve_of[0])
    return 0 <= which < len(starts) - 1 and 0 <= int(starts[which]) <= int(starts[which + 1]) <= rows


def _are_valid(starts: IntArray, curve_of: IntArray, rows: int) -> bool:
    """Return True if the indices of all sensor curves are valid."""
    if len(starts) == 0 or starts[0] < 0 or starts[-1] > rows or (np.diff(starts) < 0).any():
        return False
    return len(curve_of) == 0 or bool(curve_of.min() >= 0 and curve_of.max() < len(starts) - 1)


def solve_series(
    values: FloatArray,
    gains: FloatArray,
    pieces: FloatArray,
    limits: tuple[float, bool, bool],
    rows: FloatArray,
    status: IntArray,
    samples: tuple[FloatArray, FloatArray] | None = None,
    sections: FloatArray | None = None,
) -> None:
    """Integrate the robot's motion under the virtual damper, for any sensor curve.

    The equation of motion is L(1), and the virtual force is L(2). This includes the motion equations L(4), L(7) and
    L(14).

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        gains: D_p [N s], shape (n,).
        pieces: middle [m], half width [m] and coefficients of g in z [1/m] of each piece, shape (p, 2 + degree).
        limits: horizon [s], whether the lowest border is the contact, whether the curve continues beyond the pieces.
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,).
        samples: ascending times [s], shape (n, m), and the output of layout.TRACE_COLUMNS at these times, shape
            (n, m, 4). Entries after the end of an encounter are not changed.
        sections: later sections of each obstacle's path, with the columns of layout.SECTION_COLUMNS, shape (n, k, 4).
    """
    n = len(values)
    traced: tuple[int | None, int, int | None] = (None, 0, None)
    if samples is not None:
        times, trace = samples
        m = times.shape[1]
        traced = shaped(times, (n, m)), m, shaped(trace, (n, m, len(TRACE_COLUMNS)))
    path: tuple[int | None, int] = (None, 0)
    if sections is not None:
        path = shaped(sections, (n, sections.shape[1], len(SECTION_COLUMNS))), sections.shape[1]
    filled = shaped(rows, (n, len(COLUMNS))), shaped(status, (n,), _INDEX)
    _series(*_encounters(values, gains, pieces, limits), limits[0], *filled, *traced, *path)


class DragBalance(NamedTuple):
    """Outputs for the impulse balance of encounters under the virtual drag.

    Args:
        impulses: output, the time integral of the admittance's force [N s], shape (n,).
        steps: output, the number of integration steps with a drag, shape (n,).
        first: index of the first of these steps of each encounter, shape (n,); needed for `nodes`.
        nodes: optional output, weight [s], l [m] and l' [m/s] at the quadrature nodes of these steps, shape (steps,
            DRAG_NODES, 3).
    """

    impulses: FloatArray
    steps: IntArray
    first: IntArray | None = None
    nodes: FloatArray | None = None


def solve_drag_courses(
    values: FloatArray,
    drags: FloatArray,
    pieces: FloatArray,
    limits: tuple[float, bool, bool],
    rows: FloatArray,
    status: IntArray,
    samples: tuple[FloatArray, FloatArray] | None = None,
    sections: FloatArray | None = None,
    balance: DragBalance | None = None,
) -> None:
    """Integrate the robot's motion under the virtual drag, for any sensor curve and obstacles with a course.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        drags: phi [N s^2], shape (n,).
        pieces: as in `solve_series`, as the other arguments except for the last one.
        limits: horizon [s], whether the lowest border is the contact, whether the curve continues beyond the pieces.
        rows: filled with layout.COLUMNS, shape (n, 15).
        status: filled with the numbers of ContactStatus, shape (n,).
        samples: times and output of the sampled motions.
        sections: later sections of each obstacle's path.
        balance: outputs for the impulse balance.
    """
    n = len(values)
    balance = balance or DragBalance(np.empty(n), np.empty(n, dtype=np.int64))
    names: dict[str, int | None] = {"rows": shaped(rows, (n, len(COLUMNS))), "status": shaped(status, (n,), _INDEX)}
    names |= {"impulses": shaped(balance.impulses, (n,)), "steps": shaped(balance.steps, (n,), _INDEX)}
    if balance.nodes is not None and balance.first is not None:
        names["first"] = shaped(balance.first, (n,), _INDEX)
        names["nodes"] = shaped(balance.nodes, (len(balance.nodes), DRAG_NODES, 3))
    if samples is not None:
        times, trace = samples
        m = times.shape[1]
        names |= {"times": shaped(times, (n, m)), "m": m, "trace": shaped(trace, (n, m, len(TRACE_COLUMNS)))}
    if sections is not None:
        count = sections.shape[1]
        names |= {"sections": shaped(sections, (n, count, len(SECTION_COLUMNS))), "section_count": count}
    wanted = _DragCoursesOfCore(**names)
    _drag_courses(*_encounters(values, drags, pieces, limits), limits[0], byref(wanted))


def follow_gradients(
    values: FloatArray,
    gains: FloatArray,
    pieces: FloatArray,
    terms: FloatArray,
    horizon: float,
    derivatives: FloatArray,
    status: NDArray[np.int8],
) -> None:
    """Integrate encounters until contact, and differentiate contact time and velocity.

    Args:
        values: relative quantities of Scenario.relative, shape (n, 10).
        gains: D_p [N s], shape (n,).
        pieces: the curve from l = 0 upward, from `curve_pieces`, shape (p, 2 + degree).
        terms: coefficients of dg/d(parameter) in z on each piece, for m = 0 or 1 parameter of the curve, shape
            (p, m, degree).
        horizon: latest time of contact [s].
        derivatives: filled with the derivatives of time and l' by layout.RELATIVE_INPUTS and the parameter, shape
            (n, 2, 9 + m); NaN without contact.
        status: filled with 0 (contact), 1 (l went beyond the pieces) or 2 (other), shape (n,).
    """
    n, count = len(values), min(terms.shape[1], 1)
    coefficients = shaped(terms, (len(pieces), count, pieces.shape[1] - 2))
    filled = shaped(derivatives, (n, 2, INPUTS + count)), shaped(status, (n,), _SHORT)
    encounters = _encounters(values, gains, pieces, (horizon, True, False))
    _follow(*encounters, coefficients if count else None, horizon, *filled)


def _encounters(
    values: FloatArray, gains: FloatArray, pieces: FloatArray, limits: tuple[float, bool, bool]
) -> tuple[int, int, int, Any]:
    """Return the arguments of a compiled solver for given encounters."""
    n, curve = len(values), byref(pieces_of_core(pieces, *limits[1:]))
    return shaped(values, (n, 10)), n, shaped(gains, (n,)), curve


def pieces_of_core(pieces: FloatArray, ends_in_contact: bool, open_ended: bool) -> _PiecesOfCore:
    """Return the C structure of a piecewise polynomial curve. The array must outlive it."""
    count, width = pieces.shape
    if not (count > 0 and 3 <= width <= _WIDEST):
        raise TypeError(
            f"the polynomial table of a sensor curve has the shape {pieces.shape}, but needs one or more rows with "
            f"3 to {_WIDEST} numbers each"
        )
    return _PiecesOfCore(address(pieces), count, width, ends_in_contact, open_ended)
