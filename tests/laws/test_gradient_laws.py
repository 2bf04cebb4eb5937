"""Laws of gradients: consistency under changes of units, mass and scale, and between equivalent parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given
from hypothesis import strategies as st

from encounters import CURVES, Encounters, random_encounters
from gradient_scales import sizes_of
from pretouch._core.errors import ResultUnavailableError
from pretouch.motion import Admittance, ContactResult, Obstacle, Plant, Reference, Scenario, find_contact
from pretouch.sensors import (
    ExponentialFirstOrder,
    ExponentialSecondOrder,
    InversePower,
    MittagLeffler,
    Recessed,
    SensorModel,
)
from pretouch.sensors.model import parameter
from pretouch.sensors.sensitivity import curve_sensitivity
from properties import examples
from refusals import refused
from sensor_samples import SAMPLES

DIMENSIONS = {  # of length and of time, the powers of SI units
    "time": (0, 1),
    "position": (1, 0),
    "velocity": (1, -1),
    "acceleration": (1, -2),
    "displacement": (1, 0),
    "relative_velocity": (1, -1),
    "virtual_force": (1, -2),
}
MASSES = ("admittance.mass", "admittance.damping", "admittance.stiffness", "gain")
EXACT = 3e-8  # three terms of 1e-8 each


@pytest.fixture
def letter() -> Scenario:
    return Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-0.3),
    )


def value_of(e: Encounters, sensor: SensorModel, name: str) -> Any:
    if name == "gain":
        return e.gain
    part, field = name.split(".")
    if part != "sensor":
        return getattr(getattr(e.scenario, part), field)
    if isinstance(sensor, Recessed):
        return sensor.parameters[field]
    return getattr(sensor, field)


def input_dimensions(name: str) -> tuple[int, int]:
    """Powers of length and of time in an input, with the mass left out."""
    part, field = name.split(".") if "." in name else ("", name)
    if part == "sensor":
        return {"distance_offset": (1, 0), "recess": (1, 0), "rate": (-1, 0), "curvature": (-2, 0)}.get(field, (0, 0))
    by_field = {"position": (1, 0), "velocity": (1, -1), "acceleration": (1, -2), "gain": (1, -1)}
    return {**by_field, "mass": (0, 0), "damping": (0, -1), "stiffness": (0, -2)}[field]


def total_and_size(result: ContactResult, e: Encounters, sensor: SensorModel, quantity: str, weights: Any) -> Any:
    """Sum of weight * value * derivative, and the largest of the terms."""
    terms = [w * value_of(e, sensor, n) * result.gradients.of(quantity, n) for n, w in weights.items() if w]
    return sum(terms), np.abs(terms).max(axis=0)


@pytest.mark.parametrize("kind", ["letter", "under-damped", "accelerated", "tracking", "everything"])
@pytest.mark.parametrize("curve", CURVES)
def test_another_unit_changes_nothing(curve: str, kind: str) -> None:
    """Euler's identity for the units of mass, length and time: the inputs' derivatives add up to the quantity."""
    sensor, e = CURVES[curve], random_encounters(kind, 40, seed=5)
    result = find_contact(e.scenario, sensor, e.gain)
    names = result.gradients.inputs
    reached, sizes = result.reached, sizes_of(e, sensor, np.asarray(result.end.time))
    for quantity, (length, time) in DIMENSIONS.items():
        value = np.asarray(getattr(result.end, quantity))
        laws = [
            (dict.fromkeys(MASSES, 1.0), 1.0 if quantity == "virtual_force" else 0.0),
            ({n: input_dimensions(n)[1] for n in names}, time),
        ]
        if curve not in {"table", "custom"}:  # whose lengths are no parameters
            laws.append(({n: input_dimensions(n)[0] for n in names}, length))
        for weights, degree in laws:
            total, size = total_and_size(result, e, sensor, quantity, weights)
            error = np.abs(total - degree * value)
            assert (error <= EXACT * (size + sizes[quantity]))[reached].all(), quantity


def test_the_scale_of_the_output_has_no_influence_at_all(letter: Scenario) -> None:
    for curve in ("inverse-power", "exponential-1", "exponential-2", "mittag-leffler", "recessed"):
        gradients = find_contact(letter, CURVES[curve], -0.7).gradients
        assert [gradients.of(q, "sensor.scale") for q in gradients.quantities] == [0.0] * 7


def test_a_recess_is_a_distance_offset(letter: Scenario) -> None:
    gradients = find_contact(letter, CURVES["recessed"], -0.7).gradients
    for quantity in gradients.quantities:
        assert gradients.of(quantity, "sensor.recess") == gradients.of(quantity, "sensor.distance_offset")
    bare = InversePower(scale=1.0, distance_offset=0.011, exponent=2.2)
    other = find_contact(letter, bare, -0.7).gradients
    for quantity in gradients.quantities:  # the same curve, by other roundings and so in other steps
        expected = other.of(quantity, "sensor.distance_offset")
        # a step leaves 1e-10 of a response, and of its rate 16 times that
        assert gradients.of(quantity, "sensor.recess") == pytest.approx(expected, rel=16e-10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Power(SensorModel):
    """L(3) as a user would write it: nothing is said of its derivatives by its parameters."""

    offset: float = parameter("l_0", "m")
    exponent: float = parameter("n", "")
    name: ClassVar[str] = "power"

    def _log_output(self, distance: Any) -> Any:
        return -self.exponent * np.log(distance + self.offset)

    def _log_slope(self, distance: Any) -> Any:
        return -self.exponent / (distance + self.offset)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bent(InversePower):
    """A curve that inherits another: what that says of its parameters does not hold."""

    name: ClassVar[str] = "bent"

    def _log_output(self, distance: Any) -> Any:
        return InversePower._log_output(self, distance) - 20 * self.exponent * distance

    def _log_slope(self, distance: Any) -> Any:
        return InversePower._log_slope(self, distance) - 20 * self.exponent


def test_parameters_of_a_users_curve_are_followed_along_the_motion(letter: Scenario) -> None:
    """Two ways to the same derivatives: by the shift and the strength of the curve, and by its change alone."""
    known = find_contact(letter, CURVES["inverse-power"], -0.7).gradients
    own = find_contact(letter, Power(offset=0.0419, exponent=3.32), -0.7).gradients
    assert own.inputs[-2:] == ("sensor.offset", "sensor.exponent")
    for quantity in known.quantities:
        for name, other in (("offset", "distance_offset"), ("exponent", "exponent")):
            expected = known.of(quantity, f"sensor.{other}")
            assert own.of(quantity, f"sensor.{name}") == pytest.approx(expected, rel=1e-9), (quantity, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinked(SensorModel):
    """A curve whose slope has a kink at 13 mm, which no polynomial meets. It is undefined beyond 0.3 m."""

    rate: float = parameter("b", "1/m")
    name: ClassVar[str] = "kinked"

    def _log_output(self, distance: Any) -> Any:
        beyond = np.where(distance > 0.3, np.nan, 0.0)
        return -self.rate * distance + 500 * distance**2 - 250 * np.maximum(distance - 0.013, 0) ** 2 + beyond

    def _log_slope(self, distance: Any) -> Any:
        beyond = np.where(distance > 0.3, np.nan, 0.0)
        return -self.rate + 1000 * distance - 500 * np.maximum(distance - 0.013, 0) + beyond


def test_a_recessed_curve_with_a_kink_has_a_derivative_by_its_recess(letter: Scenario) -> None:
    """The error of differences over 2e-6 m is below 1e-7 here, as larger steps show."""
    near = replace(letter, obstacle=Obstacle(position=0.03, velocity=-0.3))

    def contact(recess: float) -> ContactResult:
        return find_contact(near, Recessed(sensor=Kinked(rate=60.0), recess=recess), -0.3)

    gradients, step = contact(0.002).gradients, 1e-6
    low, high = contact(0.002 - step), contact(0.002 + step)
    for quantity in ("relative_velocity", "displacement", "virtual_force"):
        slope = (getattr(high.end, quantity) - getattr(low.end, quantity)) / (2 * step)
        assert gradients.of(quantity, "sensor.recess") == pytest.approx(slope, rel=1e-6)


def test_a_curve_that_inherits_is_asked_itself(letter: Scenario) -> None:
    sensor = Bent(scale=1.0, distance_offset=0.0419, exponent=3.32)
    found = curve_sensitivity(sensor, "exponent").slope(np.array([0.01]))
    assert found == pytest.approx(-1 / (0.01 + 0.0419) - 20, rel=1e-10)


@pytest.mark.parametrize("cls", SAMPLES, ids=lambda cls: cls.__name__)
@given(data=st.data())
@examples(12, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
def test_every_sensor_says_how_its_parameters_change_its_slope(cls: type[SensorModel], data: st.DataObject) -> None:
    """The change by each parameter, where a class gives it, against curves with other values of it."""
    sensor = data.draw(SAMPLES[cls])
    low, high = sensor.valid_range
    distance = np.linspace(low, min(high, low + 0.05), 7)[1:-1]
    slope = sensor.log_slope(distance)
    for name in sensor.parameter_units:
        change = curve_sensitivity(sensor, name)
        inner = sensor.sensor if isinstance(sensor, Recessed) else sensor
        value = sensor.recess if name == "recess" else getattr(inner, name)
        step = 1e-4 * (abs(value) if name != "recess" else 0.01)
        assume(step > 1e-100)  # a difference over less overflows
        if name == "order":
            assume(value < 0.9)
        if change.slope is not None:
            found = change.slope(distance)
        else:
            bend = _bend(sensor, distance)
            found = change.output * slope + change.shift * bend + change.stretch * (slope + distance * bend)
        expected = (_changed(sensor, name, step, distance) - _changed(sensor, name, -step, distance)) / (2 * step)
        # the difference is good to the square of the step, 1e-8, and to rounding over it, 1e-9 of the slope
        assert np.abs(found - expected).max() <= 1e-6 * (np.abs(expected).max() + np.abs(slope / (step * 1e4)).max())


def _bend(sensor: SensorModel, distance: Any) -> Any:
    step = 1e-6
    return (sensor.log_slope(distance + step) - sensor.log_slope(distance - step)) / (2 * step)


def _changed(sensor: SensorModel, name: str, change: float, distance: Any) -> Any:
    if name == "recess":
        return sensor.sensor._log_slope(distance + sensor.recess + change)
    inner = sensor.sensor if isinstance(sensor, Recessed) else sensor
    own = distance + (sensor.recess if isinstance(sensor, Recessed) else 0.0)
    return replace(inner, **{name: getattr(inner, name) + change})._log_slope(own)


def test_arrays_hold_what_single_encounters_give() -> None:
    e = random_encounters("accelerated", 12, seed=8)
    for curve in ("exponential-1", "mittag-leffler"):
        many = find_contact(e.scenario, CURVES[curve], e.gain)
        for i in np.flatnonzero(many.reached)[:4]:
            s = e.scenario
            one = find_contact(
                Scenario(
                    admittance=Admittance(
                        mass=s.admittance.mass[i], damping=s.admittance.damping[i], stiffness=s.admittance.stiffness[i]
                    ),
                    obstacle=Obstacle(
                        position=s.obstacle.position[i],
                        velocity=s.obstacle.velocity[i],
                        acceleration=s.obstacle.acceleration[i],
                    ),
                ),
                CURVES[curve],
                e.gain[i],
            )
            for name in one.gradients.inputs:
                found = one.gradients.of("relative_velocity", name)
                assert isinstance(found, float)
                expected = many.gradients.of("relative_velocity", name)[i]
                assert found == pytest.approx(expected, rel=1e-7, abs=1e-9)


def test_gradients_have_the_broadcast_shape_and_cannot_be_changed(letter: Scenario) -> None:
    found = find_contact(letter, CURVES["table"], np.full((2, 5), -0.5)).gradients
    derivative = found.of("time", "obstacle.position")
    assert derivative.shape == (2, 5)
    with pytest.raises(ValueError, match="read-only"):
        derivative[0, 0] = 1.0
    with pytest.raises(AttributeError, match="cannot assign"):
        found.inputs = ()
    assert repr(found) == "<ContactGradients: 7 quantities by 12 inputs>"


def test_rows_that_are_not_kept_are_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    from pretouch.motion import gradient_rows

    e = random_encounters("everything", 30, seed=9)
    kept = find_contact(e.scenario, CURVES["exponential-2"], e.gain).gradients
    monkeypatch.setattr(gradient_rows, "_KEPT", 10)
    monkeypatch.setattr(gradient_rows, "_BLOCK", 7)
    again = find_contact(e.scenario, CURVES["exponential-2"], e.gain).gradients
    for name in kept.inputs:
        np.testing.assert_array_equal(kept.of("position", name), again.of("position", name))


def test_what_is_not_in_contact_has_no_derivative(letter: Scenario) -> None:
    scenario = Scenario(admittance=letter.admittance, obstacle=Obstacle(position=0.03, velocity=np.array([-0.3, 0.3])))
    for curve in CURVES:
        gradients = find_contact(scenario, CURVES[curve], -0.5, horizon=1.0).gradients
        for name in gradients.inputs:
            assert np.isnan(gradients.of("velocity", name)).tolist() == [False, True]
    beyond = InversePower(scale=1.0, distance_offset=0.01, exponent=2.0, minimum_distance=0.005)
    assert np.isnan(find_contact(letter, beyond, -0.5).gradients.of("time", "sensor.exponent"))


def test_without_a_gain_the_curve_is_not_felt(letter: Scenario) -> None:
    gradients = find_contact(letter, CURVES["inverse-power"], 0.0).gradients
    assert gradients.of("time", "obstacle.velocity") == pytest.approx(0.0422 / 0.3**2, rel=1e-12)
    assert gradients.of("relative_velocity", "sensor.exponent") == 0.0
    assert gradients.of("relative_velocity", "sensor.distance_offset") == pytest.approx(0.0, abs=1e-11)


def test_a_slow_start_loses_no_digits_of_its_derivatives() -> None:
    """l'(0) is a twentieth of the speed that the motion comes to: no derivative may rest on a division by it."""
    sensor = Recessed(
        sensor=InversePower(scale=1.0, distance_offset=0.01, exponent=2.0, minimum_distance=0.005), recess=0.0075
    )
    scenario = Scenario(
        admittance=Admittance(mass=3.823833004383657, damping=155.497426230996, stiffness=250.6509783506881),
        obstacle=Obstacle(position=0.21378796728737232, velocity=-1.7547441982209493, acceleration=-2.6038718872324225),
        plant=Plant(position=-0.10814554014513038, velocity=-1.6510048795389483),
        reference=Reference(
            position=-0.09391987071795513, velocity=-0.20717310128278912, acceleration=2.453215103280216
        ),
    )
    gain = -0.6223426539192045
    expected = 0.064807085694231  # by differences of an integration in many digits
    for copies in (gain, np.full(9, gain)):
        found = find_contact(scenario, sensor, copies).gradients.of("relative_velocity", "plant.velocity")
        assert found == pytest.approx(expected, rel=1e-8)


