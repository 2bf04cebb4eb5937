"""The largest demands along the Taylor steps of eight encounters: the vector code of contact_peaks.

Over a step all demands are polynomials q(s), s in [0, 1]: with y = -x~ those of y, y shifted by the reference, y', y''
and F_p. What each reaches at the ends of the steps is kept. It can reach more inside a step only where q' changes its
sign, and then at most by the smaller of max q' and max -q'. These two are bounded in Bernstein's form: for s in [0, 1]

    sum_{k <= 6} a_k s^k = sum_j beta_j B_j(s),   beta_j = sum_{k <= j} a_k C(j, k) / C(6, k),   B_j >= 0, sum B_j = 1,

lies between the least and the largest beta, and what follows a_6 s^6 adds to beta_6 at most the sum of its magnitudes,
for s^7 <= s^6 = B_6(s). A polynomial for which that does not settle the matter waits in a row of eight, to have its
peak found by find_peaks: q' in Bernstein's form of full degree has at least as many changes of sign as q' has zeros
(Descartes), so that as many zeros as that, found between nine values, are all.
"""

from __future__ import annotations

import math
from itertools import pairwise
from math import comb
from typing import Any

from numba.extending import intrinsic

from .compiler import kernel
from .lanes import LANES, Rows, Vector
from .series_step import ORDER, ROWS, Row, make_intrinsic

__all__ = [
    "ALL_ROWS",
    "BEST",
    "KEPT_ROWS",
    "SPARE",
    "WAITING_ROWS",
    "follow_peaks",
    "settle_peaks",
    "start_peaks",
    "write_peaks",
]

_PARTS = 8
_LOW_DEGREE = 6
SPARE = 64.0  # steps are as short as a tolerance smaller by this makes them: derivatives lose digits
_PEAKS = 5
BEST, TAIL_SPEED, TAIL_BEND, TERMS_OF_FORCE, DRIFT, PULL, X0 = (ROWS + k for k in (0, 5, 6, 7, 8, 9, 10))
KEPT_ROWS = ROWS + 11
_POLYNOMIALS = KEPT_ROWS
_WIDTH = ORDER + 1
ALL_ROWS = _POLYNOMIALS + _PEAKS * _WIDTH
_UNIT, _FOUND = _WIDTH, _WIDTH + 1  # rows of those that wait
WAITING_ROWS = _FOUND + 1
_SMALL = 1e-11  # of the largest: what a peak is allowed to add unseen
_ROUNDING = 1e-14
_DOUBT, _STEEP_DOUBT = 2e-10, 5e-10  # of the largest; estimates are last coefficients kept, those left out are 1/16


def _bernstein(a: list[Vector]) -> list[Vector]:
    """Return the coefficients of a polynomial in Bernstein's form."""
    degree = len(a) - 1
    found = [value * (1 / comb(degree, k)) for k, value in enumerate(a)]
    for start in range(1, degree + 1):
        for j in range(degree, start - 1, -1):
            found[j] = found[j] + found[j - 1]
    return found


def _total(a: list[Vector]) -> Vector:
    total = a[-1]
    for value in a[-2::-1]:
        total = total + value
    return total


def _range(a: list[Vector]) -> tuple[Vector, Vector]:
    """Return bounds of a polynomial on [0, 1]."""
    beta = _bernstein(a[: _LOW_DEGREE + 1])
    rest = _total([abs(value) for value in a[_LOW_DEGREE + 1 :]])
    least, most = beta[-1] - rest, beta[-1] + rest
    for value in beta[:-1]:
        least, most = least.least(value), most.most(value)
    return least, most


def _slope(a: list[Vector]) -> list[Vector]:
    return [value * float(k) for k, value in enumerate(a) if k]


def _paths(work: Rows, b: list[Vector]) -> tuple[list[Vector], list[Vector]]:
    """Return x~ and x - x(0) over a step, with their signs turned."""
    length, start = work[Row.LENGTH], work[Row.START]
    square, bend, velocity = length * length, work[Row.ACCELERATION], work[Row.VELOCITY]
    drift, pull = work[DRIFT], work[PULL]
    y = [
        b[0] - work[Row.POSITION].plus(velocity.plus(bend * 0.5, start), start),
        b[1] - velocity.plus(bend, start) * length,
        b[2] - bend * 0.5 * square,
    ]
    travel = [
        (y[0] + work[X0]) - drift.plus(pull * 0.5, start) * start,
        y[1] - drift.plus(pull, start) * length,
        y[2] - pull * 0.5 * square,
    ]
    return [*y, *b[3:]], [*travel, *b[3:]]


def _keep(work: Rows, row: int, q: list[Vector], slope: list[Vector], unit: Vector, moved: Any) -> tuple[Vector, Any]:
    """Keep what a polynomial reaches at both ends; return it there and whether it may reach more in between."""
    for k, value in enumerate(q[: 3 if row == 1 else None]):  # from there on travel is as excursion
        work[_POLYNOMIALS + row * _WIDTH + k] = value
    end = _total(q)
    largest = abs(end).most(abs(q[0])) * unit
    best = largest.most(work[BEST + row])
    work[BEST + row] = best.where(moved, work[BEST + row])
    least, most = _range(slope)
    possible = largest.plus(most.least(-least), unit)
    return end, work.all([moved, least.below(0.0), (-most).below(0.0), (best * (1 + _SMALL)).below(possible)])


