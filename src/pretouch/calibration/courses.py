"""Every curve that the readings allow: over families, offsets and parameters; and what they agree on about g.

One family with one offset knows its parameters to a percent; the readings do not know the family, and a pedestal that
is moved by a little bends another family through them as well. So each family of three parameters is fitted at each
offset that comes into question, side by side, and every fit keeps the weight that its sum of squares leaves it. What
all of them say together is what is known: the offset, and g at every distance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray

from .averaging import AveragedCurve, ReadingNoise, two_components
from .families import Family, InversePowerFamily, MittagLefflerFamily, SecondOrderFamily
from .many_fits import Fits, minimize_many
from .result import NoiseEstimate, OffsetEstimate

__all__ = ["HEAVIEST_KAPPA", "Course", "Courses", "Problem", "families_of", "find_courses", "find_noise", "fit_free"]

HEAVIEST_KAPPA: Final = 1 / 0.7
"""1 / n of the flattest inverse power that is considered."""

_EXPONENTIAL_KAPPA: Final = 1e-6
_SMALLEST: Final = 1e-9  # of the largest signal: exact numbers are fitted as if they had this noise
_FEWEST_REPEATED: Final = 2
_LARGEST_MISFIT: Final = 0.3
_USUAL: Final = 0.03  # a positioning error of 0.4 mm where the slope is 80 1/m
_FIRST_MISFIT: Final = 0.01
_SURE_OF_MISFIT: Final = 0.99
_ROUNDS: Final = 4
_FORM: Final = 4.0  # for the offset of a curve that no family is quite
_FLAT_TAIL: Final = 0.65  # of the logarithm of 2 / n
_BENDS: Final = 6.0  # places at which a misfit bends freely, over a window
_MOST_ALIKE: Final = 0.8  # of neighbors: more leaves no number of points to speak of
_SPREAD: Final = np.sinh(np.linspace(-3.0, 3.0, 21)) / np.sinh(3.0) * 8.0  # standard errors, denser in the middle
_NARROW: Final = np.linspace(-2.8, 2.8, 9)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One family on some points, fitted many times.

    Args:
        curve: the points.
        family: of the curves.
        noise: what weighs the points.
        offsets: of the fits, shape (b,); None where each finds its own, as a last parameter.
        weights: of each point in each fit, shape (b, n); None where all count alike.
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

    def starts(self, guess: float) -> FloatArray:
        """Return starts at an offset, one per row."""
        d, y = self.curve.distance, self.curve.output
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
    """Return the families of three parameters for the span of a curve."""
    first, last = float(curve.distance[0]), float(curve.distance[-1])
    return (
        InversePowerFamily(first=first, last=last, kappa_max=HEAVIEST_KAPPA, kappa_floor=_EXPONENTIAL_KAPPA),
        SecondOrderFamily(first=first, last=last),
        MittagLefflerFamily(first=first, last=last),
    )


def fit_free(curve: AveragedCurve, family: Family, noise: NoiseEstimate, offset: float | None) -> Fits:
    """Fit one family from several starts, with its own offset as the last parameter where none is given; b = 1."""
    guess = float(curve.output.min() - 0.02 * np.ptp(curve.output)) if offset is None else offset
    offsets = None if offset is None else np.array([offset])
    problem = Problem(curve=curve, family=family, noise=noise, offsets=offsets)
    starts = problem.starts(guess)
    many = problem if offsets is None else replace(problem, offsets=np.repeat(offsets, len(starts)))
    rough = minimize_many(many.residuals, starts, problem.bounds(), tolerance=1e-3, most=12)
    return problem.minimize(rough.x[[int(rough.costs.argmin())]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """The fits of one family, one for each of some offsets.

    Args:
        family: the family.
        offsets: increasing, shape (b,).
        x: the parameters at each, shape (b, 3).
        covariances: of them, at unit variance of the residuals, shape (b, 3, 3).
        costs: sums of squares, with what is known of the offset beforehand, shape (b,).
    """

    family: Family
    offsets: FloatArray
    x: FloatArray
    covariances: FloatArray
    costs: FloatArray

    def interval(self, level: float) -> tuple[float, float] | None:
        """Return between which offsets the cost lies below a level, along lines in its root; None where nowhere."""
        root = np.sqrt(np.maximum(self.costs - min(float(self.costs.min()), level), 0.0))
        below = np.flatnonzero(self.costs <= level)
        if not len(below):
            return None
        height, ends = float(np.sqrt(max(level - float(self.costs.min()), 0.0))), []
        for inner, outer in ((below[0], below[0] - 1), (below[-1], below[-1] + 1)):
            if not 0 <= outer < len(self.offsets):
                ends.append(float(self.offsets[inner]))
                continue
            share = (height - root[inner]) / max(root[outer] - root[inner], 1e-300)
            ends.append(float(self.offsets[inner] + share * (self.offsets[outer] - self.offsets[inner])))
        return ends[0], ends[1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Courses:
    """All curves that the readings allow.

    Args:
        parts: one for each family.
        form: by how much the squares count less for g, whose families a fitted offset rests on; 1 where it is known.
        inflation: by how much the squares exceed what noise and misfit explain; 1 where they do not.
        rise: of a sum of squares over the least, to the end of a 95 % interval.
    """

    parts: tuple[Course, ...]
    form: float
    inflation: float
    rise: float

    @property
    def least(self) -> float:
        """The least sum of squares."""
        return min(float(part.costs.min()) for part in self.parts)

    @property
    def best(self) -> Course:
        """The family that has it."""
        return min(self.parts, key=lambda part: float(part.costs.min()))

    def offset(self, kind: str) -> OffsetEstimate:
        """Return the offset with the interval in which any family lies within the rise of the best."""
        best = self.best
        at = int(best.costs.argmin())
        ends = [e for part in self.parts if (e := part.interval(self.least + self.rise)) is not None]
        low, high = min(e[0] for e in ends), max(e[1] for e in ends)
        value = float(best.offsets[at])
        return OffsetEstimate(
            value=value,
            standard_error=(high - low) / (2 * float(np.sqrt(self.rise))),
            low=float(low),
            high=float(high),
            kind=kind,
        )

    def weights(self) -> list[FloatArray]:
        """Return what weight each fit keeps, all together one."""
        found = []
        for part in self.parts:
            width = np.gradient(part.offsets) if len(part.offsets) > 1 else np.ones(1)
            excess = np.minimum((part.costs - self.least) / (self.inflation * self.form), 700.0)
            found.append(np.exp(-0.5 * excess) * width)
        total = sum(float(w.sum()) for w in found)
        return [w / total for w in found]

    def slope(self, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ln |g| at distances and its standard deviation, over all fits and within each."""
        rows, spreads, weights = [], [], []
        for part, weight in zip(self.parts, self.weights(), strict=True):
            kept = weight > 1e-6
            if not kept.any():
                continue
            x, covariance = part.x[kept], part.covariances[kept] * self.inflation * self.form
            log = np.log(np.maximum(-part.family.slope(x, distance), 1e-12))
            change = np.empty((*log.shape, x.shape[1]))
            for i in range(x.shape[1]):
                moved = x.copy()
                moved[:, i] += 1e-5
                change[..., i] = (np.log(np.maximum(-part.family.slope(moved, distance), 1e-12)) - log) / 1e-5
            rows.append(log)
            spreads.append(np.einsum("bnp,bpq,bnq->bn", change, covariance, change))
            weights.append(weight[kept])
        every, own, share = np.concatenate(rows), np.concatenate(spreads), np.concatenate(weights)
        share = share / share.sum()
        mean = share @ every
        variance = share @ (np.minimum(own, 4.0) + (every - mean) ** 2)
        return np.asarray(mean), np.asarray(np.sqrt(variance))


