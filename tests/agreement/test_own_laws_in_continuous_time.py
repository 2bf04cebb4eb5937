"""Custom laws in continuous time compared with the built-in laws, and the cases that they must refuse.

The collocation has an error of about 1e-13 per encounter; the other methods claim 1e-9. The acceleration is the
difference of the force and the admittance's pull, so its error is taken relative to these terms, l' over the damping
time constant.
"""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from encounters import CURVES, random_encounters
from pretouch._core.errors import OutOfRangeError
from pretouch.motion import (
    DRAG,
    Admittance,
    ContactStatus,
    CustomLaw,
    LawNumber,
    Obstacle,
    Plant,
    Reference,
    Scenario,
    custom_motion,
    find_contact,
    solve_motion,
)
from pretouch.motion.custom_force import ForceLaw
from pretouch.motion.scenario import map_fields
from pretouch.sensors import InversePower, SensorModel
from refusals import refused

TIGHT = 1e-8
GAIN = LawNumber("gain", "D_p", "N*s", -1)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
ADMITTANCE = Admittance(mass=1.7, damping=11.0, stiffness=30.0)
APPROACH = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.0422, velocity=-0.3))


def damper(value: float, output: float, rate: float) -> float:
    return value * rate


def drag(value: float, output: float, rate: float) -> float:
    return -value * rate * max(rate, 0.0)


def own(force: Any, **options: Any) -> CustomLaw:
    return CustomLaw(kind="own", number=GAIN, force=force, **options)


DAMPER_AGAIN = own(damper)
DRAG_AGAIN = own(drag, suspends_admittance=True)

SCALES = {
    **dict.fromkeys(("time",), 1e-2),  # beside which a quantity is compared, at least
    **dict.fromkeys(("distance", "position", "displacement", "largest_excursion", "largest_travel"), 1e-2),
    **dict.fromkeys(("velocity", "relative_velocity", "largest_speed"), 1e-2),
}


def check(found: Any, expected: Any, which: Any, damping_rate: Any) -> None:
    """Compare all quantities at the end of some runs; a force and an acceleration beside the damping times l'."""
    for name, values in expected.end.as_dict().items():
        scale = np.maximum(np.abs(values), SCALES.get(name, 0.0))
        if name not in SCALES:
            scale = scale + damping_rate * np.abs(expected.end.relative_velocity) + 1e-3
        error = np.abs(getattr(found.end, name) - values) / scale
        assert np.max(error[which], initial=0.0) < TIGHT, name


@pytest.mark.slow(keep=12)
@pytest.mark.parametrize("kind", ["letter", "everything", "tracking"])
@pytest.mark.parametrize("name", CURVES)
def test_the_damper_as_a_law_of_ones_own(name: str, kind: str) -> None:
    sensor = CURVES[name]
    drawn = random_encounters(kind, 3, 20261122, min(0.055, sensor.valid_range[1]))
    found = find_contact(drawn.scenario, sensor, drawn.gain, law=DAMPER_AGAIN, horizon=20.0)
    expected = find_contact(drawn.scenario, sensor, drawn.gain, horizon=20.0)
    reached = expected.reached
    assert (found.reached == reached).all()
    assert (found.gain == drawn.gain).all()
    assert (found.impulse_residual < 1e-9).all()
    assert found.method == "integration"
    admittance = drawn.scenario.admittance
    rate = (admittance.damping + drawn.gain * sensor.log_slope(max(sensor.valid_range[0], 0.0))) / admittance.mass
    check(found, expected, reached, rate * np.maximum(admittance.mass, 1.0))
    np.testing.assert_allclose(found.closest_distance[reached], 0.0, atol=1e-15)


