"""The sampled loop, linearized at one distance and discretized exactly, and the damping at which it becomes unstable.

Near a distance l, ln xi changes by g dx. The force of two readings is -(d / h) (y_k - y_k-1), where d = D_p g is the
equivalent damping of the virtual force and h the time for which it acts. All other parts are linear and time-invariant,
so matrix exponentials give the effect of one force on all later readings: no step is approximated.

The eigenvalues of the closed loop solve 1 + d P(z) = 0. At d = 0 they are those of the plant, of the filter and of the
delay. An eigenvalue on the unit circle at d = 0, an undamped oscillation, moves in or out as soon as d > 0. Any other
eigenvalue can reach the circle only at an omega for which P(exp(i omega T)) is real and negative, with d = -1 / P. Its
modulus then changes with d as P^2 Im(dP/domega) / |dP/domega|^2, so it leaves if the imaginary part of P rises.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import BoolArray, FloatArray

from .chain import LoopTiming

_Complex: TypeAlias = NDArray[np.complex128]
_Plant: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]  # x' = A x + B F, read as C x
_TERMS: Final = 18  # of an exponential: the next is 1/19! of it, below rounding
_ROUNDING: Final = 4 * 2.0**-52
_LOWEST: Final = 1e-6  # of omega T, without a delay: a crossover below is none within 10^6 periods
_TURN: Final = 0.2  # rad between two neighbors: a phase that turns less cannot cross unseen
_POINTS: Final = 20_000
_SILENT: Final = 1e-12  # of the largest response: below, as where a low-pass has its zeros, the phase is rounding
_UNDAMPED: Final = 1e-12  # of the fastest mode of the plant: what its eigenvalues are off by rounding
_BESIDE: Final = 1e-7  # of the angle of an undamped mode, around which P is beyond all bounds
_NUDGE: Final = 1e-6  # of an eigenvalue: its second order is 1e-12, above rounding
_FLAT: Final = 1e-9  # of P: an imaginary part below is rounding
_DENSE: Final = 300  # periods of delay up to which all eigenvalues are computed


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearLoop:
    """The linear loop, opened at the damping d, from the start of one exposure to that of the next.

    Args:
        timing: when it samples and acts.
        transition: what a period makes of the state of the plant, shape (n, n).
        reading: what an exposure reads of the state at its start [m], shape (n,).
        lag: periods for which no force does anything, so that a long delay costs no more than a short one.
        pushes: what the unit force of the reading lag + i periods ago adds to the state within a period, shape (m, n).
        feedthrough: what it adds to the reading itself [m/N], shape (m,).
        modes: eigenvalues of the plant times the period, by which its own motions grow, shape (n,).
    """

    timing: LoopTiming
    transition: FloatArray
    reading: FloatArray
    lag: int
    pushes: FloatArray
    feedthrough: FloatArray
    modes: _Complex

    def response(self, angle: _Complex | FloatArray) -> _Complex:
        """Return P(exp(i omega T)) [m/(N s)], from the damping's force to what it reads, at angles omega T, shape (k,).

        They are real in (0, pi] on the unit circle, complex beside it. Where 1 + d P(z) = 0, z is an eigenvalue.
        """
        z = np.exp(1j * np.asarray(angle))
        delays = np.exp(-1j * np.asarray(angle)[:, None] * (self.lag + np.arange(len(self.feedthrough))))
        system = z[:, None, None] * np.eye(len(self.reading)) - self.transition
        state = np.linalg.solve(system, (delays @ self.pushes)[:, :, None])[:, :, 0]
        out = state @ self.reading + delays @ self.feedthrough
        for b0, b1, b2, _, a1, a2 in self.timing.filters:
            out = out * (b0 + b1 / z + b2 / z**2) / (1 + a1 / z + a2 / z**2)
        # 1 - 1/z loses digits near z = 1: 1 - exp(-ia) = 2i sin(a/2) exp(-ia/2)
        difference = 2j * np.sin(np.asarray(angle) / 2) * np.exp(-0.5j * np.asarray(angle))
        return np.asarray(difference * out / self.timing.holding, dtype=np.complex128)

    def closed(self, damping: float) -> FloatArray:
        """Return the matrix by which a period changes the closed loop's state at the damping d [N s/m].

        The state is that of the plant, the forces that still act, the last filtered reading and the filter's states.
        """
        n, later = len(self.reading), np.zeros((self.lag, len(self.reading) + 1))
        effects = np.vstack([later, np.column_stack([self.pushes, self.feedthrough])])
        size = n + len(effects) + 2 * len(self.timing.filters)
        return np.stack([self._advance(unit, damping, effects[:, :n], effects[:, n]) for unit in np.eye(size)], axis=1)

    @property
    def remembered(self) -> int:
        """How many periods the force of a reading acts after it at most."""
        return self.lag + len(self.feedthrough)

    def _advance(self, state: FloatArray, damping: float, pushes: FloatArray, feedthrough: FloatArray) -> FloatArray:
        n, m = len(self.reading), len(feedthrough)
        plant, past, previous, filters = state[:n], state[n : n + m - 1], state[n + m - 1], state[n + m :].copy()
        value = float(self.reading @ plant + feedthrough[1:] @ past)
        for i, (b0, b1, b2, _, a1, a2) in enumerate(self.timing.filters):
            out = b0 * value + filters[2 * i]
            filters[2 * i] = b1 * value - a1 * out + filters[2 * i + 1]
            filters[2 * i + 1] = b2 * value - a2 * out
            value = out
        forces = np.array([-damping * (value - previous) / self.timing.holding, *past])
        plant = self.transition @ plant + forces @ pushes
        return np.concatenate([plant, forces[: m - 1], [value], filters])


def linear_loop(system: FloatArray, push: FloatArray, output: FloatArray, timing: LoopTiming) -> LinearLoop:
    """Discretize a plant exactly, open at the damping: x' = A x + B F, read as C x, for B and C of shape (n,)."""
    n, exposure, period = len(push), timing.exposure, timing.period
    block = np.zeros((n + 2, n + 2))  # the state, the integral of the reading, a constant force
    block[:n, :n], block[n, :n], block[:n, n + 1] = system, output, push
    start = exposure / 2 + timing.delay  # of the force, after the start of the exposure
    count = max(int(np.ceil((start + timing.holding) / period - 1e-12)), 1)
    lag = max(math.floor((start - exposure) / period - 1e-9), 0)
    ends = np.arange(lag, count + 1) * period
    # a pulse is a force from its start on less one from its end on, each felt before and after an exposure
    since = np.array([ends, ends + exposure])[:, :, None] - np.array([start, start + timing.holding])
    made = _exponentials(block * np.array([period, exposure, *np.maximum(since, 0.0).ravel()])[:, None, None])
    felt = made[2:, : n + 1, n + 1].reshape(*since.shape, n + 1)
    before, after = felt[:, :, 0] - felt[:, :, 1]
    states, transition = before[:, :n], made[0, :n, :n]
    if exposure > 0:
        reading = made[1, n, :n] / exposure
        # the integral of a pulse that has ended still grows with the state: it is taken over the exposure alone
        feedthrough = (after[:, n] - before[:, n]) / exposure - states @ reading
    else:
        reading, feedthrough = output.copy(), np.zeros(len(ends))
    pushes = np.zeros((len(ends), n))
    pushes[:-1] = states[1:] - states[:-1] @ transition.T
    return LinearLoop(
        timing=timing,
        transition=transition,
        reading=reading,
        lag=lag,
        pushes=pushes,
        feedthrough=feedthrough,
        modes=np.asarray(np.linalg.eigvals(system) * period, dtype=np.complex128),
    )


