"""From a minimum to estimates: covariance, profile intervals, the share of the offset, what runs away together."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.sensors import Family, SensorModel

from .family_fits import Problem
from .many_fits import Fits, gradient, intervals
from .result import Estimate, OffsetEstimate

__all__ = ["estimates"]


def estimates(
    problem: Problem, best: Fits, sensor: SensorModel, *, offset: OffsetEstimate, output_unit: str, informed_by: int
) -> dict[str, Any]:
    """Work out what a fit, b = 1, at its offset knows about its parameters and the slope in the middle of a window."""
    # The parameters, their covariance, and what else a `SensorFit` says of them. Its offset, if it is not exact, moves
    # the parameters to those fitted at either end of its interval; `informed_by` points told the noise.
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    family, x = problem.family, best.x[0]
    dof = max(best.residuals.shape[1] - len(x), 1)
    inflation = max(1.0, float(best.costs[0]) / dof)  # a model that does not fit does not know its parameters better
    known = informed_by - 3 - (offset.kind == "fitted")  # degrees of freedom of the noise
    rise = float(stdtrit(max(dof, known), 0.975)) ** 2 * inflation
    outer = np.array([o for o in (offset.low, offset.high) if o != offset.value])
    shifted = replace(problem, offsets=outer).minimize(np.repeat(best.x, len(outer), axis=0)).x
    share = offset.standard_error / (offset.high - offset.low) if len(shifted) == 2 else 0.0
    place = np.array([family.middle])

    def every(u: FloatArray) -> FloatArray:
        rows = [family.coordinates(row) for row in u]
        return np.column_stack([rows, np.log(np.maximum(-family.slope(u, place)[:, 0], 1e-9))])

    center, moved = every(best.x)[0], [every(u[None])[0] for u in shifted]
    least, most = np.min([center, *moved], axis=0), np.max([center, *moved], axis=0)
    ends = []
    found = intervals(problem.residuals, best, problem.bounds(), every, rise)
    for at, lowest, highest, (low, high, *reached) in zip(center, least, most, found, strict=True):
        down = at - math.hypot(at - low, at - lowest) if reached[0] else low
        up = at + math.hypot(high - at, highest - at) if reached[1] else high
        ends.append((down, up, reached[0], reached[1]))
    own = best.covariances[0]
    covariance = _covariance(x, own, family, moved, share=share, inflation=inflation)
    slopes = [-math.exp(v) for v in (center[-1], ends[-1][1], ends[-1][0])]
    moved_slopes = [-math.exp(m[-1]) for m in moved]
    shift = share * abs(moved_slopes[1] - moved_slopes[0]) / abs(slopes[0]) if share else 0.0
    log_slope = gradient(lambda u: every(u[None])[0, -1:], x)[0]
    slope_error = abs(slopes[0]) * math.hypot(math.sqrt(inflation * float(log_slope @ own @ log_slope)), shift)
    middle = Estimate(value=slopes[0], standard_error=slope_error, low=slopes[1], high=slopes[2], unit="1/m")
    runaway = family.runs_away(ends)
    parameters = _parameters(family, sensor, center[:-1], ends[:-1], covariance, unit=output_unit, runaway=runaway)
    at_bound = any(min(value - low, high - value) < 1e-4 for value, low, high in zip(x, *family.bounds, strict=True))
    warnings = family.remarks(parameters, at_bound=at_bound)
    if offset.kind == "fitted":
        moves = f"one standard error of it moves the slope by {100 * shift:.2g} %."
        warnings = (*warnings, f"The offset was fitted, not measured; {moves}")
    return {
        "parameters": parameters,
        "covariance": covariance,
        "middle_slope": middle,
        "slope_shift": shift,
        "identifiable": family.told_apart(parameters, middle, runaway=runaway),
        "warnings": warnings,
    }


def _covariance(
    x: FloatArray, own: FloatArray, family: Family, moved: list[FloatArray], *, share: float, inflation: float
) -> FloatArray:
    """Carry the covariance to the written parameters and add what the offset contributes."""
    with np.errstate(over="ignore", invalid="ignore"):  # a scale that runs away has no finite variance
        jacobian = gradient(lambda u: family.parameters(family.coordinates(u)), x)
        covariance = inflation * jacobian @ own @ jacobian.T
        if share:
            shift = share * (family.parameters(moved[1][:-1]) - family.parameters(moved[0][:-1]))
            covariance = covariance + np.outer(shift, shift)
    return np.asarray(np.where(np.isfinite(covariance), covariance, np.inf))


def _parameters(
    family: Family,
    sensor: SensorModel,
    center: FloatArray,
    ends: list[tuple[float, float, bool, bool]],
    covariance: FloatArray,
    *,
    unit: str,
    runaway: bool,
) -> dict[str, Estimate]:
    """Map the intervals of the coordinates to those of the written parameters, which have the sensor's values."""
    found = {}
    for i, told in enumerate(sensor._declared()):
        name, meta, mapped = told.name, told.metadata, []
        for k in (0, 1):
            q = center.copy()
            q[i] = ends[i][k]
            mapped.append((float(family.parameters(q)[i]), ends[i][2 + k]))
        (low, low_reached), (high, high_reached) = sorted(mapped)
        first, last = meta["domain"]
        low, high = low if low_reached else first, high if high_reached else last
        if runaway:
            low, high = first if name == "scale" else low, math.inf
        error = float(np.sqrt(max(covariance[i, i], 0.0))) if math.isfinite(high - low) else math.inf
        value, of_output = sensor.parameters[name], meta["of_output"]
        found[name] = Estimate(
            value=value,
            standard_error=error,
            low=min(max(low, first), value),
            high=max(min(high, last), value),
            unit=meta["unit"] if of_output is None else f"{unit} {of_output}".strip(),
        )
    return found