@pytest.mark.parametrize("name", CURVES)
def test_the_drag_as_a_law_of_ones_own(name: str) -> None:
    """Objects that go on, are pushed, brake, and stop before they touch; those that come from rest, or later."""
    sensor = CURVES[name]
    span = 0.8 * min(sensor.valid_range[1], 0.1)
    velocity = np.array([-0.2, -0.4, -0.3, -0.2, 0.0, 0.05])
    push = np.array([0.0, -3.0, 0.1, 5.0, -0.5, -1.0])
    obstacle = Obstacle(position=0.1 + span, velocity=velocity + 0.2, acceleration=push + 0.3)
    scenario = Scenario(
        admittance=ADMITTANCE,
        obstacle=obstacle,
        plant=Plant(position=0.1, velocity=0.2),
        reference=Reference(position=0.1, velocity=0.2, acceleration=0.3),
    )
    phi = 1.5 * ADMITTANCE.mass / (sensor.log_slope(0.5 * span) ** 2 * span)
    found = find_contact(scenario, sensor, phi, law=DRAG_AGAIN)
    expected = find_contact(scenario, sensor, phi, law=DRAG)
    assert {0, 1} <= set(expected.status.tolist())
    assert (found.status == expected.status).all()
    check(found, expected, slice(None), 1.0)
    np.testing.assert_allclose(found.closest_distance, expected.closest_distance, atol=1e-10)
    never = ~found.reached
    assert (found.settling_distance[never] == expected.settling_distance[never]).all()
    assert (found.impulse_residual < 1e-9).all()


def test_a_value_of_zero_is_the_free_motion() -> None:
    drawn = random_encounters("everything", 12, 3)
    found = find_contact(drawn.scenario, POWER, 0.0, law=DAMPER_AGAIN, horizon=20.0)
    expected = find_contact(drawn.scenario, POWER, 0.0, horizon=20.0)
    assert (found.reached == expected.reached).all()
    check(found, expected, expected.reached, drawn.scenario.admittance.damping / drawn.scenario.admittance.mass)


@pytest.mark.parametrize("gain", [-100.0, -3000.0])
def test_a_stiff_motion(gain: float) -> None:
    """The damping settles in a millionth of the encounter: l' is known as well as the distance, which sets it."""
    found = find_contact(APPROACH, POWER, gain, law=DAMPER_AGAIN)
    expected = find_contact(APPROACH, POWER, gain)
    assert found.end.time == pytest.approx(expected.end.time, rel=TIGHT)
    assert found.contact.relative_velocity == pytest.approx(expected.contact.relative_velocity, rel=TIGHT)
    assert found.contact.largest_acceleration == pytest.approx(expected.contact.largest_acceleration, rel=TIGHT)
    assert found.impulse_residual < 1e-9


def test_samples_of_the_motion() -> None:
    scenario = replace(
        APPROACH,
        obstacle=Obstacle(position=0.1422, velocity=np.array([-0.3, -0.1]), acceleration=-0.2),
        plant=Plant(position=0.1, velocity=0.05),
        reference=Reference(position=0.09, velocity=0.1, acceleration=0.3),
    )
    found = solve_motion(scenario, POWER, -0.7, law=DAMPER_AGAIN, samples=37)
    expected = solve_motion(scenario, POWER, -0.7, samples=37)
    assert (found.distance[:, -1] == 0).all()
    for name in ("time", "distance", "position", "velocity", "acceleration", "displacement", "virtual_force"):
        values = getattr(expected, name)
        np.testing.assert_allclose(getattr(found, name), values, atol=TIGHT * np.abs(values).max(), err_msg=name)
    assert found.result == find_contact(scenario, POWER, -0.7, law=DAMPER_AGAIN)


def test_encounters_broadcast_and_each_is_the_same_alone() -> None:
    scenario = replace(APPROACH, obstacle=Obstacle(position=0.0422, velocity=np.array([[-0.3], [-0.1]])))
    found = find_contact(scenario, POWER, np.array([0.01, 0.02, 0.03]), law=DRAG_AGAIN)
    assert found.status.shape == (2, 3)
    alone = find_contact(APPROACH, POWER, 0.02, law=DRAG_AGAIN)
    assert alone.status is ContactStatus.CONTACT
    assert alone.end.as_dict() == {name: values[0, 1] for name, values in found.end.as_dict().items()}
    assert find_contact(APPROACH, POWER, np.zeros((0, 2)), law=DRAG_AGAIN).status.shape == (0, 2)
    assert solve_motion(APPROACH, POWER, np.zeros((0, 2)), law=DRAG_AGAIN, samples=5).time.shape == (0, 2, 5)


