"""Generate random sensor curves that agree with the readings.

A gain is tested on them as alternatives to the fitted curve. The controller subtracts one offset o from every output y.
Between two readings, the impulse of the letter's virtual force, L(2), is D_p times the change of ln(y - o). This
impulse does not depend on the curve between the readings, or on the true offset. So the readings themselves contradict
a fit that is wrong between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import PiecewiseCubic
from pretouch.sensors.table import monotone_slopes

from .averaging import AveragedCurve, nonincreasing
from .ceilings import CeilingFits
from .result import DrawnCurve, NoiseEstimate, OffsetEstimate

_LARGEST_ERROR: Final = 0.05  # relative error of a signal that the fits may contribute: more would hide contradictions
_SMALLEST_ERROR: Final = 1e-4
_SMALLEST_SIGNAL: Final = 0.3  # share of the measured signal below which random errors do not reduce it
_EXPLAINED: Final = (
    3.0  # RMS residual of the fits under ceilings, over the noise, up to which they describe the readings
)
_SURE: Final = 3.0  # standard errors of a rise that noise does not explain
_BENDING: Final = 0.35  # standard deviation of ln of a random slope at a reading
_STEEPEST: Final = 3.0  # times the flatter neighboring secant: with more, a cubic is not monotone (Fritsch 1980)


@dataclass(frozen=True, slots=True, kw_only=True)
class Witness(Value):
    """Source of random sensor curves that fit the readings.

    The curves do not depend on the fitted model.

    Args:
        distances: distances with a signal above the offset [m], increasing, shape (N,).
        signals: mean output minus the offset that the controller subtracts, positive, shape (N,).
        errors: relative standard error of each signal, shape (N,).
        offset: the offset that the controller subtracts, in the unit of the outputs.
        ceilings: the fits under soft ceilings.
        follows: whether these fits describe the readings, if not even a ceiling explains why the output flattens.
    """

    distances: FloatArray
    signals: FloatArray
    errors: FloatArray
    offset: float
    ceilings: CeilingFits
    follows: bool = True

    def through_readings(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Return random sensor curves that pass through the readings, within their errors.

        The first curve is linear in ln xi between neighbors, the second is SciPy's PCHIP interpolant. The others
        alternate between linear pieces and random slopes, with each reading moved within its error.
        """
        rng = np.random.default_rng(seed)
        level, width = np.log(self.signals), np.diff(self.distances)
        curves = []
        for number in range(count):
            levels = level
            if number > 1:
                factor = 1 + self.errors * rng.standard_normal(len(level))
                levels = level + np.log(np.maximum(factor, _SMALLEST_SIGNAL))
            levels = _without_noisy_rises(levels, self.errors)
            secants = np.diff(levels) / width
            slopes = [(secant, secant) for secant in secants.tolist()]
            if number % 2:
                bent = monotone_slopes(self.distances, levels)
                if number > 1:
                    bent = _bounded(bent * np.exp(_BENDING * rng.standard_normal(len(bent))), secants)
                slopes = list(pairwise(bent.tolist()))
            curve = PiecewiseCubic(
                distances=tuple(self.distances.tolist()), log_outputs=tuple(levels.tolist()), slopes=tuple(slopes)
            )
            curves.append(DrawnCurve(sensor=curve, offset=self.offset))
        return tuple(curves)

    def draw(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Draw random sensor curves with soft saturation according to their posterior probabilities.

        If no such curve describes the readings, the curves pass through the readings.

        Returns:
            The curves.
        """
        return self.ceilings.draw(count, seed) if self.follows else self.through_readings(count, seed + 1)


def witness_of(
    curve: AveragedCurve,
    offset: OffsetEstimate,
    noise: NoiseEstimate,
    ceilings: CeilingFits,
    farthest: float,
    *,
    flattens: bool = False,
) -> Witness | None:
    """Return a source of random sensor curves.

    The curves fit the readings. Return None if fewer than two readings have a signal. `flattens` says that the nearest
    readings are used although they are flattened; then their noise decides which curves describe them.
    """
    part = curve.part((curve.output > offset.value) & (curve.distance <= farthest))
    if len(part.distance) < 2:
        return None
    signal = part.output - offset.value
    repeated = part.count > 1
    relative = np.where(repeated, noise.relative / np.sqrt(part.count), min(ceilings.error, _LARGEST_ERROR))
    error = np.hypot(noise.output / np.sqrt(part.count) / signal, relative)
    follows = True
    if flattens:
        error = noise.of_readings(part.count, signal) / signal
        follows = ceilings.error <= _EXPLAINED * float(np.median(error))
    return Witness(
        distances=part.distance,
        signals=signal,
        errors=np.clip(error, _SMALLEST_ERROR, 1.0),
        offset=offset.value,
        ceilings=ceilings,
        follows=follows,
    )


def _without_noisy_rises(level: FloatArray, errors: FloatArray) -> FloatArray:
    """Remove rises due to noise from the logarithm of the output.

    The log outputs are unchanged if noise cannot explain all rises.

    Returns:
        The logarithm of the output.
    """
    if (np.diff(level) <= 0).all():
        return level
    falling, _ = nonincreasing(level, 1 / errors**2)
    return falling if (np.abs(falling - level) <= _SURE * errors).all() else level


def _bounded(slopes: FloatArray, secants: FloatArray) -> FloatArray:
    """Limit slopes so that the cubic curve is monotone."""
    near, far = np.concatenate([secants[:1], secants]), np.concatenate([secants, secants[-1:]])
    size = _STEEPEST * np.minimum(np.abs(near), np.abs(far))
    same = np.sign(near) == np.sign(far)
    return np.where(same, np.sign(near) * np.minimum(np.abs(slopes), size), 0.0)
