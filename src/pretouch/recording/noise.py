"""Estimate the offset, noise, resolution and saturation of a sensor from its recorded readings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.control import Conditioning

from .drift import Drift, trend_of
from .no_object import frozen_values, probability_of_at_least
from .timing import ROBUST

_HOUR: Final = 3600.0  # s
_FEWEST: Final = 30  # readings that an estimate needs
_OUTLIER: Final = 8.0  # robust standard deviations, beyond which a difference is no noise
_FOURTH: Final = (1.0, -4.0, 6.0, -4.0, 1.0)  # removes a cubic course, so that only noise remains
_SMOOTHED: Final = 51  # readings of a moving average, whose noise is 0.14 of that of a reading
_SIGMAS: Final = 0.5  # deviation of the moving average, in standard deviations of a reading, that is no noise
_ROUNDS: Final = 4  # the level without an object and the readings without an object follow from each other
_BINS: Final = 8  # levels of xi at which noise is estimated
_FEWEST_LEVELS: Final = 6  # distinct readings: with fewer, equal steps may be chance
_CLIPPED: Final = 5  # readings in a row at the largest value, from which it counts as a limit
_ROUNDED: Final = 10.0  # rounding errors, above which a step is no rounding
_LEAST_NOISE: Final = 0.5  # of the noise with an object: certainly present without one, unless the output is limited
_UNLIKELY: Final = 1e-3  # probability below which so many equal readings are no rounded noise
_WHOLE: Final = 0.02  # of a step: deviation of quantized readings from whole steps


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise(Value):
    """Noise properties of a sensor, estimated from recorded readings.

    A property is None if it is unknown.

    Args:
        offset: median reading without an object, in the unit of the readings.
        noise: robust standard deviation of a reading without an object, from the differences of successive readings.
        wander: robust standard deviation of the readings without an object around their median. It exceeds the noise if
            the offset drifts.
        relative_noise: standard deviation relative to xi, in addition to the noise; None also if the noise is unknown.
        resolution: step of the readings; 0 if they have none.
        largest: largest finite reading.
        clipped: whether the largest reading occurs many times in a row, so that it is probably a limit of the sensor.
        quiet: number of readings without an object.
        drift: significant change of the readings without an object over the recording.
        limited: whether the readings stay at one value without an object; the noise is then that with an object.
    """

    offset: float | None
    noise: float | None
    wander: float | None
    relative_noise: float | None
    resolution: float
    largest: float | None
    clipped: bool
    quiet: int
    drift: Drift | None = None
    limited: bool = False


def noise_of(
    readings: FloatArray,
    regular: BoolArray,
    detecting: BoolArray,
    near: BoolArray,
    offset: float,
    *,
    approaches: BoolArray,
    codes: tuple[float, ...] = (),
    time: FloatArray | None = None,
) -> Noise:
    """Estimate the noise properties of a sensor from its readings.

    Args:
        readings: the readings in the order of their times.
        regular: whether each reading followed the one before after about one period.
        detecting: whether the law detected an object when it used the reading.
        near: whether the reading is shortly before or after a detection, when an object may be near already.
        offset: offset that the controller subtracts, for xi.
        approaches: whether the reading is a few seconds before or after a detection, when an object below the floor
            may already change it.
        codes: values by which the driver says that there is no object; they are no sensor outputs.
        time: times of the readings [s], for a drift.

    Returns:
        The estimates.
    """
    coded = np.isin(readings, codes)
    finite = np.isfinite(readings) & ~coded
    resolution = _resolution(readings[finite])
    quiet = finite & ~detecting & ~near
    for _ in range(_ROUNDS):  # an object whose signal is below the floor is there, too
        kept = quiet & ~(approaches & _around(readings, quiet, regular, detecting, resolution))
        if kept.sum() < _FEWEST or kept.sum() == quiet.sum():
            break
        quiet = kept
    if quiet.sum() < _FEWEST:
        quiet = finite & ~detecting
    values = readings[quiet]
    noise = wander = center = None
    pairs = quiet[1:] & quiet[:-1] & regular[1:]
    if pairs.sum() >= _FEWEST:
        noise = _spread((readings[1:][pairs] - readings[:-1][pairs]) / np.sqrt(2), resolution)
        center = float(np.median(values))
        wander = _spread(values - center, resolution)
    relative = None if noise is None else _relative(readings, finite & detecting, regular, offset, noise)
    # an output that is limited without an object has noise only with an object
    both, limits = None, _limits(values)
    if limits or coded.any():
        both = _both_noises(readings, finite & detecting & ~np.isin(readings, limits), regular, offset)
    if both is not None and not coded.any() and _is_rounding(values, both[0], resolution):
        both = None
    noise, relative = both or (noise, relative)
    largest = float(readings[finite].max()) if finite.any() else None
    if coded.any():  # all other readings are those of an object, so they show no offset
        center = wander = time = None
    return Noise(
        offset=center,
        noise=noise,
        wander=wander,
        relative_noise=relative,
        resolution=resolution,
        largest=largest,
        clipped=_is_clipped(readings[finite]),
        quiet=int(quiet.sum()),
        limited=both is not None,
        drift=None if time is None or noise is None else trend_of(time[quiet], values),
    )


def quiet_floor(conditioning: Conditioning, rate: float, noise: float) -> float:
    """Return the lowest noise floor without frequent false detections.

    Gaussian noise exceeds this floor less than once per hour.

    Args:
        conditioning: how the controller processes the readings.
        rate: readings per second [Hz].
        noise: standard deviation of a reading without an object.

    Returns:
        The floor in the unit of the readings; 0 with a low-pass filter, or if rate or noise are unknown.
    """
    if conditioning.low_pass_order or not rate > 0 or not noise > 0:
        return 0.0
    window = conditioning.median_window
    if window == 1:  # after a median, the readings of an average depend on each other: the median alone is a bound
        noise /= math.sqrt(conditioning.moving_average)
    least = (window + 1) // 2  # readings above the floor for a median above it
    chance = (1 / (_HOUR * rate * math.comb(window, least))) ** (1 / least)
    return -noise * NormalDist().inv_cdf(chance)


def _around(
    readings: FloatArray, quiet: BoolArray, regular: BoolArray, detecting: BoolArray, resolution: float
) -> BoolArray:
    """Return the readings before and after each detection whose moving average differs from the quiet readings."""
    pairs = quiet[1:] & quiet[:-1] & regular[1:]
    if pairs.sum() < _FEWEST:
        return np.zeros(len(readings), dtype=bool)
    center = float(np.median(readings[quiet]))
    noise = _spread((readings[1:][pairs] - readings[:-1][pairs]) / np.sqrt(2), resolution)
    filled = np.pad(np.where(np.isfinite(readings), readings, center), _SMOOTHED // 2, "edge")
    smooth = np.convolve(filled, np.full(_SMOOTHED, 1 / _SMOOTHED), "valid")
    away = (np.abs(smooth - center) > _SIGMAS * noise) | detecting
    edges = np.flatnonzero(np.diff(away, prepend=False, append=False))
    around = np.zeros(len(readings), dtype=bool)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        around[begin:end] = bool(detecting[begin:end].any())
    return around


def _spread(deviations: FloatArray, resolution: float) -> float:
    """Return a standard deviation that ignores outliers."""
    robust = float(ROBUST * np.median(np.abs(deviations - np.median(deviations))))
    if robust > 2 * resolution:
        return robust
    # the median of few levels is coarse, so the mean square of all but the outliers is used
    kept = np.abs(deviations) <= _OUTLIER * max(robust, resolution, np.finfo(float).tiny)
    return float(np.std(deviations[kept])) if kept.any() else 0.0


def spread_of_course(values: FloatArray, regular: BoolArray) -> float | None:
    """Return the noise of a time series around its trend.

    The noise is a standard deviation. It is None for too few values. Values that repeat exactly, for much longer than
    others, are left out: they are no measurements, but for example the value without an object.

    Args:
        values: the values in the order of their times; those that are not finite are left out.
        regular: whether each value followed the one before after about one period.
    """
    rest, _ = _rest_of_course(values, np.isfinite(values) & ~np.isin(values, frozen_values(values)), regular)
    return None if rest is None else _spread(rest, _resolution(values[np.isfinite(values)]))


def _rest_of_course(
    values: FloatArray, used: BoolArray, regular: BoolArray
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return scaled fourth differences and local means of a time series.

    The standard deviation of the scaled differences equals the noise.
    """
    width, windows = len(_FOURTH), np.lib.stride_tricks.sliding_window_view
    if len(values) < width:
        return None, None
    fits = windows(used, width).all(axis=1) & windows(regular, width)[:, 1:].all(axis=1)
    if fits.sum() < _FEWEST:
        return None, None
    views = windows(values, width)[fits]
    return views @ np.array(_FOURTH) / np.sqrt(np.sum(np.square(_FOURTH))), views.mean(axis=1)