@pytest.mark.parametrize("suspends", [False, True])
def test_a_vectorized_force_gives_the_same_bits_as_single_numbers(suspends: bool) -> None:
    """Also each encounter of a batch the same as alone."""

    def by_numbers(value: float, output: float, rate: float) -> float:
        return value * max(rate - 1.0, 0.0)

    def by_arrays(value: Any, output: Any, rate: Any) -> Any:
        return value * np.maximum(rate - 1.0, 0.0)

    drawn = random_encounters("everything", 12, 20261123, 0.05)
    options: dict[str, Any] = {"suspends_admittance": suspends}
    found, expected = (
        find_contact(drawn.scenario, POWER, drawn.gain, law=law, horizon=2.0)
        for law in (own(by_arrays, vectorized=True, **options), own(by_numbers, **options))
    )
    assert found == expected
    for i in range(0, 12, 5):
        one = map_fields(drawn.scenario, lambda values, i=i: values[i] if np.ndim(values) else values)  # type: ignore[misc]
        alone = find_contact(one, POWER, float(drawn.gain[i]), law=own(by_numbers, **options), horizon=2.0)
        assert alone.end.as_dict() == {name: values[i] for name, values in found.end.as_dict().items()}
        assert alone.impulse_residual == found.impulse_residual[i]


@pytest.mark.parametrize("wrong", [0.0, np.zeros(3), "1", np.zeros(1, dtype=complex)])
def test_a_vectorized_force_must_return_one_number_for_each_state(wrong: Any) -> None:
    with refused("force"):
        find_contact(APPROACH, POWER, np.array([1.0, 2.0]), law=own(lambda *_: wrong, vectorized=True))


def test_a_corner_of_the_force_is_passed_accurately() -> None:
    """An independent integration is restarted at the corner s' = 1 /s, wherever in its steps that lies.

    Its tolerance of 1e-12 gives an error of about 1e-11 in these encounters.
    """
    speeds = np.linspace(-0.5, -0.05, 10)
    scenario = replace(APPROACH, obstacle=Obstacle(position=0.0422, velocity=speeds, acceleration=0.1))
    law = own(lambda *asked: asked[0] * np.maximum(asked[2] - 1.0, 0.0), vectorized=True)
    found = find_contact(scenario, POWER, -2.0, law=law, horizon=2.0)
    for i, speed in enumerate(speeds):
        time, excursion = _through_a_corner(float(speed), 0.1, -2.0, 2.0)
        assert found.end.time[i] == pytest.approx(time, rel=1e-9)
        assert found.end.displacement[i] == pytest.approx(excursion, rel=1e-9)


def _through_a_corner(speed: float, push: float, gain: float, horizon: float) -> tuple[float, float]:
    """Integrate F = gain max(s' - 1, 0) piece by piece; return time [s] and displacement [m] at the end."""

    def distance(t: float, y: Any) -> float:
        return float(0.0422 + speed * t + push * t * t / 2 - y[0])

    def excess(t: float, y: Any) -> float:
        at = max(distance(t, y), 0.0)
        return float(POWER.log_slope(at) * (speed + push * t - y[1]) - 1.0)

    def rates(t: float, y: Any) -> tuple[float, float]:
        force = gain * excess(t, y) if acts else 0.0
        return y[1], (force - ADMITTANCE.damping * y[1] - ADMITTANCE.stiffness * y[0]) / ADMITTANCE.mass

    distance.terminal = excess.terminal = True  # type: ignore[attr-defined]
    time, state, acts = 0.0, np.zeros(2), excess(0.0, np.zeros(2)) > 0
    while True:
        excess.direction = -1 if acts else 1  # type: ignore[attr-defined]
        run = solve_ivp(
            rates, (time, horizon), state, method="DOP853", rtol=1e-12, atol=1e-14, events=[distance, excess]
        )
        time, state = run.t[-1], run.y[:, -1]
        if run.status == 0 or len(run.t_events[0]):
            return float(time), float(state[0])
        acts = not acts


def test_runs_that_end_without_contact() -> None:
    at_rest = replace(APPROACH, obstacle=Obstacle(position=0.0422))
    result = find_contact(at_rest, POWER, -0.7, law=DAMPER_AGAIN)
    assert result.status is ContactStatus.NEVER
    assert result.settling_distance == result.closest_distance == result.end.distance == 0.0422
    assert result.impulse_residual == 0.0
    stops = replace(APPROACH, obstacle=Obstacle(position=0.0422, velocity=-0.02, acceleration=0.5))
    found, expected = (
        find_contact(stops, POWER, -0.7, law=law, horizon=0.3) for law in (DAMPER_AGAIN, "virtual-damper")
    )
    assert found.status is expected.status is ContactStatus.HORIZON
    assert found.end.time == 0.3
    assert found.closest_distance == pytest.approx(expected.closest_distance, rel=TIGHT)
    assert math.isnan(found.settling_distance)


