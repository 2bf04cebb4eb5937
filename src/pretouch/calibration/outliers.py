"""Distances at which the mean of all readings fits no curve through the others."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import Family

from .averaging import MAD_TO_SIGMA, AveragedCurve, ReadingNoise
from .family_fits import fit_free, forward_change, problem_at, quick_families
from .noise import find_noise
from .result import NoiseEstimate, OffsetEstimate

__all__ = ["bad_distances"]

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
