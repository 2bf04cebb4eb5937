"""One model on one calibration: the curve, its parameters with their uncertainty, and how well it fits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch.sensors import Table

from .averaging import AveragedCurve
from .data import Calibration
from .diagnostics import corrected_akaike, r_squared, root_mean_square, runs_p_value, slope_error
from .families import FAMILIES, Family, SecondOrderFamily
from .least_squares import Residuals, Solution, minimize
from .offset import Baseline
from .preparation import OffsetChoice, Prepared, prepare
from .result import Estimate, NoiseEstimate, OffsetEstimate, SensorFit
from .uncertainty import estimates

__all__ = ["MODELS", "check_models", "common_noise", "fit_prepared", "fit_sensor", "why_not"]

MODELS = (*sorted(FAMILIES), "table")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelProblem:
    """A family of curves on the points of a window, with offset and noise.

    The residual of a reading is h(y - o) - h(xi) with h(u) = asinh(u / tau) / sigma_rel and tau = sigma / sigma_rel:
    the transformation that gives readings of variance sigma^2 + (sigma_rel xi)^2 unit variance. Well above tau it is
    the logarithm divided by sigma_rel; a reading below the offset still has one.
    """

    family: Family
    curve: AveragedCurve
    offset: float
    noise: NoiseEstimate

    def residuals(self) -> Residuals:
        """Return the function from the parameters to the residuals."""
        jitter = max(self.noise.relative, 1e-6)
        tau = self.noise.output / jitter / np.sqrt(self.curve.count)
        measured = np.arcsinh((self.curve.output - self.offset) / tau)
        distance, log_output = self.curve.distance, self.family.log_output
        log_tau = np.log(tau)
        return lambda u: (measured - np.arcsinh(np.exp(np.minimum(log_output(u, distance) - log_tau, 300)))) / jitter

    def minimize(self, starts: list[FloatArray], tolerance: float = 1e-13) -> Solution:
        """Fit from every start and return the best minimum."""
        residuals = self.residuals()
        found = [minimize(residuals, start, self.family.bounds, tolerance=tolerance) for start in starts]
        return min(found, key=lambda solution: solution.cost)


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
    return fit_prepared(model, prepared, common_noise(prepared))


def check_models(models: tuple[str, ...]) -> None:
    """Refuse names that are no models.

    Args:
        models: names.

    Raises:
        InvalidInputError: a name is no model, or there is none.
    """
    for model in models:
        if model not in MODELS:
            raise InvalidInputError(f"model: found {model!r}, expected one of {', '.join(MODELS)}")
    if not models:
        raise InvalidInputError(f"models: found none, expected one or more of {', '.join(MODELS)}")


def why_not(model: str, prepared: Prepared) -> str:
    """Say why a model cannot be fitted to readings that do carry a signal; nothing where it can."""
    used = prepared.used
    if model != "table":
        count, size = len(used.distance), len(FAMILIES[model].parameter_names)
        return "" if count > size else f"It has {size} parameters, and only {count} distances stand above the floor."
    rises = np.flatnonzero(np.diff(used.output) >= 0)
    if not len(rises):
        return ""
    d = used.distance[rises[0] : rises[0] + 2] * 1e3
    return f"The averaged output does not fall from {d[0]:g} to {d[1]:g} mm, and a table must fall strictly."


def common_noise(prepared: Prepared) -> NoiseEstimate:
    """Return the noise that all models share, so that their criteria compare like with like.

    It is the scatter about the inverse power fitted with the offset, or about the second-order exponential where
    that describes the window better and leaves two degrees of freedom.
    """
    baseline = _baseline(prepared)
    noise, count = baseline.noise, len(prepared.used.distance)
    if count < 5:
        return noise
    family = SecondOrderFamily(first=float(prepared.used.distance[0]), last=float(prepared.used.distance[-1]))
    for _ in range(3):
        problem = ModelProblem(family=family, curve=prepared.used, offset=baseline.offset.value, noise=noise)
        found = problem.minimize(_starts(family, prepared), tolerance=1e-8)
        reduced = found.cost / (count - 3)
        if reduced >= 1:
            break
        noise = replace(noise, relative=max(noise.relative * float(np.sqrt(reduced)), 1e-6))
    return noise


def fit_prepared(model: str, prepared: Prepared, noise: NoiseEstimate) -> SensorFit:
    """Fit one model to prepared readings."""
    if model == "table":
        return _fit_table(prepared, noise)
    used, baseline = prepared.used, _baseline(prepared)
    family = FAMILIES[model](first=float(used.distance[0]), last=float(used.distance[-1]))
    problem = ModelProblem(family=family, curve=used, offset=baseline.offset.value, noise=noise)
    best = problem.minimize(_starts(family, prepared))
    shifted = [
        replace(problem, offset=o).minimize([best.x], tolerance=1e-9).x
        for o in (baseline.offset.low, baseline.offset.high)
        if o != baseline.offset.value
    ]
    sensor = family.sensor(best.x, used.distance[0].item(), used.distance[-1].item())
    xi = used.output - baseline.offset.value
    spread = estimates(
        problem.residuals(), best, family, offset=baseline.offset, shifted=shifted, informed_by=prepared.informed_by
    )
    log_model = family.log_output(best.x, used.distance)
    residuals = np.log(xi) - log_model
    deviance = best.cost + _log_variance(problem)
    return SensorFit(
        model=model,
        sensor=sensor,
        parameters=_with_units(spread.parameters, sensor.parameters, family, prepared.calibration.unit),
        covariance=spread.covariance,
        middle_slope=spread.middle_slope,
        window=prepared.window,
        offset=baseline.offset,
        noise=noise,
        distances=used.distance,
        residuals=residuals,
        r_squared=r_squared(xi, np.exp(log_model)),
        rmse_log_output=root_mean_square(residuals),
        rmse_log_slope=slope_error(used.distance, residuals),
        aicc=corrected_akaike(deviance, prepared.informed_by, len(best.x)),
        cross_validation=_cross_validation(problem, best),
        runs_p_value=runs_p_value(residuals),
        slope_shift=spread.slope_shift,
        outliers=prepared.outliers,
        identifiable=spread.identifiable,
        warnings=_warnings(spread.slope_shift, baseline.offset, best, family),
    )


def _baseline(prepared: Prepared) -> Baseline:
    if prepared.baseline is None:
        raise ResultUnavailableError(" ".join(prepared.no_signal))
    return prepared.baseline


def _starts(family: Family, prepared: Prepared) -> list[FloatArray]:
    """Start from the curve that was fitted with the offset, and from an exponential of its slope."""
    log_middle, slope, curvature = _baseline(prepared).shape_at(family.middle)
    return [family.start(log_middle, slope, c) for c in (curvature, 0.02 * slope**2)]


def _log_variance(problem: ModelProblem) -> float:
    """Return the part of -2 ln L of ln xi that is the same for every model."""
    xi = problem.curve.output - problem.offset
    variance = problem.noise.output**2 / problem.curve.count + (problem.noise.relative * xi) ** 2
    return float(np.sum(np.log(2 * np.pi * variance / xi**2)))


def _cross_validation(problem: ModelProblem, best: Solution) -> float | None:
    """Return the RMS error of ln xi at distances left out one by one."""
    curve, count = problem.curve, len(problem.curve.distance)
    if count - 1 < len(best.x):
        return None
    errors = []
    for i in range(count):
        part = replace(problem, curve=curve.part(np.arange(count) != i))
        found = part.minimize([best.x], tolerance=1e-7)
        predicted = problem.family.log_output(found.x, curve.distance[[i]])[0]
        errors.append(float(np.log(curve.output[i] - problem.offset) - predicted))
    return root_mean_square(np.array(errors))


def _with_units(
    parameters: dict[str, Estimate], fitted: dict[str, float], family: Family, output_unit: str
) -> dict[str, Estimate]:
    """Give every estimate its unit, and the very value that the sensor has."""
    units = {"rate": "1/m", "distance_offset": "m", "curvature": "1/m^2", "scale": output_unit}
    if family.name == "inverse-power":
        units["scale"] = f"{output_unit} m^n".strip()
    return {name: _clear(e, fitted[name], units.get(name, "")) for name, e in parameters.items()}


def _clear(estimate: Estimate, value: float, unit: str) -> Estimate:
    """Give an estimate its unit and a value, which its interval holds."""
    return replace(estimate, value=value, unit=unit, low=min(estimate.low, value), high=max(estimate.high, value))


def _warnings(shift: float, offset: OffsetEstimate, best: Solution, family: Family) -> tuple[str, ...]:
    found = []
    if offset.kind == "fitted":
        found.append(
            f"The offset was fitted, not measured; one standard error of it moves the slope by {100 * shift:.2g} %."
        )
    low, high = family.bounds
    at = [i for i, x in enumerate(best.x) if min(x - low[i], high[i] - x) < 1e-4]
    if at and family.name == "exponential-2":
        found.append("The curvature is at the limit beyond which the curve would turn around inside the window.")
    return tuple(found)


def _fit_table(prepared: Prepared, noise: NoiseEstimate) -> SensorFit:
    """Take the averaged curve as it is."""
    used, offset = prepared.used, _baseline(prepared).offset
    xi = used.output - offset.value
    sensor = Table(distances=tuple(used.distance.tolist()), outputs=tuple(xi.tolist()))
    errors = []
    for i in range(1, len(xi) - 1):
        rest = np.arange(len(xi)) != i
        part = Table(distances=tuple(used.distance[rest].tolist()), outputs=tuple(xi[rest].tolist()))
        errors.append(float(np.log(xi[i]) - part.log_output(float(used.distance[i]))))
    middle = float((used.distance[0] + used.distance[-1]) / 2)
    k = int(np.clip(np.searchsorted(used.distance, middle), 1, len(xi) - 1))
    variance = noise.output**2 / used.count / xi**2 + noise.relative**2
    error = float(np.sqrt(variance[k - 1] + variance[k]) / (used.distance[k] - used.distance[k - 1]))
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