def test_the_ends_of_a_curve() -> None:
    def ended(sensor: SensorModel, **obstacle: Any) -> Any:
        return find_contact(
            replace(APPROACH, obstacle=Obstacle(position=0.04, **obstacle)), sensor, -0.7, law=DAMPER_AGAIN
        )

    near, far = replace(POWER, minimum_distance=0.01), replace(POWER, maximum_distance=0.05)
    result = ended(near, velocity=-0.3)
    assert result.status is ContactStatus.LEFT_RANGE
    assert result.end.distance == 0.01
    result = ended(far, velocity=0.3)
    assert result.status is ContactStatus.LEFT_RANGE
    assert result.end.distance == pytest.approx(0.05, rel=1e-12)
    assert result.closest_distance == 0.04
    assert ended(replace(POWER, minimum_distance=0.04), velocity=-0.3).end.time == 0.0
    assert ended(replace(POWER, maximum_distance=0.04), velocity=0.3).status is ContactStatus.LEFT_RANGE
    with refused("obstacle position", error=OutOfRangeError, value=0.04, limit=(0.0, 0.03)):
        ended(replace(POWER, maximum_distance=0.03), velocity=-0.3)
    with refused("obstacle position"):  # in contact already
        replace(APPROACH, obstacle=Obstacle(position=0.0))


def test_a_touch_is_a_contact() -> None:
    """Without admittance and law, l = 0.04 - 0.4 t + a t^2 / 2 has its smallest value, zero, for a = 2 m/s^2."""
    floats = Admittance(mass=1.0, damping=0.0, stiffness=0.0)

    def ended(acceleration: float) -> Any:
        obstacle = Obstacle(position=0.04, velocity=-0.4, acceleration=acceleration)
        return find_contact(Scenario(admittance=floats, obstacle=obstacle), POWER, 0.0, law=DAMPER_AGAIN, horizon=1.0)

    assert ended(2.0).status is ContactStatus.CONTACT
    assert (ended(2.0).end.distance, ended(2.0).end.relative_velocity) == (0.0, 0.0)
    assert ended(2.0).end.time == pytest.approx(0.2, rel=1e-9)
    assert ended(2.0001).status is ContactStatus.HORIZON
    assert ended(2.0001).closest_distance == pytest.approx(0.04 * (1 - 2 / 2.0001), rel=1e-9)
    before = ended(1.9999)  # it comes out at the other side again within a step
    assert before.contact.time == pytest.approx((0.4 - math.sqrt(0.16 - 0.08 * 1.9999)) / 1.9999, rel=1e-9)
    assert before.contact.relative_velocity == pytest.approx(-math.sqrt(0.16 - 0.08 * 1.9999), rel=1e-7)


def test_a_touch_in_the_last_of_several_pieces_leaves_the_others_as_they_are() -> None:
    """A table is followed from knot to knot; the last piece passes the contact, and is cut there."""
    floats = Admittance(mass=1.0, damping=0.0, stiffness=0.0)
    obstacle = Obstacle(position=0.04, velocity=-0.4, acceleration=1.9999)
    scenario = Scenario(admittance=floats, obstacle=obstacle)
    motion = solve_motion(scenario, CURVES["table"], 0.0, law=DAMPER_AGAIN, horizon=1.0, samples=41)
    assert motion.result.status is ContactStatus.CONTACT
    assert motion.time[-1] == pytest.approx((0.4 - math.sqrt(0.16 - 0.08 * 1.9999)) / 1.9999, rel=1e-9)
    path = 0.04 - 0.4 * motion.time + 1.9999 * motion.time**2 / 2
    np.testing.assert_allclose(motion.distance, path, atol=1e-12)


