"""Average the sensor readings at each distance, and estimate the noise of the readings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.units import format_quantity

from .data import Calibration

MAD_TO_SIGMA = 1.4826  # median absolute deviation to standard deviation, for a normal distribution
_FEWEST_COMPARED = 5  # repeats beyond the first of each distance, to find an outlier among repeats
_FEWEST_IN_GROUP = 3  # readings of which a majority shows the outlier
_FEW_EMPTY = 4  # at most so many readings without an object do not show their own scatter
_ROUGH = 60.0  # widens the limit of n readings by 1 + 60 / n^2: false alarms in at most 1 % of 5 to 50 normal readings
_LARGEST_EMPTY = 0.5  # deviation over the range of the outputs that is an outlier whatever the scatter
_BAD_READING_SIGMAS = 6.0  # one false alarm in 5e8 normal readings; lost or doubled readings deviate much more
_EXPLAINED = 3.0  # standard errors up to which noise explains the deviation of an output
_CLEAR_OF_ZERO = 5  # a zero counts as lost if the smallest other reading is at least so many converter steps above it
_USUAL_SPREAD = 0.5  # standard deviation of the prior of ln c above its usual value
_FEWEST_REPEATS = 3  # degrees of freedom from which a standard deviation is trusted
_NEIGHBORS = 4  # values of which one too many determines a parabola
_FEWEST_COPIED = 3  # repeated distances; at fewer, noisy readings may be equal by chance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AveragedCurve:
    """Mean sensor output at each distance of a calibration.

    The distances are in increasing order. `output` is the mean of `count` readings at each `distance` [m], all of shape
    (N,).

    `bad_readings` are the indices of outliers among repeats, which the means do not include.
    """

    distance: FloatArray
    output: FloatArray
    count: IntArray
    bad_readings: tuple[int, ...] = ()

    def part(self, which: BoolArray | IntArray | slice) -> AveragedCurve:
        """Return the averaged readings at selected distances."""
        return AveragedCurve(distance=self.distance[which], output=self.output[which], count=self.count[which])

    @property
    def steady(self) -> FloatArray:
        """The averaged output after a 3-point median filter, which removes single outliers."""
        y = self.output.copy()
        if len(y) > 2:
            y[1:-1] = np.median([self.output[:-2], self.output[1:-1], self.output[2:]], axis=0)
        return y


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingNoise:
    """Noise of a single sensor reading.

    It has a constant part and a part that grows with the signal. `sigma` is the standard deviation at a weak signal,
    with `freedom` degrees of freedom. It is None if the readings do not determine it. `jitter` is the additional
    standard deviation of repeats relative to the signal.
    """

    sigma: float | None
    source: str
    resolution: float
    freedom: float = 0.0
    jitter: float = 0.0


def resolution(calibration: Calibration) -> float:
    """Return the resolution of the sensor outputs.

    The resolution is the smallest step between outputs (one LSB). It is 0 if the outputs have no common step size.

    The step is an approximate common divisor of all differences.
    """
    values = np.unique(np.concatenate([calibration.outputs, calibration.no_object]))
    if len(values) < 4:
        return 0.0
    steps = np.diff(values)
    tolerance = 1e-9 * float(np.abs(values).max())
    step = 0.0
    for difference in steps[steps > tolerance]:
        a, b = float(difference), step
        while b > tolerance * 10:
            a, b = b, abs(a - b * round(a / b))
        step = a
    span = float(values[-1] - values[0])
    return step if step > 1e-5 * span else 0.0


def average(calibration: Calibration) -> AveragedCurve:
    """Average the readings at each distance, without outliers and lost readings (zeros)."""
    keep = ~_lost(calibration)
    distance, place = np.unique(calibration.distances[keep], return_inverse=True)
    groups = [np.flatnonzero(keep)[place == i] for i in range(len(distance))]
    medians = np.array([np.median(calibration.outputs[g]) for g in groups])
    background = min(medians.min(), *calibration.no_object, np.inf)
    noise = _spread_of_repeats(calibration.outputs, groups, medians - background)
    if noise is not None:
        sigma, jitter = noise
        floor = resolution(calibration)
        for i in _repeated(groups):
            limit = _BAD_READING_SIGMAS * max(float(np.hypot(sigma, jitter * (medians[i] - background))), floor)
            keep[groups[i][np.abs(calibration.outputs[groups[i]] - medians[i]) > limit]] = False
    means = np.array([np.mean(calibration.outputs[g[keep[g]]]) for g in groups])
    counts = np.array([int(keep[g].sum()) for g in groups])
    bad = tuple(int(i) for i in np.flatnonzero(~keep))
    return AveragedCurve(distance=distance, output=means, count=counts, bad_readings=bad)


def _spread_of_repeats(outputs: FloatArray, groups: list[IntArray], signal: FloatArray) -> tuple[float, float] | None:
    """Estimate the noise of repeats by a method that outliers do not change.

    Returns:
        The constant and the relative noise; None with too few repeats.
    """
    repeated = _repeated(groups)
    dof = np.array([len(groups[i]) - 1 for i in repeated], dtype=np.float64)
    if dof.sum() < _FEWEST_COMPARED:
        return None
    spread = np.array([_robust_deviation(outputs[groups[i]]) ** 2 for i in repeated])
    return two_components(spread, dof, signal[repeated])


def _repeated(groups: list[IntArray]) -> list[int]:
    return [i for i, g in enumerate(groups) if len(g) >= _FEWEST_IN_GROUP]


def _robust_deviation(values: FloatArray) -> float:
    return MAD_TO_SIGMA * float(np.median(np.abs(values - np.median(values))))


def leave_out_empty_outliers(calibration: Calibration) -> tuple[Calibration, FloatArray]:
    """Leave out outliers among the readings without an object.

    They must not change the offset, the noise, or the step of the converter. If neither these readings nor repeats at
    distances show the scatter, an outlier deviates by more than half of the range of the outputs.

    Returns:
        The calibration without the outliers, and the outliers.
    """
    readings = calibration.no_object
    if len(readings) < _FEWEST_IN_GROUP:
        return calibration, readings[:0]
    deviation = np.abs(readings - np.median(readings))
    large = _LARGEST_EMPTY * float(np.ptp(calibration.outputs))
    ordinary = replace(calibration, no_object=readings[deviation <= large])  # a huge outlier would hide the step
    distance, place = np.unique(calibration.distances, return_inverse=True)
    groups = [np.flatnonzero(place == i) for i in range(len(distance))]
    medians = np.array([np.median(calibration.outputs[g]) for g in groups])
    repeats = _spread_of_repeats(calibration.outputs, groups, medians - medians.min())
    limit = _BAD_READING_SIGMAS * max(_robust_deviation(readings), resolution(ordinary), repeats[0] if repeats else 0.0)
    if repeats is None:
        limit *= 1 + _ROUGH / len(readings) ** 2
    if limit == 0 or (repeats is None and len(readings) <= _FEW_EMPTY):
        limit = max(limit, large)
    is_outlier = deviation > limit
    return replace(calibration, no_object=readings[~is_outlier]), readings[is_outlier]


def _lost(calibration: Calibration) -> BoolArray:
    """Find lost readings, recorded as exact zeros.

    Zeros are lost readings only if all other readings are clearly above zero.

    Returns:
        Whether each reading is lost.
    """
    zero = calibration.outputs == 0
    others = np.concatenate([calibration.outputs[~zero], calibration.no_object])
    step = resolution(calibration)
    few = 0 < zero.sum() <= max(1, len(zero) // 10)
    clear = len(others) > 0 and step > 0 and others.min() >= _CLEAR_OF_ZERO * step
    return zero if few and clear else np.zeros_like(zero)


def reading_noise(calibration: Calibration, curve: AveragedCurve) -> ReadingNoise:
    """Estimate the noise of a single sensor reading.

    The estimate uses repeated readings and readings without an object. The estimate is never below the quantization.
    The variance of a reading is modeled as sigma^2 + (c xi)^2. Both parts are estimated by maximum likelihood over the
    groups of repeats, so jitter of a strong signal does not raise the noise of the far field. Estimates from fewer than
    three degrees of freedom are not used.

    Returns:
        The noise.
    """
    step = resolution(calibration)
    floor = step / np.sqrt(12.0)
    keep = np.ones(len(calibration.outputs), dtype=bool)
    keep[list(curve.bad_readings)] = False
    groups = [calibration.outputs[keep & (calibration.distances == d)] for d in curve.distance]
    background = float(np.mean(calibration.no_object)) if len(calibration.no_object) else float(curve.output.min())
    signal = list(np.maximum(curve.output - background, 0.0))
    groups.append(calibration.no_object)
    signal.append(0.0)
    used = [i for i, g in enumerate(groups) if len(g) > 1]
    dof = np.array([len(groups[i]) - 1 for i in used], dtype=np.float64)
    if dof.sum() < _FEWEST_REPEATS:
        return ReadingNoise(sigma=None, source="", resolution=step)
    variance = np.array([np.var(groups[i], ddof=1) for i in used])
    sigma, jitter = two_components(variance, dof, np.array([signal[i] for i in used]))
    source = "no-object readings" if used == [len(groups) - 1] else "repeats"
    if sigma < floor:
        sigma, source = float(floor), f"quantization ({source} vary less)"
    if sigma <= 0:
        return ReadingNoise(sigma=None, source="", resolution=step)
    return ReadingNoise(sigma=sigma, source=source, resolution=step, freedom=float(dof.sum()), jitter=jitter)


def two_components(
    variance: FloatArray, dof: FloatArray, signal: FloatArray, *, usual: float | None = None
) -> tuple[float, float]:
    """Split the noise into constant noise and noise proportional to the signal.

    Sigma and c of variance = sigma^2 + (c xi)^2 have the maximum likelihood for groups of repeats. Sigma has a closed
    form for each ratio c / sigma. The prior of c is flat up to `usual`; beyond, ln c has a normal prior.

    Returns:
        The constant noise, and the relative noise.
    """
    top = float(signal.max())
    ratios = np.concatenate([[0.0], np.geomspace(1e-2, 1e4, 61) / top]) if top > 0 else np.array([0.0])
    shape = 1 + (ratios[:, None] * signal) ** 2
    total = float(dof.sum())
    sigma2 = (dof * variance / shape).sum(axis=1) / total
    deviance = total * np.log(np.maximum(sigma2, 1e-300)) + (dof * np.log(shape)).sum(axis=1)
    if usual is not None:
        beyond = np.log(np.maximum(np.sqrt(sigma2) * ratios / usual, 1.0))
        deviance = deviance + (beyond / _USUAL_SPREAD) ** 2
    best = int(np.argmin(deviance))
    sigma = float(np.sqrt(sigma2[best]))
    return sigma, sigma * float(ratios[best])


def falling_means(curve: AveragedCurve, errors: FloatArray) -> AveragedCurve | None:
    """Combine neighboring distances whose outputs rise by noise, so that the outputs fall from each to the next.

    `errors` are the standard errors of the outputs. A combined point has the weighted mean distance and output, but the
    ends of the range stay where they are.

    Returns:
        The falling outputs; None if the noise does not explain a rise.
    """
    if (np.diff(curve.output) < 0).all():
        return curve
    weights = 1 / np.maximum(errors, 1e-300) ** 2
    fitted, starts = nonincreasing(curve.output, weights)
    if not (np.abs(fitted - curve.output) <= _EXPLAINED * errors).all():
        return None
    total = np.add.reduceat(weights, starts)
    distance = np.add.reduceat(weights * curve.distance, starts) / total
    distance[[0, -1]] = curve.distance[[0, -1]]
    return AveragedCurve(distance=distance, output=fitted[starts], count=np.add.reduceat(curve.count, starts))


def nonincreasing(values: FloatArray, weights: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the nearest values that never increase, in weighted least squares, by pooling neighbors that do.

    Returns:
        The values, and the index of the first member of each group of equal values.
    """
    groups: list[tuple[float, float, int]] = []  # mean, weight and first member
    for i, (value, weight) in enumerate(zip(values.tolist(), weights.tolist(), strict=True)):
        mean, total, start = value, weight, i
        while groups and groups[-1][0] <= mean:
            other, size, start = groups.pop()
            mean += size / (size + total) * (other - mean)  # equal means stay exactly equal
            total += size
        groups.append((mean, total, start))
    starts = np.array([start for *_, start in groups], dtype=np.int64)
    means = np.array([mean for mean, *_ in groups])
    return np.repeat(means, np.diff(np.append(starts, len(values)))), starts


