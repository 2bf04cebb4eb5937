"""Fit sensor curves to averaged readings, and estimate noise and outliers from the residuals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch.sensors import Family, sensor_curves

from .averaging import MAD_TO_SIGMA, AveragedCurve, ReadingNoise, two_components
from .curve_residuals import CurveResiduals, Residuals
from .least_squares import Fits, minimize_many
from .result import NoiseEstimate, OffsetEstimate

_STEP: Final = 1e-5  # step of a family's parameter for finite differences


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """Least-squares fits of one curve family to averaged readings.

    There is one fit for each of many sensor offsets. The readings are weighted by their noise.

    The fits use the `offsets`, shape (b,); if `offsets` is None, each fit has its offset as the last parameter.
    `weights` has the weight of each point in each fit, shape (b, n); all weights are equal by default.
    """

    curve: AveragedCurve
    family: Family
    noise: NoiseEstimate
    offsets: FloatArray | None
    weights: FloatArray | BoolArray | None = None

    def residuals(self, u: FloatArray, which: IntArray) -> FloatArray:
        """Return the fit residuals after an asinh transformation, scaled to unit variance.

        Residuals are (h(y - o) - h(xi)) / c with h(z) = asinh(z / tau) and tau = sigma / (c sqrt n).
        """
        return self.function()(u, which)

    def function(self) -> Residuals:
        """Return the residuals as a function, with everything computed that does not depend on the parameters."""
        relative = self.noise.relative_of_means(self.curve.count)
        tau = np.maximum(self.noise.output, 1e-300) / np.sqrt(self.curve.count) / relative
        if self.family.number >= 0:
            return CurveResiduals(
                family=self.family,
                distances=self.curve.distance,
                outputs=self.curve.output,
                widths=tau,
                errors=relative,
                offsets=self.offsets,
                weights=self.weights,
            )
        log_tau, size, weights, output = np.log(tau), self.family.size, self.weights, self.curve.output
        log_output, distance = self.family.log_output, self.curve.distance
        known = None if self.offsets is None else np.arcsinh((output - self.offsets[:, None]) / tau)

        def residuals(u: FloatArray, which: IntArray) -> FloatArray:
            measured = np.arcsinh((output - u[:, -1:]) / tau) if known is None else known[which]
            log_ratio = log_output(u[:, :size], distance) - log_tau
            rows = (measured - np.arcsinh(np.exp(np.minimum(log_ratio, 300)))) / relative
            return np.asarray(rows if weights is None else rows * weights[which])

        return residuals

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lower and upper bounds of the fit parameters."""
        low, high = self.family.bounds
        if self.offsets is not None:
            return low, high
        return np.append(low, lowest_offset(self.curve)), np.append(high, self.curve.output.max())

    def minimize(self, start: FloatArray) -> Fits:
        """Solve each fit problem from a single start point."""
        return minimize_many(self.function(), start, self.bounds())

    def minimize_from_afar(self, count: int, bounds: tuple[FloatArray, FloatArray]) -> Fits:
        """Solve the first `count` fit problems from several start points.

        The best coarse results are then refined.

        Returns:
            The fits.
        """
        rows, problems = self._starts(), np.arange(count)
        which, residuals = np.tile(problems, len(rows)), self.function()
        rough = minimize_many(
            residuals, np.repeat(rows, count, axis=0), bounds, problems=which, tolerance=1e-3, most=15
        )
        best = rough.costs.reshape(len(rows), count).argmin(axis=0)
        return minimize_many(residuals, rough.x.reshape(len(rows), count, -1)[best, problems], bounds)

    def _starts(self) -> FloatArray:
        """Return several start points of a fit, one in each row.

        The start offset is the first offset, or a value just below the lowest output.
        """
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
    """Return the lower bound of the fitted sensor offset.

    The bound is not far below 0 if no output is negative.
    """
    lowest, reach = float(curve.output.min()), float(np.ptp(curve.output))
    return lowest - reach if lowest < 0 else max(-0.1 * reach, lowest - reach)


