"""A new curve is one class in one place: everything else reads from its own fields what it needs."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import pretouch as pt
from pretouch.calibration import Calibration, rank_models
from pretouch.calibration.fit import model_names
from pretouch.motion.scenario import sensor_inputs
from pretouch.sensors import SensorModel, known_curves, parameter
from scenario_text import ENCOUNTER

FILE = (
    """
[sensor]
model = "two-sources"
scale = 2.0
spread = "20 mm"
recess = "1 mm"
"""
    + ENCOUNTER
    + """\
[uncertainty]
sensor.spread = { normal = ["20 mm", "1 mm"] }
"""
)


def planted() -> type[SensorModel]:
    """Define a curve as a user would: two functions, what its parameters are, and where a fit starts."""

    @dataclass(frozen=True, slots=True, kw_only=True)
    class TwoSources(SensorModel):
        scale: float = parameter("a", "", sign="positive", example="1.0", of_output="m^2")
        spread: float = parameter("b", "m", sign="positive", example='"20 mm"')

        name: ClassVar[str] = "two-sources"

        def _log_output(self, distance: np.ndarray) -> np.ndarray:
            return np.log(self.scale) - np.log(self.spread**2 + distance**2) - 10 * distance

        def _log_slope(self, distance: np.ndarray) -> np.ndarray:
            return -2 * distance / (self.spread**2 + distance**2) - 10

        @classmethod
        def fit_start(cls, slope: float, curvature: float, middle: float) -> Mapping[str, float]:  # noqa: ARG003
            return {"spread": middle}

    return TwoSources


@pytest.fixture
def curve() -> Iterator[type[SensorModel]]:
    made = planted()
    yield made
    del made
    gc.collect()


def test_it_is_known_by_its_name_with_its_parameters_and_their_units(curve: type[SensorModel]) -> None:
    assert known_curves(foreign=True)["two-sources"] is curve
    assert "two-sources" not in model_names()  # it takes part in nothing unasked
    fitted = {"exponential-1", "exponential-2", "inverse-power", "mittag-leffler"}
    assert set(known_curves(fitted=True)) == fitted
    assert set(known_curves()) == fitted | {"table"}
    assert sensor_inputs(curve(scale=1.0, spread=0.02)) == {"sensor.scale": "", "sensor.spread": "m"}
    with pytest.raises(pt.errors.InvalidInputError, match=r"spread: found -0.02 m, which must be positive"):
        curve(scale=1.0, spread=-0.02)


def test_a_file_takes_it_and_its_uncertainty(curve: type[SensorModel], tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    path.write_text(FILE, encoding="utf-8")
    task = pt.load_scenario(path)
    assert task.sensor.bare == (curve(scale=2.0, spread=0.02), 0.001)
    path.write_text(FILE.replace('"20 mm"\n', '"20 kg"\n', 1), encoding="utf-8")
    with pytest.raises(pt.errors.ScenarioFileError, match=r"line 5: sensor.spread: found .*expected a quantity in m"):
        pt.load_scenario(path)
    path.write_text(FILE.replace('spread = "20 mm"\n', "", 1), encoding="utf-8")
    with pytest.raises(pt.errors.ScenarioFileError, match='add, for example: spread = "20 mm"'):
        pt.load_scenario(path)


def test_readings_are_fitted_by_it(curve: type[SensorModel]) -> None:
    distance = np.repeat(np.arange(2, 40) * 0.002, 3)
    noise = 1 + 2e-3 * np.random.default_rng(5).standard_normal(len(distance))
    outputs = 0.1 + curve(scale=2e-3, spread=0.031).output(distance) * noise
    readings = Calibration(distances=distance, outputs=outputs, no_object=[0.0999, 0.1, 0.1001], unit="V")
    report = rank_models(readings, (*model_names(), "two-sources"))
    assert report.best is not None
    assert report.best.model == "two-sources"
    found = report.best.parameters["spread"]
    assert found.low < 0.031 < found.high
    assert (found.unit, report.best.parameters["scale"].unit) == ("m", "V m^2")
    assert "two-sources" in str(report)


def test_motion_and_design_differentiate_by_its_parameters(curve: type[SensorModel]) -> None:
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
    )
    sensor = curve(scale=1.0, spread=0.02)
    by_spread = pt.find_contact(scenario, sensor, -0.7).gradients.of("relative_velocity", "sensor.spread")
    step = 1e-6
    ends = [pt.find_contact(scenario, curve(scale=1.0, spread=0.02 + s), -0.7) for s in (-step, step)]
    slope = (ends[1].end.relative_velocity - ends[0].end.relative_velocity) / (2 * step)
    assert by_spread == pytest.approx(slope, rel=1e-6)  # differences of order 2 over 1e-6 m of 0.02 m
