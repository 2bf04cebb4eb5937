"""Integrate many approaches under the virtual drag over the distance.

With w = l'^2 and k = phi / M, the equation M l'' = M a_o + phi g^2 l'^2 is linear in w,

    dw/dl = 2 (a_o + k g^2 w),   so   w = e^-q W,   W = w_0 - 2 a_o int_l^{l_0} e^q dl,   q = 2 k int_l^{l_0} g^2 dl,

for any l_0, and t = int dl / sqrt(w). A cell is an interval of the distance without a knot of the curve. Integrals are
those of the polynomials through 16 Gauss points on the cell. Cells are halved until the last Legendre coefficients of
both integrands are negligible. If w is zero at one end of a cell, 1 / sqrt(w) is not smooth, but sqrt(w) is a smooth
function of the square root of the distance from that end. Therefore the traversed share s of a cell is a function of r
from 0 to 1, s(r) = r - b r (1 - r). This is r for b = 0, r^2 for a start at rest (b = 1), and 1 - (1 - r)^2 for an end
at rest (b = -1).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .layout import ContactStatus

NODES: Final = 16
_TOLERANCE: Final = 1e-12  # tolerance of the last Legendre coefficients, relative to the largest value
_PAST_REST: Final = 0.9  # cell width over the distance from a virtual rest behind the start of the cell
_BEFORE_REST: Final = 0.45  # cell width over the distance to a virtual rest beyond the cell
_GROWTH: Final = 3.0  # largest q on a cell; a polynomial of degree 15 then equals its exponential to rounding
_MAX_CELLS: Final = 4_000
_PARTS: Final = 3.0 ** -np.arange(4)  # tried cell widths; the largest one on which q is likely to be small is taken
_MAX_GROWTH: Final = 100.0  # larger values of q are limited to this one to avoid overflow
_ON: Final = -1  # status of an approach that has not ended
_ENDINGS: Final = (ContactStatus.NEVER, ContactStatus.HORIZON)

_X, WEIGHTS = legendre.leggauss(NODES)
_R: Final = (1 + _X) / 2
TO_TERMS: Final[FloatArray] = np.asarray(np.linalg.inv(legendre.legvander(_X, NODES - 1)), dtype=np.float64)
"""Matrix from values at the nodes to Legendre coefficients."""

_INTEGRAL: Final[FloatArray] = legendre.legint(np.eye(NODES), lbnd=-1) @ TO_TERMS
_SO_FAR: Final[FloatArray] = (legendre.legvander(_X, NODES) @ _INTEGRAL).T
_TO_COME: Final[FloatArray] = _SO_FAR[::-1, ::-1].copy()


def so_far(values: FloatArray) -> FloatArray:
    """Integrate over each interval from its start up to each of its quadrature nodes."""
    # Each interval has the variable z from -1 to 1. The result has the shape (n, nodes).
    return np.asarray(values @ _SO_FAR)


def evaluate_at(values: FloatArray, z: FloatArray) -> FloatArray:
    """Interpolate values that are given at the quadrature nodes to one position in each interval."""
    return np.asarray(np.einsum("ij,ij->i", legendre.legvander(z, NODES - 1), values @ TO_TERMS.T))


def where_reached(rates: FloatArray, total: FloatArray) -> FloatArray:
    """Return the position in each interval at which the integral of a positive function reaches a given value."""
    terms = rates @ _INTEGRAL.T
    low, high = np.full(len(total), -1.0), np.ones(len(total))
    z = 2 * total / np.maximum(rates @ WEIGHTS, np.finfo(float).tiny) - 1
    for _ in range(60):
        z = np.where((z > low) & (z < high), z, (low + high) / 2)
        basis = legendre.legvander(z, NODES)
        excess = np.einsum("ij,ij->i", basis, terms) - total
        low, high = np.where(excess <= 0, z, low), np.where(excess >= 0, z, high)
        step = excess / np.einsum("ij,ij->i", basis[:, :-1], rates @ TO_TERMS.T)
        z = z - step
        if (np.abs(step) <= 1e-16).all() or (high - low <= 1e-16).all():
            break
    return np.clip(z, -1.0, 1.0)


class DragApproach(NamedTuple):
    """Initial values of several approaches under the virtual drag, such as distance and squared speed.

    Args:
        strength: k = phi / M [m].
        acceleration: a_o of the obstacle relative to the reference [m/s^2].
        distance: l at the start [m].
        square: l'^2 at the start [m^2/s^2].
        time: t at the start [s].
    """

    strength: FloatArray
    acceleration: FloatArray
    distance: FloatArray
    square: FloatArray
    time: FloatArray


class DragCells(NamedTuple):
    """Distance intervals over which the motions of several encounters are integrated.

    Args:
        lane: indices of the encounters.
        start: l at the start of the cell [m].
        width: width of the cell, toward smaller l [m].
        bend: b of the traversed share: 1 for a start at rest, -1 for an end at rest, else 0.
        square: l'^2 at the start [m^2/s^2].
        time: t at the start [s].
    """

    lane: IntArray
    start: FloatArray
    width: FloatArray
    bend: FloatArray
    square: FloatArray
    time: FloatArray

    def some(self, which: BoolArray | IntArray) -> DragCells:
        """Return the distance intervals of selected encounters."""
        columns: Any = tuple(column[which] for column in self)
        return DragCells(*columns)

    def share(self, z: FloatArray) -> FloatArray:
        """Return which share of each distance interval has been traversed at a quadrature position z."""
        r = (1 + z) / 2
        return np.asarray(r - self.bend * r * (1 - r))


class _Nodes(NamedTuple):
    """Quantities such as the squared speed of several encounters at the quadrature nodes of their distance intervals.

    At nodes the shape is (n, nodes), at the ends (n,).

    Args:
        distance: l [m].
        slope: g [1/m].
        length: |dl/dz| [m].
        growth: q.
        grown: e^q |dl/dz| [m].
        square: l'^2 [m^2/s^2].
        pace: dt/dz [s].
        whole_growth: q at the end.
        last_square: l'^2 at the end; negative if l' becomes zero inside the cell.
        duration: duration of the cell [s].
    """

    distance: FloatArray
    slope: FloatArray
    length: FloatArray
    growth: FloatArray
    grown: FloatArray
    square: FloatArray
    pace: FloatArray
    whole_growth: FloatArray
    last_square: FloatArray
    duration: FloatArray

    def replace_rows(self, which: BoolArray, rows: _Nodes) -> None:
        """Replace the values of selected encounters."""
        for column, new in zip(self, rows, strict=True):
            column[which] = new

    def error(self) -> FloatArray:
        """Estimate the relative quadrature error from the size of the last two Legendre coefficients."""
        return np.maximum(_last_terms(self.pace), _last_terms(self.grown))


def _last_terms(values: FloatArray) -> FloatArray:
    terms = np.abs(values @ TO_TERMS[-2:].T).sum(axis=1)
    return np.asarray(terms / np.abs(values).max(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DragPath(Value):
    """Motions of several approaches under the virtual drag, from their start to their end.

    Args:
        sensor: the sensor curve.
        borders: smallest distance, and the knots of the curve above it [m].
        approach: start of the approaches.
        steps: the cells, in the order in which each encounter passes them.
        status: how each approach ended, as the integer value of ContactStatus.
        distance: l at the end [m].
        square: l'^2 at the end [m^2/s^2].
        time: t at the end [s].
        slope: g at the end [1/m].
        error: estimated relative error of the duration.
    """

    sensor: SensorModel
    borders: FloatArray
    approach: DragApproach
    status: IntArray
    distance: FloatArray
    square: FloatArray
    time: FloatArray
    slope: FloatArray
    error: FloatArray
    steps: list[DragCells] = field(default_factory=list)

    def walk(self) -> Iterator[tuple[DragCells, _Nodes]]:
        """Yield all distance intervals with the values at their quadrature nodes."""
        for cells in self.steps:
            yield cells, _evaluate(self.sensor, self.approach, cells)


@np.errstate(all="ignore")  # cells with NaN are halved until they count as unresolved
def follow(sensor: SensorModel, approach: DragApproach, end: float, horizon: float) -> DragPath:
    """Compute approaches under the virtual drag until contact, until rest, or until the longest allowed time.

    They end at l = `end`.

    Args:
        sensor: the sensor curve, valid from `end` to the farthest start.
        approach: start of the approaches.
        end: smallest distance [m].
        horizon: longest time [s].

    Returns:
        The paths. Their status is CONTACT at l = end, NEVER if l' becomes zero before, HORIZON or UNRESOLVED.
    """
    path = DragPath(
        sensor=sensor,
        borders=np.array([end, *(knot for knot in sensor.knots if knot > end)]),
        approach=approach,
        status=np.full(len(approach.distance), _ON),
        distance=approach.distance.copy(),
        square=approach.square.copy(),
        time=approach.time.copy(),
        slope=np.asarray(sensor.log_slope(approach.distance)),
        error=np.zeros(len(approach.distance)),
    )
    scale, lanes = np.ones(len(path.time)), np.arange(len(path.time))
    for _ in range(_MAX_CELLS):
        if not len(lanes):
            break
        border = path.borders[np.searchsorted(path.borders, path.distance[lanes]) - 1]
        proposed = _next_cells(path, lanes, path.distance[lanes] - border, scale[lanes])
        cells, nodes, status, miss = _shorten_to_end(path, proposed, horizon)
        error = np.maximum(nodes.error(), miss)
        good = (error <= _TOLERANCE) & np.isfinite(nodes.duration)
        scale[lanes] = np.where(good, np.minimum(2 * scale[lanes], 1.0), scale[lanes] / 2)
        # A drag that stops an object within rounding of its distance, or a horizon that ends there.
        stuck = (cells.start - cells.width == cells.start) & (path.approach.acceleration[lanes] == 0)
        good &= ~stuck
        path.status[lanes[stuck]] = ContactStatus.HORIZON
        path.square[lanes[stuck & (status != ContactStatus.HORIZON)]] = 0.0
        whole = (cells.width == cells.start - border)[good]
        cells, status, on = cells.some(good), status[good], lanes[good]
        path.steps.append(cells)
        path.distance[on] = np.where(whole, border[good], cells.start - cells.width)
        path.square[on] = nodes.last_square[good]
        path.time[on] += nodes.duration[good]
        path.error[on] += error[good] * nodes.duration[good]
        path.slope[on] = sensor.log_slope(path.distance[on])
        path.status[on] = np.where((path.distance[on] <= end) & (status == _ON), ContactStatus.CONTACT, status)
        lanes = lanes[path.status[lanes] == _ON]
    path.status[lanes] = ContactStatus.UNRESOLVED
    path.error[:] /= np.maximum(path.time - approach.time, np.finfo(float).tiny)
    return path


def _next_cells(path: DragPath, lanes: IntArray, room: FloatArray, scale: FloatArray) -> DragCells:
    """Choose the next distance interval for integrating each encounter, short enough for accurate quadrature."""
    # An interval ends at the next border at the latest.
    square, start, strength = path.square[lanes], path.distance[lanes], path.approach.strength[lanes]
    push = 2 * path.approach.acceleration[lanes]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        far = np.fmin(room, _GROWTH / (2 * strength * path.slope[lanes] ** 2))
        tried = far[:, None] * _PARTS
        places = np.maximum(start[:, None] - tried, path.borders[0])  # rounding may pass the border
        ahead = 2 * strength[:, None] * np.asarray(path.sensor.log_slope(places)) ** 2  # dq/dl
        far = tried[np.arange(len(lanes)), np.argmax(ahead * tried <= 2 * _GROWTH, axis=1)]
        far = np.where((ahead * tried > 2 * _GROWTH).all(axis=1), np.fmin(tried[:, -1], _GROWTH / ahead[:, -1]), far)
        far = scale * far
        near = np.where(push < 0, _PAST_REST, _BEFORE_REST) * square / np.abs(push)
        rest = 1.01 * square / push  # l' becomes zero before this distance, since e^q >= 1
    limited = np.fmin(far, np.where(push * far > square, rest, near))
    far = np.where(square > 0, limited, far)
    bend = np.where(square == 0, 1.0, 0.0)
    return DragCells(lanes, start, far, bend, square, path.time[lanes])


def _shorten_to_end(path: DragPath, cells: DragCells, horizon: float) -> tuple[DragCells, _Nodes, IntArray, FloatArray]:
    """Shorten the distance interval of each object that comes to rest inside it or reaches the longest allowed time.

    Args:
        path: the path so far.
        cells: the proposed cells.
        horizon: longest time [s].

    Returns:
        The cells; the quantities at their nodes; their status, _ON if they do not end; and the relative error of that
        end. The error matters because the cell from which the end was computed may have been too long.
    """
    nodes = _evaluate(path.sensor, path.approach, cells)
    status = np.full(len(cells.lane), _ON)
    acceleration = path.approach.acceleration[cells.lane]
    for ending in _ENDINGS:
        if ending == ContactStatus.NEVER:
            ends = nodes.last_square <= 0
            z = where_reached(nodes.grown[ends], cells.square[ends] / (2 * acceleration[ends]))
            bend = np.full(len(z), -1.0)
        else:
            ends = cells.time + nodes.duration > horizon
            z = where_reached(nodes.pace[ends], horizon - cells.time[ends])
            bend = np.maximum(cells.bend[ends], 0.0)
        if ends.any():
            width, bends = cells.width.copy(), cells.bend.copy()
            width[ends] *= cells.some(ends).share(z)
            bends[ends] = bend
            cells = cells._replace(width=width, bend=bends)
            status[ends] = ending
            nodes.replace_rows(ends, _evaluate(path.sensor, path.approach, cells.some(ends)))
    turn = np.abs(1 - 2 * acceleration * (nodes.grown @ WEIGHTS) / np.where(cells.square > 0, cells.square, 1.0))
    late = np.abs(1 - (cells.time + nodes.duration) / horizon)
    none = np.zeros(len(status))
    return cells, nodes, status, np.select([status == s for s in _ENDINGS], [turn, late], none)


def _evaluate(sensor: SensorModel, approach: DragApproach, cells: DragCells) -> _Nodes:
    """Evaluate the motions of several encounters at the quadrature nodes of their distance intervals."""
    bend, width, square = (column[:, None] for column in (cells.bend, cells.width, cells.square))
    twice = 2 * approach.acceleration[cells.lane]
    passed = width * (_R - bend * _R * (1 - _R))
    distance = np.maximum(cells.start[:, None] - passed, sensor.valid_range[0])
    length = width * (0.5 - 0.5 * bend * (1 - 2 * _R))
    slope = np.asarray(sensor.log_slope(distance))
    rate = 2 * approach.strength[cells.lane][:, None] * slope**2 * length
    growth, whole = np.minimum(so_far(rate), _MAX_GROWTH), np.minimum(rate @ WEIGHTS, _MAX_GROWTH)
    grown = np.exp(growth) * length
    to_rest = cells.bend < 0
    total = square - twice[:, None] * so_far(grown)
    total[to_rest] = twice[to_rest, None] * (grown[to_rest] @ _TO_COME)
    last = np.where(to_rest, 0.0, cells.square - twice * (grown @ WEIGHTS)) * np.exp(-whole)
    squares = np.exp(-growth) * total
    with np.errstate(invalid="ignore", divide="ignore"):
        pace = length / np.sqrt(squares)
    return _Nodes(distance, slope, length, growth, grown, squares, pace, whole, last, pace @ WEIGHTS)
