"""Fit sensor curves that flatten near the sensor because its output saturates.

An amplifier or converter that saturates softly turns the ideal output xi into xi / (1 + (xi / C)^p)^(1/p) with a
ceiling C and a sharpness p. Each family of ideal curves is fitted under every ceiling of a grid (the infinite one
included) and at every plausible offset. The weight of a fit is its posterior probability, with the scale of the errors
integrated out. The weights give the probability that a reading lies in the flattened part, for 6 readings as for 50.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.sensors import Family, PiecewiseCubic

from .averaging import AveragedCurve, ReadingNoise
from .family_fits import families_of, lowest_offset
from .least_squares import Fits, minimize_many
from .result import DrawnCurve, OffsetEstimate

_ABOVE: Final = (0.003, 0.01, 0.03, 0.08, 0.15, 0.3, 0.5, 0.8, 1.2)  # ln of the ceiling over the largest signal
_SHARPNESS: Final = (2.0, 3.5, 7.0)
_CEILING: Final = 0.5  # prior probability that the output has a ceiling near the readings
_ERROR: Final = 0.01  # usual error of a reading relative to the signal: noise, positioning and the family together
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lanes(Value):
    """Fits of one curve family for several saturation levels.

    There is one fit for each pair of sensor offset and saturation level. `offsets`, ln of the `ceilings` (inf for none)
    and their `sharpness` have the shape (b,).

    Parameters x have the shape (b, p), their `covariances` at unit variance of the residuals (b, p, p). `costs` are
    sums of squares in units of the usual error; `priors` are -2 ln of the prior of the offset and of the curve.
    """

    family: Family
    offsets: FloatArray
    ceilings: FloatArray
    sharpness: FloatArray
    x: FloatArray
    covariances: FloatArray
    costs: FloatArray
    priors: FloatArray


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
        return _ERROR * float(np.sqrt((_ERROR_FREEDOM + cost) / (_ERROR_FREEDOM + max(self.readings - 3, 1))))

    def flattened(self, distance: FloatArray) -> FloatArray:
        """Return the probability of saturation at each distance.

        Saturation means here that the sensor slope is reduced by more than 15 %.
        """
        # The slope is compared with that of the ideal curve; distances [m] and probabilities have the shape (N,).
        probability = np.zeros(len(distance))
        for lanes, weight in zip(self.lanes, self.weights, strict=True):
            level = lanes.family.log_output(lanes.x, distance)
            probability += weight @ (_under(level, lanes.ceilings[:, None], lanes.sharpness[:, None])[1] < _FLAT)
        return probability

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
        """
        # If the output is flattened at all distances, the result is the index of the last distance.
        steep = np.flatnonzero(self.flattened(distance) < _PROBABLY)
        return int(steep[0]) if len(steep) else len(distance) - 1

    def draw(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Draw random sensor curves according to their posterior probabilities."""
        # Each curve has its own offset.
        rng = np.random.default_rng(seed)
        fits = [(lanes, i) for lanes in self.lanes for i in range(len(lanes.costs))]
        freedom = max(self.readings - 3 + _ERROR_FREEDOM, 1.0)
        places = np.linspace(self.lanes[0].family.first, self.lanes[0].family.last, _KNOTS)
        curves = []
        for number in rng.choice(len(fits), count, p=np.concatenate(self.weights)):
            lanes, i = fits[number]
            scale = (_ERROR_FREEDOM + lanes.costs[i]) / rng.chisquare(freedom)
            with np.errstate(all="ignore"):
                x = rng.multivariate_normal(
                    lanes.x[i], scale * lanes.covariances[i], method="svd", check_valid="ignore"
                )
            x = np.clip(np.where(np.isfinite(x), x, lanes.x[i]), *lanes.family.easing(*lanes.family.bounds))
            level, slope = lanes.family.log_output(x, places), lanes.family.slope(x, places)
            level, share = _under(level, lanes.ceilings[i], lanes.sharpness[i])
            curves.append(drawn_curve(places, level, slope * share, float(lanes.offsets[i])))
        return tuple(curves)


def drawn_curve(distance: FloatArray, log_output: FloatArray, slope: FloatArray, offset: float) -> DrawnCurve:
    """Return a smooth sensor curve through given points.

    The points have the log output ln xi and the slope g [1/m].
    """
    sensor = PiecewiseCubic(
        distances=tuple(distance),
        log_outputs=tuple(np.clip(log_output, -600.0, 600.0)),
        slopes=tuple(pairwise(slope)),
    )
    return DrawnCurve(sensor=sensor, offset=offset)


def fit_under_ceilings(curve: AveragedCurve, noise: ReadingNoise, offset: OffsetEstimate | None) -> CeilingFits:
    """Fit sensor curves that may saturate near the sensor."""
    # The fit needs at least four averaged readings.
    # An offset of None is fitted together with the curve.
    ceilings = [(above, p) for above in _ABOVE for p in _SHARPNESS]
    lanes = []
    for family in families_of(curve):  # slow families are fitted without a ceiling only
        above, sharpness = np.array([(np.inf, 2.0), *(ceilings if family.quick else [])]).T
        problem = _Problem(curve=curve, noise=noise, family=family, above=above, sharpness=sharpness)
        lanes.append(problem.lanes(offset))
    # integrating over the unknown scale of the errors gives a power of the sum of squares
    power = 0.5 * (min(len(curve.distance), _FULL_WEIGHT) - 3 + _ERROR_FREEDOM)
    logs = []
    for lane in lanes:
        prior = np.log(np.where(np.isinf(lane.ceilings), 1 - _CEILING, _CEILING / len(ceilings))) - lane.priors / 2
        logs.append(prior - power * np.log(_ERROR_FREEDOM + lane.costs))
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
        offsets: shape (b,); None if each fit determines its own.
    """

    curve: AveragedCurve
    noise: ReadingNoise
    family: Family
    above: FloatArray
    sharpness: FloatArray
    offsets: FloatArray | None = None

    def ceilings(self, offsets: FloatArray, above: FloatArray) -> FloatArray:
        """Return the logarithm of the saturation level for each given sensor offset."""
        return np.asarray(np.log(np.maximum(float(self.curve.output.max()) - offsets, 1e-300)) + above)

    def residuals(self, u: FloatArray, which: IntArray) -> FloatArray:
        """Return the normalized residuals of the fit.

        They are computed after an asinh transformation, and divided by the usual error of a reading.
        """
        # Residuals are differences of asinh(signal / tau), as in `family_fits.Problem`.
        curve, reach = self.curve, float(np.ptp(self.curve.output))
        sigma = self.noise.sigma or 1e-3 * reach
        sigma = max(sigma, self.noise.resolution / np.sqrt(12.0), 1e-9 * reach)
        tau = sigma / np.sqrt(curve.count) / _ERROR
        offset = u[:, -1] if self.offsets is None else self.offsets[which]
        level = self.family.log_output(u[:, : self.family.size], curve.distance)
        ceiling = self.ceilings(offset, self.above[which])
        level, _ = _under(level, ceiling[:, None], self.sharpness[which, None])
        measured = np.arcsinh((curve.output - offset[:, None]) / tau)
        return np.asarray((measured - np.arcsinh(np.exp(np.minimum(level, 300.0)) / tau)) / _ERROR)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return bounds of the fit parameters.

        Within the bounds, the log output cannot become steeper with distance.
        """
        low, high = self.family.easing(*self.family.bounds)
        if self.offsets is not None:
            return low, high
        return np.append(low, lowest_offset(self.curve)), np.append(high, float(self.curve.output.max()))

    def fit(self) -> Fits:
        """Fit each sensor curve from several start points."""
        # The best coarse result is then refined.
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
        which = np.tile(np.arange(count), len(starts))

        def each(u: FloatArray, number: IntArray) -> FloatArray:
            return self.residuals(u, which[number])

        rough = minimize_many(each, np.concatenate(starts), self.bounds(), tolerance=1e-3, most=12)
        best = rough.costs.reshape(len(starts), count).argmin(axis=0)
        start = rough.x.reshape(len(starts), count, -1)[best, np.arange(count)]
        return minimize_many(self.residuals, start, self.bounds(), tolerance=1e-8, most=40)

    def lanes(self, known_offset: OffsetEstimate | None) -> _Lanes:
        """Fit one curve family for every saturation level."""
        # Each fit is repeated for several likely sensor offsets.
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
            offsets=(all_offsets := np.repeat(offsets, ceilings)),
        )
        start = np.tile(first_fits.x[:, : self.family.size], (len(offsets), 1))
        fits = minimize_many(problems.residuals, start, problems.bounds(), tolerance=1e-8, most=40)
        return _Lanes(
            family=self.family,
            offsets=all_offsets,
            ceilings=problems.ceilings(all_offsets, problems.above),
            sharpness=problems.sharpness,
            x=fits.x,
            covariances=fits.covariances,
            costs=fits.costs,
            priors=np.repeat(priors, ceilings) + self.family.prior(fits.x),
        )

    def _offsets_around(self, fits: Fits) -> tuple[FloatArray, FloatArray]:
        """Return several sensor offsets near the best-fitting offset.

        The second result is the cost -2 ln(prior probability) of each offset.
        """
        best, reach = int(fits.costs.argmin()), float(np.ptp(self.curve.output))
        scale = (_ERROR_FREEDOM + float(fits.costs[best])) / _ERROR_FREEDOM
        error = float(np.sqrt(scale * fits.covariances[best, -1, -1])) or 0.1 * reach  # zero at a bound
        offsets = fits.x[best, -1] + float(np.clip(error, 1e-4 * reach, 0.1 * reach)) * _FITTED_OFFSETS
        low, high = self.bounds()
        offsets = np.unique(np.clip(offsets, low[-1], high[-1] - 1e-3 * reach))
        width = np.gradient(offsets) if len(offsets) > 1 else np.ones(1)
        return offsets, -2 * np.log(width / width.max())  # each offset represents those around it


def _under(level: FloatArray, ceiling: Any, sharpness: Any) -> tuple[FloatArray, FloatArray]:
    """Return the logarithm of a sensor output with gradual saturation.

    The second result is the factor by which saturation reduces the slope.
    """
    # `level` and `ceiling` are logarithms of the ideal signal and of the saturation level.
    above = np.where(np.isinf(ceiling), -np.inf, sharpness * (level - np.where(np.isinf(ceiling), 0.0, ceiling)))
    return np.asarray(level - np.logaddexp(0.0, above) / sharpness), np.asarray(
        1 / (1 + np.exp(np.minimum(above, 700.0)))
    )
