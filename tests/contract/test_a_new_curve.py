"""A new curve is one class in one place: everything else reads from its own fields what it needs."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import pretouch as pt
from pretouch.calibration import Calibration, fit
from pretouch.calibration.model_fit import model_names
from pretouch.motion.scenario import sensor_inputs
from pretouch.sensors import SensorModel, parameter, sensor_curves
from pretouch.sensors.registry import _subclasses, find_curve
from refusals import refused
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


@pytest.fixture(autouse=True)
def forgotten(request: pytest.FixtureRequest) -> Iterator[None]:
    """After a test, no other one of the same process ranks its curves, even if something still holds one."""
    yield
    request.node.funcargs.clear()
    for kept in gc.get_objects():
        if isinstance(kept, type(lru_cache(len))):
            kept.cache_clear()
    gc.collect()
    for curve in _subclasses(SensorModel):  # type: ignore[type-abstract]
        if curve.__qualname__.startswith("failing."):
            curve.__module__ = __name__
    assert set(sensor_curves(fitted=True)) == {"exponential-1", "exponential-2", "inverse-power", "mittag-leffler"}


@pytest.fixture
def curve() -> type[SensorModel]:
    return planted()


def test_it_is_known_by_its_name_with_its_parameters_and_their_units(curve: type[SensorModel]) -> None:
    assert sensor_curves(foreign=True)["two-sources"] is curve
    assert "two-sources" not in model_names()  # it takes part in nothing unasked
    fitted = {"exponential-1", "exponential-2", "inverse-power", "mittag-leffler"}
    assert set(sensor_curves(fitted=True)) == fitted
    assert set(sensor_curves()) == fitted | {"table"}
    assert sensor_inputs(curve(scale=1.0, spread=0.02)) == {"sensor.scale": "", "sensor.spread": "m"}
    with refused("spread", value=-0.02):
        curve(scale=1.0, spread=-0.02)


def test_a_second_curve_of_the_same_name_is_named_with_the_first(curve: type[SensorModel]) -> None:
    class Other(curve):  # type: ignore[misc, valid-type]
        name: ClassVar[str] = "two-sources"

    with pytest.raises(pt.errors.InvalidInputError, match="have the same name") as error:
        find_curve("two-sources")
    assert all(f"{c.__module__}.{c.__qualname__}" in str(error.value) for c in (curve, Other))
    readings = Calibration(distances=[0.01, 0.02, 0.03, 0.04], outputs=[4.0, 3.0, 2.0, 1.5], unit="V")
    with pytest.raises(pt.errors.InvalidInputError, match="have the same name"):
        fit(readings, ("two-sources",))


def test_a_curve_cannot_take_the_place_of_a_built_in_one() -> None:
    class Mine(pt.InversePower):
        name: ClassVar[str] = "inverse-power"

    with pytest.raises(pt.errors.InvalidInputError, match=r"pretouch\.sensors\.inverse_power\.InversePower and .*Mine"):
        find_curve("inverse-power")
    del Mine
    gc.collect()
    assert find_curve("inverse-power") is pt.InversePower


def test_a_curve_that_is_defined_again_replaces_the_earlier_one(curve: type[SensorModel]) -> None:
    """As in a notebook, whose cell is run twice."""
    again = planted()
    assert again is not curve
    assert find_curve("two-sources") is again


def test_a_file_takes_it_and_its_uncertainty(curve: type[SensorModel], tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    path.write_text(FILE, encoding="utf-8")
    task = pt.load_scenario(path)
    assert task.sensor.bare == (curve(scale=2.0, spread=0.02), 0.001)
    path.write_text(FILE.replace('"20 mm"\n', '"20 kg"\n', 1), encoding="utf-8")
    with refused("sensor.spread", error=pt.errors.ScenarioFileError, value="20 kg"):
        pt.load_scenario(path)
    path.write_text(FILE.replace('spread = "20 mm"\n', "", 1), encoding="utf-8")
    with refused("sensor.spread", error=pt.errors.ScenarioFileError):
        pt.load_scenario(path)


def test_readings_are_fitted_by_it(curve: type[SensorModel]) -> None:
    distance = np.repeat(np.arange(2, 40) * 0.002, 3)
    noise = 1 + 2e-3 * np.random.default_rng(5).standard_normal(len(distance))
    outputs = 0.1 + curve(scale=2e-3, spread=0.031).output(distance) * noise
    readings = Calibration(distances=distance, outputs=outputs, no_object=[0.0999, 0.1, 0.1001], unit="V")
    report = fit(readings, (*model_names(), "two-sources"))
    assert report.best is not None
    assert report.best.model == "two-sources"
    found = report.best.parameters["spread"]
    assert found.low < 0.031 < found.high
    assert (found.unit, report.best.parameters["scale"].unit) == ("m", "V m^2")
    assert "two-sources" in str(report)


SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)


def test_motion_and_design_differentiate_by_its_parameters(curve: type[SensorModel]) -> None:
    scenario = SCENARIO
    sensor = curve(scale=1.0, spread=0.02)
    by_spread = pt.find_contact(scenario, sensor, -0.7).gradients.of("relative_velocity", "sensor.spread")
    step = 1e-6
    ends = [pt.find_contact(scenario, curve(scale=1.0, spread=0.02 + s), -0.7) for s in (-step, step)]
    slope = (ends[1].end.relative_velocity - ends[0].end.relative_velocity) / (2 * step)
    assert by_spread == pytest.approx(slope, rel=1e-6)  # differences of order 2 over 1e-6 m of 0.02 m


def test_a_design_with_it_prints_itself_and_makes_its_report(curve: type[SensorModel], tmp_path: Path) -> None:
    """The scale changes no slope: what differences leave of it is rounding, which no polynomial meets."""
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    task = pt.Task(SCENARIO, curve(scale=1.0, spread=0.02), objective, bounds=(-10.0, -0.01))
    design = pt.design(task)
    assert "D_p = -0.7121 N s" in str(design)
    assert design.to_dict()["gain"] == design.gain
    assert "<svg" in pt.write_report(design, tmp_path / "design.html").read_text(encoding="utf-8")
    assert design.gradient("sensor.scale") == 0.0
    assert "The optimal admittance has a natural frequency of" in str(
        pt.design(task.replace(natural_frequency=(2.0, 20.0)))
    )


@pytest.mark.parametrize("size", [1e-8, 1e-6, 1e-4, 1.0])
def test_a_parameter_that_hardly_changes_it_has_a_derivative_too(size: float) -> None:
    """Differences of slopes of 40 1/m have errors of 1e-11 1/m: 0.03 % of a change of 4e-8 1/m, 1 % where it is less.

    The derivative of the contact speed by a change of slope of w l is that of the derivative by w.
    """

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Bent(SensorModel):
        bend: float = parameter("w", "1/m^2", example='"1 1/m^2"')
        faint: float = parameter("f", "", 1.0, example="1.0")
        name: ClassVar[str] = "bent"

        def _log_output(self, distance: np.ndarray) -> np.ndarray:
            return -40.0 * distance - (self.bend + size * self.faint) * distance**2 / 2

        def _log_slope(self, distance: np.ndarray) -> np.ndarray:
            return -40.0 - (self.bend + size * self.faint) * distance

    found = pt.find_contact(SCENARIO, Bent(bend=2.0), -0.7).gradients
    by_bend, by_faint = (found.of("relative_velocity", f"sensor.{name}") for name in ("bend", "faint"))
    assert by_faint == pytest.approx(size * by_bend, rel=1e-3, abs=1e-7 * abs(by_bend))


def failing(kind: str, module: str) -> type[SensorModel]:
    """Define a curve whose fit fails."""

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Failing(SensorModel):
        scale: float = parameter("a", "", sign="positive", example="1.0", of_output="")
        rate: float = parameter("b", "1/m", example="1.0")
        other: float = parameter("c", "1/m", example="1.0")
        name: ClassVar[str] = "failing"

        def _log_output(self, distance: np.ndarray) -> np.ndarray:
            if kind == "raises":
                raise ZeroDivisionError("division by zero")
            level = np.nan if kind == "not a number" else np.log(self.scale)
            return level + (self.rate + self.other) * distance

        def _log_slope(self, distance: np.ndarray) -> np.ndarray:
            return np.full_like(distance, self.rate + self.other)

        @classmethod
        def fit_start(cls, slope: float, curvature: float, middle: float) -> Mapping[str, float]:  # noqa: ARG003
            return {"rate": slope} if kind == "incomplete start" else {"rate": slope, "other": 0.0}

    for curve in SensorModel.__subclasses__():  # also the class without slots that the decorator has replaced
        if curve.__qualname__ == Failing.__qualname__:
            curve.__module__ = module
    return Failing


def test_a_fitted_curve_whose_slope_is_not_that_of_its_output_is_refused() -> None:
    """The readings see only ln xi, but the robot acts on the slope, which is 10 % too large here."""

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Inconsistent(SensorModel):
        scale: float = parameter("a", "", sign="positive", example="1.0", of_output="")
        rate: float = parameter("b", "1/m", example="1.0")
        name: ClassVar[str] = "inconsistent"

        def _log_output(self, distance: np.ndarray) -> np.ndarray:
            return np.log(self.scale) - self.rate * distance

        def _log_slope(self, distance: np.ndarray) -> np.ndarray:
            return np.full_like(distance, -1.1 * self.rate)

        @classmethod
        def fit_start(cls, slope: float, curvature: float, middle: float) -> Mapping[str, float]:  # noqa: ARG003
            return {"rate": -slope}

    distance = np.repeat(np.arange(2, 40) * 0.002, 3)
    noise = 1 + 2e-3 * np.random.default_rng(5).standard_normal(len(distance))
    outputs = 0.1 + 2.0 * np.exp(-40.0 * distance) * noise
    readings = Calibration(distances=distance, outputs=outputs, no_object=[0.0999, 0.1, 0.1001], unit="V")
    report = fit(readings, ("exponential-1", "inconsistent"))
    assert [fit.model for fit in report.fits] == ["exponential-1"]
    assert "derivative" in report.not_fitted["inconsistent"]


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("module", [__name__, "pretouch.sensors.failing"])
@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("raises", "ZeroDivisionError: division by zero"),
        ("not a number", "InvalidInputError: scale: found nan"),
        ("incomplete start", "KeyError: 'other'"),
        (
            "readings cannot distinguish",
            "InvalidInputError: rate and other: the readings cannot distinguish the effects of these parameters",
        ),
    ],
)
def test_a_family_whose_fit_fails_costs_no_other_its_fit(kind: str, reason: str, module: str) -> None:
    """One inside the package is ranked unasked."""
    failing(kind, module)
    distance = np.repeat(np.arange(2, 40) * 0.002, 3)
    noise = 1 + 2e-3 * np.random.default_rng(5).standard_normal(len(distance))
    outputs = 0.1 + 1.3e-5 / (distance + 0.0419) ** 3.32 * noise
    readings = Calibration(distances=distance, outputs=outputs, no_object=[0.0999, 0.1, 0.1001], unit="V")
    report = fit(readings, None if module.startswith("pretouch.") else (*model_names(), "failing"))
    assert list(report.not_fitted) == ["failing"]
    assert reason in report.not_fitted["failing"]
    assert f"failing: not fitted. Its fit raised {reason}" in str(report)
    assert report.best is not None
    assert len(report.fits) == len(set(model_names()) - {"failing"})
    with refused("calibration", error=pt.errors.ResultUnavailableError):
        pt.calibration.fit_sensor(readings, "failing")
