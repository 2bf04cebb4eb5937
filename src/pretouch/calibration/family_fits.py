"""Fit curve families to averaged readings, estimate noise and misfit from the residuals, find outlier distances."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch.sensors import Family, known_curves

from .averaging import MAD_TO_SIGMA, AveragedCurve, ReadingNoise, two_components
from .least_squares import Fits, minimize_many
from .result import NoiseEstimate, OffsetEstimate

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


_SMALLEST: Final = 1e-9  # of the largest signal: exact numbers are fitted as if they had this noise
_FEWEST_REPEATED: Final = 2
_LARGEST_MISFIT: Final = 0.3
_USUAL: Final = 0.03  # a positioning error of 0.4 mm where the slope is 80 1/m
_FIRST_MISFIT: Final = 0.01
_SURE_OF_MISFIT: Final = 0.99
_MISFIT_KNOWN: Final = 1e-9  # to which it is found
_ROUNDS: Final = 4


def find_noise(
    curve: AveragedCurve, known: ReadingNoise, offset: OffsetEstimate | None, families: tuple[Family, ...] = ()
) -> NoiseEstimate:
    """Tell noise and misfit from repeats and from how far means lie from the curve that fits them best."""
    # The offset is None where it is fitted; all families of three parameters take part where none is named.
    value = None if offset is None else offset.value
    freedom = max(len(curve.distance) - 3 - (value is None), 1)
    reach = max(float(np.ptp(curve.output)), 1e-12 * float(np.abs(curve.output).max()), 1e-300)
    floor = max(known.resolution / np.sqrt(12.0), _SMALLEST * reach)
    repeated = known.sigma is not None and bool((curve.count > 1).sum() > _FEWEST_REPEATED)
    found = NoiseEstimate(
        output=max(known.sigma or 0.01 * reach, floor),
        relative=known.jitter if repeated else 0.0,
        misfit=_FIRST_MISFIT,
        resolution=known.resolution,
    )
    families = families or families_of(curve)
    miss, signal = np.zeros_like(curve.output), curve.output
    for _ in range(_ROUNDS):
        fits = [(family, fit_free(curve, family, found, value)) for family in families]
        family, best = min(fits, key=lambda pair: float(pair[1].costs[0]))
        x = best.x[0]
        signal = np.exp(np.minimum(family.log_output(x[:3], curve.distance), 300.0))
        miss = curve.output - (x[3] if value is None else value) - signal
        before = found.misfit
        if known.sigma is None:
            own, relative = two_components(miss**2 * len(miss) / freedom, np.ones(len(miss)), signal, usual=_USUAL)
            found = replace(found, output=float(max(own, floor)), misfit=min(relative, _LARGEST_MISFIT))
        else:
            found = replace(found, misfit=_misfit(curve, found, signal, miss, freedom))
        if abs(np.log((found.misfit + 1e-4) / (before + 1e-4))) < 0.05:  # 1e-4: nothing is known better
            break
    if not repeated:
        found = _parted(curve, found, signal, miss)
    crossings = max(int((np.diff(np.sign(miss)) != 0).sum()), 1)
    span = float(curve.distance[-1] - curve.distance[0])
    source = known.source if known.sigma is not None else "scatter about the fitted curve"
    if known.sigma is None and found.output <= 1.01 * known.resolution / np.sqrt(12.0):
        source = "quantization (the fit scatters less)"
    return replace(
        found,
        misfit_length=span / (np.pi * crossings) if found.misfit > 0 else 0.0,  # Rice 1944: of a smooth normal process
        output_source=source,
        relative_source="repeats" if repeated else "scatter between neighboring distances",
    )


def _parted(curve: AveragedCurve, noise: NoiseEstimate, signal: FloatArray, miss: FloatArray) -> NoiseEstimate:
    """Tell noise from misfit where no distance was read twice: what neighbors do not share is noise."""
    row, share = miss / noise.of_means(curve.count, signal), 1.0
    if len(row) >= 5 and noise.misfit > 0:
        rough = float(np.mean(np.diff(row) ** 2) / 2 / max(float(np.mean(row**2)), 1e-300))
        share = rough if rough <= 1 - 1.7 / np.sqrt(len(row)) else 1.0
    return replace(noise, relative=noise.misfit * math.sqrt(share), misfit=noise.misfit * math.sqrt(1 - share))


def _misfit(curve: AveragedCurve, noise: NoiseEstimate, signal: FloatArray, miss: FloatArray, freedom: int) -> float:
    """Return the misfit with which squares add up to their number; 0 where chance explains them without it."""
    from scipy.special import gammaincinv  # noqa: PLC0415 - SciPy is loaded only for fits

    def excess(misfit: float) -> float:
        return float(((miss / replace(noise, misfit=misfit).of_means(curve.count, signal)) ** 2).sum()) - freedom

    if excess(0.0) + freedom <= 2 * float(gammaincinv(freedom / 2, _SURE_OF_MISFIT)):  # the quantile of chi squared
        return 0.0
    low, high = 0.0, _LARGEST_MISFIT
    while high - low > _MISFIT_KNOWN and excess(_LARGEST_MISFIT) < 0:
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return high


_LEVEL: Final = 0.02  # chance of naming a distance of a curve that has no bad one
_SUSPECT: Final = 4.0  # robust standard deviations
_CONSPICUOUS: Final = 3.0  # times what lies between the curve and the other means, all together
_NEGLIGIBLE: Final = 1e-4  # of the largest signal: no bad reading, however exact all others are
_FEWEST: Final = 6


def bad_distances(curve: AveragedCurve, known: ReadingNoise, offset: OffsetEstimate | None) -> tuple[int, ...]:
    """Find the indices of distances whose mean lies beyond what chance allows from a curve fitted without it."""
    # The test is Student's t, with Bonferroni's level. What is judged by is how far the other means lie from their
    # curve, however many readings each is of: fifty readings that are all off by what others are off, too, are misfit,
    # and stay. The nearest distance is never judged: nothing confirms the curve there.
    found: list[int] = []
    kept = np.arange(len(curve.distance))
    while len(kept) >= _FEWEST and len(found) < max(1, len(curve.distance) // 8):
        worst = _worst(curve.part(kept), known, offset)
        if worst is None:
            break
        found.append(int(kept[worst]))
        kept = np.delete(kept, worst)
    return tuple(sorted(found))


def _worst(curve: AveragedCurve, known: ReadingNoise, offset: OffsetEstimate | None) -> int | None:
    families = quick_families(curve)
    noise = find_noise(curve, known, offset, families)
    value = None if offset is None else offset.value
    suspects: dict[int, None] = {}
    for family in families:
        row = np.abs(_robust(curve, family, noise, value))
        suspects |= {int(i): None for i in np.argsort(-row)[:2] if i > 0 and row[i] > _SUSPECT}
    return next((i for i in suspects if _is_bad(curve, i, known, offset, families)), None)


def _robust(curve: AveragedCurve, family: Family, noise: NoiseEstimate, value: float | None) -> FloatArray:
    """Return residuals about a fit that outliers hardly move, over their robust standard deviation."""
    row = weight = np.ones(len(curve.distance))
    x = fit_free(curve, family, noise, value).x
    problem = problem_at(curve, family, noise, value)
    for _ in range(8):
        x = replace(problem, weights=weight[None]).minimize(x).x
        row = problem.residuals(x, np.zeros(1, int))[0]
        row = row / max(MAD_TO_SIGMA * float(np.median(np.abs(row))), 1e-12)
        weight = 1 / np.maximum(1.0, np.abs(row) / 1.5)
        weight[np.abs(row) > _SUSPECT] *= 0.1
    return row


def _is_bad(
    curve: AveragedCurve, i: int, known: ReadingNoise, offset: OffsetEstimate | None, families: tuple[Family, ...]
) -> bool:
    """Judge one distance by a curve through all others, of the family that meets it best."""
    from scipy.special import stdtr  # noqa: PLC0415 - SciPy is loaded only for fits

    part = curve.part(np.arange(len(curve.distance)) != i)
    value = None if offset is None else offset.value
    freedom = len(part.distance) - 3 - (value is None)
    if freedom < 2:
        return False
    noise = find_noise(part, known, offset, families)
    chance = 0.0
    for family in families:
        fit = fit_free(part, family, noise, value)
        x, base = fit.x[0], fit.x[0][-1] if value is None else value
        at, u = curve.distance[[i]], x[: family.size]

        def output(v: FloatArray, distance: FloatArray, family: Family = family) -> FloatArray:
            return np.exp(family.log_output(v, distance))

        signal = float(output(u, at)[0])
        change = np.append(forward_change(output, u, at)[:, 0], [1.0] if value is None else [])
        inflation = max(1.0, float(fit.costs[0]) / freedom)
        variance = inflation * float(change @ fit.covariances[0] @ change)
        own = float(noise.of_means(curve.count[[i]], np.array([signal]))[0])
        miss = abs(float(curve.output[i]) - base - signal)
        others = output(u, part.distance)
        relative = (part.output - base - others) / np.maximum(others, 1e-300)
        near = others > 0.2 * signal  # what is much smaller is off by more of itself
        typical = float(np.sqrt(np.mean(relative[near] ** 2))) * signal if near.any() else 0.0
        if miss < max(_CONSPICUOUS * typical, _NEGLIGIBLE * float(others.max())):
            return False
        chance = max(chance, 2 * float(stdtr(freedom, -miss / np.sqrt(variance + inflation * own**2))))
    return chance < _LEVEL / len(curve.distance)