def families_of(curve: AveragedCurve, named: tuple[str, ...] = ()) -> tuple[Family, ...]:
    """Return the curve families that the readings may have.

    These are the built-in families of three parameters, the fast ones first, and the installed curves among `named`.
    """
    first, last = float(curve.distance[0]), float(curve.distance[-1])
    curves = sorted(sensor_curves().values(), key=lambda curve: curve.name, reverse=True)
    ordered = [c for c in curves if c.family.quick] + [c for c in curves if not c.family.quick]
    built_in = tuple(c.family.at_large(c, first, last) for c in ordered if c.family.informs)
    others = {name: c for name, c in sensor_curves(foreign=True).items() if name not in sensor_curves()}
    return (*built_in, *(others[name].family.at_large(others[name], first, last) for name in named if name in others))


def quick_families(curve: AveragedCurve) -> tuple[Family, ...]:
    """Return the families of sensor curves that are fast to evaluate.

    These are all families except the Mittag-Leffler curve.
    """
    return tuple(f for f in families_of(curve) if f.quick)


def problem_at(curve: AveragedCurve, family: Family, noise: NoiseEstimate, offset: float | None) -> Problem:
    """Return the fit problem for one sensor offset.

    The offset is also fitted if it is None.
    """
    offsets = None if offset is None else np.array([offset])
    return Problem(curve=curve, family=family, noise=noise, offsets=offsets)


def fit_free(curve: AveragedCurve, family: Family, noise: NoiseEstimate, offset: float | None) -> Fits:
    """Fit one curve family from several start points.

    The offset is also fitted if it is None.

    Returns:
        The fit.
    """
    problem = problem_at(curve, family, noise, offset)
    return problem.minimize_from_afar(1, problem.bounds())


def forward_change(
    function: Callable[[FloatArray, FloatArray], FloatArray], u: FloatArray, distance: FloatArray
) -> FloatArray:
    """Differentiate a function with respect to each fit parameter.

    The derivatives are forward finite differences. Parameters of shape (..., p) give derivatives of shape (p, ...).

    Returns:
        The derivatives.
    """
    size = u.shape[-1]
    moved = u + _STEP * np.eye(size).reshape(size, *[1] * (u.ndim - 1), size)
    return (function(moved, distance) - function(u, distance)) / _STEP


_SMALLEST: Final = 1e-6  # noise over the largest signal with which exact numbers are fitted
_FEWEST_REPEATED: Final = 2  # with at most so many distances with repeats, the relative noise is undetermined
_LARGEST_MISFIT: Final = 0.3
_USUAL: Final = 0.03  # usual misfit: a positioning error of 0.4 mm at a slope of 80 1/m
_FIRST_MISFIT: Final = 0.01  # start of the iteration
_SURE_OF_MISFIT: Final = 0.99  # confidence level from which on a misfit is reported
_MISFIT_TOLERANCE: Final = 1e-9
_ROUNDS: Final = 4
_NOT_CONVERGED: Final = 30.0  # residuals over the noise of the round before, above which a fit has not converged


def find_noise(
    curve: AveragedCurve, raw_noise: ReadingNoise, offset: OffsetEstimate | None, families: tuple[Family, ...] = ()
) -> NoiseEstimate:
    """Estimate the noise of the readings.

    Also estimate the fixed error (misfit) of the best-fitting sensor curve. The offset is None if it is fitted. By
    default, all families of three parameters are fitted.

    Returns:
        The noise and the misfit.
    """
    value = None if offset is None else offset.value
    freedom = max(len(curve.distance) - 3 - (value is None), 1)
    reach = max(float(np.ptp(curve.output)), 1e-12 * float(np.abs(curve.output).max()), 1e-300)
    floor = max(raw_noise.resolution / np.sqrt(12.0), _SMALLEST * reach)
    repeated = raw_noise.sigma is not None and bool((curve.count > 1).sum() > _FEWEST_REPEATED)
    noise = NoiseEstimate(
        output=max(raw_noise.sigma or 0.01 * reach, floor),
        relative=raw_noise.jitter if repeated else 0.0,
        misfit=_FIRST_MISFIT,
        resolution=raw_noise.resolution,
    )
    families = families or families_of(curve)
    residuals, signal = np.zeros_like(curve.output), curve.output
    for round_number in range(_ROUNDS):
        fits = [(family, fit_free(curve, family, noise, value)) for family in families]
        family, best = min(fits, key=lambda pair: float(pair[1].costs[0]))
        x = best.x[0]
        level = np.exp(np.minimum(family.log_output(x[:3], curve.distance), 300.0))
        deviations = curve.output - (x[3] if value is None else value) - level
        if round_number > 0 and raw_noise.sigma is None:
            ratios = deviations / noise.of_means(np.ones_like(level), level)
            if float((ratios**2).mean()) > _NOT_CONVERGED**2:  # weights of nearly exact readings stop the descent early
                break
        residuals, signal = deviations, level
        before = noise.misfit
        if raw_noise.sigma is None:
            sigma, relative = two_components(
                residuals**2 * len(residuals) / freedom, np.ones(len(residuals)), signal, usual=_USUAL
            )
            noise = replace(noise, output=float(max(sigma, floor)), misfit=min(relative, _LARGEST_MISFIT))
        else:
            noise = replace(noise, misfit=_misfit(curve, noise, signal, residuals, freedom))
        if abs(np.log((noise.misfit + 1e-4) / (before + 1e-4))) < 0.05:  # 1e-4: smaller misfits do not matter
            break
    if not repeated:
        noise = _separate_noise_from_misfit(curve, noise, signal, residuals)
    crossings = max(int((np.diff(np.sign(residuals)) != 0).sum()), 1)
    span = float(curve.distance[-1] - curve.distance[0])
    source = raw_noise.source if raw_noise.sigma is not None else "residuals of the fitted curve"
    if raw_noise.sigma is None and noise.output <= 1.01 * raw_noise.resolution / np.sqrt(12.0):
        source = "quantization (the residuals are smaller)"
    return replace(
        noise,
        misfit_length=span / (np.pi * crossings)
        if noise.misfit > 0
        else 0.0,  # from the rate of zero crossings of a smooth normal process (Rice 1944)
        output_source=source,
        relative_source="repeats" if repeated else "differences between neighboring distances",
    )


