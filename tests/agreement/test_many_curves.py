"""Encounters with one sensor curve each, solved in one call, agree with separate solutions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from encounters import CURVES as SHARED
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion import Admittance, ContactState, Obstacle, Plant, Reference, Scenario, find_contact
from pretouch.motion.curve import LOW, MIDDLE, TERMS, TOP, curve_windows
from pretouch.motion.many_curves import ManyCurves
from pretouch.motion.many_windows import find_images
from pretouch.sensors import CustomSensor, InversePower, MittagLeffler, Recessed, SensorModel, Table, parameter
from pretouch.sensors.sensitivity import CurveSensitivity
from pretouch.uncertainty import Ensemble, make_ensemble
from refusals import refused

COUNT = 24
SCENARIO = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=20.0),
    obstacle=Obstacle(position=0.0422, velocity=-0.3, acceleration=-0.1),
    plant=Plant(position=0.001, velocity=0.01),
    reference=Reference(position=0.002, velocity=-0.01),
)
GAINS = -np.geomspace(0.02, 1.5, 9)[:, None]  # enough of them for the fast path of one curve


@dataclass(frozen=True, slots=True, kw_only=True)
class Gaussian(SensorModel):
    """A curve of somebody else's, who says nothing of how it changes with its parameters."""

    width: float = parameter("w", "m")
    offset: float = parameter("l_0", "m")
    name = "gaussian"

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return -(((distance + self.offset) / self.width) ** 2)

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return -2 * (distance + self.offset) / self.width**2


@dataclass(frozen=True, slots=True, kw_only=True)
class Bell(Gaussian):
    """The same from somebody who says that the width stretches a curve without offset."""

    name = "bell"

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:
        return CurveSensitivity(stretch=-1 / self.width) if name == "width" and self.offset == 0 else None

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return -(((distance + self.offset) / self.width) ** 2) - np.abs(distance + self.offset) / self.width

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return -2 * (distance + self.offset) / self.width**2 - 1 / self.width


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreign(SensorModel):
    """An inverse power that does not know that it is one, or nearly one where bent."""

    offset: float = parameter("l_0", "m")
    bend: float = parameter("k", "1/m")
    name = "foreign"

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return -3 * np.log(distance + self.offset) - self.bend * distance

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return -3 / (distance + self.offset) - self.bend


TABLE = Table(
    distances=(0.0, 0.005, 0.012, 0.02, 0.03, 0.045, 0.07),
    outputs=(0.46, 0.31, 0.205, 0.13, 0.083, 0.041, 0.022),
)
CUSTOM = CustomSensor(
    log_output_function=lambda d: -40 * d - 3 * np.tanh(d / 0.02),
    log_slope_function=lambda d: -40 - 3 / 0.02 / np.cosh(d / 0.02) ** 2,
    maximum_distance=2.0,
)
MITTAG_LEFFLER = MittagLeffler(scale=1.0, rate=-80.0, order=0.8)


def spread(low: float, high: float) -> np.ndarray:
    return np.random.default_rng(7).permutation(np.linspace(low, high, COUNT))


IMAGES: dict[str, tuple[SensorModel, dict[str, np.ndarray]]] = {
    "mittag-leffler by rate": (MITTAG_LEFFLER, {"rate": spread(-90, -70), "scale": spread(0.5, 2)}),
    "recessed mittag-leffler": (
        Recessed(sensor=MITTAG_LEFFLER, recess=0.004),
        {"rate": spread(-90, -70), "recess": spread(0.006, 0.001)},
    ),
    "recessed table": (Recessed(sensor=TABLE, recess=0.004), {"recess": spread(0.0, 0.006)}),
    "recessed custom": (Recessed(sensor=CUSTOM, recess=0.004), {"recess": spread(0.0, 0.006)}),
    "recessed gaussian": (
        Recessed(sensor=Gaussian(width=0.05, offset=0.03), recess=0.004),
        {"recess": spread(0, 0.01)},
    ),
    "bell by width": (Bell(width=0.04, offset=0.0), {"width": spread(0.03, 0.05)}),
    "recessed bell": (
        Recessed(sensor=Bell(width=0.04, offset=0.0), recess=0.003),
        {"width": spread(0.03, 0.05), "recess": spread(0.0, 0.006)},
    ),
}
OTHERS: dict[str, tuple[SensorModel, dict[str, np.ndarray]]] = {
    "gaussian": (Gaussian(width=0.05, offset=0.03), {"width": spread(0.04, 0.06), "offset": spread(0.04, 0.02)}),
    "recessed gaussian by width": (
        Recessed(sensor=Gaussian(width=0.05, offset=0.03), recess=0.004),
        {"width": spread(0.04, 0.06), "recess": spread(0.006, 0.001)},
    ),
    "bell by offset": (Bell(width=0.04, offset=0.01), {"width": spread(0.03, 0.05), "offset": spread(0.0, 0.02)}),
    "mittag-leffler by order": (MITTAG_LEFFLER, {"order": spread(0.7, 0.9)}),
    "recessed mittag-leffler by order": (
        Recessed(sensor=MITTAG_LEFFLER, recess=0.004),
        {"order": spread(0.7, 0.9), "rate": spread(-85, -75), "recess": spread(0.0, 0.006)},
    ),
    "steep to flat": (Gaussian(width=0.05, offset=0.03), {"width": np.geomspace(0.02, 2.0, COUNT)}),
    "powers of somebody else": (Foreign(offset=0.03, bend=0.0), {"offset": spread(0.01, 0.05)}),
    "powers among others": (
        Foreign(offset=0.03, bend=0.0),
        {"bend": np.where(np.arange(COUNT) % 3, 0.0, spread(0.0, 20.0)), "offset": spread(0.01, 0.05)},
    ),
}
FAMILIES = IMAGES | OTHERS


