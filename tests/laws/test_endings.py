"""How a motion ends in difficult cases: at a touch, while it decays to rest, and at the end of the curve.

All methods must agree: the closed form and the integration, for one encounter and for many.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from encounters import CURVES
from pretouch.motion import (
    Admittance,
    ContactResult,
    ContactStatus,
    Obstacle,
    Plant,
    Reference,
    Scenario,
    find_contact,
    solve_motion,
)
from pretouch.motion.layout import RESOLUTION
from pretouch.sensors import CustomSensor, ExponentialFirstOrder, InversePower, MittagLeffler, SensorModel, Table
from refusals import refused

FAR = {
    "exponential-1": ExponentialFirstOrder(scale=1.0, rate=-60.0),
    "inverse-power": InversePower(scale=1.0, distance_offset=0.04, exponent=3.0),
    "mittag-leffler": MittagLeffler(scale=1.0, rate=-20.0, order=0.7),
    "table": Table(distances=(0.0, 0.1, 0.3, 0.6, 2.0, 50.0), outputs=(8.0, 4.0, 2.0, 1.0, 0.5, 0.1)),
}
ADMITTANCES = [
    (1, 10, 25),
    (1, 20, 25),
    (1, 3, 25),
    (1, 0, 25),
    (1, 10, 0),
    (1, 0, 0),
    (3.7, 41.3, 0.8),
    (0.2, 0.1, 90),
]


def every_way(scenario: Scenario, sensor: SensorModel, gain: float, **options: Any) -> Iterator[ContactResult]:
    """Solve an encounter by each method, alone and as the third of eleven that are not alike."""
    methods = ["integration"] if sensor.constant_log_slope is None else ["closed-form", "integration"]
    gains = gain * np.linspace(0.8, 1.3, 11)
    gains[2] = gain
    for method in methods:
        yield find_contact(scenario, sensor, gain, method=method, **options)
        many = find_contact(scenario, sensor, gains, method=method, **options)
        one = find_contact(scenario, sensor, gains[2:3], method=method, **options)
        assert many.status[2] == one.status[0]
        assert many.end.time[2] == pytest.approx(one.end.time[0], rel=1e-10)
        yield one


def admittance(values: tuple[float, float, float]) -> Admittance:
    mass, damping, stiffness = values
    return Admittance(mass=mass, damping=damping, stiffness=stiffness)


def status_of(result: ContactResult) -> int:
    return int(np.ravel(result.status)[0])


# --- a motion that tends to zero


def zero_at_rest(values: tuple[float, float, float], speed: float = 0.0, shift: float = 0.0) -> Scenario:
    """An object at rest where the reference is: l obeys M l'' + (D + D_p g) l' + K l = 0 and tends to 0."""
    return Scenario(
        admittance=admittance(values),
        obstacle=Obstacle(position=0.5 + shift),
        plant=Plant(position=shift, velocity=-speed),
        reference=Reference(position=0.5 + shift),
    )


@pytest.mark.parametrize("shift", [0.0, 0.25, -3.5])
@pytest.mark.parametrize("name", FAR)
@pytest.mark.parametrize("values", [(1, 10, 25), (1, 20, 25), (2.5, 10, 10), (4, 40, 1e-3), (0.7, 30.0, 20.0)])
def test_a_distance_that_decays_to_zero_never_gets_there(
    values: tuple[float, float, float], name: str, shift: float
) -> None:
    for gain in (0.0, -0.5, -3.0):
        for found in every_way(zero_at_rest(values, shift=shift), FAR[name], gain):
            assert status_of(found) == ContactStatus.NEVER
            assert np.ravel(found.settling_distance)[0] == 0.0
            assert 0.0 <= np.ravel(found.closest_distance)[0] <= 1e-11


@pytest.mark.parametrize("name", FAR)
def test_it_gets_there_where_its_speed_exceeds_its_fastest_decay(name: str) -> None:
    """Without a gain l = A exp(-mu_1 t) + B exp(-mu_2 t): a zero is passed where l' < -mu_2 l at the start, only."""
    for mass, damping, stiffness in [(1, 10, 25), (1, 20, 25), (2, 50, 3), (1, 10, 0), (3.7, 41.3, 0.8)]:
        root = np.sqrt(damping**2 - 4 * mass * stiffness)
        slow, fast = (damping - root) / (2 * mass), (damping + root) / (2 * mass)
        for excess in (-0.5, -1e-3, -1e-9, 0.0, 1e-9, 1e-3, 0.5):
            scenario = zero_at_rest((mass, damping, stiffness), speed=-0.5 * fast * (1 + excess))
            for found in every_way(scenario, FAR[name], 0.0):
                if excess <= 0:
                    assert status_of(found) == ContactStatus.NEVER, excess
                    continue
                apart = fast - slow
                time = np.log1p(apart / (fast * excess)) / apart if apart > 0 else 1 / (fast * excess)
                if slow * time > 500:
                    continue  # below e^-500 nothing is told from rest
                assert status_of(found) == ContactStatus.CONTACT, excess
                # what rounding leaves of the excess decides; 2e-16 of the speed
                assert np.ravel(found.end.time)[0] == pytest.approx(time, rel=1e-10 + 1e-15 / excess)