def _variances(
    readings: FloatArray, used: BoolArray, regular: BoolArray, offset: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return squared levels of the sensor output, and the variance of the readings at each level."""
    rest, means = _rest_of_course(readings, used, regular)
    if rest is None or means is None:
        return None
    level = means - offset
    order = np.argsort(level)
    parts = [part for part in np.array_split(order, _BINS) if len(part) >= _FEWEST // 2]
    squares = np.array([np.median(level[part]) ** 2 for part in parts])
    variances = np.array([(ROBUST * np.median(np.abs(rest[part]))) ** 2 for part in parts])
    return (squares, variances) if parts and (variances > 0).any() else None


def _weights(variances: FloatArray) -> FloatArray:
    """Return the weight of each variance.

    The error of a variance is proportional to it. Thus low levels, where the other noise dominates, have little weight.
    """
    return np.asarray(np.where(variances > 0, variances, variances[variances > 0].min()) ** -2.0)


def _relative(readings: FloatArray, used: BoolArray, regular: BoolArray, offset: float, noise: float) -> float | None:
    """Return the noise relative to the sensor output, or None."""
    levels = _variances(readings, used, regular, offset)
    if levels is None:
        return None
    squares, variances = levels
    weights = _weights(variances)
    share = float(weights @ (squares * (variances - noise**2)) / (weights @ squares**2))
    return float(np.sqrt(max(share, 0.0)))


def _both_noises(
    readings: FloatArray, used: BoolArray, regular: BoolArray, offset: float
) -> tuple[float, float] | None:
    """Return the noise without a signal and the noise relative to the output, both from an object's readings."""
    levels = _variances(readings, used, regular, offset)
    if levels is None:
        return None
    squares, variances = levels
    weights = _weights(variances)
    mean = weights @ squares / weights.sum()
    spread = float(weights @ (squares - mean) ** 2)
    slope = float(weights @ ((squares - mean) * variances)) / spread if spread > 0 else 0.0
    constant = float(weights @ variances / weights.sum() - slope * mean)
    if slope < 0:
        return float(np.sqrt(weights @ variances / weights.sum())), 0.0
    if constant < 0:
        return 0.0, float(np.sqrt(weights @ (squares * variances) / (weights @ squares**2)))
    return float(np.sqrt(constant)), float(np.sqrt(slope))


def _limits(values: FloatArray) -> tuple[float, ...]:
    """Return the values that most readings without an object have, because they repeat exactly."""
    frozen = frozen_values(values)
    if not frozen and len(values) >= _FEWEST and (values == values[0]).all():
        return (float(values[0]),)
    return frozen if frozen and np.isin(values, frozen).mean() > 0.5 else ()


def _is_rounding(values: FloatArray, noise: float, resolution: float) -> bool:
    """Return True if rounding alone explains how many readings without an object are equal.

    Rounded readings are equal, too, if the noise is below their resolution. They show a limit only if there are more
    of them than half of the noise with an object would allow.
    """
    if resolution <= 0:
        return False
    _, counts = np.unique(values, return_counts=True)
    rounding = resolution**2 / 12  # variance that the noise with an object contains
    spread = _LEAST_NOISE * float(np.sqrt(max(noise**2 - rounding, 0.0)))
    share = math.erf(resolution / (2 * math.sqrt(2) * spread)) if spread > 0 else 1.0  # if the mean is a whole step
    return probability_of_at_least(int(counts.max()), len(values), share) >= _UNLIKELY


def _resolution(values: FloatArray) -> float:
    """Return the quantization step of the readings, or 0."""
    levels = np.unique(values)
    if len(levels) < _FEWEST_LEVELS:
        return 0.0
    steps = np.diff(levels)
    step = float(steps.min())
    rounding = float(np.spacing(np.float32(np.abs(levels).max())))  # of numbers in single precision
    if step <= _ROUNDED * rounding:
        return 0.0
    multiples = (levels - levels[0]) / step
    return step if np.all(np.abs(multiples - np.round(multiples)) <= _WHOLE + rounding / step) else 0.0


def _is_clipped(values: FloatArray) -> bool:
    """Return True if the readings are probably clipped. The largest value then occurs several times in a row."""
    if len(values) < _CLIPPED or values.min() == values.max():
        return False
    at_top = np.concatenate([[0], (values == values.max()).astype(np.int8), [0]])
    edges = np.diff(at_top)
    return bool((np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)).max() >= _CLIPPED)