def ensemble(name: str, scenario: Scenario = SCENARIO, **inputs: np.ndarray) -> Ensemble:
    sensor, own = FAMILIES[name]
    values = {"obstacle.velocity": spread(-0.6, -0.1), **{f"sensor.{key}": value for key, value in own.items()}}
    return make_ensemble(scenario, sensor, values | inputs)


def curves_of(name: str) -> ManyCurves:
    found = ensemble(name).many
    assert found is not None
    return found


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("name", FAMILIES)
def test_many_curves_in_one_call_are_each_alone(name: str) -> None:
    several = ensemble(name)
    assert several.many is not None
    found = several.contacts(GAINS)
    assert found.reached.all()
    for i in range(COUNT):
        alone = find_contact(*several.at(i), GAINS[:, 0])
        push = alone.end.largest_acceleration.max()
        for quantity in ContactState.names():
            # on other windows a motion takes other steps: each leaves 8e-14 of l(0), which a contact has some hundred
            # times larger in its time; x'' is a difference of forces beside the largest one
            near = 1e-10 * push if quantity.endswith("acceleration") else 3e-12 * float(alone.end.time.max())
            mine, theirs = getattr(found.end, quantity)[:, i], getattr(alone.end, quantity)
            np.testing.assert_allclose(mine, theirs, rtol=3e-11, atol=near, err_msg=f"{quantity} of {i}")
        np.testing.assert_array_equal(found.gain[:, i], GAINS[:, 0])
    assert found.impulse_residual.max() < 1e-10  # by each sensor's own ln xi; more would have been left open


def test_an_inverse_power_is_one_window_that_is_exact() -> None:
    """1 / g is linear: g = n / (l - middle) with the exponent and the virtual source, L(3), and no polynomial."""
    table = curve_windows(InversePower(scale=1.0, distance_offset=0.0419, exponent=3.32), 0.0, 0.05)
    assert table.shape == (1, TERMS + 1)
    assert table[0, [MIDDLE, TERMS]] == pytest.approx([-0.0419, -3.32], rel=1e-12)  # from slopes that are rounded


def test_windows_that_all_encounters_share_cannot_be_written() -> None:
    for sensor in SHARED.values():
        table = curve_windows(sensor, max(sensor.valid_range[0], 0.0), 0.05)
        assert not table.flags.writeable
        assert curve_windows(sensor, max(sensor.valid_range[0], 0.0), 0.05) is table


@pytest.mark.parametrize("name", FAMILIES)
def test_the_windows_of_every_curve_meet_its_slope(name: str) -> None:
    curves = curves_of(name)
    windows = curves.windows(0.0625)
    assert windows.falling
    for i, sensor in enumerate(curves.sensors):
        own = windows.table[windows.starts[i] : windows.starts[i + 1]]
        assert own[0, LOW] == 0.0
        top = min(0.0625, sensor.valid_range[1])
        assert (
            own[-1, TOP] == pytest.approx(top, rel=1e-15) or own[-1, TOP] == curves.windows(0.0625).table[:, TOP].max()
        )
        assert (own[1:, LOW] <= own[:-1, TOP]).all()
        for row in own:
            distance = np.linspace(row[LOW], min(row[TOP], top), 40)
            z, terms = distance - row[MIDDLE], row[TERMS:]
            slope = terms[0] / z if len(terms) == 1 else sum(j * terms[j] * z ** (j - 1) for j in range(1, len(terms)))
            expected = sensor.log_slope(np.clip(distance, *sensor.valid_range))
            # 4e-13 is allowed at the probes; between them it is as much again at most, and E_alpha is good to 1e-13
            assert np.abs(slope - expected).max() <= 8e-13 * np.abs(expected).max()


