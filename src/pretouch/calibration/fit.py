"""One model on one calibration: the curve, its parameters with their uncertainty, and how well it fits."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Final, TypeVar

import numpy as np

from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import Family, Table, known_curves

from .averaging import AveragedCurve
from .data import Calibration
from .diagnostics import corrected_akaike, r_squared, root_mean_square, runs_p_value, slope_error
from .family_fits import Problem, fit_free
from .many_fits import Fits
from .preparation import OffsetChoice, Prepared, prepare
from .result import Estimate, NoiseEstimate, OffsetEstimate, SensorFit
from .uncertainty import estimates

__all__ = ["check_models", "fit_prepared", "fit_sensor", "model_names", "why_not"]

_TABLE: Final = "table"

_Part = TypeVar("_Part")


def fit_sensor(
    calibration: Calibration,
    model: str = "inverse-power",
    *,
    offset: OffsetChoice = "auto",
    saturation: float | str | None = "auto",
    near_field_peak: float | str | None = "auto",
    floor_sigmas: float = 3.0,
) -> SensorFit:
    """Fit one model of L(3), L(5), L(6) or its kin to a calibration, on ln xi.

    An option that is none of those described raises `InvalidInputError`.

    Args:
        calibration: the readings.
        model: "inverse-power", "exponential-1", "exponential-2", "mittag-leffler" or "table".
        offset: output with no object: "auto" (measured where there are no-object readings, else fitted), "fit",
            "zero", a number in the unit of the outputs, or a number and its standard error.
        saturation: output from which readings are clipped; "auto" to find it, None where nothing clips.
        near_field_peak: distance of the near-field peak [m], or text with a unit; "auto" to find it, None for none.
        floor_sigmas: how many standard errors above the offset a signal must stand to be used.

    Returns:
        The fit; its `sensor` is valid on the usable window.

    Raises:
        ResultUnavailableError: there is no usable signal, or this model cannot describe it; `rank_models` returns a
            report that says so instead.

    Examples:
        >>> distance = np.linspace(0.0, 0.042, 15)
        >>> measured = Calibration(distances=distance, outputs=1.30e-5 / (distance + 0.0419) ** 3.32, unit="V")
        >>> fit = fit_sensor(measured, "inverse-power", offset="zero")
        >>> round(fit.parameters["exponent"].value, 6)
        3.32
    """
    check_models((model,))
    prepared = prepare(
        calibration,
        offset=offset,
        saturation=saturation,
        near_field_peak=near_field_peak,
        floor_sigmas=floor_sigmas,
    )
    reason = " ".join(prepared.no_signal) or why_not(model, prepared)
    if reason:
        raise ResultUnavailableError(f"{calibration.name}: {model} cannot be fitted. {reason}")
    return fit_prepared(model, prepared)


def check_models(models: tuple[str, ...]) -> None:
    """Refuse names that are no models, and none at all."""
    for model in models:
        if model not in model_names() and model not in known_curves(fitted=True, foreign=True):
            raise InvalidInputError(f"model: found {model!r}, expected one of {', '.join(model_names())}")
    if not models:
        raise InvalidInputError(f"models: found none, expected one or more of {', '.join(model_names())}")


def why_not(model: str, prepared: Prepared) -> str:
    """Say why a model cannot be fitted to readings that do carry a signal; nothing where it can."""
    used = prepared.used
    if model != "table":
        count, size = len(used.distance), _family(model, used).size
        return "" if count > size else f"It has {size} parameters, and only {count} distances stand above the floor."
    rises = np.flatnonzero(np.diff(used.output) >= 0)
    if not len(rises):
        return ""
    d = used.distance[rises[0] : rises[0] + 2] * 1e3
    return f"The averaged output does not fall from {d[0]:g} to {d[1]:g} mm, and a table must fall strictly."


def model_names() -> tuple[str, ...]:
    """Return the names of the models that are ranked where none are named."""
    return (*sorted(known_curves(fitted=True)), _TABLE)


def _family(model: str, used: AveragedCurve) -> Family:
    curve = known_curves(foreign=True)[model]
    return curve.family(curve=curve, first=float(used.distance[0]), last=float(used.distance[-1]))


def fit_prepared(model: str, prepared: Prepared) -> SensorFit:
    """Fit one model to prepared readings."""
    used, offset, noise = prepared.used, _given(prepared.offset), _given(prepared.noise)
    if model == "table":
        return _fit_table(prepared, offset, noise)
    family = _family(model, used)
    best = fit_free(used, family, noise, offset.value)
    problem = Problem(curve=used, family=family, noise=noise, offsets=np.array([offset.value]))
    ends = np.array([o for o in (offset.low, offset.high) if o != offset.value])
    shifted = replace(problem, offsets=ends).minimize(np.repeat(best.x, len(ends), axis=0)).x
    x = best.x[0]
    sensor = family.sensor(x, used.distance[0].item(), used.distance[-1].item())
    xi = used.output - offset.value
    spread = estimates(problem, best, offset=offset, shifted=list(shifted), informed_by=prepared.informed_by)
    log_model = family.log_output(x, used.distance)
    residuals = np.log(xi) - log_model
    deviance = float(best.costs[0]) + _log_variance(used, xi, noise)
    return SensorFit(
        model=model,
        sensor=sensor,
        parameters=_with_units(spread.parameters, sensor.parameters, family, prepared.calibration.unit),
        covariance=spread.covariance,
        middle_slope=spread.middle_slope,
        window=prepared.window,
        offset=offset,
        noise=noise,
        distances=used.distance,
        residuals=residuals,
        r_squared=r_squared(xi, np.exp(log_model)),
        rmse_log_output=root_mean_square(residuals),
        rmse_log_slope=slope_error(used.distance, residuals),
        aicc=corrected_akaike(deviance, prepared.informed_by, len(x)),
        cross_validation=_cross_validation(problem, best),
        runs_p_value=runs_p_value(residuals),
        slope_shift=spread.slope_shift,
        outliers=prepared.outliers,
        identifiable=spread.identifiable,
        warnings=_warnings(spread.slope_shift, offset, x, family, spread.parameters),
    )


def _given(part: _Part | None) -> _Part:
    """Return what is there wherever there is a signal."""
    if part is None:
        raise AssertionError
    return part


def _log_variance(curve: AveragedCurve, xi: FloatArray, noise: NoiseEstimate) -> float:
    """Return the part of -2 ln L of ln xi that is the same for every model."""
    return float(np.sum(np.log(2 * np.pi * (noise.of_means(curve.count, xi) / xi) ** 2)))


def _cross_validation(problem: Problem, best: Fits) -> float | None:
    """Return the RMS error of ln xi at distances left out one by one."""
    curve, count = problem.curve, len(problem.curve.distance)
    if count - 1 < problem.family.size or problem.offsets is None:
        return None
    offset = float(problem.offsets[0])
    many = replace(problem, offsets=np.full(count, offset), weights=~np.eye(count, dtype=bool))
    found = many.minimize(np.repeat(best.x, count, axis=0))
    predicted = np.diagonal(problem.family.log_output(found.x, curve.distance))
    return root_mean_square(np.log(curve.output - offset) - predicted)


def _with_units(
    parameters: dict[str, Estimate], fitted: dict[str, float], family: Family, output_unit: str
) -> dict[str, Estimate]:
    """Give every estimate its unit, and the very value that the sensor has."""
    units = {}
    for f in fields(family.curve):
        of_output = f.metadata.get("of_output")
        units[f.name] = f.metadata.get("unit", "") if of_output is None else f"{output_unit} {of_output}".strip()
    return {name: _clear(e, fitted[name], units[name]) for name, e in parameters.items()}


def _clear(estimate: Estimate, value: float, unit: str) -> Estimate:
    """Give an estimate its unit and a value, which its interval holds."""
    return replace(estimate, value=value, unit=unit, low=min(estimate.low, value), high=max(estimate.high, value))


def _warnings(
    shift: float, offset: OffsetEstimate, x: FloatArray, family: Family, parameters: dict[str, Estimate]
) -> tuple[str, ...]:
    low, high = family.bounds
    at_bound = any(min(value - low[i], high[i] - value) < 1e-4 for i, value in enumerate(x))
    found = list(family.remarks(parameters, at_bound=at_bound))
    if offset.kind == "fitted":
        found.append(
            f"The offset was fitted, not measured; one standard error of it moves the slope by {100 * shift:.2g} %."
        )
    return tuple(found)


def _fit_table(prepared: Prepared, offset: OffsetEstimate, noise: NoiseEstimate) -> SensorFit:
    """Take the averaged curve as it is."""
    used = prepared.used
    xi = used.output - offset.value
    sensor = Table(distances=tuple(used.distance.tolist()), outputs=tuple(xi.tolist()))
    errors = []
    for i in range(1, len(xi) - 1):
        rest = np.arange(len(xi)) != i
        part = Table(distances=tuple(used.distance[rest].tolist()), outputs=tuple(xi[rest].tolist()))
        errors.append(float(np.log(xi[i]) - part.log_output(float(used.distance[i]))))
    middle = float((used.distance[0] + used.distance[-1]) / 2)
    k = int(np.clip(np.searchsorted(used.distance, middle), 1, len(xi) - 1))
    own = noise.of_means(used.count, xi) / xi
    error = float(np.hypot(own[k - 1], own[k]) / (used.distance[k] - used.distance[k - 1]))
    slope = float(sensor.log_slope(middle))
    return SensorFit(
        model="table",
        sensor=sensor,
        parameters={},
        covariance=np.empty((0, 0)),
        middle_slope=Estimate(
            value=slope, standard_error=error, low=slope - 1.96 * error, high=slope + 1.96 * error, unit="1/m"
        ),
        window=prepared.window,
        offset=offset,
        noise=noise,
        distances=used.distance,
        residuals=np.zeros(len(xi)),
        r_squared=1.0,
        rmse_log_output=0.0,
        rmse_log_slope=0.0,
        aicc=None,
        cross_validation=root_mean_square(np.array(errors)) if errors else None,
        runs_p_value=None,
        outliers=prepared.outliers,
        warnings=("A table passes through the readings with their noise; cross-validation alone judges it.",),
    )
