"""The compiled residuals of sensor curves and their derivatives, compared with the families in Python."""

from __future__ import annotations

import numpy as np
import pytest

from pretouch.calibration.curve_residuals import CurveResiduals
from pretouch.calibration.least_squares import gradient, minimize_many
from pretouch.sensors import Family, sensor_curves

FIRST, LAST = 0.003, 0.06
DISTANCES = np.linspace(FIRST, LAST, 9)
EVERYWHERE = (np.full(4, -np.inf), np.full(4, np.inf))
ROUNDING = (
    1e-8  # of asinh and of the Mittag-Leffler function with the accuracy of fits, over the relative error of 0.01
)
DIFFERENCES = 2e-6  # error of central differences with steps of 1e-6 of a function that is accurate to 1e-12

# u of each family: steep and flat, straight and bent, and near the singular order 1 and inverse exponent 0
PARAMETERS = {
    "exponential-1": [[2.0, 4.0], [-3.0, 2.0], [5.0, 6.0]],
    "exponential-2": [[2.0, 4.0, -1.0], [1.0, 3.0, 0.5], [0.0, 4.5, -1e-9], [2.0, 4.0, -8.0]],
    "inverse-power": [[2.0, -4.0, 0.3], [1.0, -6.0, 1.2], [0.0, -3.5, 0.01], [3.0, -4.5, 5.0]],
    "mittag-leffler": [[2.0, 4.0, 0.7], [1.0, 6.0, 0.9], [0.0, 3.0, 0.3], [1.0, 5.0, 0.999], [2.0, 4.5, 1.0 - 1e-9]],
}


def family_of(name: str) -> Family:
    curve = sensor_curves()[name]
    return curve.family.at_large(curve, FIRST, LAST)


CASES = [
    pytest.param(family_of(name), np.array(u), id=f"{name} {u}") for name, rows in PARAMETERS.items() for u in rows
]


def residuals_of(family: Family, level: float, **options) -> CurveResiduals:
    """Residuals of readings around a level of the output."""
    scale = np.exp(level)
    return CurveResiduals(
        family=family,
        distances=DISTANCES,
        outputs=scale * np.linspace(2.0, 0.1, len(DISTANCES)) + 0.05 * scale,
        widths=np.linspace(0.01, 0.03, len(DISTANCES)) * scale,
        errors=np.linspace(0.01, 0.02, len(DISTANCES)),
        **options,
    )


def in_numpy(residuals: CurveResiduals, x: np.ndarray, problem: int) -> np.ndarray:
    """The same residuals in NumPy, from the curves in Python."""
    family = residuals.family
    offset = x[-1] if residuals.offsets is None else residuals.offsets[problem]
    level = family.log_output(x[: family.size], residuals.distances)
    if residuals.above is not None and np.isfinite(residuals.above[problem]):
        ceiling = np.log(residuals.outputs.max() - offset) + residuals.above[problem]
        sharpness = residuals.sharpness[problem]
        level = level - np.logaddexp(0, sharpness * (level - ceiling)) / sharpness
    rows = np.arcsinh((residuals.outputs - offset) / residuals.widths) - np.arcsinh(np.exp(level) / residuals.widths)
    rows = rows / residuals.errors
    return rows if residuals.weights is None else rows * residuals.weights[problem]


def derivatives(residuals: CurveResiduals, x: np.ndarray, problem: int = 0) -> np.ndarray:
    size = len(x)
    bounds = tuple(bound[:size] for bound in EVERYWHERE)
    return minimize_many(residuals, x[None], bounds, problems=np.array([problem]), most=0).jacobian[0]


def check_derivatives(residuals: CurveResiduals, x: np.ndarray, problem: int = 0) -> None:
    def function(v: np.ndarray) -> np.ndarray:
        return residuals(v[None], np.array([problem]))[0]

    exact, compared = derivatives(residuals, x, problem), gradient(function, x)
    size = np.abs(compared).max(axis=0) + 1.0
    # central differences of order 1 would need curves beyond it
    parts = slice(None) if x[2:3].sum() < 1 - 1e-6 or residuals.family.number != 3 else slice(2)
    assert np.abs((exact - compared) / size)[:, parts].max() < DIFFERENCES


@pytest.mark.parametrize(("family", "u"), CASES)
def test_residuals_and_derivatives_are_those_of_the_family(family, u):
    known = residuals_of(family, u[0], offsets=np.array([0.0, 0.04]) * np.exp(u[0]))
    for problem in (0, 1):
        found = known(u[None], np.array([problem]))[0]
        assert found == pytest.approx(in_numpy(known, u, problem), rel=ROUNDING, abs=1e-6)
        check_derivatives(known, u, problem)