def find_noise(
    curve: AveragedCurve, known: ReadingNoise, offset: OffsetEstimate | None, families: tuple[Family, ...] = ()
) -> NoiseEstimate:
    """Tell noise, misfit and their sizes from repeats and from how far means lie from the curve that fits them best.

    Args:
        curve: the averaged readings.
        known: what repeats and readings without an object tell.
        offset: the offset, None where it is fitted.
        families: of curves; all of three parameters where none is named.

    Returns:
        The noise and the misfit.
    """
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
        fits = [fit_free(curve, family, found, value) for family in families]
        best = min(range(len(fits)), key=lambda i: float(fits[i].costs[0]))
        family, x = families[best], fits[best].x[0]
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
    row = miss / noise.of_means(curve.count, signal)
    if len(row) < 5 or noise.misfit == 0:
        return replace(noise, relative=noise.misfit, misfit=0.0)
    rough = float(np.mean(np.diff(row) ** 2) / 2 / max(float(np.mean(row**2)), 1e-300))
    if rough > 1 - 1.7 / np.sqrt(len(row)):
        return replace(noise, relative=noise.misfit, misfit=0.0)
    share = min(max(rough, 0.0), 1.0)
    return replace(noise, relative=noise.misfit * np.sqrt(share), misfit=noise.misfit * np.sqrt(1 - share))