def test_a_start_at_rest_has_derivatives() -> None:
    """l'(0) = 0: the plant goes to its reference, or the object begins to fall."""
    for body in ({"obstacle": Obstacle(position=0.05, acceleration=-3.0)}, {"plant": Plant(position=-0.01)}):
        scenario = Scenario(
            admittance=Admittance(mass=1.0, damping=8.0, stiffness=25.0),
            **({"obstacle": Obstacle(position=0.04), "reference": Reference(position=0.1)} | body),
        )
        gradients = find_contact(scenario, CURVES["inverse-power"], -0.2, method="integration").gradients
        moved = [
            find_contact(
                replace(scenario, plant=replace(scenario.plant, velocity=v)), CURVES["inverse-power"], -0.2
            ).contact.time
            for v in (1e-4, -1e-4)
        ]
        # a central difference: the square of 1e-4, and rounding of 1e-13 over it
        assert gradients.of("time", "plant.velocity") == pytest.approx((moved[0] - moved[1]) / 2e-4, rel=1e-6)


@pytest.mark.parametrize(("quantity", "by"), [("speed", "gain"), ("time", "obstacle.speed"), ("time", "sensor.rate")])
def test_what_is_not_known_is_refused_by_name(letter: Scenario, quantity: str, by: str) -> None:
    gradients = find_contact(letter, CURVES["inverse-power"], -0.7).gradients
    for ask in (gradients.of, gradients.unit):
        with refused("quantity" if quantity == "speed" else "by", value=quantity if quantity == "speed" else by):
            ask(quantity, by)


