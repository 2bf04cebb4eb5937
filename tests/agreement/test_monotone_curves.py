"""Slopes of monotone cubics and values that never increase, compared with SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import isotonic_regression

from pretouch.calibration.averaging import nonincreasing
from pretouch.sensors import Table
from pretouch.sensors.table import monotone_slopes


def readings(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """2 to 30 points that fall, or rise and fall, some with equal neighbors."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 31))
    values = rng.normal(size=count) if seed % 2 else -np.cumsum(np.abs(rng.normal(size=count)))
    return np.cumsum(rng.uniform(0.001, 1.0, count)), np.round(values) if seed % 5 == 0 else values


@pytest.mark.parametrize("seed", range(40))
def test_slopes_are_those_of_pchip(seed):
    distance, values = readings(seed)
    expected = PchipInterpolator(distance, values).derivative()(distance)
    assert monotone_slopes(distance, values) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("seed", range(0, 40, 2))
def test_a_table_is_pchip_through_its_logarithms(seed):
    distance, values = readings(seed)
    distance, level = 0.01 * distance, np.unique(values)[::-1]
    distance = distance[: len(level)]
    if len(level) < 2:
        return
    table, curve = Table(distances=tuple(distance), outputs=tuple(np.exp(level))), PchipInterpolator(distance, level)
    places = np.linspace(distance[0], distance[-1], 57)
    assert table.log_output(places) == pytest.approx(curve(places), rel=1e-12, abs=1e-12)
    slopes = curve(places, 1)
    assert table.log_slope(places) == pytest.approx(np.minimum(slopes, 0.0), rel=1e-9, abs=1e-9 * np.abs(slopes).max())


@pytest.mark.parametrize("seed", range(40))
def test_pooled_values_are_the_isotonic_regression(seed):
    _, values = readings(seed)
    weights = np.random.default_rng(seed + 100).uniform(0.1, 5.0, len(values))
    found, starts = nonincreasing(values, weights)
    expected = isotonic_regression(values, weights=weights, increasing=False)
    assert found == pytest.approx(expected.x, rel=1e-12, abs=1e-12)
    assert (np.diff(found) <= 0).all()
    assert (np.diff(found[starts]) < 0).all()
    assert np.array_equal(found[starts], np.unique(found)[::-1])
