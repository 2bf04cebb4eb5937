"""How the state at contact depends on the nine inputs: the vector code of contact_gradients.

A change of an input changes l by d(t), which obeys the linear equation of small changes,

    M d'' + D d' + K d + D_p (g d)' = f,    d' = y - c d,   y' = -(K d - f) / M,   c = (D + D_p g) / M,

along the motion that is known already, so its Taylor coefficients follow over the same steps by one convolution of c
and d. Eight responses are followed: h_1 to l(0) and h_2 to l'(0), and from rest those to the forces x~' (for D), x~
(for K), -d(ln xi)/dt (for D_p), and M times 1, t and t^2/2 (F_0, F_1, F_2). They give

    d_x0 = -h_1,   d_p = h_1 + (K/M) F_0,   d_a = F_0 + (D F_1 + K F_2) / M,
    d_u0 = -h_2,   d_v = h_2 + (D F_0 + K F_1) / M,

and a symmetry of the equation of motion, the same factor on M, D, K and D_p, gives the last,

    0 = M d_M + D d_D + K d_K + D_p d_Dp.

(Other units and another origin of time would give h_2 and h_1 as well, but lose digits: the one divides by l'(0), which
is small at a slow start, the other takes those of the damping rate where the motion is stiff.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import intrinsic

from .compiler import kernel
from .lanes import Rows, Vector
from .series_step import ORDER, Row, convolve, make_intrinsic, shifted, weighted

__all__ = ["RESPONSE_TOLERANCE", "carry_4", "carry_12", "carry_power", "write_gradient"]

RESPONSE_TOLERANCE = 1e-10
"""What the last term of a step may add to a response, of its size."""

_BY_GAIN, _BY_DISTANCE = 2, 6  # the responses that are tested: the least smooth force, and the start


def _products(b: dict[int, Vector], terms: list[Vector], order: int) -> dict[int, Vector]:
    """Return the series of the slope of a polynomial sum_j terms_j z^j."""
    z: dict[int, Vector] = {}
    z2: dict[int, Vector] = {}
    z3: dict[int, Vector] = {}
    z4: dict[int, Vector] = {}
    inner: dict[int, Vector] = {}
    outer: dict[int, Vector] = {}
    slope = [terms[0], *(term * float(j) for j, term in enumerate(terms[1:], 1))]
    found = {0: slope[1]}
    for n in range(1, order + 1):
        for series, value in ((z, b[n]), (z2, convolve(z, z, n)), (z3, convolve(z, z2, n))):
            if value is not None:
                series[n] = value
        low = [(slope[2], z[n]), (slope[3], z2.get(n)), (slope[4], z3.get(n))]
        if len(terms) == 5:
            total = weighted(low)
        else:
            square = convolve(z2, z2, n)
            if square is not None:
                z4[n] = square
            value = weighted([(slope[10], z[n]), (slope[11], z2.get(n)), (slope[12], z3.get(n))])
            if value is not None:
                inner[n] = value
            middle = [(slope[6], z[n]), (slope[7], z2.get(n)), (slope[8], z3.get(n)), (slope[9], z4.get(n))]
            value = weighted(middle, convolve(z4, inner, n))
            if value is not None:
                outer[n] = value
            total = weighted([*low, (slope[5], z4.get(n))], convolve(z4, outer, n))
        if total is not None:
            found[n] = total
    return found


def _inverse(work: Rows, b: dict[int, Vector], order: int) -> dict[int, Vector]:
    """Return the series of n / (l + l_0)."""
    first = work.constant(1.0) / (b[0] - work[Row.MIDDLE])
    found, rest = {0: work[Row.TERMS] * first}, {k: b[k] for k in range(1, order + 1)}
    for n in range(1, order + 1):
        total = convolve(rest, found, n)
        found[n] = -first * total if total is not None else work.constant(0.0)
    return found


def _carry(work: Rows, degree: int) -> Any:
    """Build what one step adds to the eight responses, in the lanes that were moved."""
    b = {k: work[k] for k in range(ORDER + 1)}
    length, start, stiffness, bend = work[Row.LENGTH], work[Row.START], work[Row.STIFFNESS], work[Row.ACCELERATION]
    last = ORDER - 1
    g = _products(b, shifted(work, degree, b[0]), last) if degree else _inverse(work, b, last)
    weight = -work[Row.GAIN] * length
    c = {k: value * weight for k, value in g.items()}
    c[0] = c[0] - work[Row.DAMPING] * length
    speed = {k: b[k + 1] * float(k + 1) for k in range(ORDER)}
    square = length * length
    velocity = work[Row.VELOCITY].plus(bend, start)
    path = {k: -b[k] for k in range(ORDER + 1)}
    path[0] = path[0] + work[Row.POSITION].plus(work[Row.VELOCITY].plus(bend * 0.5, start), start)
    path[1] = path[1].plus(velocity, length)
    path[2] = path[2].plus(bend * 0.5, square)
    forces: list[dict[int, Vector]] = [{}, {}, {}]
    for k in range(last):
        forces[0][k] = path[k + 1] * float(k + 1) * length
        forces[1][k] = path[k] * square
        rate = convolve(g, speed, k)
        forces[2][k] = -rate * length if rate is not None else work.constant(0.0)
    forces.append({0: square})
    forces.append({0: square * start, 1: square * length})
    forces.append({0: square * start * start * 0.5, 1: square * length * start, 2: square * square * 0.5})
    forces += [{}, {}]
    pull = -stiffness * square
    ds = [{0: work[Row.RESPONSES + 2 * i]} for i in range(len(forces))]
    ys = [work[Row.RESPONSES + 2 * i + 1] * length for i in range(len(forces))]
    totals, momenta = [d[0] for d in ds], list(ys)
    for k in range(ORDER):  # side by side: none waits for the last coefficient of another
        for i, (d, force) in enumerate(zip(ds, forces, strict=True)):
            held = convolve(c, d, k)
            change = ys[i] if held is None else ys[i] + held
            if k < last:
                grown = force[k].plus(pull, d[k]) if k in force else pull * d[k]
                ys[i] = grown * (1.0 / (k + 1))
                momenta[i] = momenta[i] + ys[i]
            d[k + 1] = change * (1.0 / (k + 1))
            totals[i] = totals[i] + d[k + 1]
    responses = [(total, y / length, d[ORDER]) for total, y, d in zip(totals, momenta, ds, strict=True)]
    widest = work[Row.WIDEST].most(abs(responses[_BY_GAIN][0]))
    excess = (abs(responses[_BY_GAIN][2]) / widest.most(1e-300)).most(abs(responses[_BY_DISTANCE][2]))
    work[Row.EXCESS] = excess
    smooth = excess.below(RESPONSE_TOLERANCE)
    moved = work.all([work.constant(0.5).below(work[Row.MOVED]), smooth])
    work[Row.WIDEST] = widest.where(moved, work[Row.WIDEST])
    for column, (total, rate, _) in enumerate(responses):
        at, rate_row = Row.RESPONSES + 2 * column, Row.RESPONSES + 2 * column + 1
        work[at] = total.where(moved, work[at])
        work[rate_row] = rate.where(moved, work[rate_row])
    return work.masks(smooth)


carry_power: Any = intrinsic(make_intrinsic(lambda work: _carry(work, 0)))
carry_4: Any = intrinsic(make_intrinsic(lambda work: _carry(work, 4)))
carry_12: Any = intrinsic(make_intrinsic(lambda work: _carry(work, 12)))

DAMPING, STIFFNESS, GAIN, MASS, RESPONSES = Row.DAMPING, Row.STIFFNESS, Row.GAIN, Row.MASS, Row.RESPONSES
VELOCITY, ACCELERATION = Row.VELOCITY, Row.ACCELERATION
FINAL_TIME, FINAL_SPEED, FINAL_BEND = Row.FINAL_TIME, Row.FINAL_SPEED, Row.FINAL_BEND


@kernel
def write_gradient(queue: Any, lane: int, slope: float, found: Any) -> None:
    """Write the derivatives of time, x~ and l' at contact by the nine inputs, shape (3, 9); slope: g at contact."""
    dm, km, gm, m = queue[DAMPING, lane], queue[STIFFNESS, lane], queue[GAIN, lane], queue[MASS, lane]
    v, a, time = queue[VELOCITY, lane], queue[ACCELERATION, lane], queue[FINAL_TIME, lane]
    speed, bend = queue[FINAL_SPEED, lane], queue[FINAL_BEND, lane]
    held = dm + gm * slope
    for part in range(2):  # the change of l, then that of l', at the time of contact
        r = np.zeros(8)
        for j in range(8):
            d, y = queue[RESPONSES + 2 * j, lane], queue[RESPONSES + 2 * j + 1, lane]
            r[j] = d if part == 0 else y - held * d
        by_a = r[3] + dm * r[4] + km * r[5]
        driven = dm * r[3] + km * r[4]
        row = 2 * part
        found[row, 0] = -(dm * r[0] + km * r[1] + gm * r[2]) / m
        found[row, 1], found[row, 2], found[row, 8] = r[0] / m, r[1] / m, r[2] / m
        found[row, 3], found[row, 4] = -r[6], -r[7]
        found[row, 5], found[row, 6], found[row, 7] = r[6] + km * r[3], r[7] + driven, by_a
    for j in range(9):
        found[0, j] = -found[0, j] / speed
        found[2, j] += bend * found[0, j]
        found[1, j] = (v + a * time) * found[0, j]
    found[1, 5] += 1.0
    found[1, 6] += time
    found[1, 7] += time * time / 2