def test_units_are_those_of_quantity_and_input(letter: Scenario) -> None:
    gradients = find_contact(letter, CURVES["inverse-power"], -0.7).gradients
    assert gradients.unit("time", "obstacle.position") == "s/m"
    assert gradients.unit("time", "sensor.exponent") == "s"
    assert gradients.unit("acceleration", "admittance.damping") == "(m/s^2)/(N*s/m)"


def test_the_uniform_motion_has_no_gradients(letter: Scenario) -> None:
    result = find_contact(letter, CURVES["exponential-2"], -0.7, method="uniform-motion")
    with refused("gradients", error=ResultUnavailableError):
        _ = result.gradients


def test_a_curvature_near_zero_keeps_its_derivative(letter: Scenario) -> None:
    """By the identity where it holds its digits, along the motion where it would not: both meet at the border."""
    found = []
    for curvature in (0.0, 1e-6, 1.0, 17.4, 17.6):  # c / b is a hundred times the distance at 17.5 / m^2
        sensor = ExponentialSecondOrder(scale=1.0, rate=-74.0, curvature=curvature)
        found.append(find_contact(letter, sensor, -0.7, method="integration").gradients.of("time", "sensor.curvature"))
    assert found[1] == pytest.approx(found[0], rel=1e-6)
    assert found[4] == pytest.approx(found[3], rel=1e-3)
    exact = find_contact(letter, ExponentialFirstOrder(scale=1.0, rate=-74.0), -0.7).gradients
    other = ExponentialSecondOrder(scale=1.0, rate=-74.0, curvature=0.0)
    assert find_contact(letter, other, -0.7).gradients.of("time", "sensor.rate") == pytest.approx(
        exact.of("time", "sensor.rate"), rel=1e-9
    )


def test_the_order_of_a_mittag_leffler_curve_has_a_derivative_at_one(letter: Scenario) -> None:
    """One-sided there: an order above one is refused. The curve goes over into L(5)."""
    sensor = MittagLeffler(scale=1.0, rate=-60.0, order=1.0)
    found = find_contact(letter, sensor, -0.7).gradients.of("relative_velocity", "sensor.order")
    speeds = [
        find_contact(letter, MittagLeffler(scale=1.0, rate=-60.0, order=1 - k * 1e-4), -0.7).contact.relative_velocity
        for k in range(3)
    ]
    # one-sided of second order: the square of 1e-4 times a third derivative of some hundred, of 0.1
    assert found == pytest.approx((3 * speeds[0] - 4 * speeds[1] + speeds[2]) / 2e-4, rel=1e-4)


def test_a_plant_that_moves_has_its_own_derivatives() -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.05, velocity=-0.3),
        plant=Plant(position=0.0, velocity=0.05),
    )
    gradients = find_contact(scenario, CURVES["custom"], -0.4).gradients
    everything = sum(gradients.of("position", f"{body}.position") for body in ("obstacle", "plant", "reference"))
    assert everything == pytest.approx(1.0, rel=1e-9)  # another origin
