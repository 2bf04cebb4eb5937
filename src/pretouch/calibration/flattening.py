"""Where the output flattens toward the sensor: an amplifier or converter that compresses, and curves that hide it.

Ideal curves fall most steeply, in ln xi, where they are nearest: -g never grows with distance. An output that
approaches a ceiling below full scale has its slope fall toward zero instead, over a part of the range; a curve that is
fitted through it is too steep there. What is compared is the slope itself: a straight line through the residuals of the
nearest readings is the difference between the slope of the readings and that of the curve, whatever the shape of both.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.sensors import Family

from .averaging import AveragedCurve, slope_weights
from .family_fits import Problem, families_of, forward_change
from .result import NoiseEstimate, OffsetEstimate

_FALL: Final = 0.5  # of ln xi: over so much the slope is judged
_AHEAD: Final = 0.25  # of ln xi: from so far out on the curve is fitted that foretells the slope
_MISFIT: Final = 0.005
_FEWEST: Final = 4  # points in a straight line
_FEWEST_TO_SEE: Final = 7  # points of a curve
_TOO_FLAT: Final = 0.1  # of g: what is flatter than the curve by more than that is not its near end
_SURE: Final = 2.5  # standard errors
_MARGIN: Final = 0.35  # of ln xi, beyond where flattening is seen: over so much it fades to a third, p being 3
_CLEAR: Final = 0.15  # of the largest signal: what is smaller has a slope that an offset may make
_LEFT: Final = 5  # points at least that a curve is fitted to
_NARROWEST: Final = 0.8  # of the points, at most, that may be left out


def first_steep(curve: AveragedCurve, noise: NoiseEstimate, known: OffsetEstimate | None, *, flat: bool) -> int:
    """Find the first point from which on readings are as steep as a curve that fits them; 0 where nothing flattens."""
    # The misfit of the noise is not used, for it may be the flattening itself; `flat`: the first point is known to have
    # no slope.
    if len(curve.distance) < _FEWEST_TO_SEE:
        return _beyond(curve, 0, known) if flat else 0
    index = _bulging(curve, noise, None)
    if known is not None and known.kind == "measured":
        index = max(index, _bulging(curve, noise, known))
    index += _first_followed(curve.part(slice(index, None)), noise, known)
    if index == 0 and not flat:
        return 0
    return _beyond(curve, index, known)


def _beyond(curve: AveragedCurve, index: int, known: OffsetEstimate | None) -> int:
    """Return the point at which the signal has fallen so far that what flattened it has faded."""
    base = float(curve.output.min()) if known is None else known.value
    signal = curve.output - base
    beyond = np.flatnonzero(signal <= np.exp(-_MARGIN) * signal[index])
    last = min(int(_NARROWEST * len(signal)), len(signal) - _LEFT - (known is None))
    return int(min(max(beyond[0] if len(beyond) else index, index), max(last, index)))


def _bulging(curve: AveragedCurve, noise: NoiseEstimate, known: OffsetEstimate | None) -> int:
    """Return the first point whose slope is not surely smaller than one farther away.

    Without an offset it is that of the output, which is convex wherever ln xi is, whatever the offset.
    """
    top = float(curve.output.max())
    base = float(curve.output.min()) if known is None else known.value
    signal = np.maximum(curve.output - base, 1e-12 * max(abs(top), 1e-300))
    own = np.hypot(noise.output, noise.relative * signal) / np.sqrt(curve.count)
    if known is None:
        value, error, drop = -curve.output, own, 0.25 * (top - base)
        usable = len(curve.distance)
    else:
        value, error, drop = -np.log(signal), own / signal, _FALL
        usable = int(np.sum(np.cumprod(signal > np.maximum(_CLEAR * (top - base), 20 * known.standard_error))))
    slopes, errors = [], []
    for k in range(usable - 1):
        stop = k + _FEWEST
        while stop < usable and value[stop - 1] - value[k] < drop:
            stop += 1
        if stop > usable:
            break
        line = slope_weights(curve.distance[k:stop], error[k:stop] ** 2 + (1e-6 * drop) ** 2)
        slopes.append(float(line @ value[k:stop]))
        errors.append(float(np.sqrt((line**2 * error[k:stop] ** 2).sum())))
    if len(slopes) < 2:
        return 0
    sure = np.array(slopes) - _SURE * np.array(errors)
    ahead = np.maximum.accumulate(sure[::-1])[::-1]
    low = np.array(slopes) < (1 - _TOO_FLAT) * ahead
    return int(np.argmin(low)) if low[0] else 0


def _first_followed(curve: AveragedCurve, noise: NoiseEstimate, known: OffsetEstimate | None) -> int:
    """Return the first point from which on a curve through what lies beyond foretells the slope of the readings."""
    count = len(curve.distance)
    last = min(int(_NARROWEST * count), count - _LEFT - (known is None))
    if last < 1:
        return 0
    ok = np.zeros(last + 1, dtype=bool)
    for family in families_of(curve):
        if not ok[0]:
            ok |= _foretold(curve, family, noise, known, last)
    return int(np.argmax(ok)) if ok.any() else last


def _foretold(
    curve: AveragedCurve, family: Family, noise: NoiseEstimate, known: OffsetEstimate | None, last: int
) -> BoolArray:
    """Tell from which first points on the slope of the readings is that of a curve fitted a little farther out."""
    distance, count, first = curve.distance, last + 1, np.arange(len(curve.distance) - _LEFT + 1)
    problem = Problem(
        curve=curve,
        family=family,
        noise=replace(noise, misfit=_MISFIT),
        offsets=None if known is None else np.full(len(first), known.value),
        weights=np.arange(len(distance)) >= first[:, None],
    )
    fits = problem.minimize_from_afar(len(first), family.easing(*problem.bounds()))
    offset = fits.x[:, -1] if problem.offsets is None else problem.offsets
    log = np.clip(family.log_output(fits.x[:, :3], distance), -600, 600)
    slope = family.slope(fits.x[:, :3], distance)
    covariance = fits.covariances[:, :3, :3]
    ok = np.ones(count, dtype=bool)
    for k in range(count):
        fallen, nearer = np.searchsorted(-log[k], -log[k, k] + np.array([_FALL, _AHEAD]))
        stop = min(max(int(fallen), k + _FEWEST), len(distance))
        ahead = min(max(int(nearer), k + 2), len(fits.x) - 1)
        part = slice(k, stop)
        for i in (k, ahead):
            signal = curve.output[part] - offset[i]
            if (signal <= 0).any():
                continue
            miss = np.log(signal) - log[i, part]
            variance = (noise.output / signal) ** 2 / curve.count[part] + noise.relative**2 / curve.count[part] + 1e-8
            line = slope_weights(distance[part], variance)
            own = float((line**2 * variance).sum())
            change = forward_change(family.log_output, fits.x[i, :3], distance[part]) @ line
            spread = _roughness(fits.residuals[i, max(stop, i) :])
            error = np.sqrt(own + spread * float(change @ covariance[i] @ change))
            g = -float(slope[i, part].mean())
            flatter = float(line @ miss) / g
            ok[k] &= flatter <= _TOO_FLAT or flatter <= _SURE * error / g
    return ok


def _roughness(standardized: FloatArray) -> float:
    """Return the variance of neighbors about each other, at least one: what is smooth does not count."""
    if len(standardized) < 3:
        return 1.0
    return max(float(np.mean(np.diff(standardized) ** 2) / 2), 1.0)
