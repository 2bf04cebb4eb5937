"""Laws of every motion, for any curve, method and encounter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from encounters import CURVES, KINDS, random_encounters
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.fields import declared
from pretouch.designs.later_contact import never_touches
from pretouch.motion import (
    Admittance,
    ContactStatus,
    Obstacle,
    Plant,
    Reference,
    Scenario,
    find_contact,
    solve_motion,
)
from pretouch.sensors import ExponentialFirstOrder, InversePower, SensorModel
from properties import examples
from refusals import refused

positive = st.floats(0.02, 1.0)
encounters = st.builds(
    lambda mass, omega, ratio, distance, speed, shift, acceleration: Scenario(
        admittance=Admittance.from_natural_frequency(mass=mass, natural_frequency=omega, damping_ratio=ratio),
        obstacle=Obstacle(position=shift + distance, velocity=-speed, acceleration=acceleration),
        plant=Plant(position=shift),
        reference=Reference(position=shift),
    ),
    mass=st.floats(0.2, 5),
    omega=st.floats(0.5, 15),
    ratio=st.floats(0.0, 4),
    distance=st.floats(0.002, 0.055),
    speed=positive,
    shift=st.floats(-1, 1),
    acceleration=st.floats(-5, 0.5),
)
gains = st.floats(0.001, 4).map(lambda g: -g)
curves = st.sampled_from(sorted(CURVES))


@examples(150)
@given(scenario=encounters, gain=gains, name=curves)
def test_impulse_balance(scenario: Scenario, gain: float, name: str) -> None:
    """M dx~' + D dx~ + K int x~ dt = D_p d ln xi for every curve: the certificate that each result carries."""
    found = find_contact(scenario, CURVES[name], gain, horizon=30.0)
    # positions of about 1 m leave 1e-16 m in l, which ln xi turns into g x 1e-16; 30 s of steps add up. x~ is the path
    # less l, which is rounded to half an eps of it; K int x~ dt is off by that, beside M |l'(0)| at least
    mass, _, stiffness, _, _, p, v, a, _, _ = scenario.relative()
    t = found.end.time
    rounding = 1.1e-16 * (abs(p) + abs(v) * t + abs(a) * t**2 / 2) * stiffness * t / (mass * abs(v))
    assert found.impulse_residual < 1e-11 + rounding


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("name", sorted(CURVES))
def test_the_impulse_balance_contradicts_a_slope_that_is_not_that_of_the_output(
    name: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The motion uses g alone, the balance ln xi: where that changes by a tenth more, a tenth of its term is left over.

    K int x~ dt follows from the balance as it holds; the residual is taken over the largest of all terms.
    """
    scenario = Scenario(
        admittance=Admittance(mass=1.3, damping=9.0, stiffness=25.0),
        obstacle=Obstacle(position=np.linspace(0.03, 0.042, count), velocity=-0.3),
    )
    sensor, gain = CURVES[name], -0.7
    found = find_contact(scenario, sensor, gain)
    end, start = found.end, scenario.obstacle.position
    assert (end.time > 0).all()  # solved, before the output changes
    log_output = type(sensor).log_output
    monkeypatch.setattr(type(sensor), "log_output", lambda self, distance: 1.1 * log_output(self, distance))
    nearest = sensor.valid_range[0]
    rise = log_output(sensor, np.maximum(end.distance, nearest)) - log_output(sensor, start)
    inertia, damping = 1.3 * end.velocity, 9.0 * end.displacement
    force = -1.1 * gain * rise
    spring = -(inertia + damping - gain * rise)
    largest = np.max(np.abs(np.broadcast_arrays(inertia, damping, spring, force, 1.3 * 0.3, 9.0 * start)), axis=0)
    # most of the virtual force's impulse is a large term of every one of these encounters
    np.testing.assert_allclose(found.impulse_residual, 0.1 * np.abs(gain * rise) / largest, rtol=1e-7)
    assert (np.asarray(found.impulse_residual) > 0.01).all()


@examples(100)
@given(scenario=encounters, gain=gains, name=curves)
def test_every_run_has_an_end_that_fits_its_status(scenario: Scenario, gain: float, name: str) -> None:
    found = find_contact(scenario, CURVES[name], gain, horizon=30.0)
    end = found.end
    assert all(np.isfinite(v) for v in end.as_dict().values())
    if found.status is ContactStatus.CONTACT:
        assert end.distance == 0.0
        assert found.closest_distance == 0.0
        assert end.relative_velocity <= 0
        assert found.contact is end
    else:
        assert found.closest_distance > 0
        with pytest.raises(ResultUnavailableError, match=found.status.label):
            _ = found.contact
    assert abs(end.displacement) <= end.largest_excursion * (1 + 1e-14) + 1e-15
    assert abs(end.velocity) <= end.largest_speed * (1 + 1e-14) + 1e-13
    assert abs(end.virtual_force) <= end.largest_virtual_force * (1 + 1e-10) + 1e-13


@examples(60)
@given(scenario=encounters, gain=gains, factor=st.floats(1e-6, 1e6))
def test_the_scale_of_the_output_changes_nothing(scenario: Scenario, gain: float, factor: float) -> None:
    """Reflectance and amplification cancel in xi'/xi."""
    sensor = CURVES["inverse-power"]
    one = find_contact(scenario, sensor, gain, horizon=30.0)
    other = find_contact(scenario, replace(sensor, scale=factor), gain, horizon=30.0)
    assert one.end == other.end


@examples(60)
@given(scenario=encounters, gain=gains, length=st.sampled_from([0.5, 2.0, 1000.0]), time=st.sampled_from([0.25, 4.0]))
def test_units_rescale(scenario: Scenario, gain: float, length: float, time: float) -> None:
    """The same encounter in other units of length and time: D goes with 1/T, K with 1/T^2, D_p = F T with L/T."""
    a, o, sensor = scenario.admittance, scenario.obstacle, CURVES["inverse-power"]
    assert isinstance(sensor, InversePower)
    other = Scenario(
        admittance=Admittance(mass=a.mass, damping=a.damping / time, stiffness=a.stiffness / time**2),
        obstacle=Obstacle(
            position=o.position * length,
            velocity=o.velocity * length / time,
            acceleration=o.acceleration * length / time**2,
        ),
        plant=Plant(position=scenario.plant.position * length),
        reference=Reference(position=scenario.reference.position * length),
    )
    rescaled = replace(sensor, distance_offset=sensor.distance_offset * length)
    here = find_contact(scenario, sensor, gain, horizon=30.0)
    there = find_contact(other, rescaled, gain * length / time, horizon=30.0 * time)
    assert here.status == there.status
    if here.reached:
        assert there.end.time == pytest.approx(here.end.time * time, rel=1e-10)
        assert there.end.largest_excursion == pytest.approx(here.end.largest_excursion * length, rel=1e-9, abs=1e-12)


@examples(100)
@given(scenario=encounters, gain=st.floats(0.001, 2), more=st.floats(1.01, 3), name=curves)
def test_more_gain_never_arrives_faster(scenario: Scenario, gain: float, more: float, name: str) -> None:
    """From rest at the reference, against an obstacle that approaches steadily: more damping never hastens contact."""
    steady = replace(scenario, obstacle=replace(scenario.obstacle, acceleration=0.0))
    weak, strong = find_contact(steady, CURVES[name], [-gain, -gain * more], horizon=100.0).end.time
    assert strong >= weak * (1 - 1e-12)


@examples(100)
@given(
    mass=st.floats(0.1, 10),
    omega=st.floats(0, 20),
    ratio=st.floats(1, 4),
    start=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.5)),
    velocity=st.floats(-1, -0.01),
    acceleration=st.floats(-2, 0),
    gain=st.floats(0.001, 2),
    more=st.floats(1.01, 3),
    name=curves,
)
def test_a_stronger_gain_touches_later_where_the_designs_rely_on_it(
    mass: float,
    omega: float,
    ratio: float,
    start: tuple[float, float],
    velocity: float,
    acceleration: float,
    gain: float,
    more: float,
    name: str,
) -> None:
    """The theorem of docs/developers/fast-designs.md: critical damping or more, any plant, an approaching obstacle."""
    damping, stiffness = 2 * ratio * omega * mass, mass * omega**2
    x0, u0 = start
    rate = omega * (ratio - np.sqrt(ratio**2 - 1)) * mass
    assume(-damping * velocity - stiffness * x0 >= rate * (u0 - velocity) > 0)
    scenario = Scenario(
        admittance=Admittance(mass=mass, damping=damping, stiffness=stiffness),
        obstacle=Obstacle(position=x0 + 0.0422, velocity=velocity, acceleration=acceleration),
        plant=Plant(position=x0, velocity=u0),
    )
    motion = solve_motion(scenario, CURVES[name], [-gain, -gain * more], horizon=100.0)
    weak, strong = motion.result.end.time
    assert strong >= weak * (1 - 1e-12)
    assert (motion.relative_velocity <= 1e-9).all(), "l falls all along"