def _follow(work: Rows, degree: int) -> Any:
    """Build what one step adds to the demands; return where, for each of them, a peak inside it is to be found."""
    moved = work.constant(0.5).below(work[Row.MOVED])
    b = [work[k] for k in range(ORDER + 1)]
    length, one = work[Row.LENGTH], work.constant(1.0)
    inverse = one / length
    square = inverse * inverse
    tail = abs(b[ORDER]) * float(ORDER)
    for row, value in ((TAIL_SPEED, tail * inverse), (TAIL_BEND, tail * float(ORDER - 1) * square)):
        work[row] = work[row].most(value).where(moved, work[row])
    y, travel = _paths(work, b)
    first, speed = _slope(y), _slope(travel)
    way, in_excursion = _keep(work, 0, y, first, one, moved)
    _, in_travel = _keep(work, 1, travel, speed, one, moved)
    second, acceleration = _slope(first), _slope(speed)
    _, in_speed = _keep(work, 2, speed, acceleration, inverse, moved)
    _, in_acceleration = _keep(work, 3, acceleration, _slope(acceleration), square, moved)
    if degree == 1:
        force = _slope(b)
        _, in_force = _keep(work, 4, force, _slope(force), inverse, moved)
    else:
        damping, stiffness = work[Row.DAMPING] * length, work[Row.STIFFNESS] * length * length
        force = [e.plus(damping, first[k]).plus(stiffness, y[k]) for k, e in enumerate(second)]
        _, in_force = _keep(work, 4, force, _slope(force), square, moved)
        terms = abs(_total(second)).plus(abs(damping), abs(_total(first))).plus(stiffness, abs(way)) * square
        work[TERMS_OF_FORCE] = work[TERMS_OF_FORCE].most(terms).where(moved, work[TERMS_OF_FORCE])
    return work.masks(in_excursion, in_travel, in_speed, in_acceleration, in_force)


def _find(work: Rows) -> Any:
    """Build the search for the peaks of eight polynomials on [0, 1]; what is not certain is not a number."""
    q = [work[k] for k in range(_WIDTH)]
    slope = _slope(q)
    zero, one = work.constant(0.0), work.constant(1.0)
    values = [slope[0].where(zero.below(abs(slope[0])), q[2])]  # from rest: the way that it bends
    for j in range(1, _PARTS):
        value = slope[-1]
        for a in slope[-2::-1]:
            value = a.plus(value, j / _PARTS)
        values.append(value)
    values.append(_total(slope))
    found, changes = zero, zero
    first, last = (zero, zero), (zero, zero)
    for j in range(_PARTS):
        changed = (values[j] * values[j + 1]).below(0.0)
        secant = (values[j] / (values[j] - values[j + 1]) + float(j)) * (1 / _PARTS)
        now = (work.constant(j / _PARTS), secant)
        earlier = first
        new = found.below(0.5)
        first = (now[0].where(changed, first[0]), now[1].where(changed, first[1]))
        first = (first[0].where(new, earlier[0]), first[1].where(new, earlier[1]))
        last = (now[0].where(changed, last[0]), now[1].where(changed, last[1]))
        found = found + one.where(changed, 0.0)
    beta = _bernstein(slope)
    least, most = beta[0], beta[0]
    for value in beta[1:]:
        least, most = least.least(value), most.most(value)
    ends = abs(q[0]).most(abs(_total(q)))
    flat = most.least(-least).below(ends * _SMALL)
    for left, right in pairwise(beta):
        changes = changes + one.where((left * right).below(0.0), 0.0)
    largest, doubt = zero, zero
    for left, start in (first, last):
        s = start
        for _ in range(5):
            value, bend = slope[-1], zero
            for a in slope[-2::-1]:
                bend = value.plus(bend, s)
                value = a.plus(value, s)
            following = (s - value / bend).most(left).least(left + 1 / _PARTS)
            change, s = abs(following - s), following
        doubt = doubt.most(change)
        value = q[-1]
        for a in q[-2::-1]:
            value = a.plus(value, s)
        largest = largest.most(abs(value))
    some = zero.below(found)
    largest, doubt = largest.where(some, 0.0), doubt.where(some, 0.0)
    extra = zero.where(flat, changes - found)
    settled = work.all([doubt.below(1e-6), found.below(2.5), extra.below(0.5)])
    work[_FOUND] = (largest * work[_UNIT]).where(settled, math.nan)
    return work.masks(settled)


_follow_1: Any = intrinsic(make_intrinsic(lambda work: _follow(work, 1)))
_follow_curve: Any = intrinsic(make_intrinsic(lambda work: _follow(work, 0)))
_find_peaks: Any = intrinsic(make_intrinsic(_find))


