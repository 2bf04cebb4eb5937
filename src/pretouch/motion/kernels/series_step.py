"""One Taylor step of eight encounters, and the contact inside a step: the vector code of series_block.

With the obstacle at p + v t + a t^2 / 2 from the reference, expanded about the present time,

    M l'' = M a + D (v - l') + K (x_o - l) - D_p d(ln xi)/dt

gives the coefficient c_{k+2} of l from c_0 ... c_{k+1} and the coefficient k + 1 of ln xi(l(t)). That one comes
from the polynomial sum_j a_j z^j about the present l, with z = l(t) - l(0) = c_1 t + c_2 t^2 + ..., by Paterson's and
Stockmeyer's way: z^2, z^3 and z^4 are series once, and

    degree 4:   a_1 z + a_2 z^2 + z^2 (a_3 z + a_4 z^2)
    degree 12:  a_1 z + ... + a_3 z^3 + z^4 (a_4 + ... + a_7 z^3 + z^4 (a_8 + ... + a_12 z^4))

so that 1.5 and 4 convolutions are left, all of them short since z starts at order one. For g = n / (l + l_0) one is
enough: q (l + l_0) = l', d(ln xi)/dt = n q. A constant slope, degree 1, needs none: the motion is linear.
"""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.extending import intrinsic

from .lanes import Rows, Vector

__all__ = [
    "MOST_STEPS",
    "ORDER",
    "ROWS",
    "Row",
    "convolve",
    "find_in_step",
    "make_intrinsic",
    "shifted",
    "step_1",
    "step_4",
    "step_12",
    "step_power",
    "weighted",
]

ORDER = 16
_LOG_TOLERANCE = -43.5  # log2 of what the last coefficient may add to l, of l at the start: 8e-14
_ROUNDING = 2e-16


class Row:
    """The rows of the work array. The first ORDER + 1 are the coefficients of l over the step, in [0, 1]."""

    DAMPING, STIFFNESS, GAIN, POSITION, VELOCITY, ACCELERATION = range(ORDER + 1, ORDER + 7)  # the first three over M
    TIME, DISTANCE, SPEED, INTEGRAL, ERROR, STRONGEST = range(ORDER + 7, ORDER + 13)  # the state
    CAP, LENGTH, END, BOUND, SCALE, HORIZON, STEPS, WEAKEST = range(ORDER + 13, ORDER + 21)
    EDGE, SWITCH, MIDDLE = range(ORDER + 21, ORDER + 24)
    FINAL_TIME, FINAL_SPEED, FINAL_BEND, FINAL_INTEGRAL, DOUBT = range(ORDER + 24, ORDER + 29)  # of find_in_step
    START, MOVED, MASS, FIRST_SPEED, RESPONSES = range(ORDER + 29, ORDER + 34)
    TERMS = RESPONSES + 16
    WIDEST, EXCESS = range(TERMS + 13, TERMS + 15)  # the largest response to D_p, and what last terms add beside it


ROWS = Row.EXCESS + 1
MOST_STEPS = 200.0  # what takes more is stiff: l' and l'' are differences of much larger numbers there


