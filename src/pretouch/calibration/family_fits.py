"""A family of curves fitted to averaged readings, many times at once: with given offsets, or each with its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch.sensors import Family, known_curves

from .averaging import AveragedCurve
from .many_fits import Fits, minimize_many
from .result import NoiseEstimate

__all__ = ["Problem", "families_of", "fit_free", "forward_change", "lowest_offset", "problem_at", "quick_families"]

_STEP: Final = 1e-5  # of a family's parameter, for differences


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One family on some points, which the noise weighs, fitted many times.

    The fits have offsets, shape (b,), or each finds its own, as a last parameter; `weights` are those of each point in
    each fit, shape (b, n), or all count alike.
    """

    curve: AveragedCurve
    family: Family
    noise: NoiseEstimate
    offsets: FloatArray | None
    weights: FloatArray | BoolArray | None = None

    def residuals(self, u: FloatArray, which: IntArray) -> FloatArray:
        """Return (h(y - o) - h(xi)) / c with h(z) = asinh(z / tau), tau = sigma / (c sqrt n): of unit variance."""
        relative = self.noise.relative_of_means(self.curve.count)
        tau = np.maximum(self.noise.output, 1e-300) / np.sqrt(self.curve.count) / relative
        offset = u[:, -1:] if self.offsets is None else self.offsets[which][:, None]
        measured = np.arcsinh((self.curve.output - offset) / tau)
        log_ratio = self.family.log_output(u[:, : self.family.size], self.curve.distance) - np.log(tau)
        found = (measured - np.arcsinh(np.exp(np.minimum(log_ratio, 300)))) / relative
        return np.asarray(found if self.weights is None else found * self.weights[which])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the bounds of the parameters."""
        low, high = self.family.bounds
        if self.offsets is not None:
            return low, high
        return np.append(low, lowest_offset(self.curve)), np.append(high, self.curve.output.max())

    def minimize(self, start: FloatArray) -> Fits:
        """Fit from one start each."""
        return minimize_many(self.residuals, start, self.bounds())

    def minimize_from_afar(self, count: int, bounds: tuple[FloatArray, FloatArray]) -> Fits:
        """Fit each of the first problems within bounds, from several starts; the best is followed to its end."""
        rows, every = self._starts(), np.arange(count)
        which = np.tile(every, len(rows))

        def each(u: FloatArray, number: IntArray) -> FloatArray:
            return self.residuals(u, which[number])

        rough = minimize_many(each, np.repeat(rows, count, axis=0), bounds, tolerance=1e-3, most=15)
        best = rough.costs.reshape(len(rows), count).argmin(axis=0)
        return minimize_many(self.residuals, rough.x.reshape(len(rows), count, -1)[best, every], bounds)

    def _starts(self) -> FloatArray:
        """Return starts at the first offset, or one just below the lowest output; one per row."""
        d, y = self.curve.distance, self.curve.output
        guess = float(y.min() - 0.02 * np.ptp(y) if self.offsets is None else self.offsets[0])
        reach = float(np.ptp(y)) or max(abs(float(y[0])), 1.0)
        third = max(2, len(d) // 3)
        xi = np.log(np.maximum(y - guess, 0.01 * reach))
        middle = float(np.interp(self.family.middle, d, xi))
        steep = min(float(np.polyfit(d[:third], xi[:third], 1)[0]), -0.1 / self.family.span)
        rows = []
        for bend in (0.05, 0.3, 0.8):
            slope = steep * (1 - 0.5 * bend)
            start = np.clip(self.family.start(middle, slope, bend * slope**2), *self.family.bounds)
            rows.append(np.append(start, guess) if self.offsets is None else start)
        return np.array(rows)


def lowest_offset(curve: AveragedCurve) -> float:
    """Return the lowest offset that is looked for: hardly below zero where no output is negative."""
    lowest, reach = float(curve.output.min()), float(np.ptp(curve.output))
    return lowest - reach if lowest < 0 else max(-0.1 * reach, lowest - reach)


def families_of(curve: AveragedCurve) -> tuple[Family, ...]:
    """Return the families that inform, for the span of a curve, the quick ones first."""
    first, last = float(curve.distance[0]), float(curve.distance[-1])
    curves = sorted(known_curves().values(), key=lambda curve: curve.name, reverse=True)
    ordered = [c for c in curves if c.family.quick] + [c for c in curves if not c.family.quick]
    return tuple(c.family.at_large(c, first, last) for c in ordered if c.family.informs)


def quick_families(curve: AveragedCurve) -> tuple[Family, ...]:
    """Return those of the families that take a small part of the time: all but the Mittag-Leffler curve."""
    return tuple(f for f in families_of(curve) if f.quick)


def problem_at(curve: AveragedCurve, family: Family, noise: NoiseEstimate, offset: float | None) -> Problem:
    """Return the problem of one fit at an offset, or with its own where none is given."""
    offsets = None if offset is None else np.array([offset])
    return Problem(curve=curve, family=family, noise=noise, offsets=offsets)


def fit_free(curve: AveragedCurve, family: Family, noise: NoiseEstimate, offset: float | None) -> Fits:
    """Fit one family from several starts, with its own offset as the last parameter where none is given; b = 1."""
    problem = problem_at(curve, family, noise, offset)
    return problem.minimize_from_afar(1, problem.bounds())


def forward_change(
    function: Callable[[FloatArray, FloatArray], FloatArray], u: FloatArray, distance: FloatArray
) -> FloatArray:
    """Differentiate a function of parameters u, shape (..., p), and distances by each parameter, shape (p, ...)."""
    size = u.shape[-1]
    moved = u + _STEP * np.eye(size).reshape(size, *[1] * (u.ndim - 1), size)
    return (function(moved, distance) - function(u, distance)) / _STEP
