"""Fit one sensor model to a calibration.

Also compute confidence intervals and the goodness of fit.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_percent
from pretouch._core.warning_codes import caution
from pretouch.sensors import Family, SensorModel, Table, sensor_curves
from pretouch.sensors.conformance import refuse_invalid_curve
from pretouch.sensors.model import is_built_in
from pretouch.sensors.registry import CURVE_KINDS, find_curve

from .averaging import AveragedCurve
from .data import Calibration
from .family_fits import Problem, fit_free, problem_at
from .least_squares import Fits, gradient, intervals
from .preparation import OffsetChoice, Prepared, prepare
from .result import Estimate, NoiseEstimate, OffsetEstimate, SensorFit
from .slope_uncertainty import with_choice_of_family

# Singular values of the Jacobian with columns of norm 1: above 0.01 for sensible families, 1e-7 (the error of the
# differences) if two parameters change the curve in the same way.
_ROUNDING: Final = 1e-9  # of the largest residual, up to which a residual is only rounding
_REDUNDANT: Final = 1e-5
_INVOLVED: Final = 0.1  # smallest component of an involved parameter in the direction that does not change the curve


def root_mean_square(values: FloatArray) -> float:
    """Return the root mean square (RMS) of an array."""
    return float(np.sqrt(np.mean(np.square(values))))


def r_squared(measured: FloatArray, modelled: FloatArray) -> float:
    """Return the coefficient of determination of the sensor output.

    R squared is computed as in the published letter.
    """
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1 - float(np.sum((measured - modelled) ** 2)) / total if total > 0 else 0.0


def slope_error(distance: FloatArray, residuals: FloatArray) -> float:
    """Return the RMS error of the modeled sensor slope [1/m].

    The slope is compared between neighboring distances.
    """
    return root_mean_square(np.diff(residuals) / np.diff(distance))


def corrected_akaike(deviance: float, points: int, parameters: int) -> float | None:
    """Return the corrected Akaike information criterion AICc.

    It is None if there are too few points.

    AICc = -2 ln L + 2 k + 2 k (k + 1) / (N - k - 1).
    """
    free = points - parameters - 1
    return None if free <= 0 else deviance + 2 * parameters + 2 * parameters * (parameters + 1) / free


def runs_p_value(residuals: FloatArray) -> float | None:
    """Return the p-value of the Wald-Wolfowitz runs test.

    The test is exact and one-sided. The result is None if all residuals have one sign.

    The p-value is the probability of at most as many runs of equal signs in a random order. Zeros are ignored,
    also those that are only rounding: a table passes through most of its readings.
    """
    signs = np.sign(residuals[np.abs(residuals) > _ROUNDING * np.max(np.abs(residuals), initial=0.0)])
    plus, minus = int((signs > 0).sum()), int((signs < 0).sum())
    if not plus or not minus:
        return None
    runs = 1 + int((signs[1:] != signs[:-1]).sum())
    ways = 0
    for r in range(2, runs + 1):  # both signs have equally many runs, or one of them has one more
        for first, second in ((r // 2, (r + 1) // 2), ((r + 1) // 2, r // 2)):
            ways += math.comb(plus - 1, first - 1) * math.comb(minus - 1, second - 1)
    return ways / math.comb(plus + minus, plus)


def estimates(
    problem: Problem, best: Fits, sensor: SensorModel, *, offset: OffsetEstimate, output_unit: str, informed_by: int
) -> dict[str, Any]:
    """Return the estimated parameters of a curve fit.

    The dictionary has the parameters, their covariance and the mid-range slope, as arguments of `SensorFit`.

    If the offset is uncertain, the curve is also fitted with the offsets at both ends of the interval of the offset.
    The changes of the parameters widen their intervals. The noise was estimated from `informed_by` points.
    """
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    family, x = problem.family, best.x[0]
    _check_identifiable(best, [item.name for item in sensor._declared()])
    dof = max(best.residuals.shape[1] - len(x), 1)
    inflation = max(1.0, float(best.costs[0]) / dof)  # a bad fit must not have small standard errors
    noise_freedom = informed_by - 3 - (offset.kind == "fitted")  # degrees of freedom of the noise
    # increase of the sum of squares from its minimum to the ends of the 95 % intervals
    rise = float(stdtrit(max(dof, noise_freedom), 0.975)) ** 2 * inflation
    end_offsets = np.array([o for o in (offset.low, offset.high) if o != offset.value])
    shifted = replace(problem, offsets=end_offsets).minimize(np.repeat(best.x, len(end_offsets), axis=0)).x
    share = offset.standard_error / (offset.high - offset.low) if len(shifted) == 2 else 0.0
    place = np.array([family.middle])

    def coordinates(u: FloatArray) -> FloatArray:
        slope = np.log(np.maximum(-family.slope(u, place), 1e-9))
        return np.concatenate([family.coordinates(u), slope], axis=-1)

    center, moved = coordinates(best.x)[0], [coordinates(u[None])[0] for u in shifted]
    lowest_of_ends, highest_of_ends = np.min([center, *moved], axis=0), np.max([center, *moved], axis=0)
    ends = []
    profile_intervals = intervals(problem.function(), best, problem.bounds(), coordinates, rise)
    for at, lowest, highest, (low, high, *reached) in zip(
        center, lowest_of_ends, highest_of_ends, profile_intervals, strict=True
    ):
        down = at - math.hypot(at - low, at - lowest) if reached[0] else low
        up = at + math.hypot(high - at, highest - at) if reached[1] else high
        ends.append((down, up, reached[0], reached[1]))
    fit_covariance = best.covariances[0]
    covariance = _covariance(x, fit_covariance, family, moved, share=share, inflation=inflation)
    slopes = [-math.exp(v) for v in (center[-1], ends[-1][1], ends[-1][0])]
    moved_slopes = [-math.exp(m[-1]) for m in moved]
    shift = share * abs(moved_slopes[1] - moved_slopes[0]) / abs(slopes[0]) if share else 0.0
    log_slope = gradient(lambda u: coordinates(u[None])[0, -1:], x)[0]
    standard_error = abs(slopes[0]) * math.hypot(
        math.sqrt(inflation * float(log_slope @ fit_covariance @ log_slope)), shift
    )
    middle = Estimate(value=slopes[0], standard_error=standard_error, low=slopes[1], high=slopes[2], unit="1/m")
    runaway = family.runs_away(ends)
    parameters = _parameters(family, sensor, center[:-1], ends[:-1], covariance, unit=output_unit, runaway=runaway)
    at_bound = any(min(value - low, high - value) < 1e-4 for value, low, high in zip(x, *family.bounds, strict=True))
    warnings = family.remarks(parameters, at_bound=at_bound)
    if offset.kind == "fitted":
        warnings = (
            *warnings,
            "The offset was fitted, not measured. If the offset is wrong by one standard error, the slope "
            f"changes by {format_percent(shift)}.",
        )
    unidentifiable = family.identifiability_remarks(parameters, middle, runaway=runaway)
    return {
        "parameters": parameters,
        "covariance": covariance,
        "middle_slope": middle,
        "slope_shift": shift,
        "unidentifiable": tuple(caution("PT111", text) for text in unidentifiable),
        "warnings": tuple(caution("PT111" if text in unidentifiable else "PT112", text) for text in warnings),
    }


def _check_identifiable(best: Fits, names: list[str]) -> None:
    """Raise an error if fit parameters are not identifiable. Such parameters have the same effect on the curve."""
    norms = np.linalg.norm(best.jacobian[0], axis=0)
    free = np.flatnonzero(norms)  # a parameter at its bound has no derivatives
    if not len(free):
        return
    _, s, vt = np.linalg.svd(best.jacobian[0][:, free] / norms[free], full_matrices=False)
    if s[-1] < _REDUNDANT * s[0]:
        involved = [names[free[i]] for i in np.flatnonzero(np.abs(vt[-1]) > _INVOLVED)]
        raise InvalidInputError(
            f"{' and '.join(involved)}: the readings cannot distinguish the effects of these parameters "
            "on the sensor curve; remove one of the parameters"
        )


def _covariance(
    x: FloatArray, own: FloatArray, family: Family, moved: list[FloatArray], *, share: float, inflation: float
) -> FloatArray:
    """Return the covariance of the sensor curve's parameters. It includes the effect of the offset uncertainty."""
    with np.errstate(over="ignore", invalid="ignore"):  # an unbounded scale has no finite variance
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
    """Compute confidence intervals of the sensor curve's parameters.

    The intervals are converted from intervals of the transformed fit parameters.

    Returns:
        The estimate of each parameter by name.
    """
    parameters = {}
    for i, declared in enumerate(sensor._declared()):
        name, meta, mapped = declared.name, declared.metadata, []
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
        parameters[name] = Estimate(
            value=value,
            standard_error=error,
            low=min(max(low, first), value),
            high=max(min(high, last), value),
            unit=meta["unit"] if of_output is None else f"{unit} {of_output}".strip(),
        )
    return parameters