def test_a_damping_that_is_critical_to_rounding_is_critical() -> None:
    rng = np.random.default_rng(1)
    for mass, omega in 10 ** rng.uniform(-1, 1, (40, 2)):
        critical = Admittance.from_natural_frequency(mass=mass, natural_frequency=omega)
        scenario = replace(zero_at_rest((1, 10, 25)), admittance=critical)
        for found in every_way(scenario, FAR["exponential-1"], 0.0):
            assert status_of(found) == ContactStatus.NEVER


@pytest.mark.parametrize("ratio", [0.02, 0.5, 0.9, 0.99, 0.998, 0.9999])
@pytest.mark.parametrize("name", FAR)
def test_an_oscillation_about_zero_passes_it_however_small_it_has_become(name: str, ratio: float) -> None:
    """l = e^(-s t) cos(w t - phi) / cos(phi) has its zero at (pi / 2 + phi) / w, at e^-220 of its start for 0.9999."""
    omega = 5.0
    scenario = zero_at_rest((1.0, 2 * ratio * omega, omega**2))
    damped, decay = omega * np.sqrt(1 - ratio**2), ratio * omega
    time = (np.pi / 2 + np.arctan2(decay, damped)) / damped
    for found in every_way(scenario, FAR[name], 0.0):
        assert status_of(found) == ContactStatus.CONTACT
        assert np.ravel(found.end.time)[0] == pytest.approx(time, rel=1e-10)
        expected = -0.5 * omega**2 / damped * np.sin(damped * time) * np.exp(-decay * time)
        # the exponent, of 220 at most, carries the error of the time
        assert np.ravel(found.end.relative_velocity)[0] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("name", FAR)
def test_a_free_mass_that_comes_to_rest_at_zero_never_gets_there(name: str) -> None:
    """K = 0: M l' + D l + D_p ln xi is constant, so l tends to 0 where it is what it is at l = 0."""
    sensor = FAR[name]
    for mass, damping, gain in [(1, 10, 0), (1, 10, -0.5), (2, 0, -0.7), (0.3, 0.1, -2.0), (1, 0.7, 0.0)]:
        impulse = damping * 0.5 + gain * (sensor.log_output(0.5) - sensor.log_output(0.0))
        for excess, status in ((-1e-6, ContactStatus.NEVER), (0.0, ContactStatus.NEVER), (1e-6, ContactStatus.CONTACT)):
            scenario = zero_at_rest((mass, damping, 0.0), speed=-impulse / mass * (1 + excess))
            for found in every_way(scenario, sensor, gain):
                assert status_of(found) == status, (mass, damping, gain, excess)


def test_without_stiffness_and_damping_only_the_relative_motion_counts() -> None:
    """D = K = 0 and a steady obstacle: l' decays by the gain alone, and l comes to rest whatever both move at."""
    sensor = FAR["exponential-1"]
    for drift in (0.0, -0.7, 1.3):
        scenario = Scenario(
            admittance=Admittance(mass=1.0, damping=0.0, stiffness=0.0),
            obstacle=Obstacle(position=0.5, velocity=drift - 15.0),
            plant=Plant(velocity=drift),
        )
        for found in every_way(scenario, sensor, -0.5):  # 0.5 m are left after 15 m/s over 30 1/s
            assert status_of(found) == ContactStatus.NEVER
            assert np.ravel(found.settling_distance)[0] == pytest.approx(0.0, abs=RESOLUTION)
        for found in every_way(scenario, sensor, -0.5 * (1 - 1e-6)):
            assert status_of(found) == ContactStatus.CONTACT


def test_a_resting_place_that_rounding_leaves_beside_zero_is_zero() -> None:
    for place in (0.1 + 0.2, np.nextafter(0.3, 0), np.nextafter(0.3, 1)):
        scenario = Scenario(
            admittance=admittance((1, 10, 25)), obstacle=Obstacle(position=0.3), reference=Reference(position=place)
        )
        for sensor in FAR.values():
            for found in every_way(scenario, sensor, -0.1):
                assert status_of(found) == ContactStatus.NEVER
        near = replace(scenario, reference=Reference(position=0.3 + 1e-9))  # but a nanometer is none
        for sensor in FAR.values():
            for found in every_way(near, sensor, -0.1):
                assert status_of(found) == ContactStatus.CONTACT