@examples(100)
@given(
    mass=st.floats(0.1, 10),
    omega=st.floats(0, 20),
    ratio=st.floats(1, 4),
    start=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.5, 0.5)),
    distance=st.floats(1e-4, 0.06),
    velocity=st.floats(0, 1),
    acceleration=st.floats(0, 2),
    gain=st.floats(0.001, 2),
    name=curves,
)
def test_a_receding_object_is_never_touched_where_the_designs_rely_on_it(
    mass: float,
    omega: float,
    ratio: float,
    start: tuple[float, float],
    distance: float,
    velocity: float,
    acceleration: float,
    gain: float,
    name: str,
) -> None:
    """The theorem of docs/developers/fast-designs.md: critical damping or more, any plant, a receding obstacle."""
    x0, u0 = start
    scenario = Scenario(
        admittance=Admittance(mass=mass, damping=2 * ratio * omega * mass, stiffness=mass * omega**2),
        obstacle=Obstacle(position=x0 + distance, velocity=velocity, acceleration=acceleration),
        plant=Plant(position=x0, velocity=u0),
    )
    assume(bool(never_touches(scenario, CURVES[name])))
    motion = solve_motion(scenario, CURVES[name], -gain, horizon=20.0)
    assert not motion.result.reached
    assert (motion.relative_velocity[:-1] >= -1e-9).all(), "l rises all along"  # the last may leave the range


