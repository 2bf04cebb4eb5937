"""The loop at one distance, linear and exactly discretized: what a reading makes of all forces before it.

Near a distance l, ln xi changes by g dx, and the force of two readings is -(d / h) (y_k - y_k-1) with d = D_p g the
damping that the virtual force amounts to and h the time for which it acts. All else is linear and time-invariant, so
that what one force does to all later readings follows from matrix exponentials: no step is approximated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pretouch._core.numbers import FloatArray

from .chain import LoopTiming

__all__ = ["ComplexArray", "LinearLoop", "linear_loop"]

ComplexArray: TypeAlias = NDArray[np.complex128]
_TERMS: Final = 18  # of an exponential: the next is 1/19! of it, below rounding


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
    modes: ComplexArray

    def response(self, angle: ComplexArray | FloatArray) -> ComplexArray:
        """Return P(exp(i omega T)) [m/(N s)], from the damping's force to what it reads, at angles omega T, shape (k,).

        They are real in (0, pi] on the unit circle, complex beside it. Where 1 + d P(z) = 0, z is an eigenvalue.
        """
        z = np.exp(1j * np.asarray(angle))
        delays = np.exp(-1j * np.asarray(angle)[:, None] * (self.lag + np.arange(len(self.feedthrough))))
        system = z[:, None, None] * np.eye(len(self.reading)) - self.transition
        state = np.linalg.solve(system, (delays @ self.pushes)[:, :, None])[:, :, 0]
        out = state @ self.reading + delays @ self.feedthrough
        for b0, b1, b2, _, a1, a2 in self.timing.sections:
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
        size = n + len(effects) + 2 * len(self.timing.sections)
        return np.stack([self._advance(unit, damping, effects[:, :n], effects[:, n]) for unit in np.eye(size)], axis=1)

    @property
    def remembered(self) -> int:
        """How many periods the force of a reading acts after it at most."""
        return self.lag + len(self.feedthrough)

    def _advance(self, state: FloatArray, damping: float, pushes: FloatArray, feedthrough: FloatArray) -> FloatArray:
        n, m = len(self.reading), len(feedthrough)
        plant, past, previous, filters = state[:n], state[n : n + m - 1], state[n + m - 1], state[n + m :].copy()
        value = float(self.reading @ plant + feedthrough[1:] @ past)
        for i, (b0, b1, b2, _, a1, a2) in enumerate(self.timing.sections):
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