@pytest.mark.parametrize("name", FAMILIES)
def test_what_is_an_image_of_one_curve_is_found_to_be_one(name: str) -> None:
    sensor, values = FAMILIES[name]
    assert (find_images(sensor, values) is not None) == (name in IMAGES)


@pytest.mark.parametrize("name", ["gaussian", "mittag-leffler by rate", "recessed table"])
def test_what_does_not_end_in_contact_is_left_to_each_curve_alone(name: str) -> None:
    several = ensemble(name, **{"obstacle.velocity": np.where(np.arange(COUNT) % 2, -0.3, 0.0)})
    found = several.contacts(GAINS)
    for i in range(COUNT):
        alone = find_contact(*several.at(i), GAINS[:, 0])
        np.testing.assert_array_equal(found.status[:, i], alone.status)
        if i % 2 == 0:
            np.testing.assert_array_equal(found.closest_distance[:, i], alone.closest_distance)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("name", ["gaussian", "recessed mittag-leffler"])
def test_gradients_are_those_of_each_curve_alone(name: str) -> None:
    several = ensemble(name)
    found = several.contacts(GAINS)
    for by in ("gain", "obstacle.velocity", *(f"sensor.{key}" for key in FAMILIES[name][1])):
        mine = found.gradients.of("relative_velocity", by)
        for i in (0, COUNT - 1):
            alone = find_contact(*several.at(i), GAINS[:, 0]).gradients.of("relative_velocity", by)
            np.testing.assert_array_equal(mine[:, i], alone)
    assert found.gradients.unit("time", "gain") == "s/(N*s)"


def test_a_few_encounters_take_the_guaranteed_path() -> None:
    sensor, own = FAMILIES["gaussian"]
    several = make_ensemble(SCENARIO, sensor, {f"sensor.{key}": value[:3] for key, value in own.items()})
    found = several.contacts(-0.4)
    for i in range(3):
        assert found.end.time[i] == find_contact(*several.at(i), -0.4).end.time


def test_a_start_beyond_the_range_of_one_curve_names_it() -> None:
    sensor = Recessed(sensor=TABLE, recess=0.004)
    several = make_ensemble(SCENARIO, sensor, {"sensor.recess": np.linspace(0.0, 0.04, COUNT)})
    with refused("obstacle position", value=0.0412, limit=(-0.0295652, 0.0404348)):
        several.contacts(GAINS)


@pytest.mark.parametrize("method", ["closed-form", "uniform-motion"])
def test_other_methods_are_asked_curve_by_curve(method: str) -> None:
    sensor, own = FAMILIES["gaussian"]
    several = make_ensemble(SCENARIO, sensor, {f"sensor.{key}": value for key, value in own.items()}, method=method)
    assert several.many is None
    with pytest.raises(InvalidInputError):
        several.contacts(GAINS)


def test_a_constant_slope_among_others_is_solved_for_itself() -> None:
    several = make_ensemble(SCENARIO, MITTAG_LEFFLER, {"sensor.order": np.array([0.9, 1.0])})
    assert several.many is None
    assert several.contacts(-0.4).reached.all()


def test_an_inverse_power_keeps_its_likeness() -> None:
    sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    several = make_ensemble(SCENARIO, sensor, {"sensor.exponent": spread(3.0, 4.0)})
    assert several.many is None
    assert several.likeness is not None


@pytest.mark.slow(keep=10)
@pytest.mark.parametrize("name", FAMILIES)
def test_most_of_what_many_curves_come_to_is_right_to_rounding(name: str) -> None:
    several = ensemble(name)
    found = several.contacts(GAINS)
    alone = np.stack([find_contact(*several.at(i), GAINS[:, 0]).end.time for i in range(COUNT)], axis=-1)
    error = np.abs(found.end.time / alone - 1)
    assert np.median(error) < 5e-13
    assert np.quantile(error, 0.9) < 2e-12
