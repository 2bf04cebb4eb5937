"""Average sensor offset and slope over all possible sensor curves.

With one family and one offset, the readings determine the parameters to about a percent. But they do not determine the
family: with a slightly different offset, another family fits equally well. So each family of three parameters is fitted
at each plausible offset, and each fit gets a weight from its sum of squares. The weighted fits give the offset and the
slope g at every distance, with their uncertainties.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import Family

from .averaging import AveragedCurve
from .family_fits import Problem, families_of, fit_free, forward_change, lowest_offset, problem_at
from .least_squares import Fits
from .result import DrawnCurve, NoiseEstimate, OffsetEstimate

_FORM: Final = 4.0  # inflation of the variance if the offset was fitted, because no family is exact
_BENDS: Final = 6.0  # independent points of a smooth misfit over a window
_LARGEST_CORRELATION: Final = 0.8  # largest correlation of neighboring residuals that is used
# standard errors around a fitted offset, denser in the middle
_FITTED_OFFSETS: Final = np.sinh(np.linspace(-3.0, 3.0, 21)) / np.sinh(3.0) * 8.0
_KNOWN_OFFSETS: Final = np.linspace(-2.8, 2.8, 9)  # standard errors around a known offset


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyFits(Value):
    """Fits of one curve family for several offsets.

    `offsets` have the shape (b,). Parameters x, shape (b, 3), have `covariances`, shape (b, 3, 3), at unit variance of
    the residuals. `costs`, shape (b,), are sums of squares that include the prior of the offset.
    """

    family: Family
    offsets: FloatArray
    x: FloatArray
    covariances: FloatArray
    costs: FloatArray

    def interval(self, level: float) -> tuple[float, float] | None:
        """Return the range of sensor offsets with a low fit cost.

        The fit cost of these offsets is at most `level`. The range is None if no offset has such a low cost. The square
        root of the cost is interpolated linearly.
        """
        root = np.sqrt(np.maximum(self.costs - min(float(self.costs.min()), level), 0.0))
        below = np.flatnonzero(self.costs <= level)
        if not len(below):
            return None
        height, ends = float(np.sqrt(max(level - float(self.costs.min()), 0.0))), []
        for inner, way in ((below[0], -1), (below[-1], 1)):
            outer = min(max(inner + way, 0), len(root) - 1)  # nothing lies beyond the last offset
            share = (height - root[inner]) / max(root[outer] - root[inner], 1e-300) if outer != inner else 0.0
            ends.append(float(self.offsets[inner] + share * (self.offsets[outer] - self.offsets[inner])))
        return ends[0], ends[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class PossibleCurves(Value):
    """All sensor curves that fit the readings, with weights.

    A weight expresses how well a curve fits.

    Args:
        parts: the fits of each family.
        form: factor by which the variance of g is inflated because a fitted offset depends on inexact families; 1 for a
            known offset.
        inflation: sum of squares relative to what noise and misfit explain; at least 1.
        rise: increase of the sum of squares from its minimum to the end of a 95 % interval.
    """

    parts: tuple[FamilyFits, ...]
    form: float
    inflation: float
    rise: float

    @property
    def least(self) -> float:
        """The smallest sum of squared residuals among all fitted sensor curves."""
        return min(float(part.costs.min()) for part in self.parts)

    @property
    def best(self) -> FamilyFits:
        """The fits of the best curve family.

        This family has the smallest sum of squared residuals.
        """
        return min(self.parts, key=lambda part: float(part.costs.min()))

    def offset(self, kind: str) -> OffsetEstimate:
        """Return the best-fitting sensor offset with its interval.

        The 95 % interval covers all well-fitting curve families.
        """
        ends = [e for part in self.parts if (e := part.interval(self.least + self.rise)) is not None]
        low, high = min(e[0] for e in ends), max(e[1] for e in ends)
        error = (high - low) / (2 * float(np.sqrt(self.rise)))
        value = float(self.best.offsets[self.best.costs.argmin()])
        return OffsetEstimate(value=value, standard_error=error, low=low, high=high, kind=kind)

    def draw(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Draw random sensor curves according to their weights.

        Each curve has its own offset.

        Returns:
            The curves.
        """
        rng = np.random.default_rng(seed)
        fits, curves = [(part, i) for part in self.parts for i in range(len(part.offsets))], []
        for number in rng.choice(len(fits), count, p=np.concatenate(self.weights())):
            part, i = fits[number]
            spread = part.covariances[i] * self.inflation * self.form
            with np.errstate(all="ignore"):
                moved = rng.multivariate_normal(part.x[i], spread, method="svd", check_valid="ignore")
            moved = np.where(np.isfinite(moved), moved, part.x[i])
            family = part.family
            sensor = family.sensor(np.clip(moved, *family.bounds), family.first, family.last)
            curves.append(DrawnCurve(sensor=sensor, offset=float(part.offsets[i])))
        return tuple(curves)

    def doubt(self, offset: OffsetEstimate) -> float:
        """Return the deviation of a sensor offset from the best-fitting offset.

        The deviation is 0 for the best-fitting offset, and 1 at an end of its 95 % interval. The deviation is that of
        the value in the interval of the offset that is nearest to the best-fitting offset. It is infinite if this value
        is beyond all fitted offsets.
        """
        cost = np.inf
        for part in self.parts:
            at = np.clip(part.offsets[int(part.costs.argmin())], offset.low, offset.high)
            cost = min(cost, float(np.interp(at, part.offsets, part.costs, left=np.inf, right=np.inf)))
        return float(np.sqrt(max(cost - self.least, 0.0) / self.rise))

    def weights(self) -> list[FloatArray]:
        """Return the probability weight of each fitted sensor curve.

        They add up to 1.
        """
        weights = []
        for part in self.parts:
            width = np.gradient(part.offsets) if len(part.offsets) > 1 else np.ones(1)
            excess = np.minimum((part.costs - self.least) / (self.inflation * self.form), 700.0)
            weights.append(np.exp(-0.5 * excess) * width)
        total = sum(float(w.sum()) for w in weights)
        return [w / total for w in weights]

    def slope(self, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and standard deviation of the log slope.

        The log slope is ln |g| with the sensor slope g. All curves that fit the readings contribute.

        The value is ln |g|; the deviation includes both the scatter between fits and the error of each.
        """
        rows, spreads, weights = [], [], []
        for part, weight in zip(self.parts, self.weights(), strict=True):
            relevant = weight > 1e-6
            if not relevant.any():
                continue
            x, covariance = part.x[relevant], part.covariances[relevant] * self.inflation * self.form

            def log_slope(u: FloatArray, at: FloatArray, family: Family = part.family) -> FloatArray:
                return np.asarray(np.log(np.maximum(-family.slope(u, at), 1e-12)))

            change = np.moveaxis(forward_change(log_slope, x, distance), 0, -1)
            rows.append(log_slope(x, distance))
            spreads.append(np.einsum("bnp,bpq,bnq->bn", change, covariance, change))
            weights.append(weight[relevant])
        log_slopes, variances, share = np.concatenate(rows), np.concatenate(spreads), np.concatenate(weights)
        share = share / share.sum()
        mean = share @ log_slopes
        variance = share @ (np.minimum(variances, 4.0) + (log_slopes - mean) ** 2)
        return np.asarray(mean), np.asarray(np.sqrt(variance))


def fit_possible_curves(
    curve: AveragedCurve,
    noise: NoiseEstimate,
    known_offset: OffsetEstimate | None,
    *,
    informed_by: int | None = None,
    also: float | None = None,
) -> PossibleCurves:
    """Fit every family of sensor curves for every plausible sensor offset.

    A fit needs five points or more, or four with a known offset. The noise was estimated from `informed_by` points, by
    default those of the curve. `also` is an additional offset.

    Returns:
        The fits with their weights.
    """
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    parts = []
    for family in families_of(curve):
        free = fit_free(curve, family, noise, None if known_offset is None else known_offset.value)
        offsets = _offsets(curve, free, known_offset)
        offsets = offsets if also is None else np.unique(np.append(offsets, also))
        problem = Problem(curve=curve, family=family, noise=noise, offsets=offsets)
        fits = problem.minimize(np.repeat(free.x[:, :3], len(offsets), axis=0))
        prior = family.prior(fits.x)
        if known_offset is not None and known_offset.standard_error > 0:
            prior += ((offsets - known_offset.value) / known_offset.standard_error) ** 2
        costs = fits.costs + prior
        parts.append(FamilyFits(family=family, offsets=offsets, x=fits.x, covariances=fits.covariances, costs=costs))
    freedom = max((informed_by or len(curve.distance)) - 3 - (known_offset is None), 1)
    best = min(parts, key=lambda part: float(part.costs.min()))
    at = int(best.costs.argmin())
    problem = problem_at(curve, best.family, noise, best.offsets[at])
    row = problem.residuals(best.x[[at]], np.zeros(1, dtype=np.int64))[0]
    # the share of the misfit in the variance of the means
    smooth = float(np.mean(noise.misfit**2 / noise.relative_of_means(curve.count) ** 2))
    inflation = max(1.0, float(row @ row) / max(len(row) - 3 - (known_offset is None), 1)) * _correlation_inflation(
        row, smooth
    )
    return PossibleCurves(
        parts=tuple(parts),
        form=_FORM if known_offset is None else 1.0,
        inflation=inflation,
        rise=float(stdtrit(freedom, 0.975)) ** 2 * inflation,
    )


def _correlation_inflation(residuals: FloatArray, smooth: float) -> float:
    """Return the variance inflation due to correlated residuals.

    A misfit is smooth: forty points carry no more information about the misfit than the few points at which it can bend
    independently. The misfit has the share `smooth` of the variance of the residuals, which is 1. If the correlation of
    neighboring residuals is significant and gives a larger factor, that factor is used (Bayley and Hammersley 1946).
    """
    count, total = len(residuals), float(residuals @ residuals)
    bends = 1 + smooth * max(count / _BENDS - 1, 0.0)
    if count < 5 or total <= 0:
        return bends
    correlation = float(residuals[1:] @ residuals[:-1]) / total
    correlation = min(correlation, _LARGEST_CORRELATION) if correlation > 1.7 / np.sqrt(count) else 0.0
    return max(bends, (1 + correlation) / (1 - correlation))


def _offsets(curve: AveragedCurve, free: Fits, known_offset: OffsetEstimate | None) -> FloatArray:
    """Return the sensor offsets for which a family of curves is fitted."""
    if known_offset is not None:
        return known_offset.value + known_offset.standard_error * (
            _KNOWN_OFFSETS if known_offset.standard_error > 0 else np.zeros(1)
        )
    reach = float(np.ptp(curve.output))
    error = np.sqrt(float(free.covariances[0, 3, 3])) or 0.1 * reach  # zero if a parameter is at a bound
    error = float(np.clip(error, 1e-9 * reach, 0.3 * reach))
    offsets = free.x[0, 3] + error * _FITTED_OFFSETS
    top = float(curve.output.max())
    return np.unique(np.clip(offsets, lowest_offset(curve), top - 1e-3 * reach))
