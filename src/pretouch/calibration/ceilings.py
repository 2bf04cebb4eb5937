"""Fit sensor curves that saturate near the sensor, or that ignore a nearest reading which may be wrong.

An amplifier or converter that saturates softly turns the ideal output xi into xi / (1 + (xi / C)^p)^(1/p) with a
ceiling C and a sharpness p. Each family of ideal curves is fitted under every ceiling of a grid (the infinite one
included) and at every plausible offset. The weight of a fit is its posterior probability, with the scale of the errors
integrated out. The weights give the probability that a reading lies in the flattened part, for 6 readings as for 50.

No nearer reading confirms the nearest one, and it decides the slope near contact. So each family is also fitted without
it. The weight of these fits is the probability that the nearest reading is wrong. It is large if the reading does not
agree with the curve through the others, and small if it agrees or if the other readings do not predict it.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.sensors import Family, PiecewiseCubic, sensor_curves

from .averaging import AveragedCurve, ReadingNoise
from .curve_residuals import CurveResiduals, Residuals
from .family_fits import families_of, forward_change, lowest_offset
from .least_squares import Fits, minimize_many
from .result import DrawnCurve, OffsetEstimate

_ABOVE: Final = (0.003, 0.01, 0.03, 0.08, 0.15, 0.3, 0.5, 0.8, 1.2)  # ln of the ceiling over the largest signal
_SHARPNESS: Final = (2.0, 3.5, 7.0)
_CEILING: Final = 0.5  # prior probability that the output has a ceiling near the readings
ERROR: Final = 0.01  # usual error of a reading relative to the signal: noise, positioning and the family together
_ERROR_FREEDOM: Final = 3.0  # degrees of freedom of the prior of the usual error
_FULL_WEIGHT: Final = 18  # most readings that sharpen the posterior, because families are not exact
_FLAT: Final = 0.85  # share of the ideal slope below which a reading counts as flattened
_PROBABLY: Final = 0.35  # probability of flattening from which on a reading is not used
_KNOWN_OFFSETS: Final = np.linspace(-2.0, 2.0, 5)  # standard errors around a known offset
_INTERVAL: Final = (0.025, 0.975)
_FITTED_OFFSETS: Final = (
    np.sinh(np.linspace(-2.0, 2.0, 11)) / np.sinh(2.0) * 5.0
)  # standard errors around a fitted offset
_STEEPEST: Final = (0.7, 1.5, 3.0)  # start slopes of the fits, over the steepest slope of the readings
_BENDS: Final = (0.1, 0.6)  # start curvatures of ln xi in the fits, over the squared slope
_KNOTS: Final = 60  # points of a drawn curve
_FEWEST: Final = 6  # distances needed to judge the nearest reading by the others
_WRONG: Final = 0.1  # prior probability that a single nearest reading is wrong
_WRONG_SIZE: Final = 10.0  # usual errors: median size of the error of a wrong reading


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleOptions(Value):
    """What a user knows about the sensor curve.

    Args:
        models: names of the models that are fitted; curves from outside are possible curves only if they are named.
        may_saturate: whether the output may saturate near the sensor.
    """

    models: tuple[str, ...]
    may_saturate: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lanes(Value):
    """Fits of one curve family for several saturation levels.

    There is one fit for each pair of sensor offset and saturation level. `offsets`, ln of the `ceilings` (inf for none)
    and their `sharpness` have the shape (b,).

    Parameters x have the shape (b, p), their `covariances` at unit variance of the residuals (b, p, p). `costs` are
    sums of squares in units of the usual error; `priors` are -2 ln of the prior of the offset and of the curve.
    `ignored` is the distance of the reading that a fit ignores [m]; NaN for none.
    """

    family: Family
    offsets: FloatArray
    ceilings: FloatArray
    sharpness: FloatArray
    x: FloatArray
    covariances: FloatArray
    costs: FloatArray
    priors: FloatArray
    ignored: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class CeilingFits(Value):
    """Fits of sensor curves that saturate near the sensor.

    Each fit has a posterior probability.

    Args:
        lanes: the fits, one element for each family.
        weights: the probability of each fit, shape (b,) each; all add up to 1.
        readings: the number of distances to which the curves were fitted.
    """

    lanes: tuple[_Lanes, ...]
    weights: tuple[FloatArray, ...]
    readings: int

    @property
    def error(self) -> float:
        """The relative standard error of a reading.

        It is estimated from the residuals of the most probable fit.
        """
        lanes, weight = max(zip(self.lanes, self.weights, strict=True), key=lambda pair: float(pair[1].max()))
        cost = float(lanes.costs[int(weight.argmax())])
        counted = self.readings - 3 - int(np.isfinite(lanes.ignored[int(weight.argmax())]))
        return ERROR * float(np.sqrt((_ERROR_FREEDOM + cost) / (_ERROR_FREEDOM + max(counted, 1))))

    @property
    def nearest(self) -> float:
        """The smallest distance of the fitted readings [m]."""
        return float(self.lanes[0].family.first)

    @property
    def nearest_is_wrong(self) -> float:
        """The probability that the nearest reading is wrong."""
        pairs = zip(self.lanes, self.weights, strict=True)
        return float(sum(weight[np.isfinite(lanes.ignored)].sum() for lanes, weight in pairs))

    def flattened(self, distance: FloatArray) -> FloatArray:
        """Return the probability of saturation at each distance.

        Saturation means here that the sensor slope is reduced by more than 15 %.

        The slope is compared with that of the ideal curve; distances [m] and probabilities have the shape (N,). A fit
        that ignores a reading cannot tell whether the output is flat there.
        """
        probability, total = np.zeros(len(distance)), 0.0
        for lanes, weight in zip(self.lanes, self.weights, strict=True):
            complete = weight * np.isnan(lanes.ignored)
            level = lanes.family.log_output(lanes.x, distance)
            probability += complete @ (_under(level, lanes.ceilings[:, None], lanes.sharpness[:, None])[1] < _FLAT)
            total += float(complete.sum())
        return probability / max(total, 1e-300)

    def offset_interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the sensor offset.

        The interval is in the unit of the sensor outputs.
        """
        offsets = np.concatenate([lanes.offsets for lanes in self.lanes])
        order = np.argsort(offsets)
        reached = np.cumsum(np.concatenate(self.weights)[order])
        low, high = np.minimum(np.searchsorted(reached, _INTERVAL), len(offsets) - 1)
        return float(offsets[order][low]), float(offsets[order][high])

    def first_steep(self, distance: FloatArray) -> int:
        """Return the index of the first unsaturated distance.

        At this distance, the output is probably not saturated.

        If the output is flattened at all distances, the result is the index of the last distance.
        """
        steep = np.flatnonzero(self.flattened(distance) < _PROBABLY)
        return int(steep[0]) if len(steep) else len(distance) - 1

    def draw(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Draw random sensor curves according to their posterior probabilities.

        Each curve has its own offset.

        Returns:
            The curves.
        """
        rng = np.random.default_rng(seed)
        fits = [(lanes, i) for lanes in self.lanes for i in range(len(lanes.costs))]
        places = np.linspace(self.lanes[0].family.first, self.lanes[0].family.last, _KNOTS)
        reached = np.cumsum(np.concatenate(self.weights))
        # equal steps instead of independent draws, so that each fit has its share of even a few curves
        shares = (np.arange(count) + rng.random()) / count * reached[-1]
        numbers = np.minimum(np.searchsorted(reached, shares), len(fits) - 1)
        curves: list[DrawnCurve] = []
        for number, times in zip(*np.unique(numbers, return_counts=True), strict=True):
            lanes, i = fits[number]
            ceiling, sharpness = lanes.ceilings[i], lanes.sharpness[i]
            x = self._parameters(lanes, i, int(times), rng)
            levels, slopes = lanes.family.log_output(x, places), lanes.family.slope(x, places)
            levels, share = _under(levels, ceiling, sharpness)
            ignored = None if np.isnan(lanes.ignored[i]) else float(lanes.ignored[i])
            for level, slope in zip(levels, slopes * share, strict=True):
                curve = drawn_curve(places, level, slope, float(lanes.offsets[i]))
                curves.append(replace(curve, ignored=ignored))
        return tuple(curves[k] for k in rng.permutation(len(curves)))

    def _parameters(self, lanes: _Lanes, i: int, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw parameters of one fit, shape (count, p), within their errors."""
        freedom = max(self.readings - 3 + _ERROR_FREEDOM - np.isfinite(lanes.ignored[i]), 1.0)
        scale = (_ERROR_FREEDOM + lanes.costs[i]) / rng.chisquare(freedom, count)
        with np.errstate(all="ignore"):
            _, s, vt = np.linalg.svd(lanes.covariances[i], hermitian=True)
            errors = (rng.standard_normal((count, len(s))) * np.sqrt(s)) @ vt
            x = lanes.x[i] + np.sqrt(scale)[:, None] * errors
        x = np.where(np.isfinite(x).all(axis=1)[:, None], x, lanes.x[i])
        return np.asarray(np.clip(x, *lanes.family.easing(*lanes.family.bounds)))


def drawn_curve(distance: FloatArray, log_output: FloatArray, slope: FloatArray, offset: float) -> DrawnCurve:
    """Return a smooth sensor curve through given points.

    The points have the log output ln xi and the slope g [1/m].
    """
    sensor = PiecewiseCubic(
        distances=tuple(distance.tolist()),  # Python's floats are checked three times as fast as NumPy's
        log_outputs=tuple(np.clip(log_output, -600.0, 600.0).tolist()),
        slopes=tuple(pairwise(slope.tolist())),
    )
    return DrawnCurve(sensor=sensor, offset=offset)


def fit_under_ceilings(
    curve: AveragedCurve, noise: ReadingNoise, offset: OffsetEstimate | None, *, options: SampleOptions
) -> CeilingFits:
    """Fit sensor curves that may saturate near the sensor, or whose nearest reading may be wrong.

    The fit needs at least four averaged readings. An offset of None is fitted together with the curve.

    Returns:
        The fits with their probabilities.
    """
    ceilings = [(above, p, np.nan) for above in _ABOVE for p in _SHARPNESS] if options.may_saturate else []
    suspects = [(np.inf, 2.0, float(curve.distance[0]))] if len(curve.distance) >= _FEWEST else []
    lanes = []
    for family in families_of(curve, options.models):  # slow families are fitted without a ceiling only
        above, sharpness, ignored = np.array([(np.inf, 2.0, np.nan), *(ceilings if family.quick else []), *suspects]).T
        problem = _Problem(curve=curve, noise=noise, family=family, above=above, sharpness=sharpness, ignored=ignored)
        if family.name in sensor_curves():
            lanes.append(problem.lanes(offset))
            continue
        with suppress(Exception):  # an error in a user's curve must not prevent the fits of the others
            own = problem.lanes(offset)
            lanes += [own] if np.isfinite(own.costs).all() else []
    # integrating over the unknown scale of the errors gives a power of the sum of squares
    power = 0.5 * (min(len(curve.distance), _FULL_WEIGHT) - 3 + _ERROR_FREEDOM)
    wrong = _WRONG / float(curve.count[0])  # repeated readings confirm each other
    logs = []
    for lane in lanes:
        without = 1 - _CEILING if ceilings else 1.0
        prior = np.log(np.where(np.isinf(lane.ceilings), without, _CEILING / max(len(ceilings), 1))) - lane.priors / 2
        ignores = np.isfinite(lane.ignored)
        fits = prior - (power - 0.5 * ignores) * np.log(_ERROR_FREEDOM + lane.costs)
        fits[ignores] += math.log(wrong) + _log_evidence_of_error(lane, curve, power)[ignores]
        logs.append(fits)
    largest = max(float(log.max()) for log in logs)
    total = sum(float(np.exp(log - largest).sum()) for log in logs)
    weights = tuple(np.exp(log - largest) / total for log in logs)
    return CeilingFits(lanes=tuple(lanes), weights=weights, readings=len(curve.distance))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """Least-squares problem for sensor curves with many saturation levels.

    Each fit has a given offset, or fits the offset as a last parameter.

    Args:
        curve: the averaged readings.
        noise: their noise.
        family: the ideal curves.
        above: ln of the ceilings over the largest signal, shape (b,).
        sharpness: p, shape (b,).
        ignored: distance of the reading that each fit ignores [m], NaN for none, shape (b,).
        offsets: shape (b,); None if each fit determines its own.
    """

    curve: AveragedCurve
    noise: ReadingNoise
    family: Family
    above: FloatArray
    sharpness: FloatArray
    ignored: FloatArray
    offsets: FloatArray | None = None

    def ceilings(self, offsets: FloatArray, above: FloatArray) -> FloatArray:
        """Return the logarithm of the saturation level for each given sensor offset."""
        return np.asarray(np.log(np.maximum(float(self.curve.output.max()) - offsets, 1e-300)) + above)

    def residuals(self, u: FloatArray, which: IntArray) -> FloatArray:
        """Return the normalized residuals of the fit.

        They are computed after an asinh transformation, and divided by the usual error of a reading.

        Residuals are differences of asinh(signal / tau), as in `family_fits.Problem`.
        """
        return self.function()(u, which)

    def function(self) -> Residuals:
        """Return the residuals as a function, with everything computed that does not depend on the parameters."""
        curve, reach = self.curve, float(np.ptp(self.curve.output))
        sigma = self.noise.sigma or 1e-3 * reach
        sigma = max(sigma, self.noise.resolution / np.sqrt(12.0), 1e-9 * reach)
        tau = sigma / np.sqrt(curve.count) / ERROR
        output, distance, size = curve.output, curve.distance, self.family.size
        ignores = distance == self.ignored[:, None]
        ignores_none = not ignores.any()
        if self.family.number >= 0:
            return CurveResiduals(
                family=self.family,
                distances=distance,
                outputs=output,
                widths=tau,
                errors=np.full(len(output), ERROR),
                offsets=self.offsets,
                weights=None if ignores_none else ~ignores,
                above=self.above,
                sharpness=self.sharpness,
            )
        known = None
        if self.offsets is not None:
            known = np.arcsinh((output - self.offsets[:, None]) / tau), self.ceilings(self.offsets, self.above)

        def residuals(u: FloatArray, which: IntArray) -> FloatArray:
            if known is None:
                offset = u[:, -1]
                measured = np.arcsinh((output - offset[:, None]) / tau)
                ceiling = self.ceilings(offset, self.above[which])
            else:
                measured, ceiling = known[0][which], known[1][which]
            level = _level_under(
                self.family.log_output(u[:, :size], distance), ceiling[:, None], self.sharpness[which, None]
            )
            rows = (measured - np.arcsinh(np.exp(np.minimum(level, 300.0)) / tau)) / ERROR
            return np.asarray(rows if ignores_none else np.where(ignores[which], 0.0, rows))

        return residuals

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return bounds of the fit parameters.

        Within the bounds, the log output cannot become steeper with distance.
        """
        low, high = self.family.easing(*self.family.bounds)
        if self.offsets is not None:
            return low, high
        return np.append(low, lowest_offset(self.curve)), np.append(high, float(self.curve.output.max()))

    def fit(self) -> Fits:
        """Fit each sensor curve from several start points.

        The best coarse result is then refined.

        Returns:
            The fits.
        """
        distance, output, count = self.curve.distance, self.curve.output, len(self.above)
        reach = float(np.ptp(output))
        offset = np.full(count, float(output.min()) - 0.02 * reach) if self.offsets is None else self.offsets
        signal = np.log(np.maximum(output - offset[:, None], 0.01 * reach))
        middle = np.array([np.interp(self.family.middle, distance, row) for row in signal])
        steepest = np.minimum((np.diff(signal) / np.diff(distance)).min(axis=1), -0.1 / self.family.span)
        starts = []
        for times in _STEEPEST:
            for bend in _BENDS:
                slope = times * steepest
                rows = [self.family.start(m, g, bend * g**2) for m, g in zip(middle, slope, strict=True)]
                starts.append(np.column_stack([rows, offset]) if self.offsets is None else np.array(rows))
        which, residuals = np.tile(np.arange(count), len(starts)), self.function()
        rough = minimize_many(residuals, np.concatenate(starts), self.bounds(), problems=which, tolerance=1e-3, most=12)
        best = rough.costs.reshape(len(starts), count).argmin(axis=0)
        start = rough.x.reshape(len(starts), count, -1)[best, np.arange(count)]
        return minimize_many(residuals, start, self.bounds(), tolerance=1e-8, most=40)

    def lanes(self, known_offset: OffsetEstimate | None) -> _Lanes:
        """Fit one curve family for every saturation level.

        Each fit is repeated for several likely sensor offsets.

        Returns:
            The fits of the family.
        """
        if known_offset is None:
            first_fits = self.fit()
            offsets, priors = self._offsets_around(first_fits)
        else:
            first_fits = replace(self, offsets=np.full(len(self.above), known_offset.value)).fit()
            steps = _KNOWN_OFFSETS if known_offset.standard_error > 0 else np.zeros(1)
            offsets, priors = known_offset.value + abs(known_offset.standard_error) * steps, steps**2
        ceilings = len(self.above)
        problems = replace(
            self,
            above=np.tile(self.above, len(offsets)),
            sharpness=np.tile(self.sharpness, len(offsets)),
            ignored=np.tile(self.ignored, len(offsets)),
            offsets=(all_offsets := np.repeat(offsets, ceilings)),
        )
        start = np.tile(first_fits.x[:, : self.family.size], (len(offsets), 1))
        fits = minimize_many(problems.function(), start, problems.bounds(), tolerance=1e-8, most=40)
        return _Lanes(
            family=self.family,
            offsets=all_offsets,
            ceilings=problems.ceilings(all_offsets, problems.above),
            sharpness=problems.sharpness,
            x=fits.x,
            covariances=fits.covariances,
            costs=fits.costs,
            priors=np.repeat(priors, ceilings) + self.family.prior(fits.x),
            ignored=problems.ignored,
        )

    def _offsets_around(self, fits: Fits) -> tuple[FloatArray, FloatArray]:
        """Return several sensor offsets near the best-fitting offset.

        The second result is the cost -2 ln(prior probability) of each offset.
        """
        best = int(np.where(np.isnan(self.ignored), fits.costs, np.inf).argmin())
        reach = float(np.ptp(self.curve.output))
        scale = (_ERROR_FREEDOM + float(fits.costs[best])) / _ERROR_FREEDOM
        error = float(np.sqrt(scale * fits.covariances[best, -1, -1])) or 0.1 * reach  # zero at a bound
        offsets = fits.x[best, -1] + float(np.clip(error, 1e-4 * reach, 0.1 * reach)) * _FITTED_OFFSETS
        low, high = self.bounds()
        offsets = np.unique(np.clip(offsets, low[-1], high[-1] - 1e-3 * reach))
        width = np.gradient(offsets) if len(offsets) > 1 else np.ones(1)
        return offsets, -2 * np.log(width / width.max())  # each offset represents those around it


def _log_evidence_of_error(lanes: _Lanes, curve: AveragedCurve, power: float) -> FloatArray:
    """Return ln of the likelihood of a wrong nearest reading, relative to that of a right one.

    `power` is that of the sum of squares with all readings. The error of a wrong reading has a wide distribution.

    If the other readings hardly predict the reading, it also hardly contradicts them. This is the factor sqrt(1 +
    leverage), with the variance of the predicted ln xi in units of that of a usual error.
    """
    distance, output = curve.distance[:1], float(curve.output[0])
    predicted = lanes.family.log_output(lanes.x, distance)[:, 0]
    change = forward_change(lanes.family.log_output, lanes.x, distance)[..., 0] / ERROR
    leverage = np.einsum("pb,bpq,qb->b", change, lanes.covariances, change)
    error = (np.log(np.maximum(output - lanes.offsets, 1e-300)) - predicted) / ERROR
    density = 1 / (np.pi * _WRONG_SIZE * (1 + (error / _WRONG_SIZE) ** 2))
    constant = math.lgamma(power - 0.5) - math.lgamma(power) + 0.5 * math.log(math.pi)
    return np.asarray(np.log(density) + 0.5 * np.log1p(np.clip(leverage, 0.0, 1e6)) + constant)


def _under(level: FloatArray, ceiling: Any, sharpness: Any) -> tuple[FloatArray, FloatArray]:
    """Return the logarithm of a sensor output with gradual saturation.

    The second result is the factor by which saturation reduces the slope.

    `level` and `ceiling` are logarithms of the ideal signal and of the saturation level.
    """
    above = np.where(np.isinf(ceiling), -np.inf, sharpness * (level - np.where(np.isinf(ceiling), 0.0, ceiling)))
    share = 1 / (1 + np.exp(np.minimum(above, 700.0)))
    return _level_under(level, ceiling, sharpness), np.asarray(share)


def _level_under(level: FloatArray, ceiling: Any, sharpness: Any) -> FloatArray:
    """Return the logarithm of a sensor output with gradual saturation."""
    above = np.where(np.isinf(ceiling), -np.inf, sharpness * (level - np.where(np.isinf(ceiling), 0.0, ceiling)))
    return np.asarray(level - np.logaddexp(0.0, above) / sharpness)