DAMPING, STIFFNESS, GAIN, POSITION = Row.DAMPING, Row.STIFFNESS, Row.GAIN, Row.POSITION
VELOCITY, ACCELERATION, ERROR, STRONGEST = Row.VELOCITY, Row.ACCELERATION, Row.ERROR, Row.STRONGEST
LENGTH, SCALE, MASS, TERMS, FINAL_TIME = Row.LENGTH, Row.SCALE, Row.MASS, Row.TERMS, Row.FINAL_TIME
FIRST_SPEED = Row.FIRST_SPEED


@kernel
def start_peaks(work: Any, lane: int, x0: float, drift: float, pull: float) -> None:
    """Begin to keep the demands of a lane."""
    for row in range(BEST, KEPT_ROWS):
        work[row, lane] = 0.0
    work[DRIFT, lane], work[PULL, lane], work[X0, lane] = drift, pull, x0
    work[SCALE, lane] /= SPARE


@kernel
def _follow_line(work: Any) -> int:
    return _follow_1(work)


@kernel
def _follow_any(work: Any) -> int:
    return _follow_curve(work)


@kernel
def _settle(work: Any) -> int:
    return _find_peaks(work)


@kernel
def _force_factor(work: Any, lane: int, degree: int) -> float:
    """Return what the polynomial of the force is to be multiplied with: it is l' on a line, else F_p / M."""
    return work[MASS, lane] * (abs(work[GAIN, lane] * work[TERMS + 1, lane]) if degree == 1 else 1.0)


@kernel
def follow_peaks(work: Any, degree: int, owners: Any, room: Any, out: Any) -> None:
    """Keep the demands of the step that was taken; send those with a peak inside it to be settled."""
    inside = _follow_line(work) if degree == 1 else _follow_any(work)
    if inside == 0:
        return
    waiting, whose, which, count = room
    for row in range(_PEAKS):
        for lane in range(LANES):
            if (inside >> (row * LANES + lane)) & 1 and not (row == 4 and work[GAIN, lane] == 0):
                at = count[0]
                terms = _WIDTH if row < 2 else (ORDER if row == 2 or (row == 4 and degree == 1) else ORDER - 1)
                for k in range(_WIDTH):
                    source = 0 if row == 1 and k > 2 else row
                    waiting[k, at] = work[_POLYNOMIALS + source * _WIDTH + k, lane] if k < terms else 0.0
                power = 0 if row < 2 else (1 if terms == ORDER else 2)
                factor = _force_factor(work, lane, degree) if row == 4 else 1.0
                waiting[_UNIT, at] = work[LENGTH, lane] ** -power * factor
                whose[at], which[at] = owners[lane], row
                count[0] += 1
                if count[0] == LANES:
                    settle_peaks(room, out)


@kernel
def settle_peaks(room: Any, out: Any) -> None:
    """Find the peaks that wait."""
    waiting, whose, which, count = room
    if count[0]:
        _settle(waiting)
    for at in range(count[0]):
        _raise_to(out, which[at], whose[at], waiting[_FOUND, at])
    count[0] = 0


@kernel
def _raise_to(out: Any, row: int, i: int, value: float) -> None:
    """Keep the larger; what is not a number stays none."""
    if value > out[row, i] or math.isnan(value):
        out[row, i] = value


@kernel
def write_peaks(queue: Any, lane: int, degree: int, i: int, out: Any) -> None:
    """Write the demands of an encounter that has reached its contact, where they are known well enough."""
    best = queue[BEST : BEST + _PEAKS, lane]
    p, v, a, time = queue[POSITION, lane], queue[VELOCITY, lane], queue[ACCELERATION, lane], queue[FINAL_TIME, lane]
    damping, stiffness = queue[DAMPING, lane], queue[STIFFNESS, lane]
    # what rounding leaves of quantities that are differences of larger ones, on the guaranteed path as well
    speed = _ROUNDING * (2 * abs(v) + abs(queue[FIRST_SPEED, lane]) + abs(a) * time + abs(queue[DRIFT, lane]))
    way = _ROUNDING * (abs(p) + abs(queue[X0, lane])) + speed * time
    bend = (abs(damping) + queue[STRONGEST, lane]) * speed + stiffness * way + _ROUNDING * abs(a)
    error, slip, turn = queue[ERROR, lane], queue[TAIL_SPEED, lane], queue[TAIL_BEND, lane]
    for row in range(2):
        _raise_to(out, row, i, best[row] if error <= _DOUBT * best[row] + way else math.nan)
    _raise_to(out, 2, i, best[2] if slip <= _DOUBT * best[2] + speed else math.nan)
    _raise_to(out, 3, i, best[3] if turn <= _STEEP_DOUBT * best[3] + bend else math.nan)
    lost = slip * (_STEEP_DOUBT / _DOUBT) if degree == 1 else turn + _ROUNDING * queue[TERMS_OF_FORCE, lane]
    if queue[GAIN, lane] == 0:
        out[4, i] = 0.0
    else:
        force = best[4] * _force_factor(queue, lane, degree)
        _raise_to(out, 4, i, force if lost <= _STEEP_DOUBT * best[4] else math.nan)
