"""The public conformance check passes lawful curves and names the law that another curve breaks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from encounters import CURVES
from pretouch._core.errors import InvalidInputError
from pretouch.designs import DragEffect, Task, design_drag, design_gain, excursion_objective
from pretouch.motion import Admittance, Obstacle, Scenario, find_contact
from pretouch.sensors import (
    CustomSensor,
    ExponentialFirstOrder,
    InversePower,
    Recessed,
    SensorModel,
    Table,
    check_sensor,
)
from properties import examples
from refusals import refused
from sensor_samples import SAMPLES, concrete_sensors

SHAPE = "ln xi and g accept distances of any shape and return the same shape"
FINITE = "ln xi and g are finite on the valid range"
FALLS = "the output does not grow with distance (g <= 0)"
DERIVATIVE = "g is the derivative of ln xi"
CONSTANT = "a slope that is declared constant is constant"
ELEMENTS = "an array gives the same values as its elements one by one"
VALUE = "the curve is a value: a frozen dataclass with hashable fields"
LAWS = (SHAPE, FINITE, FALLS, DERIVATIVE, CONSTANT, ELEMENTS, VALUE)


def _custom(log_output: Callable, log_slope: Callable, **more: object) -> CustomSensor:
    return CustomSensor(log_output_function=log_output, log_slope_function=log_slope, **more)


@pytest.mark.parametrize("name", CURVES)
def test_every_curve_of_the_encounters_conforms(name: str) -> None:
    found = check_sensor(CURVES[name])
    assert found.conforms, str(found)
    assert tuple(check.law for check in found.checks) == LAWS
    assert found.sensor == CURVES[name].name


@pytest.mark.parametrize("kind", concrete_sensors(), ids=lambda cls: cls.__name__)
@examples(25, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_every_class_conforms_whatever_its_parameters(kind: type[SensorModel], data: st.DataObject) -> None:
    found = check_sensor(data.draw(SAMPLES[kind]))
    assert found.conforms, str(found)


@pytest.mark.parametrize("offset", [1e-3, 1e-4, 1e-5, 1e-6])
def test_a_curve_that_is_steep_beside_the_probes_conforms(offset: float) -> None:
    """Near its pole the slope changes by its own size within micrometers, the probes are 0.8 mm apart."""
    found = check_sensor(InversePower(scale=1.0, distance_offset=offset, exponent=2.0))
    assert found.conforms, str(found)


def test_a_curve_with_named_corners_conforms_and_without_them_does_not() -> None:
    def log_slope(d: np.ndarray) -> np.ndarray:
        return np.where(d < 0.0333, -60.0, -20.0)

    def log_output(d: np.ndarray) -> np.ndarray:
        return np.where(d < 0.0333, -60 * d, -60 * 0.0333 - 20 * (d - 0.0333))

    assert check_sensor(_custom(log_output, log_slope, corners=(0.0333,))).conforms
    assert _broken(_custom(log_output, log_slope)) == [DERIVATIVE]


def _broken(sensor: SensorModel) -> list[str]:
    """The laws that a curve is found to break, after a look at what the report says about them."""
    found = check_sensor(sensor)
    broken = [check for check in found.checks if not check.holds]
    report = str(found)
    assert not found.conforms
    assert report.splitlines()[0] == f"{found.sensor}: does not conform"
    for check in broken:
        assert f"FAIL  {check.law}: {check.evidence}" in report
    return [check.law for check in broken]


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseConstant(SensorModel):
    """Declares a constant slope and bends."""

    @property
    def constant_log_slope(self) -> float | None:
        return -50.0

    def _log_output(self, distance: np.ndarray) -> np.ndarray:
        return -50 * distance - distance**2

    def _log_slope(self, distance: np.ndarray) -> np.ndarray:
        return -50 - 2 * distance


class Changing(SensorModel):
    """Obeys every law of a curve, but is no dataclass of its own: its rate can change after it was used."""

    def __init__(self, rate: float) -> None:
        super().__init__()
        object.__setattr__(self, "rate", rate)

    def _log_output(self, distance: np.ndarray) -> np.ndarray:
        return self.rate * distance

    def _log_slope(self, distance: np.ndarray) -> np.ndarray:
        return np.full_like(distance, self.rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class Unhashable(SensorModel):
    """Carries a list."""

    rates: list[float]

    def _log_output(self, distance: np.ndarray) -> np.ndarray:
        return self.rates[0] * distance

    def _log_slope(self, distance: np.ndarray) -> np.ndarray:
        return np.full_like(distance, self.rates[0])


def _forward_difference(d: np.ndarray) -> np.ndarray:
    """What is often written for a slope, and what is off by h / 2 times the curvature of ln xi."""
    h = 1e-3
    return (-3 * np.log(d + h + 0.04) + 3 * np.log(d + 0.04)) / h


@pytest.mark.parametrize(
    ("sensor", "law"),
    [
        (_custom(lambda d: -40 * d, lambda d: np.full_like(d, -41.0)), DERIVATIVE),
        (_custom(lambda d: -40 * d, lambda d: np.full_like(d, -40.001)), DERIVATIVE),
        (_custom(lambda d: -3 * np.log(d + 0.04), _forward_difference), DERIVATIVE),
        (_custom(lambda d: -40 * d - 1e-3 * (d > 0.1), lambda d: np.full_like(d, -40.0)), DERIVATIVE),
        (_custom(lambda d: 5 * d, lambda d: np.full_like(d, 5.0)), FALLS),
        (_custom(lambda d: -50 * d + 400 * d**2, lambda d: -50 + 800 * d), FALLS),
        (_custom(lambda d: -np.sqrt(0.1 - d), lambda d: 0.5 / np.sqrt(0.1 - d)), FINITE),
        (_custom(lambda d: -3 * np.log(d), lambda d: -3 / d), FINITE),
        (_custom(lambda d: -40 * d, lambda _: -40.0), SHAPE),
        (_custom(lambda d: -40 * d.ravel(), lambda d: np.full(d.size, -40.0)), SHAPE),
        (_custom(lambda d: -40 * math.tanh(d), lambda d: -40 / math.cosh(d) ** 2), SHAPE),
        (_custom(lambda d: -40 * d, lambda _: {}["slope"]), SHAPE),
        (FalseConstant(), CONSTANT),
        (_custom(lambda d: -40 * d - 1e-9 * d.size, lambda d: np.full_like(d, -40.0)), ELEMENTS),
        (_custom(lambda d: -40 * d, lambda d: np.full_like(d, -40.0 - 1e-9 * (d.ndim == 0))), ELEMENTS),
        (Changing(-40.0), VALUE),
        (Unhashable(rates=[-40.0]), VALUE),
    ],
    ids=[
        "wrong derivative",
        "slightly wrong derivative",
        "forward difference",
        "jump",
        "rising",
        "turning around",
        "not a number",
        "infinite at zero",
        "scalar slope",
        "flattened",
        "scalar functions only",
        "raises",
        "false constant slope",
        "depends on how many are asked",
        "another slope for a scalar",
        "no dataclass",
        "not hashable",
    ],
)
def test_a_curve_that_breaks_one_law_is_told_which(sensor: SensorModel, law: str) -> None:
    assert _broken(sensor) == [law]


@examples(40)
@given(error=st.floats(1e-4, 1) | st.floats(-1, -1e-4), rate=st.floats(-300, -5))
def test_no_error_of_the_slope_beyond_a_ten_thousandth_goes_unnoticed(error: float, rate: float) -> None:
    """A thousandth of what matters to a motion, a hundred times what the check allows."""
    assert DERIVATIVE in _broken(_custom(lambda d: rate * d, lambda d: np.full_like(d, rate * (1 + error))))


def test_what_a_users_function_raises_is_in_the_report() -> None:
    report = str(check_sensor(_custom(lambda d: -40 * d, lambda _: {}["slope"])))
    assert f"FAIL  {SHAPE}: KeyError: 'slope'" in report


def test_a_curve_without_a_name_goes_by_its_class() -> None:
    assert check_sensor(FalseConstant()).sensor == "FalseConstant"


def test_a_curve_is_only_probed_where_it_is_valid() -> None:
    """A finite range is probed to its end: this one turns around behind it, and at 40 mm still falls."""
    bent = {"log_output": lambda d: -50 * d + 600 * d**2, "log_slope": lambda d: -50 + 1200 * d}
    assert check_sensor(_custom(**bent, maximum_distance=0.0416)).conforms
    assert _broken(_custom(**bent, maximum_distance=0.0418)) == [FALLS]


def test_nested_and_cut_curves_conform() -> None:
    table = Table(distances=(0.0, 0.01, 0.02, 0.05), outputs=(4.0, 2.0, 1.0, 0.1))
    cut = Recessed(sensor=Recessed(sensor=table, recess=0.004), recess=0.003, maximum_distance=0.02)
    assert cut.knots == pytest.approx((0.003, 0.013))
    assert check_sensor(cut).conforms


@pytest.mark.parametrize("what", [ExponentialFirstOrder, "inverse-power", None, 5.0])
def test_what_is_no_sensor_curve_is_refused(what: object) -> None:
    with refused("sensor"):
        check_sensor(what)  # type: ignore[arg-type]


def test_too_few_probes_are_refused() -> None:
    with refused("probes", value=15):
        check_sensor(CURVES["table"], probes=15)
    assert check_sensor(CURVES["table"], probes=16).conforms


# --- the same where a curve is first used

NOISE = np.random.default_rng(3)


def noisy(function: Callable, size: float) -> Callable:
    return lambda d: function(d) + size * NOISE.standard_normal(np.shape(d))


def straight(d: np.ndarray) -> np.ndarray:
    return -40.0 * d


def forty(d: np.ndarray) -> np.ndarray:
    return np.full_like(d, -40.0)


def encounter(distance: float = 0.0422) -> Scenario:
    return Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=distance, velocity=-0.3),
    )


def design(sensor: SensorModel) -> object:
    objective = excursion_objective(position_scale=0.5, velocity_scale=0.3)
    return design_gain(Task(encounter(), sensor, objective, bounds=(-10.0, -0.01)))


UNLAWFUL = {
    "ln xi is no number": (
        _custom(lambda d: d * np.nan, forty),
        "the function log_output returned nan at a distance of 0 m, but its values must be finite",
    ),
    "slope is no number": (
        _custom(straight, lambda d: np.where(d > 0.02, np.nan, -40.0)),
        r"the function log_slope returned nan 1/m at a distance of 0\.0201\d* m, but its values must be finite",
    ),
    "noise": (
        _custom(noisy(straight, 0.01), forty),
        r"in a second call\. A sensor curve must always return the same number",
    ),
    "noisy slope": (_custom(straight, noisy(forty, 1.0)), "1/m in a second call"),
    "rising": (
        _custom(lambda d: 40 * d, lambda d: -forty(d)),
        "the slope is 40 1/m at a distance of 0 m, but must not be pos",
    ),
    "rising beside the surface": (
        _custom(lambda d: -100 * (d - 0.02) ** 2, lambda d: -200 * (d - 0.02)),
        "the slope is 4 1/m at a distance of 0 m, but must not be positive.*maximum_distance.*use the class Recessed",
    ),
    "slope 10 % off": (
        _custom(straight, lambda d: 1.1 * forty(d)),
        r"between .* average of log_slope is -44 1/m, but log_output changes by -40 per meter\. The function log_slope",
    ),
    "slope 0.3 % off": (_custom(straight, lambda d: 1.003 * forty(d)), r"the average of log_slope is -40\.12 1/m"),
    "jump": (
        _custom(lambda d: -40 * d - 0.1 * (d > 0.02), forty),
        "The function log_slope must be the derivative of log_output",
    ),
    "flat": (_custom(lambda d: 0 * d, lambda d: 0 * d), "found a slope of 0 1/m at every distance"),
    "raises": (
        _custom(lambda _: {}["slope"], forty),
        "log_output or log_slope raised the error \"KeyError: 'slope'\". Both functions must accept distances",
    ),
    "scalars only": (
        _custom(lambda d: -40 * math.tanh(d), forty),
        "must accept distances of any shape",
    ),
    "false constant slope": (FalseConstant(), "but the sensor curve declares a constant_log_slope of -50 1/m"),
    "not hashable": (Unhashable(rates=[-40.0]), "the class Unhashable has a field that cannot be hashed"),
}


@pytest.mark.parametrize("name", UNLAWFUL)
def test_an_unlawful_curve_is_refused_where_it_is_first_used(name: str) -> None:
    sensor, message = UNLAWFUL[name]
    recessed = Recessed(sensor=sensor, recess=0.0)
    drag = Task(encounter(), sensor, drag_effect=DragEffect(ratio=0.3))
    for use in (
        lambda: design(sensor),
        lambda: design(recessed),
        lambda: find_contact(encounter(), sensor, -0.7),
        lambda: design_drag(drag),
    ):
        with pytest.raises(InvalidInputError, match=message):
            use()


LAWFUL = {
    "rounded slope": _custom(straight, lambda d: 1.0001 * forty(d)),
    "corner that is not named": _custom(
        lambda d: np.where(d < 0.0333, -60 * d, -60 * 0.0333 - 20 * (d - 0.0333)),
        lambda d: np.where(d < 0.0333, -60.0, -20.0),
    ),
    "forward difference": _custom(
        lambda d: -3 * np.log(d + 0.04), lambda d: (-3 * np.log(d + 0.04 + 1e-6) + 3 * np.log(d + 0.04)) / 1e-6
    ),
    "steep beside the surface": _custom(lambda d: -2 * np.log(d + 1e-4), lambda d: -2 / (d + 1e-4)),
    "rises beyond the start": _custom(lambda d: -50 * d + 400 * d**2, lambda d: -50 + 800 * d),
    "ends beyond the start": _custom(lambda d: np.sqrt(0.05 - d), lambda d: -0.5 / (0.05 - d) ** 0.5),
    "sunk to where it falls": Recessed(
        sensor=_custom(lambda d: -100 * (d - 0.02) ** 2, lambda d: -200 * (d - 0.02)), recess=0.021
    ),
    "rounding above zero at the end": _custom(
        lambda d: -10 * d + 100 * d**2 + 1e-15 * d, lambda d: -10 + 200 * d + 1e-15, maximum_distance=0.05
    ),
}


@pytest.mark.parametrize("name", LAWFUL)
def test_a_curve_that_is_good_enough_up_to_where_encounters_start_is_used(name: str) -> None:
    found = find_contact(encounter(), LAWFUL[name], -0.1)
    assert found.contact.relative_velocity > -0.3


def test_a_curve_is_looked_at_again_only_where_an_encounter_starts_farther_away() -> None:
    asked: list[float] = []

    def log_output(d: np.ndarray) -> np.ndarray:
        asked.append(float(np.max(d)))
        return -50 * d + 400 * d**2

    sensor = _custom(log_output, lambda d: -50 + 800 * d)
    find_contact(encounter(0.05), sensor, -0.7)
    count = len(asked)
    assert count > 3
    find_contact(encounter(0.05), sensor, -0.6)
    find_contact(encounter(0.03), sensor, -0.7)
    assert len(asked) == count
    with refused("sensor"):
        find_contact(encounter(0.07), sensor, -0.7)


@pytest.mark.parametrize("name", CURVES)
def test_the_curves_of_pretouch_are_not_verified_reach(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = CURVES[name]
    ours = name != "custom"
    monkeypatch.setattr("pretouch.motion.curve.refuse_invalid_curve", lambda *_: asked.append(name))
    asked: list[str] = []
    low = max(sensor.valid_range[0], 0.0)
    find_contact(encounter(low + 0.01), sensor, -0.1)
    assert asked == ([] if ours else [name])