def _misfit(curve: AveragedCurve, noise: NoiseEstimate, signal: FloatArray, miss: FloatArray, freedom: int) -> float:
    """Return the misfit with which squares add up to their number; 0 where chance explains them without it."""
    from scipy.optimize import brentq  # noqa: PLC0415 - SciPy is loaded only for fits
    from scipy.stats import chi2  # noqa: PLC0415

    def excess(misfit: float) -> float:
        return float(((miss / replace(noise, misfit=misfit).of_means(curve.count, signal)) ** 2).sum()) - freedom

    if excess(0.0) + freedom <= float(chi2.ppf(_SURE_OF_MISFIT, freedom)):
        return 0.0
    return float(brentq(excess, 0.0, _LARGEST_MISFIT)) if excess(_LARGEST_MISFIT) < 0 else _LARGEST_MISFIT


def _smooth_share(noise: NoiseEstimate, curve: AveragedCurve) -> float:
    """Return the share of misfit in what grows with xi."""
    return float(np.mean(noise.misfit**2 / noise.relative_of_means(curve.count) ** 2))


def find_courses(
    curve: AveragedCurve, noise: NoiseEstimate, known: OffsetEstimate | None, *, informed_by: int | None = None
) -> Courses:
    """Fit every family at every offset that comes into question.

    Args:
        curve: the averaged readings, five points or more (four where the offset is known).
        noise: of readings and means.
        known: the offset where it is measured or declared; None where the readings have to tell it.
        informed_by: how many points the noise was estimated from; those of the curve where None.

    Returns:
        The fits.
    """
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    parts = []
    for family in families_of(curve):
        free = fit_free(curve, family, noise, None if known is None else known.value)
        offsets = _offsets(curve, free, known)
        problem = Problem(curve=curve, family=family, noise=noise, offsets=offsets)
        start = np.repeat(free.x[:, :3], len(offsets), axis=0)
        found = problem.minimize(start)
        prior = _flat_tail(family, found.x)
        if known is not None and known.standard_error > 0:
            prior += ((offsets - known.value) / known.standard_error) ** 2
        parts.append(
            Course(
                family=family,
                offsets=offsets,
                x=found.x,
                covariances=found.covariances,
                costs=found.costs + prior,
            )
        )
    freedom = max((informed_by or len(curve.distance)) - 3 - (known is None), 1)
    best = min(parts, key=lambda part: float(part.costs.min()))
    at = int(best.costs.argmin())
    problem = Problem(curve=curve, family=best.family, noise=noise, offsets=best.offsets[at : at + 1])
    row = problem.residuals(best.x[at : at + 1], np.zeros(1, dtype=np.int64))[0]
    inflation = max(1.0, float(row @ row) / max(len(row) - 3 - (known is None), 1)) * _likeness(
        row, _smooth_share(noise, curve)
    )
    form = 1.0 if known is not None else _FORM
    return Courses(
        parts=tuple(parts), form=form, inflation=inflation, rise=float(stdtrit(freedom, 0.975)) ** 2 * inflation
    )


def _flat_tail(family: Family, x: FloatArray) -> FloatArray:
    """Return what a tail flatter than 1 / l^2 costs: light of a source of finite size does not fall so slowly.

    Readings that ask for it get it: n = 1 costs 1.1, and no exponent more than 3.8, the square of a 95 % interval.
    """
    if not isinstance(family, InversePowerFamily):
        return np.zeros(len(x))
    return np.asarray(np.minimum((np.maximum(np.log(2 * x[:, 2]), 0.0) / _FLAT_TAIL) ** 2, 3.8))


def _likeness(residuals: FloatArray, smooth: float) -> float:
    """Return by how much the variance of a fit grows because neighbors are off alike.

    What is smooth by nature, a misfit, tells no more at forty points than at the few that it is free to bend at. Else
    the correlation of neighbors tells (Bayley and Hammersley 1946), where it is more than chance.

    Args:
        residuals: of unit variance.
        smooth: the share of their variance that is misfit.
    """
    count, total = len(residuals), float(residuals @ residuals)
    bends = 1 + smooth * max(count / _BENDS - 1, 0.0)
    if count < 5 or total <= 0:
        return bends
    alike = float(residuals[1:] @ residuals[:-1]) / total
    alike = min(alike, _MOST_ALIKE) if alike > 1.7 / np.sqrt(count) else 0.0
    return max(bends, (1 + alike) / (1 - alike))


def _offsets(curve: AveragedCurve, free: Fits, known: OffsetEstimate | None) -> FloatArray:
    """Return the offsets at which a family is fitted."""
    if known is not None:
        return known.value + known.standard_error * (_NARROW if known.standard_error > 0 else np.zeros(1))
    reach = float(np.ptp(curve.output))
    error = np.sqrt(float(free.covariances[0, 3, 3])) or 0.1 * reach  # zero where it is at a bound
    error = float(np.clip(error, 1e-9 * reach, 0.3 * reach))
    found = free.x[0, 3] + error * _SPREAD
    top = float(curve.output.max())
    return np.unique(np.clip(found, lowest_offset(curve), top - 1e-3 * reach))
