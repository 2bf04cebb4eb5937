"""The common case of L(10)-(13) in NumPy, over-damped with an obstacle in uniform motion: needs no compiled core.

With c = g D_p and d = D + c, L(8) has the solution l = v t + q + C_1 exp(lambda_1 t) + C_2 exp(lambda_2 t) with
q = p - c v / K. Its velocity is v + A_1 E_1 + A_2 E_2 with A_i = lambda_i C_i and 0 < E_i <= 1, so that

    max(A_1, 0) + max(A_2, 0) < -v    proves    l' < 0 for good:

there is one zero of l, and whatever iteration ends on it has found the first contact. Encounters for which this or
the convergence is not proved are left to the guaranteed path.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray

__all__ = ["PEAKS", "STATES", "peaks_over_damped", "solve_over_damped", "states_over_damped"]

STATES: Final = (
    "time",
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "displacement_integral",
)
"""What is computed, by its names in layout.COLUMNS."""

PEAKS: Final = (
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_acceleration",
    "largest_virtual_force",
)
"""The largest demands until the contact, by their names there."""

_DISTINCT: Final = 1e-3  # of d^2: nearer to critical damping the two exponentials lose digits
_CANCELED: Final = 1e3  # largest loss of digits
_TRUSTED: Final = 1e-10  # of a largest demand
_ROUNDING: Final = 1e-15
_STEPS: Final = 12
_CONVERGED: Final = 1e-6  # of t: each step cubes what is left


def solve_over_damped(
    columns: tuple[FloatArray, ...], slope: float, horizon: float
) -> tuple[dict[str, FloatArray], BoolArray]:
    """Solve encounters of L(8) by L(10)-(13) where that is proved to find the first contact.

    Args:
        columns: relative quantities of Scenario.relative_columns and the gain, as in Request.columns.
        slope: g [1/m].
        horizon: how long to wait for contact [s].

    Returns:
        STATES at contact by name, shape (n,) each, and which encounters are solved, shape (n,).
    """
    with np.errstate(all="ignore"):  # what is not finite is not proved
        form = _Form.of(columns, slope)
        proved = form.falls()
        t, converged = form.root()
        states = form.states(t)
        proved &= converged & (t > 0) & (t <= horizon) & (states["relative_velocity"] < 0)
        return states, proved & form.keeps_digits(states)


def states_over_damped(columns: tuple[FloatArray, ...], slope: float, time: FloatArray) -> dict[str, FloatArray]:
    """Evaluate L(10)-(13) at times of contact that `solve_over_damped` has found.

    Args:
        columns: as for `solve_over_damped`.
        slope: g [1/m].
        time: the times [s], shape (n,).

    Returns:
        STATES by name, shape (n,) each.
    """
    with np.errstate(all="ignore"):  # encounters that were not solved are not read
        return _Form.of(columns, slope).states(time)


def peaks_over_damped(columns: tuple[FloatArray, ...], slope: float, time: FloatArray) -> dict[str, FloatArray]:
    """Evaluate the largest demands until times of contact that `solve_over_damped` has found.

    Each derivative of L(10) is two exponentials, or for l' two and a constant, and has at most one zero.

    Args:
        columns: as for `solve_over_damped`.
        slope: g [1/m].
        time: the times [s], shape (n,).

    Returns:
        PEAKS by name, shape (n,) each; nan where digits are lost or a reference that moves could make another peak.
    """
    with np.errstate(all="ignore"):  # encounters that were not solved are not read
        form = _Form.of(columns, slope)
        mass, damping, stiffness, x_0, u_0, _, v, _, drift, pull, gain = np.broadcast_arrays(*columns)
        coupling = slope * gain
        start = (x_0, u_0, (coupling * form.speed - damping * u_0 - stiffness * x_0) / mass)
        turns = (form.turn(1, time), form.turn(2, time), form.turn(3, time), time)
        x, u, w = (np.array([start[k], *(form.derivative(k, t) for t in turns)]) for k in range(3))
        moves = np.where(pull == 0, 0.0, np.nan)
        values = (
            (x, 0, 1.0),
            (x - x_0 + moves + np.where(drift == 0, 0.0, np.nan), 0, 1.0),
            (u + drift + moves, 1, 1.0),
            (w + pull, 2, 1.0),
            (coupling * (v - u), 1, np.abs(coupling)),
        )
        found = {}
        for name, (value, order, unit) in zip(PEAKS, values, strict=True):
            largest = np.abs(value).max(axis=0)
            noise = unit * np.max([form.noise(order, t) for t in turns], axis=0)
            found[name] = np.where(noise <= _TRUSTED * largest, largest, np.nan)
        return found


class _Form(NamedTuple):
    """The solution l = v t + q + C_1 exp(lambda_1 t) + C_2 exp(lambda_2 t), and the start it came from."""

    start: FloatArray
    speed: FloatArray
    v: FloatArray
    p: FloatArray
    q: FloatArray
    c_1: FloatArray
    c_2: FloatArray
    slow: FloatArray
    fast: FloatArray
    usual: BoolArray

    @classmethod
    def of(cls, columns: tuple[FloatArray, ...], slope: float) -> _Form:
        """Solve the initial value problem; `usual` says where it is of this kind, its exponentials well apart."""
        mass, damping, stiffness, x_0, u_0, p, v, a, _, _, gain = np.broadcast_arrays(*columns)
        coupling = slope * gain
        d = damping + coupling
        disc = d * d - 4 * mass * stiffness
        fast = -(d + np.sqrt(disc)) / (2 * mass)
        slow = stiffness / (mass * fast)
        q = p - coupling * v / stiffness
        start, speed = p - x_0, v - u_0
        c_1 = (speed - v - fast * (start - q)) / (slow - fast)
        usual = (a == 0) & (d > 0) & (stiffness > 0) & (disc > _DISTINCT * d * d)
        return cls(start, speed, v, p, q, c_1, start - q - c_1, slow, fast, usual)

    def falls(self) -> BoolArray:
        """Tell where l' < 0 is proved for good."""
        rise = np.maximum(self.slow * self.c_1, 0) + np.maximum(self.fast * self.c_2, 0)
        return np.asarray(self.usual & (self.speed < 0) & (rise < -self.v * (1 - 1e-9)))

    def states(self, t: FloatArray) -> dict[str, FloatArray]:
        """Return STATES at times t."""
        slow, fast, v = self.slow, self.fast, self.v
        e_1, e_2 = self.c_1 * np.exp(slow * t), self.c_2 * np.exp(fast * t)
        rate = v + slow * e_1 + fast * e_2
        decayed = self.c_1 * np.expm1(slow * t) / slow + self.c_2 * np.expm1(fast * t) / fast
        found = (
            *(t, self.p + v * t, v - rate),
            *(-(slow * slow * e_1 + fast * fast * e_2), rate, (self.p - self.q) * t - decayed),
        )
        return dict(zip(STATES, found, strict=True))

    def derivative(self, order: int, t: FloatArray) -> FloatArray:
        """Return x~, x~' or x~'' at times t."""
        e_1, e_2 = self.c_1 * np.exp(self.slow * t), self.c_2 * np.exp(self.fast * t)
        moved = self.slow**order * e_1 + self.fast**order * e_2
        return np.asarray((self.p - self.q if order == 0 else 0.0) - moved)

    def noise(self, order: int, t: FloatArray) -> FloatArray:
        """Return what rounding may have made of a derivative."""
        size = _ROUNDING * (np.abs(self.q) + np.abs(self.c_1) + np.abs(self.c_2))
        slow, fast = np.abs(self.slow) ** order, np.abs(self.fast) ** order
        return np.asarray(size * (slow * np.exp(self.slow * t) + fast * np.exp(self.fast * t)))

    def turn(self, order: int, end: FloatArray) -> FloatArray:
        """Return when x~^(order) is zero; 0 where that is not between the start and the end."""
        ratio = -(self.fast**order) * self.c_2 / (self.slow**order * self.c_1)
        t = np.log(ratio) / (self.slow - self.fast)
        return np.where((t > 0) & (t < end), t, 0.0)

    def keeps_digits(self, states: dict[str, FloatArray]) -> BoolArray:
        """Tell where all is finite and few digits are lost where terms cancel."""
        t, rate = states["time"], states["relative_velocity"]
        terms = np.abs(self.v * t) + np.abs(self.q) + np.abs(self.c_1) + np.abs(self.c_2)
        finite = np.isfinite(list(states.values())).all(axis=0)
        return np.asarray(self.usual & (terms < _CANCELED * np.abs(rate) * t) & finite)

    def root(self) -> tuple[FloatArray, BoolArray]:
        """Find the zero of a falling l from between the times of the free and the asymptotic motion, by Halley."""
        v, slow, fast = self.v, self.slow, self.fast
        t = np.sqrt(np.where(self.q > 0, self.q, self.start) * self.start) / -v
        step = np.full_like(t, np.inf)
        for _ in range(_STEPS):
            e_1, e_2 = self.c_1 * np.exp(slow * t), self.c_2 * np.exp(fast * t)
            rate = v + slow * e_1 + fast * e_2
            bend = slow * slow * e_1 + fast * fast * e_2
            newton = (v * t + self.q + e_1 + e_2) / rate
            step = newton / np.maximum(1 - 0.5 * newton * bend / rate, 0.5)
            t = np.maximum(t - step, 0.1 * t)
            if not (np.abs(step) > _CONVERGED * t).any():
                break
        return t, np.abs(step) <= _CONVERGED * t
