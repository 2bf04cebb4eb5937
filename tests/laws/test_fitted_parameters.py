"""What a fit leaves open of its curve is drawn with its covariance, or refused where there is none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pretouch._core.errors import InvalidInputError
from pretouch.calibration import Calibration, SensorFit, fit_sensor
from pretouch.motion.scenario import sensor_with
from pretouch.uncertainty import CorrelatedNormal, parameter_distribution, sample_inputs
from refusals import refused

DISTANCES = np.repeat(np.arange(0.0, 0.062, 0.002), 4)
TRUE = {"inverse-power": (0.02, 2.2), "exponential-1": (-60.0,), "exponential-2": (-70.0, 300.0)}
CURVES = {
    "inverse-power": lambda d, o, n: (1 + d / o) ** -n,
    "exponential-1": lambda d, r: np.exp(r * d),
    "exponential-2": lambda d, r, c: np.exp(r * d + c * d**2),
}
NAMES = {
    "inverse-power": ("sensor.distance_offset", "sensor.exponent"),
    "exponential-1": ("sensor.rate",),
    "exponential-2": ("sensor.rate", "sensor.curvature"),
}


def fitted(model: str, seed: int = 0, jitter: float = 0.005) -> SensorFit:
    rng = np.random.default_rng(seed)
    signal = CURVES[model](DISTANCES, *TRUE[model])  # type: ignore[operator]
    noisy = signal * (1 + jitter * rng.standard_normal(len(DISTANCES))) + 2e-4 * rng.standard_normal(len(DISTANCES))
    return fit_sensor(Calibration(distances=DISTANCES, outputs=noisy, unit="V"), model, offset="zero")


@pytest.mark.parametrize("model", TRUE)
def test_the_distribution_is_that_of_the_fit_without_its_scale(model: str) -> None:
    fit = fitted(model)
    known = parameter_distribution(fit)
    assert known.names == NAMES[model]
    at = [list(fit.parameters).index(n.removeprefix("sensor.")) for n in known.names]
    np.testing.assert_array_equal(known.covariance, fit.covariance[np.ix_(at, at)])
    errors = [fit.parameters[n.removeprefix("sensor.")].standard_error for n in known.names]
    np.testing.assert_allclose(np.sqrt(np.diag(known.covariance)), errors, rtol=1e-12)
    # the truth is within five standard errors of what was fitted
    assert (np.abs(np.array(known.mean) - TRUE[model]) < 5 * np.array(errors)).all()


@pytest.mark.parametrize("model", ["inverse-power", "exponential-2"])
def test_curves_that_are_drawn_scatter_as_much_as_the_fit_says(model: str) -> None:
    """The slope in the middle of the window is known to its own standard error, which no single parameter shows."""
    fit = fitted(model)
    known = parameter_distribution(fit)
    middle = 0.5 * (fit.window.l_min + fit.window.l_max)

    def scatter(distribution: CorrelatedNormal) -> float:
        drawn = sample_inputs({"fit": distribution}, 2048)
        rows = [dict(zip(drawn, map(float, row), strict=True)) for row in zip(*drawn.values(), strict=True)]
        curves = [sensor_with(fit.sensor, {n.removeprefix("sensor."): v for n, v in row.items()}) for row in rows]
        return float(np.std([float(curve.log_slope(middle)) for curve in curves]))

    # both linearize a fit with errors of a few percent, the fit in other coordinates; 2048 Sobol points are good to 1 %
    assert scatter(known) == pytest.approx(fit.middle_slope.standard_error, rel=0.1)
    alone = replace(known, covariance=tuple(map(tuple, np.diag(np.diag(known.covariance)).tolist())))
    assert scatter(alone) > 3 * scatter(known)


def test_readings_that_do_not_bound_a_parameter_are_refused_with_the_way_out() -> None:
    rng = np.random.default_rng(1)
    outputs = np.exp(-40 * DISTANCES) * (1 + 0.01 * rng.standard_normal(len(DISTANCES)))
    fit = fit_sensor(Calibration(distances=DISTANCES, outputs=outputs, unit="V"), "inverse-power", offset="zero")
    assert math.isinf(fit.parameters["exponent"].standard_error)
    words = r"do not determine the fitted parameters distance_offset and exponent.*can grow together.*fewer"
    with pytest.raises(InvalidInputError, match=words):
        parameter_distribution(fit)
    broken = replace(fitted("exponential-1"), covariance=np.full((2, 2), np.inf))
    with refused("fit"):
        parameter_distribution(broken)


def test_a_table_has_no_parameters() -> None:
    outputs = np.exp(-40 * np.unique(DISTANCES))
    fit = fit_sensor(Calibration(distances=np.unique(DISTANCES), outputs=outputs, unit="V"), "table", offset="zero")
    with refused("fit"):
        parameter_distribution(fit)


def test_tails_that_hold_impossible_curves_are_refused() -> None:
    fit = fitted("inverse-power")
    wide = replace(fit, covariance=fit.covariance * 1e4)
    with refused("fit", value="distance_offset"):
        parameter_distribution(wide)