# --- a distance that touches zero


def passing(values: tuple[float, float, float], margin: float, moving: float = 0.0) -> Scenario:
    """An object that comes 0.5 m, to a distance of the margin, and turns: l = 0.5 + margin - t + t^2 / 2."""
    return Scenario(
        admittance=admittance(values),
        obstacle=Obstacle(position=0.5 + margin, velocity=-1.0 + moving, acceleration=1.0),
        plant=Plant(velocity=moving),
        reference=Reference(velocity=moving),
    )


@pytest.mark.parametrize("name", FAR)
@pytest.mark.parametrize("values", ADMITTANCES)
@pytest.mark.parametrize("moving", [0.0, 0.3])
def test_a_touch_is_a_contact_with_no_speed(values: tuple[float, float, float], name: str, moving: float) -> None:
    for found in every_way(passing(values, 0.0, moving), FAR[name], 0.0):
        assert status_of(found) == ContactStatus.CONTACT
        assert np.ravel(found.end.time)[0] == pytest.approx(1.0, rel=1e-11)
        assert np.ravel(found.end.relative_velocity)[0] == 0.0
        assert np.ravel(found.end.distance)[0] == 0.0
        assert np.ravel(found.closest_distance)[0] == 0.0
        assert np.isnan(np.ravel(found.gradients.of("time", "obstacle.position"))[0])


@pytest.mark.parametrize("name", FAR)
@pytest.mark.parametrize("values", ADMITTANCES)
def test_what_turns_beyond_the_resolution_is_told_by_its_sign(values: tuple[float, float, float], name: str) -> None:
    """The terms of l are at most 0.5, 1 and 0.5 m here, so that 2e-12 m is the resolution."""
    for margin in (1e-3, 1e-6, 1e-9, 1e-11):
        for found in every_way(passing(values, margin), FAR[name], 0.0, horizon=5.0):
            assert status_of(found) != ContactStatus.CONTACT
            assert np.ravel(found.closest_distance)[0] == pytest.approx(margin, rel=1e-3 if margin < 1e-10 else 1e-5)
        for found in every_way(passing(values, -margin), FAR[name], 0.0, horizon=5.0):
            assert status_of(found) == ContactStatus.CONTACT
            slow = np.sqrt(2 * margin)
            # an error of 1e-15 of l is one of 1e-15 / 2 margin of what is left of the way
            assert np.ravel(found.end.time)[0] == pytest.approx(1 - slow, abs=1e-14 / slow)
            assert np.ravel(found.end.relative_velocity)[0] == pytest.approx(-slow, rel=1e-14 / margin + 1e-10)


@pytest.mark.parametrize("name", CURVES)
def test_a_touch_under_a_gain_is_found_where_a_contact_fades(name: str) -> None:
    """Between an object that just arrives and one that just does not, the ways part at one place, the resolution."""

    def scenario(position: float) -> Scenario:
        return Scenario(
            admittance=Admittance(mass=1.0, damping=6.0, stiffness=25.0),
            obstacle=Obstacle(position=position, velocity=-0.3, acceleration=1.1),
        )

    sensor, gain = CURVES[name], -0.05
    near, far = 1e-3, 0.055
    assert find_contact(scenario(near), sensor, gain, horizon=3.0).reached
    while far - near > 1e-15:
        middle = 0.5 * (near + far)
        if find_contact(scenario(middle), sensor, gain, horizon=3.0).reached:
            near = middle
        else:
            far = middle
        if middle in {near, far} and not near < 0.5 * (near + far) < far:
            break
    for found in every_way(scenario(near), sensor, gain, horizon=3.0):
        assert status_of(found) == ContactStatus.CONTACT
    for change in (1e-10, 1e-8, 1e-5):
        for found in every_way(scenario(near + change), sensor, gain, horizon=3.0):
            assert status_of(found) != ContactStatus.CONTACT
        for found in every_way(scenario(near - change), sensor, gain, horizon=3.0):
            assert status_of(found) == ContactStatus.CONTACT