@examples(40)
@given(scenario=encounters, gain=gains, name=curves, shift=st.floats(-0.5, 0.5), speed=st.floats(-0.2, 0.2))
def test_a_moving_frame_changes_nothing(scenario: Scenario, gain: float, name: str, shift: float, speed: float) -> None:
    """Galilean invariance: everything that moves, the reference included, shifted and set in motion alike."""
    moved = Scenario(
        admittance=scenario.admittance,
        obstacle=replace(
            scenario.obstacle,
            position=scenario.obstacle.position + shift,
            velocity=scenario.obstacle.velocity + speed,
        ),
        plant=Plant(position=scenario.plant.position + shift, velocity=speed),
        reference=Reference(position=scenario.reference.position + shift, velocity=speed),
    )
    here = find_contact(scenario, CURVES[name], gain, horizon=30.0)
    there = find_contact(moved, CURVES[name], gain, horizon=30.0)
    assert here.status == there.status
    if here.reached:
        # the shift rounds the distance by 1e-16 m of the 2 mm and more that it starts with
        assert there.end.time == pytest.approx(here.end.time, rel=1e-11)
        assert there.end.relative_velocity == pytest.approx(here.end.relative_velocity, rel=1e-8)
        position = here.end.position + shift + speed * here.end.time
        assert there.end.position == pytest.approx(position, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CURVES)
def test_an_array_is_its_elements_one_by_one(name: str, kind: str) -> None:
    batch = random_encounters(kind, 6, seed=3)
    together = find_contact(batch.scenario, CURVES[name], batch.gain, horizon=10.0)
    a, o, p, r = (getattr(batch.scenario, n) for n in ("admittance", "obstacle", "plant", "reference"))

    def one(body: object, i: int) -> object:
        return replace(body, **{f.name: np.broadcast_to(getattr(body, f.name), 6)[i] for f in declared(type(body))})  # type: ignore[type-var]

    for i in range(6):
        alone = find_contact(
            Scenario(admittance=one(a, i), obstacle=one(o, i), plant=one(p, i), reference=one(r, i)),  # type: ignore[arg-type]
            CURVES[name],
            batch.gain[i],
            horizon=10.0,
        )
        assert alone.status == together.status[i]
        # the pieces of a curve start from the farthest of a batch: their rounding differs, nothing else
        assert alone.end.time == pytest.approx(together.end.time[i], rel=1e-10)


