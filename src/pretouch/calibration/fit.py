"""One model on one calibration: the curve, its parameters with their uncertainty, and how well it fits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import Family, Table, known_curves

from .averaging import AveragedCurve
from .data import Calibration
from .diagnostics import corrected_akaike, r_squared, root_mean_square, runs_p_value, slope_error
from .family_fits import Problem, fit_free, problem_at
from .many_fits import Fits
from .preparation import OffsetChoice, Prepared, prepare
from .result import Estimate, NoiseEstimate, OffsetEstimate, SensorFit
from .uncertainty import estimates

__all__ = ["check_models", "fit_prepared", "fit_sensor", "model_names", "why_not"]

_TABLE: Final = "table"


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
    prepared = prepare(calibration, offset, saturation, near_field_peak, floor_sigmas)
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
    if model != _TABLE:
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
    """Fit one model to prepared readings that carry a signal."""
    used, offset, noise = prepared.used, prepared.offset, prepared.noise
    if offset is None or noise is None:
        raise AssertionError
    xi = used.output - offset.value
    log_model, found = (_fit_table if model == _TABLE else _fit_curve)(model, prepared, offset, noise)
    residuals = np.log(xi) - log_model
    return SensorFit(
        model=model,
        window=prepared.window,
        offset=offset,
        noise=noise,
        distances=used.distance,
        residuals=residuals,
        r_squared=r_squared(xi, np.exp(log_model)),
        rmse_log_output=root_mean_square(residuals),
        rmse_log_slope=slope_error(used.distance, residuals),
        runs_p_value=runs_p_value(residuals),
        outliers=prepared.outliers,
        **found,
    )


def _fit_curve(
    model: str, prepared: Prepared, offset: OffsetEstimate, noise: NoiseEstimate
) -> tuple[FloatArray, dict[str, Any]]:
    """Fit a parametric curve: ln xi at the distances, and what a `SensorFit` says of it alone."""
    used, family = prepared.used, _family(model, prepared.used)
    best = fit_free(used, family, noise, offset.value)
    problem = problem_at(used, family, noise, offset.value)
    xi, x, unit = used.output - offset.value, best.x[0], prepared.calibration.unit
    sensor = family.sensor(x, used.distance[0].item(), used.distance[-1].item())
    deviance = float(best.costs[0]) + float(np.sum(np.log(2 * np.pi * (noise.of_means(used.count, xi) / xi) ** 2)))
    return family.log_output(x, used.distance), {
        "sensor": sensor,
        "aicc": corrected_akaike(deviance, prepared.informed_by, len(x)),
        "cross_validation": _cross_validation(problem, best, offset.value),
        **estimates(problem, best, sensor, offset=offset, output_unit=unit, informed_by=prepared.informed_by),
    }


def _cross_validation(problem: Problem, best: Fits, offset: float) -> float | None:
    """Return the RMS error of ln xi at distances left out one by one."""
    curve, count = problem.curve, len(problem.curve.distance)
    if count - 1 < problem.family.size:
        return None
    many = replace(problem, offsets=np.full(count, offset), weights=~np.eye(count, dtype=bool))
    found = many.minimize(np.repeat(best.x, count, axis=0))
    predicted = np.diagonal(problem.family.log_output(found.x, curve.distance))
    return root_mean_square(np.log(curve.output - offset) - predicted)


def _fit_table(
    _: str, prepared: Prepared, offset: OffsetEstimate, noise: NoiseEstimate
) -> tuple[FloatArray, dict[str, Any]]:
    """Take the averaged curve as it is; what is said of it as `_fit_curve` does."""
    distance, xi = prepared.used.distance, prepared.used.output - offset.value
    sensor, inner = _table(distance, xi), range(1, len(xi) - 1)
    without = [_table(np.delete(distance, i), np.delete(xi, i)).log_output(float(distance[i])) for i in inner]
    middle = float((distance[0] + distance[-1]) / 2)
    k = int(np.clip(np.searchsorted(distance, middle), 1, len(xi) - 1))
    own = noise.of_means(prepared.used.count, xi) / xi
    error = float(np.hypot(own[k - 1], own[k]) / (distance[k] - distance[k - 1]))
    slope, reach = float(sensor.log_slope(middle)), 1.96 * error
    return np.log(xi), {
        "sensor": sensor,
        "parameters": {},
        "covariance": np.empty((0, 0)),
        "middle_slope": Estimate(value=slope, standard_error=error, low=slope - reach, high=slope + reach, unit="1/m"),
        "aicc": None,
        "cross_validation": root_mean_square(np.log(xi[1:-1]) - without) if without else None,
        "warnings": ("A table passes through the readings with their noise; cross-validation alone judges it.",),
    }


def _table(distance: FloatArray, xi: FloatArray) -> Table:
    return Table(distances=tuple(distance.tolist()), outputs=tuple(xi.tolist()))