def test_a_touch_of_the_nearest_valid_distance_leaves_the_range_alike() -> None:
    for sensor in (FAR["exponential-1"], FAR["inverse-power"]):
        beyond = replace(sensor, minimum_distance=0.125)  # type: ignore[type-var]
        for found in every_way(passing((1, 10, 25), 0.125), beyond, 0.0):
            assert status_of(found) == ContactStatus.LEFT_RANGE
            assert np.ravel(found.end.distance)[0] == 0.125
        for found in every_way(passing((1, 10, 25), 0.125 + 1e-9), beyond, 0.0, horizon=3.0):
            assert status_of(found) in {ContactStatus.HORIZON, ContactStatus.NEVER}


@pytest.mark.parametrize("margin", [1e-15, 1e-14, 1e-13, 2e-13])
def test_a_touch_in_the_curve_s_second_nearest_piece_is_one(margin: float) -> None:
    """A table is as smooth as its nearest interval: its pieces grow from 1e-14 m, and all but one end above zero."""
    position, speed = 0.0673735390761907, -0.12257143327043009
    scenario = Scenario(
        admittance=Admittance(mass=0.28, damping=0.91, stiffness=1.93),
        obstacle=Obstacle(
            position=position, velocity=speed, acceleration=speed**2 / (2 * position) * (1 + margin / position)
        ),
    )
    table = Table(
        distances=(0.0, 0.0075256127864498515, 0.0329441054311641, 0.05792378550333033, 0.08685294847901223, 0.0911),
        outputs=(
            1.0,
            0.594730976284948,
            0.5937711392778147,
            0.5924260843580438,
            0.3307313352236737,
            0.20712346593650155,
        ),
    )
    for found in every_way(scenario, table, 0.0, horizon=30.0):
        assert status_of(found) == ContactStatus.CONTACT
        assert np.ravel(found.closest_distance)[0] == 0.0


def test_the_motion_of_a_touch_can_be_sampled() -> None:
    motion = solve_motion(passing((1, 10, 25), 0.0), FAR["table"], 0.0, samples=101)
    assert (motion.distance[:-1] > 0).all()
    assert motion.distance[-1] == 0.0
    assert motion.relative_velocity[-1] == pytest.approx(0.0, abs=1e-11)


# --- a curve of the user's that ends without saying so


def _root(distance: np.ndarray) -> np.ndarray:
    return np.sqrt(0.1 - distance)


ENDING = {
    "not a number": CustomSensor(log_output_function=_root, log_slope_function=lambda d: -0.5 / _root(d)),
    "overflow": CustomSensor(
        log_output_function=lambda d: -((d / 0.03) ** 2),
        log_slope_function=lambda d: -2 * d / 0.03**2 * np.exp(-((d / 0.03) ** 2)) / np.exp(-((d / 0.03) ** 2)),
    ),
    "rough": CustomSensor(
        log_output_function=lambda d: -40 * d + 0.1 * np.cos(300 * d),
        log_slope_function=lambda d: -40 - 30 * np.sin(300 * d),
    ),
    "far away": CustomSensor(
        log_output_function=lambda d: -40 * d - 3 * np.tanh(d / 0.02),
        log_slope_function=lambda d: -40 - 3 / 0.02 / np.cosh(d / 0.02) ** 2,
    ),
}


@pytest.mark.parametrize("name", ENDING)
def test_an_object_that_recedes_out_of_a_users_curve_spoils_no_other(name: str) -> None:
    sensor = ENDING[name]
    speeds = np.array([-0.3] * 10 + [0.4])
    scenario = Scenario(admittance=admittance((1, 10, 25)), obstacle=Obstacle(position=0.05, velocity=speeds))
    many = find_contact(scenario, sensor, -0.5, horizon=60.0)
    assert (many.status[:-1] == ContactStatus.CONTACT).all()
    ended = ContactStatus.HORIZON if name == "far away" else ContactStatus.LEFT_RANGE
    assert many.status[-1] == ended
    alone = find_contact(replace(scenario, obstacle=Obstacle(position=0.05, velocity=0.4)), sensor, -0.5, horizon=60.0)
    assert alone.status == ended
    assert alone.end.distance == pytest.approx(many.end.distance[-1], rel=1e-12)
    assert np.isfinite(many.gradients.of("time", "gain")[:-1]).all()
    assert np.isfinite(solve_motion(scenario, sensor, -0.5, horizon=60.0).virtual_force).all()


def test_a_start_where_a_users_curve_does_not_hold_is_refused_with_the_remedy() -> None:
    for distance, name in ((0.2, "not a number"), (5000.0, "rough")):
        scenario = Scenario(
            admittance=admittance((1, 10, 25)), obstacle=Obstacle(position=distance, velocity=-distance)
        )
        with refused("sensor"):
            find_contact(scenario, ENDING[name], -0.5)


# --- an object so far away that it stands for none