def test_a_plant_that_is_held_off_goes_along_until_the_admittance_lets_go() -> None:
    """F = c (l - l_1) whatever s' is: the object stops at l' = 0, where the pull alone would bring it near again.

    So x~'' = a from there on, until pull = F - M a; F is constant meanwhile, since l is.
    """
    stiffness, rests, brakes, mass = 40.0, 0.05, 0.1, ADMITTANCE.mass

    def spring(value: float, output: float, rate: float) -> float:
        return value * ((1.30e-5 * math.exp(-output)) ** (1 / 3.32) - 0.0419 - rests)

    scenario = replace(APPROACH, obstacle=Obstacle(position=0.0422, velocity=-0.15, acceleration=brakes))
    motion = solve_motion(
        scenario, POWER, stiffness, law=own(spring, suspends_admittance=True), horizon=4.0, samples=20001
    )
    meets, leaves = np.flatnonzero(np.abs(motion.relative_velocity) < 1e-12)[[0, -1]]
    assert meets + 5000 < leaves < 19000
    kept = motion.distance[meets]
    np.testing.assert_allclose(motion.distance[meets:leaves], kept, rtol=1e-12)
    np.testing.assert_allclose(motion.acceleration[meets + 1 : leaves], brakes, rtol=1e-12)
    pull = ADMITTANCE.stiffness * motion.displacement + ADMITTANCE.damping * motion.velocity
    assert pull[leaves] == pytest.approx(stiffness * (kept - rests) - mass * brakes, abs=1e-3)  # within a sample
    assert (motion.relative_velocity[leaves + 1 :] > 0).all()
    assert motion.result.impulse_residual < 1e-9
    assert motion.result.status is ContactStatus.HORIZON
    assert motion.result.closest_distance == pytest.approx(kept, rel=1e-12)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1j, np.array([1.0, 2.0]), np.array([1.0]), "1", None, True])
def test_a_force_that_is_no_number_is_refused_in_one_sentence(wrong: Any) -> None:
    with refused("force") as told:
        find_contact(APPROACH, POWER, 1.0, law=own(lambda *_: wrong))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("right", [0, np.float64(0.0), np.float32(0.0), np.array(0.0)])
def test_a_force_may_be_any_real_number(right: Any) -> None:
    assert find_contact(APPROACH, POWER, 1.0, law=own(lambda *_: right)).reached


def test_what_the_function_raises_passes_through() -> None:
    def fails(value: float, output: float, rate: float) -> float:
        raise ZeroDivisionError("of the user's")

    with pytest.raises(ZeroDivisionError, match="of the user's"):
        find_contact(APPROACH, POWER, 1.0, law=own(fails))


def test_the_residual_sees_what_the_integration_did_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundredth more force than the motion was made with leaves a hundredth of its impulse, the largest term."""
    assert find_contact(APPROACH, POWER, -0.7, law=DAMPER_AGAIN).impulse_residual < 1e-10
    force = ForceLaw.at
    monkeypatch.setattr(ForceLaw, "at", lambda self, *state: 1.01 * force(self, *state))
    found = find_contact(APPROACH, POWER, -0.7, law=DAMPER_AGAIN)
    assert found.impulse_residual == pytest.approx(0.01, rel=0.02)


def test_a_motion_that_takes_too_many_steps_is_unresolved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(custom_motion, "_MOST_CALLS", 100)
    result = find_contact(APPROACH, POWER, np.array([-0.7, -70.0]), law=DAMPER_AGAIN)
    assert result.status.tolist() == [ContactStatus.UNRESOLVED, ContactStatus.UNRESOLVED]
    assert (result.end.distance > 0).all()


def test_a_motion_that_would_stay_at_a_jump_of_the_force_is_unresolved() -> None:
    """Dry friction stops the approach at l' = 0, where it has no value that holds the motion there."""
    result = find_contact(APPROACH, POWER, 5.0, law=own(lambda *asked: -asked[0] * float(np.sign(asked[2]))))
    assert result.status is ContactStatus.UNRESOLVED


def test_requests_that_make_no_sense() -> None:
    with refused("method", value="closed-form"):
        find_contact(APPROACH, POWER, -0.7, law=DAMPER_AGAIN, method="closed-form")
    with refused("gain"):
        find_contact(APPROACH, POWER, math.nan, law=DAMPER_AGAIN)
    with refused("force", value=3):
        own(3)


def test_what_is_known_of_its_damping() -> None:
    assert np.isnan(DAMPER_AGAIN.damping(-0.7, np.array([-60.0, -70.0]), -0.3)).all()
    told = own(damper, damping=lambda value, slope, speed: value * slope + 0 * speed)
    assert told.damping(-0.7, -60.0, -0.3) == pytest.approx(42.0)


def test_it_travels_by_the_name_of_its_function() -> None:
    assert pickle.loads(pickle.dumps(DRAG_AGAIN)) == DRAG_AGAIN  # noqa: S301 - our own
    assert DRAG_AGAIN != DAMPER_AGAIN