def test_the_derivative_of_a_nearly_exponential_inverse_power_is_its_limit():
    """For r = e^u1 and t = (l - l_m) / r, ln xi = u0 - t + kappa (t^2 / 2 + t (l_m - l_0) / r) + O(kappa^2)."""
    family, u = family_of("inverse-power"), np.array([0.0, -3.5, 1e-6])
    residuals = residuals_of(family, 0.0, offsets=np.zeros(1))
    exact, t = derivatives(residuals, u), (DISTANCES - family.middle) / np.exp(u[1])
    ratio = exact[:, 2] / exact[:, 0]  # of d ln xi / d kappa to d ln xi / d u0 = 1
    assert ratio == pytest.approx(t**2 / 2 + t * (family.middle - FIRST) / np.exp(u[1]), rel=1e-4, abs=1e-9)


@pytest.mark.parametrize(("family", "u"), CASES)
def test_fitted_offsets_ceilings_and_weights_are_part_of_the_derivatives(family, u):
    ceilings = {"above": np.array([np.inf, 0.05, 0.3]), "sharpness": np.array([2.0, 3.5, 7.0])}
    weights = np.ones((3, len(DISTANCES)), dtype=bool)
    weights[1, 2] = False
    free = residuals_of(family, u[0], weights=weights, **ceilings)
    x = np.append(u, 0.01 * np.exp(u[0]))
    for problem in range(3):
        found = free(x[None], np.array([problem]))[0]
        assert found == pytest.approx(in_numpy(free, x, problem), rel=ROUNDING, abs=1e-6)
        exact, change = derivatives(free, x, problem), 1e-6 * np.exp(u[0])
        both = [in_numpy(free, x + change * sign * (np.arange(len(x)) == len(x) - 1), problem) for sign in (1, -1)]
        assert exact[:, -1] == pytest.approx((both[0] - both[1]) / (2 * change), rel=1e-6, abs=1e-4)
        if u[0] == 0:  # else steps of 1e-6 are of another size than the offset
            check_derivatives(free, x, problem)
    assert free(x[None], np.array([1]))[0, 2] == 0


@pytest.mark.parametrize(("family", "u"), CASES)
def test_springs_pull_the_coordinates_of_the_family(family, u):
    middle = np.array([family.middle])
    expected = np.append(family.coordinates(u), np.log(-family.slope(u, middle)))
    known = residuals_of(family, u[0], offsets=np.zeros(1))
    pulls = np.array([[k, 10.0, expected[k] - 0.1] for k in range(len(expected))])
    pulled = known.pulled(pulls)
    for k in range(len(expected)):
        row = pulled(u[None], np.array([k]))[0]
        assert row[:-1] == pytest.approx(known(u[None], np.zeros(1, dtype=np.int64))[0], rel=1e-12)
        assert row[-1] == pytest.approx(1.0, abs=1e-7 * (1 + abs(expected[k])))
        check_derivatives(pulled, u, k)


@pytest.mark.parametrize("name", PARAMETERS)
def test_compiled_minima_are_those_of_residuals_in_python(name):
    family = family_of(name)
    rng = np.random.default_rng(4)
    u = np.array(PARAMETERS[name][0])
    outputs = np.exp(family.log_output(u, DISTANCES)) * (1 + 0.01 * rng.standard_normal(len(DISTANCES)))
    compiled = CurveResiduals(
        family=family,
        distances=DISTANCES,
        outputs=outputs,
        widths=np.full(len(DISTANCES), 0.01),
        errors=np.full(len(DISTANCES), 0.01),
        offsets=np.array([0.0, 0.01, -0.01]),
    )
    start, bounds = np.tile(u + 0.1 * (np.arange(len(u)) < 2), (3, 1)), family.bounds
    fits = [minimize_many(r, start, bounds, tolerance=1e-13) for r in (compiled, compiled.__call__)]
    assert fits[0].costs == pytest.approx(fits[1].costs, rel=1e-9)
    assert fits[0].x == pytest.approx(fits[1].x, rel=1e-4, abs=1e-5)


def test_an_error_in_a_function_of_residuals_reaches_the_caller():
    def residuals(u, which):
        if len(u) > 1:
            raise ZeroDivisionError("in a user's curve")
        return u - 1.0

    with pytest.raises(ZeroDivisionError, match="user's curve"):
        minimize_many(residuals, np.array([[3.0], [2.0]]), (np.full(1, -9.0), np.full(1, 9.0)))


def test_a_family_that_inherits_is_not_taken_for_the_compiled_one():
    own = type("OwnFamily", (type(family_of("inverse-power")),), {})
    curve = sensor_curves()["inverse-power"]
    assert own(curve=curve, first=FIRST, last=LAST).number == -1
    assert [family_of(name).number for name in PARAMETERS] == [0, 1, 2, 3]