def _exponentials(matrices: FloatArray) -> FloatArray:
    """Return the exponentials of matrices, shape (k, n, n): Taylor's series for norms up to 1, then squared.

    It is exp A - 1 that is squared, so that what is small stays exact. SciPy's takes longer, and longer still to load.
    """
    norm = np.abs(matrices).sum(axis=1).max(axis=1)
    halvings = np.ceil(np.log2(np.maximum(norm, 1.0))).astype(int)
    small = matrices / 2.0 ** halvings[:, None, None]
    unit, found = np.eye(matrices.shape[1]), small
    for k in range(_TERMS, 1, -1):
        found = small @ (unit + found / k)
    for i in range(halvings.max()):
        left = halvings > i
        found[left] = 2 * found[left] + found[left] @ found[left]
    return np.asarray(found + unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossover:
    """An eigenvalue that leaves the unit circle.

    Args:
        angle: omega T of the oscillation.
        damping: d there [N s/m]; 0 where the loop is unstable with any damping, however weak.
        growth: ln |z| of an eigenvalue that is outside right after a damping of 0; NaN for any other.
    """

    angle: float
    damping: float
    growth: float = math.nan


def first_crossover(loop: LinearLoop) -> Crossover | None:
    """Find the smallest damping with which the loop is no longer stable; None where none makes it unstable."""
    fastest = float(np.abs(loop.modes).max())
    for mode in loop.modes[loop.modes.real > _UNDAMPED * fastest]:
        return Crossover(angle=_folded(mode), damping=0.0, growth=float(mode.real))
    undamped = loop.modes[(np.abs(loop.modes.real) <= _UNDAMPED * fastest) & (loop.modes.imag > 0)]
    poles = sorted({_folded(mode) for mode in undamped} - {0.0})
    for pole in poles:
        growth = _departure(loop, pole)
        if growth > 0:
            return Crossover(angle=pole, damping=0.0, growth=growth)
    angle, response = _resolved(loop, poles)
    found = _departures(loop, angle, response, poles)
    values = loop.response(np.array(found)).real
    pairs = [(-1 / float(v), w) for w, v in zip(found, values, strict=True) if v < 0]
    return Crossover(damping=min(pairs)[0], angle=min(pairs)[1]) if pairs else None


def worst_crossover(system: _Plant, timing: LoopTiming) -> tuple[LinearLoop, Crossover | None]:
    """Return the loop with the delay of a range that allows the least damping, and its first crossover."""
    # nearly always the longest; beside a mode that is hardly damped the limit has minima over the delay
    tried: dict[float, tuple[LinearLoop, Crossover | None]] = {}

    def limit(part: float) -> float:
        one = replace(timing, delay=timing.delay - part * timing.delay_range, delay_range=0.0)
        loop = linear_loop(*system, one)
        tried[part] = loop, first_crossover(loop)
        return _damping(tried[part])

    first = limit(0.0)
    if timing.delay_range > 0 and not first <= limit(0.5) <= limit(1.0) and min(map(_damping, tried.values())) > 0:
        from scipy.optimize import minimize_scalar  # noqa: PLC0415 - heavy

        worst = min(tried, key=lambda part: _damping(tried[part]))
        around = max(worst - 0.5, 0.0), min(worst + 0.5, 1.0)
        minimize_scalar(limit, bounds=around, method="bounded", options={"xatol": 1e-3})
    return min(tried.values(), key=_damping)


def _damping(found: tuple[LinearLoop, Crossover | None]) -> float:
    return math.inf if found[1] is None else found[1].damping


def spectral_radius(loop: LinearLoop, damping: float, *, free: bool, beside: float) -> float:
    """Return the largest modulus of the eigenvalues at a damping d [N s/m], without that of a position that is free.

    Where forces act beyond 300 periods after their readings the matrix is too large: then it is the modulus of the one
    eigenvalue beside the crossover at the angle that is given, NaN without one.
    """
    if loop.remembered > _DENSE:
        return math.nan if math.isnan(beside) else _moved(loop, beside, damping)
    values = np.linalg.eigvals(loop.closed(damping))
    if free:
        values = np.delete(values, np.argmin(np.abs(values - 1)))
    return float(np.abs(values).max())


def _folded(mode: complex) -> float:
    """Return the angle in [0, pi] at which readings see a mode."""
    return abs(math.remainder(mode.imag, 2 * math.pi))


def _departure(loop: LinearLoop, pole: float) -> float:
    """Return ln |z| of the eigenvalue that leaves an undamped mode z_0 of the plant, for a damping that moves it 1e-6.

    With z = z_0 exp(i e) and Q(e) = (exp(i e) - 1) P(z), which is finite at z_0, 1 + d P = 0 is exp(i e) = 1 - d Q(e).
    """

    def weight(e: complex) -> complex:
        return complex((cmath.exp(1j * e) - 1) * loop.response(np.array([pole + e]))[0])

    nudge = _NUDGE * min(pole, math.pi - pole or math.pi)  # small beside the way to the conjugate mode
    first = weight(nudge)
    if abs(first) < 0.5 * abs(weight(100 * nudge)):  # it falls with e: no pole, but a mode that no reading sees
        return 0.0
    e, damping = complex(nudge), nudge / abs(first)
    for _ in range(3):  # each gains six digits
        e = -1j * cmath.log(1 - damping * weight(e))
    return -e.imag


def _moved(loop: LinearLoop, angle: float, damping: float) -> float:
    """Return the modulus of the eigenvalue beside exp(i angle), for a damping beside that of its crossover: Newton."""
    at, step = complex(angle), 1e-6 * angle
    with np.errstate(all="ignore"):  # where two eigenvalues meet, Newton's steps go anywhere
        for _ in range(5):
            before, here, after = loop.response(np.array([at - step, at, at + step]))
            at -= complex((here + 1 / damping) * 2 * step / (after - before))
        return float(np.exp(-at.imag))


def _departures(loop: LinearLoop, angle: FloatArray, response: _Complex, poles: list[float]) -> list[float]:
    """Return the angles at which the imaginary part of P rises through 0, those of the smallest dampings at least."""
    rising = _changes(response) & np.signbit(response.imag[:-1]) & ~_holds_any(angle, poles) & _heard(response)
    # at pi P is real, and with a double eigenvalue it is flat there: the sign is that of the last angle with any
    certain = response.imag[np.abs(response.imag) > _FLAT * np.abs(response)]
    found = [math.pi] if math.pi not in poles and (not len(certain) or certain[-1] < 0) else []
    for i in np.flatnonzero(rising & (angle[1:] < math.pi)):
        # the signs at both ends are those of the scan: computed one by one they may differ by rounding
        below, above = ((float(angle[j]), float(response[j].imag)) for j in (i, i + 1))
        found.append(
            zero_between(lambda w: float(loop.response(np.array([w]))[0].imag), below, above, 1e-14 * below[0])
        )
    return found


def _resolved(loop: LinearLoop, poles: list[float]) -> tuple[FloatArray, _Complex]:
    """Return angles from nearly 0 to pi between which the phase of P turns little, and P there.

    Where P is too small for the smallest damping there is nothing to resolve.
    """
    lowest = _LOWEST / (1 + loop.remembered)
    angle = np.unique([*np.geomspace(lowest, math.pi, 400), *np.linspace(0, math.pi, 400)[1:], math.pi * (1 - _BESIDE)])
    for pole in poles:
        beside = [w for w in (pole * (1 - _BESIDE), pole * (1 + _BESIDE)) if w <= math.pi]
        angle = np.unique([*angle[np.abs(angle - pole) > _BESIDE * pole], *beside])
    response = loop.response(angle)
    while len(angle) < _POINTS:
        with np.errstate(invalid="ignore", divide="ignore"):  # 0 / 0 where nothing is heard
            turn = np.abs(np.angle(response[1:] / response[:-1]))
        wide = (turn > _TURN) & (np.diff(angle) > 1e-9 * angle[1:]) & _heard(response) & ~_holds_any(angle, poles)
        if not wide.any():
            break
        between = (angle[:-1] + angle[1:])[wide] / 2
        order = np.argsort(np.concatenate([angle, between]), kind="stable")
        response = np.concatenate([response, loop.response(between)])[order]
        angle = np.concatenate([angle, between])[order]
    return angle, response


def _changes(response: _Complex) -> BoolArray:
    """Tell between which neighbors the imaginary part changes its sign."""
    return np.asarray(np.signbit(response.imag[1:]) != np.signbit(response.imag[:-1]))


def _heard(response: _Complex) -> BoolArray:
    """Tell between which neighbors P may be as large as at the crossover of the smallest damping."""
    size = np.abs(response)
    left = _changes(response) & (response.real[1:] < 0) & (response.real[:-1] < 0)
    largest = np.minimum(size[1:], size[:-1])[left].max(initial=0.0)
    return np.asarray(np.maximum(size[1:], size[:-1]) > max(0.5 * largest, _SILENT * size.max()))


def _holds_any(angle: FloatArray, poles: list[float]) -> BoolArray:
    """Tell between which neighbors an undamped mode lies, across which P changes its sign without a crossover."""
    held = np.zeros(len(angle) - 1, dtype=bool)
    for pole in poles:
        held |= (angle[:-1] < pole) & (pole <= angle[1:])
    return held


def zero_between(
    function: Callable[[float], float], one: tuple[float, float], other: tuple[float, float], tolerance: float
) -> float:
    """Find a zero to a tolerance between two places, given with their values of unlike signs; the function may jump."""
    # by the inverse parabola through three, or halving where that may mislead; SciPy's brentq takes 0.1 s to load:
    # T. R. Chandrupatla, Advances in Engineering Software 28 (1997) 145
    (b, at_b), (a, at_a), part = one, other, 0.5
    while True:
        x = a + part * (b - a)
        value = function(x)
        c, at_c = a, at_a
        if (value > 0) != (at_a > 0):
            b, at_b, c, at_c = a, at_a, b, at_b
        a, at_a = x, value
        best, least = (a, at_a) if abs(at_a) < abs(at_b) else (b, at_b)
        near = (tolerance + _ROUNDING * abs(best)) / abs(b - a)
        if near > 0.5 or least == 0:
            return best
        along, up = (a - b) / (c - b), (at_a - at_b) / (at_c - at_b)
        part = 0.5
        if up**2 < along and (1 - up) ** 2 < 1 - along:
            part = at_a / (at_b - at_a) * at_c / (at_b - at_c)
            part += (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b)
        part = min(max(part, near), 1 - near)
