"""Find the smallest damping that makes a sampled control loop unstable.

The loop is linearized at one distance.

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
_Plant: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]  # the system x' = A x + B F, whose reading is C x
_TERMS: Final = 18  # terms of an exponential series: the next term is 1/19! of the sum, below rounding
_ROUNDING: Final = 4 * 2.0**-52
_LOWEST: Final = 1e-6  # lowest omega T without a delay: slower instabilities take more than 10^6 periods
_TURN: Final = 0.2  # rad between two neighbors: with less change of phase, no crossover is missed
_POINTS: Final = 20_000  # largest number of angles
_SILENT: Final = 1e-12  # of the largest response: below, near zeros of a low-pass, the phase is only rounding error
_UNDAMPED: Final = 1e-12  # of the fastest mode of the plant: rounding error of its eigenvalues
_NEAR: Final = 1e-7  # relative angle around an undamped mode that is excluded, because P is unbounded there
_NUDGE: Final = 1e-6  # relative change of an eigenvalue: its second order, 1e-12, is above rounding
_FLAT: Final = 1e-9  # relative to P; a smaller imaginary part is rounding error
_DENSE: Final = 300  # periods of delay up to which all eigenvalues are computed


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearLoop:
    """The linearized open control loop as a discrete-time system.

    Its time step is the sensor period. The loop is opened at the damping d. The period lasts from the start of one
    exposure to the next.

    Args:
        timing: the timing of the loop.
        transition: state transition matrix of the plant over a period, shape (n, n).
        reading: output vector: averaged reading of an exposure from the state at its start [m], shape (n,).
        lag: number of periods before a force has any effect, so that a long delay needs no more memory.
        pushes: effect on the state within a period of the unit force of the reading lag + i periods ago, shape (m, n).
        feedthrough: effect of this force on the reading itself [m/N], shape (m,).
        modes: eigenvalues of the plant times the period, shape (n,).
    """

    timing: LoopTiming
    transition: FloatArray
    reading: FloatArray
    lag: int
    pushes: FloatArray
    feedthrough: FloatArray
    modes: _Complex

    def response(self, angle: _Complex | FloatArray) -> _Complex:
        """Return the open-loop transfer function P(z) [m/(N s)].

        P leads from the virtual force to the rate of change of the readings. The rate is the difference of two
        successive readings over their period. P is evaluated at z = exp(i omega T).

        The angles omega T, shape (k,), are real in (0, pi] on the unit circle and complex elsewhere. If
        1 + d P(z) = 0, z is an eigenvalue of the closed loop.
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
        """Return the closed loop's state transition matrix over one sensor period.

        The virtual damping is d [N s/m]. The state consists of the plant's state, the forces that still act, the last
        filtered reading and filter states.
        """
        n, later = len(self.reading), np.zeros((self.lag, len(self.reading) + 1))
        effects = np.vstack([later, np.column_stack([self.pushes, self.feedthrough])])
        size = n + len(effects) + 2 * len(self.timing.filters)
        return np.stack([self._advance(unit, damping, effects[:, :n], effects[:, n]) for unit in np.eye(size)], axis=1)

    @property
    def remembered(self) -> int:
        """The number of sensor periods within which a virtual force ends.

        The count starts at the reading that caused the force.
        """
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
    """Discretize the open control loop of a linear robot exactly.

    The plant is x' = A x + B F with the output C x; B and C have the shape (n,).

    Returns:
        The loop, whose time step is the sensor period.
    """
    n, exposure, period = len(push), timing.exposure, timing.period
    block = np.zeros((n + 2, n + 2))  # the state, the integral of the reading, a constant force
    block[:n, :n], block[n, :n], block[:n, n + 1] = system, output, push
    start = exposure / 2 + timing.delay  # start of the force after the start of the exposure [s]
    count = max(int(np.ceil((start + timing.holding) / period - 1e-12)), 1)
    lag = max(math.floor((start - exposure) / period - 1e-9), 0)
    ends = np.arange(lag, count + 1) * period
    # a pulse is a step at its start minus a step at its end; both act before and after an exposure
    since = np.array([ends, ends + exposure])[:, :, None] - np.array([start, start + timing.holding])
    exponentials = _exponentials(block * np.array([period, exposure, *np.maximum(since, 0.0).ravel()])[:, None, None])
    responses = exponentials[2:, : n + 1, n + 1].reshape(*since.shape, n + 1)
    before, after = responses[:, :, 0] - responses[:, :, 1]
    states, transition = before[:, :n], exponentials[0, :n, :n]
    if exposure > 0:
        reading = exponentials[1, n, :n] / exposure
        # after its end, the integral of a pulse still grows with the state, so it is taken over the exposure only
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
    """Compute matrix exponentials with a Taylor series, scaling and squaring.

    exp(A) - 1 is squared, so that small entries stay accurate. SciPy's function takes longer, also to load.

    Returns:
        The exponentials of the k matrices.
    """
    norm = np.abs(matrices).sum(axis=1).max(axis=1)
    halvings = np.ceil(np.log2(np.maximum(norm, 1.0))).astype(int)
    small = matrices / 2.0 ** halvings[:, None, None]
    unit, sums = np.eye(matrices.shape[1]), small
    for k in range(_TERMS, 1, -1):
        sums = small @ (unit + sums / k)
    for i in range(halvings.max()):
        remaining = halvings > i
        sums[remaining] = 2 * sums[remaining] + sums[remaining] @ sums[remaining]
    return np.asarray(sums + unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossover:
    """The damping and frequency at the stability limit of a loop.

    There, an eigenvalue of the sampled loop crosses the unit circle.

    Args:
        angle: omega T of the oscillation.
        damping: the damping d at the crossover [N s/m]; 0 if the loop is unstable with any damping, however weak.
        growth: ln |z| of an eigenvalue that leaves the circle at d = 0; NaN otherwise.
    """

    angle: float
    damping: float
    growth: float = math.nan


def first_crossover(loop: LinearLoop) -> Crossover | None:
    """Find the smallest virtual damping that makes the loop unstable.

    Returns:
        The crossover; None if the loop is stable with any damping.
    """
    fastest = float(np.abs(loop.modes).max())
    for mode in loop.modes[loop.modes.real > _UNDAMPED * fastest]:
        return Crossover(angle=_aliased_angle(mode), damping=0.0, growth=float(mode.real))
    undamped = loop.modes[(np.abs(loop.modes.real) <= _UNDAMPED * fastest) & (loop.modes.imag > 0)]
    poles = sorted({_aliased_angle(mode) for mode in undamped} - {0.0})
    for pole in poles:
        growth = _growth_of_mode(loop, pole)
        if growth > 0:
            return Crossover(angle=pole, damping=0.0, growth=growth)
    angle, response = _sample_response(loop, poles)
    angles = _crossover_angles(loop, angle, response, poles)
    values = loop.response(np.array(angles)).real
    pairs = [(-1 / float(v), w) for w, v in zip(angles, values, strict=True) if v < 0]
    return Crossover(damping=min(pairs)[0], angle=min(pairs)[1]) if pairs else None


def worst_crossover(system: _Plant, timing: LoopTiming) -> tuple[LinearLoop, Crossover | None]:
    """Find the loop delay that results in the smallest stability limit.

    The worst delay is nearly always the longest. Near a weakly damped mode, the limit has minima over the delay.

    Returns:
        The loop with this delay, and its stability limit.
    """
    tried: dict[float, tuple[LinearLoop, Crossover | None]] = {}

    def limit(part: float) -> float:
        shortened = replace(timing, delay=timing.delay - part * timing.delay_range, delay_range=0.0)
        loop = linear_loop(*system, shortened)
        tried[part] = loop, first_crossover(loop)
        return _damping(tried[part])

    first = limit(0.0)
    if timing.delay_range > 0 and not first <= limit(0.5) <= limit(1.0) and min(map(_damping, tried.values())) > 0:
        from scipy.optimize import minimize_scalar  # noqa: PLC0415 - heavy

        worst = min(tried, key=lambda part: _damping(tried[part]))
        around = max(worst - 0.5, 0.0), min(worst + 0.5, 1.0)
        minimize_scalar(limit, bounds=around, method="bounded", options={"xatol": 1e-3})
    return min(tried.values(), key=_damping)


def _damping(candidate: tuple[LinearLoop, Crossover | None]) -> float:
    return math.inf if candidate[1] is None else candidate[1].damping


def spectral_radius(loop: LinearLoop, damping: float, *, free: bool, near: float) -> float:
    """Return the spectral radius of the closed loop.

    The virtual damping is d [N s/m]. The eigenvalue 1 of a `free` position is excluded.

    If forces act for more than 300 periods after their readings, the matrix is too large. Then it is the modulus of the
    eigenvalue near the crossover at the angle `near`, or NaN without a crossover.
    """
    if loop.remembered > _DENSE:
        return math.nan if math.isnan(near) else _modulus_near(loop, near, damping)
    values = np.linalg.eigvals(loop.closed(damping))
    if free:
        values = np.delete(values, np.argmin(np.abs(values - 1)))
    return float(np.abs(values).max())


def _aliased_angle(mode: complex) -> float:
    """Return the angle per sampling period of an aliased oscillation. The angle omega T is between 0 and pi."""
    return abs(math.remainder(mode.imag, 2 * math.pi))


def _growth_of_mode(loop: LinearLoop, pole: float) -> float:
    """Return the growth rate of an undamped mode under weak damping.

    The rate is ln |z|. The mode is undamped in open loop. The virtual damping is so small that it moves the eigenvalue
    by 1e-6. With z = z_0 exp(i e) and Q(e) = (exp(i e) - 1) P(z), which is finite at z_0, 1 + d P = 0 is exp(i e) = 1 -
    d Q(e).
    """

    def weight(e: complex) -> complex:
        return complex((cmath.exp(1j * e) - 1) * loop.response(np.array([pole + e]))[0])

    nudge = _NUDGE * min(pole, math.pi - pole or math.pi)  # small compared with the distance to the conjugate mode
    first = weight(nudge)
    if abs(first) < 0.5 * abs(weight(100 * nudge)):  # the weight falls with e: not a pole, but an unobservable mode
        return 0.0
    e, damping = complex(nudge), nudge / abs(first)
    for _ in range(3):  # each iteration gains six digits
        e = -1j * cmath.log(1 - damping * weight(e))
    return -e.imag


def _modulus_near(loop: LinearLoop, angle: float, damping: float) -> float:
    """Compute the modulus of a closed-loop eigenvalue near the unit circle."""
    at, step = complex(angle), 1e-6 * angle
    with np.errstate(all="ignore"):  # where two eigenvalues meet, Newton's method may diverge
        for _ in range(5):
            before, here, after = loop.response(np.array([at - step, at, at + step]))
            at -= complex((here + 1 / damping) * 2 * step / (after - before))
        return float(np.exp(-at.imag))


def _crossover_angles(loop: LinearLoop, angle: FloatArray, response: _Complex, poles: list[float]) -> list[float]:
    """Find where the imaginary part of the frequency response rises through zero.

    Only the angles of the smallest dampings are complete.

    Returns:
        The zeros of the open loop's response, as angles omega T.
    """
    rising = (
        _sign_changes(response)
        & np.signbit(response.imag[:-1])
        & ~_contains_pole(angle, poles)
        & _is_relevant(response)
    )
    # at pi, P is real, and flat for a double eigenvalue: use the sign of the last angle with a clear sign
    certain = response.imag[np.abs(response.imag) > _FLAT * np.abs(response)]
    angles = [math.pi] if math.pi not in poles and (not len(certain) or certain[-1] < 0) else []
    for i in np.flatnonzero(rising & (angle[1:] < math.pi)):
        # use the values of the scan at both ends: computed one by one, their signs may differ by rounding
        below, above = ((float(angle[j]), float(response[j].imag)) for j in (i, i + 1))
        angles.append(
            zero_between(lambda w: float(loop.response(np.array([w]))[0].imag), below, above, 1e-14 * below[0])
        )
    return angles


def _sample_response(loop: LinearLoop, poles: list[float]) -> tuple[FloatArray, _Complex]:
    """Sample the open-loop frequency response densely.

    The phase changes little between two samples. Angles at which P is too small for the smallest damping are not
    refined.

    Returns:
        Angles and responses.
    """
    lowest = _LOWEST / (1 + loop.remembered)
    ends = np.array([math.pi * (1 - _NEAR)])
    angle = np.unique(np.concatenate([np.geomspace(lowest, math.pi, 400), np.linspace(0, math.pi, 400)[1:], ends]))
    for pole in poles:
        around = [w for w in (pole * (1 - _NEAR), pole * (1 + _NEAR)) if w <= math.pi]
        angle = np.unique(np.concatenate([angle[np.abs(angle - pole) > _NEAR * pole], around]))
    response = loop.response(angle)
    while len(angle) < _POINTS:
        with np.errstate(invalid="ignore", divide="ignore"):  # 0 / 0 where the response is zero
            turn = np.abs(np.angle(response[1:] / response[:-1]))
        wide = (
            (turn > _TURN)
            & (np.diff(angle) > 1e-9 * angle[1:])
            & _is_relevant(response)
            & ~_contains_pole(angle, poles)
        )
        if not wide.any():
            break
        between = (angle[:-1] + angle[1:])[wide] / 2
        order = np.argsort(np.concatenate([angle, between]), kind="stable")
        response = np.concatenate([response, loop.response(between)])[order]
        angle = np.concatenate([angle, between])[order]
    return angle, response


def _sign_changes(response: _Complex) -> BoolArray:
    """Mark the frequency intervals in which the imaginary part changes sign."""
    return np.asarray(np.signbit(response.imag[1:]) != np.signbit(response.imag[:-1]))


def _is_relevant(response: _Complex) -> BoolArray:
    """Mark the frequency intervals that may set the stability limit."""
    size = np.abs(response)
    crossing = _sign_changes(response) & (response.real[1:] < 0) & (response.real[:-1] < 0)
    largest = np.minimum(size[1:], size[:-1])[crossing].max(initial=0.0)
    return np.asarray(np.maximum(size[1:], size[:-1]) > max(0.5 * largest, _SILENT * size.max()))


def _contains_pole(angle: FloatArray, poles: list[float]) -> BoolArray:
    """Mark the frequency intervals with an undamped open-loop mode. There, P changes its sign without a crossover."""
    contains = np.zeros(len(angle) - 1, dtype=bool)
    for pole in poles:
        contains |= (angle[:-1] < pole) & (pole <= angle[1:])
    return contains


def zero_between(
    function: Callable[[float], float], first: tuple[float, float], second: tuple[float, float], tolerance: float
) -> float:
    """Find a zero or a sign-changing jump of a function in an interval.

    The function has different signs at the two ends. Chandrupatla's method: inverse quadratic interpolation, or
    bisection if it is unreliable (T. R. Chandrupatla, Advances in Engineering Software 28 (1997) 145). SciPy's brentq
    would take 0.1 s to load.

    Returns:
        The position of the zero or jump.
    """
    (b, at_b), (a, at_a), part = first, second, 0.5
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