def _separate_noise_from_misfit(
    curve: AveragedCurve, noise: NoiseEstimate, signal: FloatArray, residuals: FloatArray
) -> NoiseEstimate:
    """Separate random noise from the systematic error of the fitted curve.

    For this, the residuals at neighboring distances are compared.

    Returns:
        The noise with both parts.
    """
    row, share = residuals / noise.of_means(curve.count, signal), 1.0
    if len(row) >= 5 and noise.misfit > 0:
        rough = float(np.mean(np.diff(row) ** 2) / 2 / max(float(np.mean(row**2)), 1e-300))
        share = rough if rough <= 1 - 1.7 / np.sqrt(len(row)) else 1.0
    return replace(noise, relative=noise.misfit * math.sqrt(share), misfit=noise.misfit * math.sqrt(1 - share))


def _misfit(
    curve: AveragedCurve, noise: NoiseEstimate, signal: FloatArray, residuals: FloatArray, freedom: int
) -> float:
    """Return the systematic error of the fitted sensor curve.

    This misfit is 0 if noise explains the residuals.

    With this misfit, chi squared equals its degrees of freedom.
    """
    from scipy.special import gammaincinv  # noqa: PLC0415 - SciPy is loaded only for fits

    def excess(misfit: float) -> float:
        return float(((residuals / replace(noise, misfit=misfit).of_means(curve.count, signal)) ** 2).sum()) - freedom

    if excess(0.0) + freedom <= 2 * float(gammaincinv(freedom / 2, _SURE_OF_MISFIT)):  # the quantile of chi squared
        return 0.0
    low, high = 0.0, _LARGEST_MISFIT
    while high - low > _MISFIT_TOLERANCE and excess(_LARGEST_MISFIT) < 0:
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return high


_LEVEL: Final = 0.02  # probability of a false outlier distance per curve
_SUSPECT: Final = 4.0  # robust standard deviations from which on a distance is tested
_CONSPICUOUS: Final = 3.0  # smallest residual of an outlier, over the RMS residual of the other means
_NEGLIGIBLE: Final = 1e-4  # smallest residual of an outlier, over the largest signal
_FEWEST: Final = 6  # distances needed to look for outliers
_ISOLATED: Final = 2.5  # ratio of the largest distance to the next one from which on the largest one is isolated
_FREEDOM: Final = 3.0  # degrees of freedom of the prior of the error
_AS_GOOD: Final = 10.0  # times the smallest sum of squares, up to which a family describes the readings


