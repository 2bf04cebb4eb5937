"""Thousands of distances, as a motor stage records them: gathered, and fitted to the same curve."""

from __future__ import annotations

import numpy as np
import pytest

from pretouch.calibration import Calibration, fit
from pretouch.calibration.averaging import condense
from pretouch.sensors import ExponentialFirstOrder, InversePower, SensorModel

SENSORS = [
    InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    ExponentialFirstOrder(scale=0.458, rate=-61.0),
]


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: s.name)
def test_a_dense_precise_curve_is_recovered(sensor: SensorModel) -> None:
    """Fifty parts of 1.6 mm at up to 80 1/m: the spline leaves (5/384) (g h)^4 = 4e-6 of the signal.

    Noise of 1e-4 of each of 80 readings per part is 1e-5 of their mean; g over a length of 10 mm is known to 1e-3 / g.
    """
    distance = np.linspace(0, 0.08, 4001)
    outputs = sensor.output(distance) * (1 + 1e-4 * np.random.default_rng(2).normal(size=4001))
    report = fit(Calibration(distances=distance, outputs=outputs), offset="zero")
    assert report.best.model == sensor.name
    assert report.verdict == "usable", report.reasons
    probe = np.linspace(0.002, 0.078, 20)
    assert report.best.sensor.log_slope(probe) == pytest.approx(sensor.log_slope(probe), rel=1e-3)


def test_a_dense_noisy_sweep_is_fitted_with_its_pedestal() -> None:
    rng = np.random.default_rng(5)
    distance = np.abs(np.arange(3000) * 0.027e-3 + rng.normal(0, 3e-6, 3000))
    outputs = 0.12 + SENSORS[0].output(distance) + rng.normal(0, 0.0015, 3000)
    report = fit(Calibration(distances=distance, outputs=outputs, no_object=rng.normal(0.12, 0.0015, 20)))
    assert report.verdict == "usable", report.reasons
    assert report.noise.output == pytest.approx(0.0015, rel=0.1)  # 3,000 readings know it to 1.3 %
    slope, truth = report.best.middle_slope, -3.32 / (0.0405 + 0.0419)
    assert abs(slope.value - truth) < 4 * slope.standard_error + 0.002 * abs(truth)  # the middle is that of the window


def test_lost_and_clipped_readings_are_still_known_for_what_they_are() -> None:
    rng = np.random.default_rng(6)
    distance = np.linspace(0, 0.08, 2000)
    outputs = np.minimum(1023, np.round(60 + 9e5 / (distance * 1e3 + 14) ** 2.4 + rng.normal(0, 2, 2000)))
    outputs[700] = 0
    calibration = Calibration(distances=distance, outputs=outputs, unit="counts", no_object=rng.normal(60, 2, 20))
    report = fit(calibration)
    assert "clips at 1023 counts" in report.window.start_reason
    assert 700 in report.best.outliers
    assert report.best.model == "inverse-power"


def test_few_distances_are_left_as_they_are() -> None:
    calibration = Calibration(distances=np.linspace(0, 0.1, 100), outputs=np.linspace(1, 0.1, 100))
    assert condense(calibration) is calibration


def test_gathering_keeps_order_and_number_of_readings() -> None:
    distance = np.random.default_rng(1).permutation(np.linspace(0, 0.05, 500))
    calibration = Calibration(distances=distance, outputs=SENSORS[0].output(distance))
    gathered = condense(calibration)
    assert len(gathered.distances) == 500
    assert len(gathered.distinct_distances) == 50
    assert np.abs(gathered.distances - distance).max() <= 0.05 / 50