def convolve(left: dict[int, Vector], right: dict[int, Vector], order: int) -> Vector | None:
    """Return a coefficient of a product; a square where both factors are the same. The newest factors come last."""
    square = left is right
    pairs = [(i, order - i) for i in left if order - i in right and not (square and 2 * i > order)]
    total: Vector | None = None
    for i, j in sorted(pairs, key=max):
        if square and i == j:
            continue
        total = left[i] * right[j] if total is None else total.plus(left[i], right[j])
    if square:
        total = None if total is None else total + total
        if order % 2 == 0 and order // 2 in left:
            middle = left[order // 2]
            total = middle * middle if total is None else total.plus(middle, middle)
    return total


def weighted(pairs: list[tuple[Vector, Vector | None]], rest: Vector | None = None) -> Vector | None:
    """Return a rest plus the sum of products; None where nothing is there."""
    total = rest
    for factor, value in pairs:
        if value is not None:
            total = factor * value if total is None else total.plus(factor, value)
    return total


def shifted(work: Rows, degree: int, distance: Vector) -> list[Vector]:
    """Return the coefficients of ln xi about a distance; the first, which is not needed, stays as it was."""
    a = [work[Row.TERMS + j] for j in range(degree + 1)]
    shift = distance - work[Row.MIDDLE]
    for i in range(degree):  # Horner's scheme once for each derivative
        for j in range(degree - 1, max(i, 1) - 1, -1):
            a[j] = a[j].plus(shift, a[j + 1])
    return a


class _Polynomial:
    """The series of a polynomial of l, one coefficient after the other."""

    def __init__(self, work: Rows, degree: int, distance: Vector) -> None:
        a = shifted(work, degree, distance)
        self.a, self.degree = a, degree
        self.factor: Vector | float = 1.0
        self.z: dict[int, Vector] = {}
        self.z2: dict[int, Vector] = {}
        self.z3: dict[int, Vector] = {}
        self.z4: dict[int, Vector] = {}
        self.inner: dict[int, Vector] = {}
        self.outer: dict[int, Vector] = {}
        self.slope = a[1]

    @staticmethod
    def _keep(series: dict[int, Vector], order: int, value: Vector | None) -> Vector | None:
        if value is not None:
            series[order] = value
        return value

    def bent(self, k: int, c: dict[int, Vector], v: Vector) -> Vector | None:  # noqa: ARG002 - as in _Power
        """Return coefficient k of d(ln xi)/dt without the part of v_k, which is the slope."""
        n, a = k + 1, self.a
        z = self.z[n] = c[n]
        z2 = self._keep(self.z2, n, convolve(self.z, self.z, n))
        if self.degree == 4:
            self._keep(self.inner, n, weighted([(a[3], z), (a[4], z2)]))
            total = weighted([(a[2], z2)], convolve(self.z2, self.inner, n))
        else:
            z3 = self._keep(self.z3, n, convolve(self.z, self.z2, n))
            z4 = self._keep(self.z4, n, convolve(self.z2, self.z2, n))
            self._keep(self.inner, n, weighted([(a[9], z), (a[10], z2), (a[11], z3), (a[12], z4)]))
            product = convolve(self.z4, self.inner, n)
            self._keep(self.outer, n, weighted([(a[5], z), (a[6], z2), (a[7], z3), (a[8], z4)], product))
            total = weighted([(a[4], z4), (a[3], z3), (a[2], z2)], convolve(self.z4, self.outer, n))
        return None if total is None else total * float(n)


class _Power:
    """The series of n ln(l + l_0)."""

    def __init__(self, work: Rows, distance: Vector) -> None:
        self.inverse = work.constant(1.0) / (distance - work[Row.MIDDLE])
        self.minus = -self.inverse
        self.factor = self.n = work[Row.TERMS]
        self.q: dict[int, Vector] = {}
        self.slope = self.n * self.inverse

    def bent(self, k: int, c: dict[int, Vector], v: Vector) -> Vector | None:
        """Return coefficient k of d(ln xi)/dt over n without the part of v_k, which is the slope."""
        total = convolve({j: c[j] for j in range(1, k + 1)}, self.q, k)
        if total is None:
            self.q[k] = self.inverse * v
            return None
        total = total * self.minus
        self.q[k] = total.plus(self.inverse, v)
        return total


class _Line:
    """The series of a line: nothing beside the slope."""

    factor = 1.0

    def __init__(self, work: Rows) -> None:
        self.slope = work[Row.TERMS + 1]

    @staticmethod
    def bent(k: int, c: dict[int, Vector], v: Vector) -> Vector | None:  # noqa: ARG004 - as in _Power
        """Return None: the slope is all there is."""
        return None


def _curve(work: Rows, degree: int, distance: Vector) -> _Polynomial | _Power | _Line:
    if degree == 1:
        return _Line(work)
    return _Polynomial(work, degree, distance) if degree else _Power(work, distance)


def _step(work: Rows, degree: int) -> Any:
    """Build one step; return a mask: which lanes moved and, LANES bits higher, which need another window."""
    damping, stiffness, gain = work[Row.DAMPING], work[Row.STIFFNESS], work[Row.GAIN]
    time, distance, speed, bend = work[Row.TIME], work[Row.DISTANCE], work[Row.SPEED], work[Row.ACCELERATION]
    position = work[Row.POSITION].plus((work[Row.VELOCITY].plus(bend * 0.5, time)), time)
    velocity = work[Row.VELOCITY].plus(bend, time)
    curve = _curve(work, degree, distance)
    c = {0: distance, 1: speed}
    drive = {
        0: bend.plus(damping, velocity).plus(stiffness, position - distance),
        1: (damping * bend).plus(stiffness, velocity),
        2: stiffness * bend * 0.5,
    }
    held = damping.plus(gain, curve.slope)  # the damping that the motion feels
    weight, spring, drag = -(gain * curve.factor), -stiffness, -held
    v = speed
    for k in range(ORDER - 1):
        parts = [(spring, c[k] if k else None), (weight, curve.bent(k, c, v))]
        total = weighted(parts, drive.get(k))
        v = (drag * v if total is None else total.plus(drag, v)) * (1.0 / (k + 1))
        c[k + 2] = v * (1.0 / (k + 2))
    size = work[Row.SCALE].logarithm() + _LOG_TOLERANCE
    reach = (size - c[ORDER].logarithm()) * (1.0 / ORDER)
    reach = reach.least((size - c[ORDER - 1].logarithm()) * (1.0 / (ORDER - 1)))
    ahead = distance / abs(speed)
    length = reach.exponential().least(ahead + ahead).least(work[Row.CAP])
    first = speed * length
    power, end, turn, area = length * length, distance + first, first, distance.plus(first, 0.5)
    bound = first
    work[0], work[1] = distance, first
    b = first
    for k in range(2, ORDER + 1):
        b = c[k] * power
        work[k] = b
        end, area, turn = end + b, area.plus(b, 1.0 / (k + 1)), turn.plus(b, float(k))
        bound = bound.plus(b.most(0.0), float(k))
        power = power * length
    work[Row.LENGTH], work[Row.END], work[Row.BOUND] = length, end, bound
    moved = time + length
    steps = work[Row.STEPS] + 1.0
    work[Row.STEPS] = steps
    tests = [work[Row.EDGE].below(end), bound.below(abs(first) * -1e-9), moved.below(work[Row.HORIZON])]
    tests.append(steps.below(MOST_STEPS))
    good = work.all(tests)
    work[Row.START], work[Row.MOVED] = time, work.constant(1.0).where(good, 0.0)
    tail = abs(b)
    lever = (work.constant(1.0) / held.most(1e-300)).least(ahead) / length
    growth = (-held * length).most(0.0)
    growth = work.constant(1.0).plus(growth, work.constant(1.0).plus(growth, work.constant(1.0).plus(growth, 0.5)))
    error = (tail + distance * _ROUNDING).plus(tail * float(ORDER), lever).plus(work[Row.ERROR], growth)
    work[Row.ERROR] = error.where(good, work[Row.ERROR])
    work[Row.STRONGEST] = work[Row.STRONGEST].most(held)
    work[Row.WEAKEST] = held
    path = position.plus((velocity * 0.5).plus(bend * (1 / 6), length), length) - area
    work[Row.TIME] = moved.where(good, time)
    work[Row.DISTANCE] = end.where(good, distance)
    work[Row.SPEED] = (turn / length).where(good, speed)
    work[Row.INTEGRAL] = work[Row.INTEGRAL].plus(path, length).where(good, work[Row.INTEGRAL])
    work[Row.CAP] = work.constant(1e300).where(good, work[Row.CAP])
    return work.masks(good, work.all([good, end.below(work[Row.SWITCH])]))


def make_intrinsic(build: Any) -> Any:
    """Make what numba.extending.intrinsic needs of a function that builds code on the rows of an array."""

    def typed(_: Any, work: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return build(Rows(context, builder, signature.args[0], arguments[0]))

        return types.int64(work), code

    return typed


def _find(work: Rows) -> Any:
    """Build the search for l = 0 inside steps that are proved monotone: Newton's method from the secant."""
    b = [work[k] for k in range(ORDER + 1)]
    s = b[0] / (b[0] - work[Row.END])
    change = s
    for _ in range(6):
        value = b[ORDER]
        slope = work.constant(0.0)
        for k in range(ORDER - 1, -1, -1):
            slope = value.plus(slope, s)
            value = b[k].plus(value, s)
        following = (s - value / slope).most(0.0)
        following = following.least(work.constant(1.0))
        change, s = abs(following - s), following
    length = work[Row.LENGTH]
    slope, bend, area = b[ORDER] * float(ORDER), b[ORDER] * float(ORDER * (ORDER - 1)), b[ORDER] * (1 / (ORDER + 1))
    for k in range(ORDER - 1, -1, -1):
        area = (b[k] * (1 / (k + 1))).plus(area, s)
        if k > 0:
            slope = (b[k] * float(k)).plus(slope, s)
        if k > 1:
            bend = (b[k] * float(k * (k - 1))).plus(bend, s)
    time, step = work[Row.TIME], length * s
    a, v = work[Row.ACCELERATION], work[Row.VELOCITY]
    position, velocity = work[Row.POSITION].plus(v.plus(a * 0.5, time), time), v.plus(a, time)
    path = position.plus((velocity * 0.5).plus(a * (1 / 6), step), step) - area
    end = time + step
    slope = slope / length
    work[Row.FINAL_TIME] = end
    work[Row.FINAL_SPEED] = slope
    work[Row.FINAL_BEND] = bend / (length * length)
    work[Row.FINAL_INTEGRAL] = work[Row.INTEGRAL].plus(path, step)
    ratio = (work[Row.STRONGEST] / work[Row.WEAKEST].most(1e-300)).most(1.0)
    error = work[Row.ERROR] + abs(b[ORDER]) * (1.0 + ORDER)
    doubt = (error * ratio + work[Row.SCALE] * _ROUNDING) / abs(slope * end)
    work[Row.DOUBT] = doubt + change * length / end * 1e-3
    return work.masks(work[Row.DOUBT].below(1.0))


step_power: Any = intrinsic(make_intrinsic(lambda work: _step(work, 0)))
step_1: Any = intrinsic(make_intrinsic(lambda work: _step(work, 1)))
step_4: Any = intrinsic(make_intrinsic(lambda work: _step(work, 4)))
step_12: Any = intrinsic(make_intrinsic(lambda work: _step(work, 12)))
find_in_step: Any = intrinsic(make_intrinsic(_find))