_TABLE: Final = "table"


@check_arguments
def fit_sensor(
    calibration: Calibration,
    model: str = "inverse-power",
    *,
    offset: OffsetChoice = "auto",
    saturation: float | str | None = "auto",
    near_field_peak: float | str | None = "auto",
    floor_sigmas: float = 3.0,
) -> SensorFit:
    """Fit one sensor model to a calibration.

    Examples are the inverse power, L(3), and the exponential curves, L(5) and L(6). The model is fitted to ln xi.

    An invalid option raises `InvalidInputError`.

    Args:
        calibration: the readings.
        model: "inverse-power", "exponential-1", "exponential-2", "mittag-leffler", "table", or the name of a custom
            curve.
        offset: output with no object: "auto" (measured if there are no-object readings, otherwise fitted), "fit",
            "zero", a number in the unit of the outputs, or a number and its standard error.
        saturation: output at and above which readings are clipped; "auto" to detect it, None if nothing clips.
        near_field_peak: distance of the near-field peak [m], or text with a unit; "auto" to detect it, None for none.
        floor_sigmas: minimum signal above the offset, in standard errors.

    Returns:
        The fit; its `sensor` is valid on the usable window.

    Raises:
        ResultUnavailableError: there is no usable signal, or the model cannot be fitted; `fit` returns a report
            with the reason instead.

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
        offset,
        saturation,
        near_field_peak,
        floor_sigmas,
        models=(model,),
        uses_flattened=model == _TABLE,  # no other model follows them
    )
    fit = " ".join(prepared.no_signal) or attempt_fit(model, prepared)
    if isinstance(fit, str):
        raise ResultUnavailableError(f"{calibration.name}: {model} cannot be fitted. {fit}")
    return fit


def check_models(models: tuple[str, ...]) -> None:
    """Raise an error for unknown names of sensor models.

    An empty list of models is also an error.

    Raises:
        InvalidInputError: a name is unknown, or there is none.
    """
    for model in models:
        if find_curve(model) is None or model not in (*sensor_curves(fitted=True, foreign=True), _TABLE):
            others = [name for name in CURVE_KINDS.names() if name not in model_names()]
            raise InvalidInputError(**not_one_of("model", model, (*model_names(), *others)))
    if not models:
        raise InvalidInputError(
            f"models: the list is empty; name at least one of the models {', '.join(model_names())}"
        )


def why_not(model: str, prepared: Prepared) -> str:
    """Explain why a sensor model cannot be fitted.

    The text is empty if the model can be fitted to the readings.

    Returns:
        The reason.
    """
    used = prepared.used
    if model != _TABLE:
        count, size = len(used.distance), _family(model, used).size
        return (
            ""
            if count > size
            else f"The model has {size} parameters. Therefore, it needs {size + 1} or more distances with a signal "
            f"above the noise floor. The number of distances with such a signal is only {count}."
        )
    if prepared.falling is not None:
        return ""
    rises = np.flatnonzero(np.diff(used.output) >= 0)
    d = used.distance[rises[0] : rises[0] + 2] * 1e3
    return (
        f"The averaged output does not fall between the distances {d[0]:g} mm and {d[1]:g} mm. A table model needs an "
        "output that falls from each distance to the next, except for noise."
    )


def model_names() -> tuple[str, ...]:
    """Return the names of the default sensor models.

    These models are fitted and ranked by default.
    """
    return (*sorted(sensor_curves(fitted=True)), _TABLE)


def _family(model: str, used: AveragedCurve) -> Family:
    curve = sensor_curves(foreign=True)[model]
    return curve.family(curve=curve, first=float(used.distance[0]), last=float(used.distance[-1]))


def attempt_fit(model: str, prepared: Prepared) -> SensorFit | str:
    """Fit one sensor model to a prepared calibration.

    Returns:
        The fit, or as text the reason why the model cannot be fitted.
    """
    reason = why_not(model, prepared)
    if reason:
        return reason
    try:
        with np.errstate(all="ignore"):
            fit = fit_prepared(model, prepared)
            if not is_built_in(fit.sensor):
                refuse_invalid_curve(fit.sensor, fit.window.l_max)
    except Exception as error:  # an error in one model must not prevent the fits of the others
        return f"Its fit raised {type(error).__name__}: {error}."
    return fit if np.isfinite(fit.residuals).all() else "Its fit has no finite output at some distances."


def fit_prepared(model: str, prepared: Prepared) -> SensorFit:
    """Fit one sensor model to the usable readings of a prepared calibration."""
    used, offset, noise = prepared.used, prepared.offset, prepared.noise
    if offset is None or noise is None:
        raise AssertionError
    xi = used.output - offset.value
    log_model, fields = (_fit_table if model == _TABLE else _fit_curve)(model, prepared, offset, noise)
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
        **fields,
    )


def _fit_curve(
    model: str, prepared: Prepared, offset: OffsetEstimate, noise: NoiseEstimate
) -> tuple[FloatArray, dict[str, Any]]:
    """Fit the parameters of a sensor curve. Return its log outputs and keyword arguments for `SensorFit`."""
    used, family = prepared.used, _family(model, prepared.used)
    best = fit_free(used, family, noise, offset.value)
    problem = problem_at(used, family, noise, offset.value)
    xi, x, unit = used.output - offset.value, best.x[0], prepared.calibration.unit
    sensor = family.sensor(x, used.distance[0].item(), used.distance[-1].item())
    deviance = float(best.costs[0]) + float(np.sum(np.log(2 * np.pi * (noise.of_means(used.count, xi) / xi) ** 2)))
    errors = estimates(problem, best, sensor, offset=offset, output_unit=unit, informed_by=prepared.informed_by)
    return family.log_output(x, used.distance), {
        **errors,
        "middle_slope": with_choice_of_family(errors["middle_slope"], prepared),
        "sensor": sensor,
        "aicc": corrected_akaike(deviance, prepared.informed_by, len(x)),
        **_left_out_one_by_one(problem, best, offset.value),
    }


def _left_out_one_by_one(problem: Problem, best: Fits, offset: float) -> dict[str, Any]:
    """Fit the curve without each distance in turn, with the same offset.

    Returns:
        The RMS error of the log output at the distances that were left out, and the relative change of g at the nearest
        distance. None of both with too few distances.
    """
    curve, count, family = problem.curve, len(problem.curve.distance), problem.family
    if count - 1 < family.size:
        return {"cross_validation": None}
    problems = replace(problem, offsets=np.full(count, offset), weights=~np.eye(count, dtype=bool))
    fits = problems.minimize(np.repeat(best.x, count, axis=0))
    predicted = np.diagonal(family.log_output(fits.x, curve.distance))
    nearest = curve.distance[:1]
    changes = family.slope(fits.x, nearest)[:, 0] / family.slope(best.x, nearest)[0, 0] - 1
    return {
        "cross_validation": root_mean_square(np.log(curve.output - offset) - predicted),
        "influences": tuple(changes.tolist()),
    }


def _fit_table(
    _: str, prepared: Prepared, offset: OffsetEstimate, noise: NoiseEstimate
) -> tuple[FloatArray, dict[str, Any]]:
    """Create a sensor table from averaged readings. Return its log outputs and keyword arguments for `SensorFit`."""
    points = prepared.falling
    if points is None:
        raise AssertionError
    distance, xi = points.distance, points.output - offset.value
    sensor, inner = _table(distance, xi), range(1, len(xi) - 1)
    without = [_table(np.delete(distance, i), np.delete(xi, i)).log_output(float(distance[i])) for i in inner]
    middle = float((distance[0] + distance[-1]) / 2)
    error = _table_slope_error(distance, xi, noise.of_means(points.count, xi) / xi, middle)
    slope, reach = float(sensor.log_slope(middle)), 1.96 * error
    return np.asarray(sensor.log_output(prepared.used.distance)), {
        "sensor": sensor,
        "parameters": {},
        "covariance": np.empty((0, 0)),
        "middle_slope": Estimate(value=slope, standard_error=error, low=slope - reach, high=slope + reach, unit="1/m"),
        "aicc": None,
        "cross_validation": root_mean_square(np.log(xi[1:-1]) - without) if without else None,
        "warnings": (
            caution(
                "PT112", "A table passes through the readings with their noise; only cross-validation can judge it."
            ),
        ),
    }


def _table_slope_error(distance: FloatArray, xi: FloatArray, errors: FloatArray, at: float) -> float:
    """Return the standard error of the slope of a sensor table.

    The interpolant's slope is not the difference of two neighbors: its error is about 1.4 times as large midway between
    two points, and 0.7 times as large at a point.
    """
    k = int(np.searchsorted(distance, at))
    step = 1e-3 * float(np.diff(-np.log(xi)).min())  # so small that the outputs still fall
    variance = 0.0
    for i in range(max(k - 3, 0), min(k + 3, len(xi))):  # readings farther away do not influence this slope
        moved = (xi * np.exp(sign * step * (np.arange(len(xi)) == i)) for sign in (1.0, -1.0))
        up, down = (float(_table(distance, outputs).log_slope(at)) for outputs in moved)
        variance += ((up - down) / (2 * step) * float(errors[i])) ** 2
    return math.sqrt(variance)


def _table(distance: FloatArray, xi: FloatArray) -> Table:
    return Table(distances=tuple(distance.tolist()), outputs=tuple(xi.tolist()))