def max_scatter(distance: FloatArray, values: FloatArray, *, unknown: float) -> float:
    """Return an upper limit of the scatter of values about a smooth curve.

    Four neighboring values show their scatter by the deviation from a parabola.

    Returns:
        The upper end of the 90 % interval of the standard deviation; `unknown` with fewer than three such deviations.
    """
    freedom = len(values) - _NEIGHBORS + 1
    if freedom < _FEWEST_REPEATS:
        return unknown
    from scipy.special import gammaincinv  # noqa: PLC0415 - SciPy is loaded only for fits

    places, y = (np.lib.stride_tricks.sliding_window_view(v, _NEIGHBORS) for v in (distance, values))
    apart = places[:, :, None] - places[:, None, :] + np.eye(_NEIGHBORS)
    weights = 1 / apart.prod(axis=2)
    deviation = np.einsum("ni,ni->n", weights, y) / np.linalg.norm(weights, axis=1)
    return float(np.sqrt(np.sum(deviation**2) / (2 * gammaincinv(freedom / 2, 0.05))))


def slope_weights(distance: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the weights that compute the slope of a fitted line.

    The weighted sum of values at these distances [m] is the slope of the line.
    """
    weight = 1 / variance
    away = distance - float(weight @ distance) / float(weight.sum())
    return np.asarray(weight * away / float(weight @ away**2))


def count_copies_once(calibration: Calibration) -> Calibration:
    """Return a calibration without exact copies of readings.

    Copies contain no information about the noise. There are copies if repeated readings are equal at every distance
    with repeats, or if every reading occurs equally often.

    Copies, averages and readings of a sensor that is coarser than its noise contain no more information than one of
    them. Some equal readings of a sensor with integer outputs are no copies, because others differ.
    """
    pairs = calibration.distances + 1j * calibration.outputs  # np.unique compares distances first, then outputs
    pairs, place, counts = np.unique(pairs, return_inverse=True, return_counts=True)
    first = np.unique(pairs.real, return_index=True)[1]
    repeated = np.add.reduceat(counts, first) > 1
    all_equal = bool((np.diff(np.append(first, len(pairs)))[repeated] == 1).all())
    times = int(np.gcd.reduce(counts))
    if repeated.sum() < _FEWEST_COPIED or not (all_equal or times > 1):
        return calibration
    kept = np.ones_like(counts) if all_equal else counts // times
    keep = _occurrence(place, counts) < kept[place]
    values, empty_place, empty_counts = np.unique(calibration.no_object, return_inverse=True, return_counts=True)
    empty_times = int(np.gcd.reduce(empty_counts)) if len(values) else 1
    keep_empty = _occurrence(empty_place, empty_counts) < (empty_counts // empty_times)[empty_place]
    return replace(
        calibration,
        distances=calibration.distances[keep],
        outputs=calibration.outputs[keep],
        no_object=calibration.no_object[keep_empty],
    )


def _occurrence(place: IntArray, counts: IntArray) -> IntArray:
    """For each reading, count the earlier readings that are equal to it. Equal readings have the same index `place`."""
    earlier = np.empty(len(place), dtype=np.int64)
    earlier[np.argsort(place, kind="stable")] = np.arange(len(place)) - np.repeat(np.cumsum(counts) - counts, counts)
    return earlier


_MANY: Final = 100  # number of distinct distances above which they are condensed
_FEW: Final = 50  # number of condensed distances, including both ends
_BLOCKS: Final = 100  # groups of readings from which the shape of the curve is estimated
_ENDS: Final = 2


def condense(calibration: Calibration) -> Calibration:
    """Combine the readings of a long calibration into groups.

    Calibrations with more than 100 distances are reduced to at most 50 groups. The range is divided into parts with
    equal steps of the sum of two terms: the decrease of asinh((y - y_far) / tau), which is ln xi above the noise tau,
    and the increase of l. So parts are narrow where the curve is steep. The first and the last distance are separate
    parts. Each reading is moved to the mean distance of its part, along a cubic spline through the medians of the
    parts; the error is of fourth order in the width of a part. Readings of exactly 0 (lost) and at a repeated largest
    value (clipped) are not moved, so that they are still recognized. The order of the readings does not change.

    Returns:
        The calibration with these groups.
    """
    distance = calibration.distances
    if len(calibration.distinct_distances) <= _MANY:
        return calibration
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - SciPy is loaded only for fits

    order = np.argsort(distance, kind="stable")
    places, part = _parts(distance[order], calibration.outputs[order])
    part = part[np.argsort(order, kind="stable")]
    part[distance == distance.min()] = -1  # the ends are separate parts, because they determine the curve there
    part[distance == distance.max()] = len(places)
    _, part = np.unique(part, return_inverse=True)
    count = int(part.max()) + 1
    middle = np.array([distance[part == i].mean() for i in range(count)])
    median = np.array([np.median(calibration.outputs[part == i]) for i in range(count)])
    inner = slice(1, -1)  # readings at the ends are not moved, and a single reading is too noisy for the spline
    spline = CubicSpline(middle[inner], median[inner]) if count > _ENDS + 1 else None
    moved = calibration.outputs - (spline(distance) - spline(middle[part]) if spline else 0.0)
    at_top = calibration.outputs == calibration.outputs.max()
    unmoved = (calibration.outputs == 0) | (at_top & (at_top.sum() > 1))
    widths = [format_quantity(float(w), "m", 3) for w in (np.diff(places).min(), np.diff(places).max())]
    distinct, source = len(calibration.distinct_distances), calibration.source
    note = (
        f"The readings at {distinct} distances were combined into {count} groups of neighboring "
        "distances. The readings of each group were averaged. "
        f"The narrowest group is {widths[0]} wide, and the widest group is {widths[1]} wide."
    )
    return replace(
        calibration,
        distances=middle[part],
        outputs=np.where(unmoved, calibration.outputs, moved),
        source=None if source is None else replace(source, notes=(*source.notes, note)),
    )


def _parts(distance: FloatArray, output: FloatArray) -> tuple[FloatArray, IntArray]:
    """Divide readings into groups of neighboring distances.

    The readings are sorted by distance.

    Returns:
        The borders of the groups, and the group of each reading.
    """
    blocks = np.array_split(np.arange(len(distance)), _BLOCKS)
    at = np.array([distance[b].mean() for b in blocks])
    level = np.array([np.median(output[b]) for b in blocks])
    noise = np.median(np.abs(np.diff(output))) + 1e-3 * float(np.ptp(level)) + 1e-300
    far = float(level.min())
    log_level = np.arcsinh((np.minimum.accumulate(level) - far) / noise)
    fallen = (log_level[0] - log_level) / max(float(np.ptp(log_level)), 1e-300)
    advanced = (at - distance[0]) / max(float(distance[-1] - distance[0]), 1e-300)
    progress = np.maximum.accumulate(fallen + advanced)
    marks = np.interp(np.linspace(0.0, progress[-1], _FEW - 1)[1:-1], progress, at)
    borders = np.unique(np.concatenate([[distance[0]], marks, [distance[-1]]]))
    return borders, np.clip(np.searchsorted(borders, distance, side="right") - 1, 0, len(borders) - 2)
