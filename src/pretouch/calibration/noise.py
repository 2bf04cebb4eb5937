"""Noise and misfit: what readings at one distance scatter, and how far their mean lies from any curve."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import Family

from .averaging import AveragedCurve, ReadingNoise, two_components
from .family_fits import families_of, fit_free
from .result import NoiseEstimate, OffsetEstimate

__all__ = ["find_noise"]

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