def test_fields_and_gain_broadcast(letter_power: InversePower) -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=np.array([[-0.1], [-0.3]])),
    )
    found = find_contact(scenario, letter_power, [-0.5, -0.7, -1.0])
    assert np.shape(found.status) == np.shape(found.end.time) == (2, 3)
    motion = solve_motion(scenario, letter_power, [-0.5, -0.7, -1.0], samples=17)
    assert motion.distance.shape == (2, 3, 17)
    assert (motion.distance[..., -1] == 0).all()


@pytest.mark.parametrize("name", CURVES)
def test_a_sampled_motion_obeys_its_differential_equation(letter_encounter: Scenario, name: str) -> None:
    """L(1) with L(2) at every sample, from sampled acceleration, velocity and force alone."""
    scenario = replace(letter_encounter, reference=Reference(position=0.01, velocity=-0.02, acceleration=0.3))
    motion = solve_motion(scenario, CURVES[name], -0.8, samples=2001)
    a, r = scenario.admittance, scenario.reference
    left = (
        a.mass * (motion.acceleration - r.acceleration)
        + a.damping * (motion.velocity - r.velocity - r.acceleration * motion.time)
        + a.stiffness * motion.displacement
    )
    assert np.abs(left - motion.virtual_force).max() < 1e-9 * np.abs(motion.virtual_force).max()
    assert motion.position + motion.distance == pytest.approx(0.0422 - 0.3 * motion.time, abs=1e-14)
    assert motion.time[-1] == motion.result.contact.time
    assert motion.velocity[-1] == pytest.approx(motion.result.contact.velocity, rel=1e-12)
    slope = np.gradient(motion.distance, motion.time, edge_order=2)
    assert np.abs(slope - motion.relative_velocity).max() < 1e-4  # differences of second order: 5e-3 at 100 steps


def test_an_oscillating_plant_is_met_at_its_first_contact() -> None:
    """Hardly damped, swinging 30 mm about a reference 20 mm short of the object: it touches at the first swing."""
    scenario = Scenario(
        admittance=Admittance.from_natural_frequency(mass=1.0, natural_frequency=20.0, damping_ratio=0.001),
        obstacle=Obstacle(position=0.02),
        plant=Plant(position=-0.03),
    )
    sensor = ExponentialFirstOrder(scale=1.0, rate=-60.0)
    for method in ("closed-form", "integration"):
        contact = find_contact(scenario, sensor, -1e-6, method=method).contact
        assert contact.time == pytest.approx(np.arccos(-2 / 3) / 20, rel=2e-3)  # 0.1 % damping shifts it that little


@pytest.mark.parametrize("method", ["closed-form", "integration"])
def test_a_grazing_pass_is_seen_on_both_sides(method: str) -> None:
    """An obstacle that brakes: its least distance is p - v^2 / (2 a), one micrometer either side of zero."""
    sensor = ExponentialFirstOrder(scale=1.0, rate=-60.0)
    for margin, status in ((1e-6, None), (-1e-6, ContactStatus.CONTACT)):
        scenario = Scenario(
            admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
            obstacle=Obstacle(position=0.02 + margin, velocity=-0.4, acceleration=4.0),
        )
        found = find_contact(scenario, sensor, 0.0, method=method, horizon=2.0)
        if status is None:
            assert found.status is not ContactStatus.CONTACT
            assert found.closest_distance == pytest.approx(1e-6, rel=1e-7)
        else:
            assert found.status is status


@pytest.mark.parametrize("method", ["closed-form", "integration"])
def test_a_plant_that_settles_short_is_never_in_contact(method: str) -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.01),
        plant=Plant(position=-0.03),
    )
    found = find_contact(scenario, ExponentialFirstOrder(scale=1.0, rate=-60.0), -0.5, method=method)
    assert found.status is ContactStatus.NEVER
    assert found.settling_distance == 0.01
    assert found.closest_distance == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize("method", ["closed-form", "integration"])