ANY_CURVE = CustomSensor(
    log_output_function=lambda d: -30 * d - np.log(d**2 + 0.01),
    log_slope_function=lambda d: -30 - 2 * d / (d**2 + 0.01),
)


@pytest.mark.parametrize("count", [3, 40])
@pytest.mark.parametrize("sentinel", [9e12, 1e20, 1e300])
@pytest.mark.parametrize("sensor", [FAR["inverse-power"], FAR["mittag-leffler"], ANY_CURVE], ids=lambda s: s.name)
def test_an_object_beyond_all_distances_leaves_the_other_encounters_as_they_are(
    sensor: SensorModel, sentinel: float, count: int
) -> None:
    """Its row was never written: all encounters of the call had the contents of unused memory, and "contact"."""
    near = np.linspace(0.02, 0.06, count)

    def result(last: float) -> ContactResult:
        obstacle = Obstacle(position=np.append(near, last), velocity=-0.3)
        return find_contact(Scenario(admittance=admittance((1, 10, 25)), obstacle=obstacle), sensor, -0.7)

    far, ordinary = result(sentinel), result(0.05)
    assert far.status.tolist() == [ContactStatus.CONTACT] * count + [ContactStatus.UNRESOLVED]
    assert (far.end.distance[-1], far.closest_distance[-1], far.end.time[-1]) == (sentinel, sentinel, 0.0)
    for name, values in far.end.as_dict().items():
        assert np.isfinite(values).all()
        np.testing.assert_array_equal(values[:-1], getattr(ordinary.end, name)[:-1], err_msg=name)
    # ln xi of a Mittag-Leffler curve is rounded in company with the others
    np.testing.assert_allclose(far.impulse_residual[:-1], ordinary.impulse_residual[:-1], rtol=0, atol=1e-14)
    derivative = far.gradients.of("relative_velocity", "gain")
    np.testing.assert_array_equal(derivative[:-1], ordinary.gradients.of("relative_velocity", "gain")[:-1])
    assert np.isnan(derivative[-1])


@pytest.mark.parametrize("name", FAR)
def test_an_object_beyond_all_distances_alone_is_no_contact(name: str) -> None:
    sensor = ANY_CURVE if name == "table" else FAR[name]
    scenario = Scenario(admittance=admittance((1, 10, 25)), obstacle=Obstacle(position=1e20, velocity=-0.3))
    found = find_contact(scenario, sensor, -0.7)
    constant = sensor.constant_log_slope is not None  # its motion is known at every distance
    assert found.status == (ContactStatus.HORIZON if constant else ContactStatus.UNRESOLVED)
    motion = solve_motion(scenario, sensor, -0.7, samples=5)
    assert motion.distance == pytest.approx(np.full(5, 1e20))
    assert np.isfinite(motion.virtual_force).all()
    assert (motion.acceleration[0] == 0.0) or constant


@pytest.mark.parametrize("content", [0, 1, 2**52])
def test_an_encounter_that_no_solver_writes_is_unresolved_whatever_its_memory_held(
    monkeypatch: pytest.MonkeyPatch, content: int
) -> None:
    """Zero stands for contact."""
    monkeypatch.setattr(np, "empty", lambda shape, dtype=np.float64: np.full(shape, content, dtype=dtype))
    scenario = Scenario(admittance=admittance((1, 10, 25)), obstacle=Obstacle(position=1e20, velocity=-0.3))
    found = find_contact(scenario, FAR["inverse-power"], -0.7)
    assert found.status == ContactStatus.UNRESOLVED
    assert found.end.distance == 1e20


def test_a_motion_is_sampled_beside_an_object_beyond_all_distances() -> None:
    obstacle = Obstacle(position=np.array([0.04, 1e20]), velocity=-0.3)
    scenario = Scenario(admittance=admittance((1, 10, 25)), obstacle=obstacle)
    alone = replace(scenario, obstacle=Obstacle(position=0.04, velocity=-0.3))
    both, one = (solve_motion(s, FAR["inverse-power"], -0.7, samples=7) for s in (scenario, alone))
    np.testing.assert_array_equal(both.distance[0], one.distance)
    assert (both.distance[1] == 1e20).all()


def test_encounters_up_to_the_largest_distance_that_is_followed_are_solved() -> None:
    obstacle = Obstacle(position=np.array([0.04, 2.0**43, np.nextafter(2.0**43, np.inf)]), velocity=-0.3)
    found = find_contact(Scenario(admittance=admittance((1, 10, 25)), obstacle=obstacle), FAR["inverse-power"], -0.7)
    assert found.status.tolist() == [ContactStatus.CONTACT, ContactStatus.HORIZON, ContactStatus.UNRESOLVED]