def outlier_indices(curve: AveragedCurve, raw_noise: ReadingNoise, offset: OffsetEstimate | None) -> tuple[int, ...]:
    """Return the indices of distances with outliers.

    At these distances, the mean reading deviates significantly from all fitted curves.

    The test is Student's t with Bonferroni's correction. A mean is compared with the residuals of the other means,
    whatever their numbers of readings. If fifty readings deviate as much as others, their deviation is misfit, so they
    are not outliers. The nearest distance is never tested, because no nearer reading confirms the curve. A far larger
    distance than all others is not tested either: `is_isolated`.
    """
    outliers: list[int] = []
    remaining = np.arange(len(curve.distance))
    while len(remaining) >= _FEWEST and len(outliers) < max(1, len(curve.distance) // 8):
        worst = _worst_outlier(curve.part(remaining), raw_noise, offset)
        if worst is None:
            break
        others = np.delete(remaining, worst)
        if not np.ptp(curve.output[others]) > 0:  # equal outputs are no curve from which one could deviate
            break
        outliers.append(int(remaining[worst]))
        remaining = others
    return tuple(sorted(outliers))


def _worst_outlier(curve: AveragedCurve, raw_noise: ReadingNoise, offset: OffsetEstimate | None) -> int | None:
    families = quick_families(curve)
    noise = find_noise(curve, raw_noise, offset, families)
    value = None if offset is None else offset.value
    suspects: dict[int, None] = {}
    tested = len(curve.distance) - is_isolated(curve)
    for family in families:
        row = np.abs(_robust_residuals(curve, family, noise, value))
        suspects |= {int(i): None for i in np.argsort(-row)[:2] if 0 < i < tested and row[i] > _SUSPECT}
    return next((i for i in suspects if is_outlier(curve, i, raw_noise, offset, families)), None)


def is_isolated(curve: AveragedCurve) -> bool:
    """Return True if the largest distance is far larger than all others, which are enough to judge it by.

    It may be a code for no object or a typing error, so it is tested on its own.
    """
    distance = curve.distance
    return len(distance) > _FEWEST and bool(distance[-1] >= _ISOLATED * distance[-2])


def _robust_residuals(curve: AveragedCurve, family: Family, noise: NoiseEstimate, value: float | None) -> FloatArray:
    """Return the normalized residuals of an outlier-resistant curve fit.

    They are divided by their robust standard deviation.
    """
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


def is_outlier(
    curve: AveragedCurve, i: int, raw_noise: ReadingNoise, offset: OffsetEstimate | None, families: tuple[Family, ...]
) -> bool:
    """Return True if the reading at one distance is an outlier.

    It must be an outlier for every family of sensor curves that describes the other readings. A family that does not
    describe them fits none of the readings, and so shows no outlier either.
    """
    from scipy.special import stdtr  # noqa: PLC0415 - SciPy is loaded only for fits

    part = curve.part(np.arange(len(curve.distance)) != i)
    value = None if offset is None else offset.value
    freedom = len(part.distance) - 3 - (value is None)
    if freedom < 2:
        return False
    noise = find_noise(part, raw_noise, offset, families)
    p_value, fits = 0.0, [(family, fit_free(part, family, noise, value)) for family in families]
    limit = _AS_GOOD * (_FREEDOM + min(float(fit.costs[0]) for _, fit in fits))
    for family, fit in fits:
        if not fit.costs[0] <= limit:
            continue
        x, base_offset = fit.x[0], fit.x[0][-1] if value is None else value
        at, u = curve.distance[[i]], x[: family.size]

        def output(v: FloatArray, distance: FloatArray, family: Family = family) -> FloatArray:
            return np.exp(family.log_output(v, distance))

        signal = float(output(u, at)[0])
        change = np.append(forward_change(output, u, at)[:, 0], [1.0] if value is None else [])
        inflation = max(1.0, float(fit.costs[0]) / freedom)
        variance = inflation * float(change @ fit.covariances[0] @ change)
        error = float(noise.of_means(curve.count[[i]], np.array([signal]))[0])
        residual = abs(float(curve.output[i]) - base_offset - signal)
        signals = output(u, part.distance)
        relative = (part.output - base_offset - signals) / np.maximum(signals, 1e-300)
        near = signals > 0.2 * signal  # much smaller signals have larger relative residuals
        typical = float(np.sqrt(np.mean(relative[near] ** 2))) * signal if near.any() else 0.0
        if residual < max(_CONSPICUOUS * typical, _NEGLIGIBLE * float(signals.max())):
            return False
        p_value = max(p_value, 2 * float(stdtr(freedom, -residual / np.sqrt(variance + inflation * error**2))))
    return p_value < _LEVEL / len(curve.distance)