def test_an_object_that_recedes_leaves_the_range(method: str) -> None:
    sensor = ExponentialFirstOrder(scale=1.0, rate=-60.0, maximum_distance=0.06)
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.05, velocity=0.1),
    )
    found = find_contact(scenario, sensor, -0.5, method=method)
    assert found.status is ContactStatus.LEFT_RANGE
    assert found.end.distance == 0.06
    assert found.closest_distance == 0.05


@pytest.mark.parametrize("name", ["inverse-power", "exponential-1", "exponential-2", "mittag-leffler", "table"])
@pytest.mark.parametrize("method", ["auto", "integration"])
def test_an_encounter_may_start_at_rest_where_the_range_starts(name: str, method: str) -> None:
    """The object rests at the largest valid distance: the first motion is the plant's, or the object's, toward it."""
    curve = replace(CURVES[name], maximum_distance=0.05)
    admittance = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
    tracking = Scenario(admittance=admittance, obstacle=Obstacle(position=-0.05), plant=Plant(position=-0.1))
    falling = Scenario(admittance=admittance, obstacle=Obstacle(position=0.05, acceleration=-1.0))
    for scenario in (tracking, falling):
        at_the_edge = find_contact(scenario, curve, -0.5, method=method).contact
        inside = find_contact(scenario, CURVES[name], -0.5, method=method).contact
        assert at_the_edge.time == pytest.approx(inside.time, rel=1e-10)


def test_the_horizon_is_kept(letter_encounter: Scenario, letter_power: InversePower) -> None:
    found = find_contact(letter_encounter, letter_power, -1.0, horizon=0.1)
    assert found.status is ContactStatus.HORIZON
    assert found.end.time == 0.1


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: Obstacle(position=np.nan), {"argument": "obstacle position"}),
        (lambda: Admittance(mass=0.0, damping=1.0, stiffness=1.0), {"argument": "mass", "value": 0.0}),
        (lambda: Admittance(mass=1.0, damping=-1.0, stiffness=1.0), {"argument": "damping", "value": -1.0}),
        (lambda: Admittance(mass=1.0, damping=1.0, stiffness=[1.0, -2.0]), {"argument": "stiffness", "value": -2.0}),
        (lambda: Admittance(mass=1.0, damping=1.0, stiffness=0.0).damping_ratio, {"argument": "damping_ratio"}),
        (
            lambda: Scenario(
                admittance=Admittance(mass=1.0, damping=1.0, stiffness=1.0), obstacle=Obstacle(position=-0.01)
            ),
            {"argument": "obstacle position"},
        ),
        (
            lambda: Scenario(
                admittance=Admittance(mass=[1.0, 2.0], damping=1.0, stiffness=1.0),
                obstacle=Obstacle(position=[0.1, 0.2, 0.3]),
            ),
            {"argument": "scenario"},
        ),
    ],
)
def test_an_encounter_that_makes_no_sense_is_refused(make: object, fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()  # type: ignore[operator]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gain": np.inf}, "gain"),
        ({"gain": [[1.0], [2.0]], "velocity": [-0.1, -0.2, -0.3], "shape": True}, None),
        ({"method": "euler"}, "method"),
        ({"method": "closed-form"}, "method"),
        ({"horizon": 0.0}, "horizon"),
        ({"position": 0.2}, "obstacle position"),
    ],
)
def test_a_solve_that_makes_no_sense_is_refused(change: dict, message: str | None) -> None:
    sensor: SensorModel = InversePower(scale=1.0, distance_offset=0.04, exponent=3.0, maximum_distance=0.1)
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=change.get("position", 0.04), velocity=change.get("velocity", -0.3)),
    )
    options = {k: change[k] for k in ("method", "horizon") if k in change}
    if message is None:
        assert np.shape(find_contact(scenario, sensor, change["gain"]).status) == (2, 3)
        return
    with refused(message):
        find_contact(scenario, sensor, change.get("gain", -1.0), **options)


@pytest.mark.parametrize("horizon", [1e-9, 1e-300, 5e-324])
def test_a_horizon_may_be_as_short_as_a_number(horizon: float) -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-0.3),
    )
    found = find_contact(scenario, CURVES["inverse-power"], -1.0, horizon=horizon)
    assert found.status is ContactStatus.HORIZON
    assert found.end.time == horizon
