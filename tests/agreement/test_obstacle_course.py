"""An obstacle that stops, recedes, returns or is thrown: the loop agrees with independent solutions."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pretouch as pt
from loop_samples import BareLaw
from pretouch._core.errors import ResultUnavailableError
from pretouch.designs.objectives import excursion_objective
from pretouch.motion import ContactStatus, Stretch
from pretouch.motion.guaranteed import drag_impulses
from pretouch.motion.laws import continuous_law
from pretouch.motion.layout import PEAKS
from pretouch.motion.page_sections import scenario_rows
from pretouch.motion.solution import Solution
from pretouch.report.pages import page_of
from pretouch.uncertainty.ensemble import make_ensemble
from refusals import refused

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
STOPS = (Stretch(until=0.0503), Stretch(until=0.1507, acceleration=0.3 / 0.1004))
"""It stops, and its breakpoints lie within periods of the law."""
RECEDES = (Stretch(until=0.0507), Stretch(until=0.2003, acceleration=4.0))
AGAIN = (*RECEDES, Stretch(until=0.4001, acceleration=-4.0))
THROWN = (Stretch(until=0.0333, acceleration=3.0), Stretch(until=0.9, acceleration=-9.81))
COURSES = {"stops": STOPS, "recedes": RECEDES, "comes again": AGAIN, "thrown": THROWN}
PLANTS = {
    "ideal": pt.simulation.IdealPlant(),
    "impedance": pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0),
}


def scene(course: tuple[Stretch, ...] = (), **others: float) -> pt.Scenario:
    given = {"position": 0.0422, "velocity": -0.3, **others}
    return pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(**given, course=course))


def run(scenario: pt.Scenario, plant: str = "ideal", gain: float = -0.7) -> pt.simulation.SimulationResult:
    return pt.simulation.simulate_loop(
        scenario, SENSOR, BareLaw(gain=gain, period=1e-3), plant=PLANTS[plant], horizon=0.6
    )


def obstacle_by_hand(course: tuple[Stretch, ...], time: float, last: float = 0.0) -> tuple[float, float]:
    position, velocity, since = 0.0422, -0.3, 0.0
    for until, a in (*((s.until, s.acceleration) for s in course), (np.inf, last)):
        t = min(time, until) - since
        if t <= 0:
            break
        position, velocity, since = position + velocity * t + a * t * t / 2, velocity + a * t, until
    return position, velocity


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("name", COURSES)
def test_the_obstacle_is_where_its_course_has_it(name: str, plant: str) -> None:
    """To rounding: of 600 steps or of some thousands, each by 1e-17 m."""
    found = run(scene(COURSES[name]), plant)
    trace = found.trace()
    until = trace.time <= (found.time if found.touched else np.inf)
    expected = [obstacle_by_hand(COURSES[name], t)[0] for t in trace.time[until]]
    assert len(expected) > 50
    np.testing.assert_allclose(trace.obstacle_position[until], expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", COURSES)
def test_a_contact_is_where_an_integrator_of_its_own_has_it(name: str) -> None:
    """Without mitigation the robot of the sampled loop is at rest, and the time of contact is that of the course."""

    def fall(time: float, state: np.ndarray) -> tuple[float, float]:
        ends = [s.until for s in COURSES[name]]
        i = int(np.searchsorted(ends, time, side="right"))
        return state[1], COURSES[name][i].acceleration if i < len(ends) else 0.0

    def touch(time: float, state: np.ndarray) -> float:
        return float(state[0])

    touch.terminal = True  # type: ignore[attr-defined]
    own = solve_ivp(fall, (0, 0.6), (0.0422, -0.3), events=touch, rtol=1e-11, atol=1e-13, max_step=1e-3)
    found = run(scene(COURSES[name]), gain=0.0)
    assert found.touched == bool(len(own.t_events[0]))
    if found.touched:
        # a step of 1e-3 s over a jump of 10 m/s^2 that the integrator does not know is rejected down to rtol
        assert found.time == pytest.approx(own.t_events[0][0], abs=1e-8)
        assert found.relative_velocity == pytest.approx(own.y_events[0][0][1], abs=1e-8)
    else:
        assert own.y[0].min() == pytest.approx(found.closest_distance, abs=1e-5)  # at steps of 1e-3 s of the integrator


@pytest.mark.parametrize("name", COURSES)
def test_a_mitigated_motion_is_that_of_an_integrator(name: str) -> None:
    """As T goes to zero the loop meets L(1) with L(2): at T = 0.1 ms within the T / 2 that a force comes late by."""
    law, course = BareLaw(gain=-0.7, period=1e-4), COURSES[name]
    found = pt.simulation.simulate_loop(scene(course), SENSOR, law, horizon=0.6)
    end = float(found.time) if found.touched else 0.6

    def motion(time: float, state: np.ndarray) -> tuple[float, float]:
        x, v = state
        position, velocity = obstacle_by_hand(course, time)
        force = -0.7 * float(SENSOR.log_slope(max(position - x, 0.0))) * (velocity - v)
        return v, force - 10.0 * v - 25.0 * x

    times = np.linspace(0.01, 0.99, 12) * end
    own = solve_ivp(motion, (0, end), (0.0, 0.0), t_eval=times, rtol=1e-9, atol=1e-12, max_step=2e-3)
    trace = found.trace()
    np.testing.assert_allclose(np.interp(times, trace.time, trace.position), own.y[0], rtol=0, atol=2e-4)
    # 0.3 m/s of a robot that moves with a delay of T / 2 = 50 us: 15 um, ten times that where the force is steep


@pytest.mark.parametrize("plant", PLANTS)
def test_one_stretch_is_a_constant_acceleration(plant: str) -> None:
    one, other = run(scene((Stretch(until=5.0, acceleration=-0.5),)), plant), run(scene(acceleration=-0.5), plant)
    for name in ("time", "position", "velocity", "relative_velocity", "largest_excursion", "largest_acceleration"):
        assert getattr(one, name) == getattr(other, name), name


@pytest.mark.parametrize("plant", PLANTS)
def test_two_equal_stretches_are_one(plant: str) -> None:
    """To rounding for an ideal robot; else a step of the method is cut, whose error is below 1e-9."""
    halves = (Stretch(until=0.04567, acceleration=-0.5), Stretch(until=5.0, acceleration=-0.5))
    one, other = run(scene(halves), plant), run(scene(acceleration=-0.5), plant)
    for name in ("time", "position", "velocity", "relative_velocity", "largest_excursion"):
        within = 1e-12 if plant == "ideal" else 1e-8
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=0, abs=within), name


def test_courses_broadcast() -> None:
    until = np.array([0.05, 0.06, 0.07])
    course = (Stretch(until=until, acceleration=1.0), Stretch(until=0.2, acceleration=[[3.0], [-3.0]]))
    several = scene(course)
    assert several.shape == (2, 3)
    found = run(several)
    alone = run(scene((Stretch(until=0.06, acceleration=1.0), Stretch(until=0.2, acceleration=-3.0))))
    assert found.time[1, 1] == alone.time
    assert found.relative_velocity[1, 1] == alone.relative_velocity


def test_the_velocity_is_that_of_the_course() -> None:
    times = np.linspace(0, 1, 57)
    for course in COURSES.values():
        expected = [obstacle_by_hand(course, t, 0.5)[1] for t in times]
        body = pt.Obstacle(position=0.0422, velocity=-0.3, acceleration=0.5, course=course)
        np.testing.assert_allclose(body.velocity_at(times), expected, rtol=0, atol=1e-14)


def test_what_stops_before_it_arrives_is_not_met() -> None:
    stops = run(scene((Stretch(until=0.1, acceleration=3.0),)), gain=0.0)
    assert not stops.touched
    assert stops.closest_distance == pytest.approx(0.0422 - 0.015, abs=1e-13)  # v^2 / 2a = 15 mm


def test_values_travel() -> None:
    given = scene(AGAIN)
    assert pickle.loads(pickle.dumps(given)) == given == copy.deepcopy(given)  # noqa: S301 - our own
    assert given != scene(RECEDES)
    assert hash(given) == hash(scene(AGAIN))
    assert eval(repr(AGAIN[0]), {"Stretch": Stretch}) == AGAIN[0]  # noqa: S307 - our own


@pytest.mark.parametrize(
    ("course", "fields"),
    [
        ((Stretch(until=0.2), Stretch(until=0.1)), {"argument": "obstacle course"}),
        (
            (Stretch(until=0.2), Stretch(until=0.2)),
            {"argument": "obstacle course"},
        ),
        ((3.0,), {"argument": "obstacle course", "value": (3.0,)}),
        (Stretch(until=1.0), {"argument": "obstacle course"}),
    ],
)
def test_courses_that_make_no_sense_are_refused(course: tuple[Stretch, ...], fields: dict[str, Any]) -> None:
    with refused(**fields):
        pt.Obstacle(position=0.04, course=course)


@pytest.mark.parametrize("until", [0.0, -1.0, np.nan, np.inf])
def test_a_stretch_ends_at_a_time(until: float) -> None:
    with refused("stretch until"):
        Stretch(until=until)


def test_shapes_that_do_not_broadcast_are_refused_by_the_scenario() -> None:
    with refused("scenario"):
        scene((Stretch(until=[0.1, 0.2]), Stretch(until=[0.3, 0.4, 0.5])))


def test_a_design_on_the_loop_takes_a_course() -> None:
    """It is the least of what the loop makes of neighboring gains, and its page is written without the ideal design."""
    law = pt.control.Controller(
        period=1e-3,
        conditioning=pt.control.Conditioning(floor=1e-3),
        law=pt.control.VirtualDamper(gain=-0.7),
        admittance=pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    loop = pt.ClosedLoop(law=law, chain=pt.SensorChain(rate=1000.0))
    scenario = scene((Stretch(until=0.05), Stretch(until=0.1, acceleration=-1.0)))
    objective = excursion_objective(position_scale=0.5, velocity_scale=0.3)
    design = pt.design(pt.Task(scenario, SENSOR, objective, bounds=(-10.0, -0.01), evaluate=loop))
    assert "sampled loop" in str(design)
    rows = dict(scenario_rows(scenario))
    assert rows["obstacle: acceleration until 0.1 s"].value == -1.0
    contact = loop(scenario, SENSOR, design.gain * np.array([1.0, 0.8, 1.25])).contact
    values = (contact.displacement / 0.5) ** 2 + (contact.relative_velocity / 0.3) ** 2
    assert values.argmin() == 0


OBJECTIVE = excursion_objective(position_scale=0.5, velocity_scale=0.3)
STEADY = (Stretch(until=0.05), Stretch(until=0.2))
"""A course that changes nothing."""
LAWS = {"virtual-damper": (-0.7, (-10.0, -0.01)), "virtual-drag": (0.01, (1e-4, 0.1))}
TIGHT = 1e-9  # of contacts, as all solvers claim


def by_runge_kutta(course: tuple[Stretch, ...], law: str, value: float, horizon: float) -> tuple[float, float]:
    """Integrate the first contact in an independent way, stretch by stretch; return its time [s] and l' [m/s]."""
    time, state = 0.0, np.array([0.0, 0.0])
    for stretch in (*course, Stretch(until=horizon)):
        start = time, *obstacle_by_hand(course, time)

        def obstacle(
            t: float, start: tuple[float, ...] = start, a: float = stretch.acceleration
        ) -> tuple[float, float]:
            return start[1] + start[2] * (t - start[0]) + a * (t - start[0]) ** 2 / 2, start[2] + a * (t - start[0])

        def distance(t: float, y: np.ndarray, obstacle: Any = obstacle) -> float:
            return float(obstacle(t)[0] - y[0])

        def rates(t: float, y: np.ndarray, obstacle: Any = obstacle) -> tuple[float, float]:
            speed = obstacle(t)[1] - y[1]
            rate = -3.32 / (max(obstacle(t)[0] - y[0], 0.0) + 0.0419) * speed
            pull = 25.0 * y[0] + 10.0 * y[1]
            if law == "virtual-drag":
                return y[1], -value * rate * max(rate, 0.0) - (max(pull, 0.0) if speed < 0 else pull)
            return y[1], value * rate - pull

        distance.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(
            rates, (time, stretch.until), state, "DOP853", rtol=1e-12, atol=1e-14, events=distance, max_step=0.01
        )
        time, state = run.t[-1], run.y[:, -1]
        if len(run.t_events[0]):
            return time, obstacle(time)[1] - state[1]
    raise AssertionError("no contact")


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["comes again", "thrown"])
def test_a_contact_of_an_obstacle_with_a_course(name: str, law: str) -> None:
    """The reference integrates to 1e-12; where the drag's force has a corner, its steps of 10 ms know it to 1e-8."""
    value = LAWS[law][0]
    found = pt.find_contact(scene(COURSES[name]), SENSOR, value, law=law, horizon=3.0)
    time, speed = by_runge_kutta(COURSES[name], law, value, 3.0)
    within = TIGHT if law == "virtual-damper" else 1e-7
    assert found.contact.time == pytest.approx(time, rel=within)
    assert found.contact.relative_velocity == pytest.approx(speed, rel=within)
    assert found.impulse_residual < 1e-9
    motion = pt.solve_motion(scene(COURSES[name]), SENSOR, value, law=law, horizon=3.0, samples=9)
    places = [obstacle_by_hand(COURSES[name], t)[0] for t in motion.time]
    np.testing.assert_allclose(motion.distance + motion.position, places, atol=1e-14)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("law", LAWS)
def test_a_course_of_constant_velocity_changes_nothing(law: str) -> None:
    """Contacts agree within what all solvers claim; a gain within what the search resolves of its objective, 1e-8."""
    value, bounds = LAWS[law]
    found, expected = (pt.find_contact(scene(course), SENSOR, value, law=law) for course in (STEADY, ()))
    for name, result in found.end.as_dict().items():
        assert result == pytest.approx(getattr(expected.end, name), rel=TIGHT, abs=1e-12), name
    designs = [pt.design(pt.Task(scene(course), SENSOR, OBJECTIVE, law=law, bounds=bounds)) for course in (STEADY, ())]
    assert designs[0].gain == pytest.approx(designs[1].gain, rel=1e-7)
    assert designs[0].objective == pytest.approx(designs[1].objective, rel=TIGHT)
    assert designs[0].gain != designs[1].gain or designs[0].objective != designs[1].objective  # another solver


CUSTOM = {
    "virtual-damper": pt.motion.CustomLaw(kind="damper", number=pt.motion.DAMPER.number, force=lambda d, _, s: d * s),
    "virtual-drag": pt.motion.CustomLaw(
        kind="drag",
        number=pt.motion.DRAG.number,
        force=lambda phi, _, s: -phi * s * max(s, 0.0),
        suspends_admittance=True,
    ),
}


def random_courses(seed: int, n: int) -> pt.Scenario:
    """Draw encounters with courses: objects that rest, come, stop, go and come again; plants that move or rest."""
    rng = np.random.default_rng(seed)
    ends = np.sort(rng.uniform(0.005, 0.6, (3, n)), axis=0)
    return pt.Scenario(
        admittance=pt.Admittance(
            mass=rng.uniform(0.5, 3.0, n),
            damping=rng.choice([0.0, 3.0, 20.0], n),
            stiffness=rng.choice([0.0, 25.0, 100.0], n),
        ),
        obstacle=pt.Obstacle(
            position=rng.uniform(0.01, 0.1, n),
            velocity=rng.choice([0.0, -0.1, -0.3, 0.05], n),
            acceleration=rng.choice([0.0, -1.0, 1.0], n),
            course=tuple(Stretch(until=end, acceleration=rng.choice([0.0, -5.0, 5.0, 2.0], n)) for end in ends),
        ),
        plant=pt.Plant(position=rng.uniform(-0.005, 0.005, n), velocity=rng.choice([0.0, -0.1, 0.1, 0.5], n)),
        reference=pt.Reference(velocity=rng.uniform(-0.1, 0.1)),
    )


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("law", CUSTOM)
@pytest.mark.parametrize("sensor", [SENSOR, pt.ExponentialFirstOrder(scale=1.0, rate=-60.0)], ids=["any", "constant"])
def test_the_compiled_solver_agrees_with_the_numerical_integration(
    sensor: pt.sensors.SensorModel, law: str, seed: int
) -> None:
    """The same encounters as of a custom law with the same force, which another method integrates."""
    scenario = random_courses(seed, 16)
    rng = np.random.default_rng(seed)
    number = rng.uniform(-4.0, 0.1, 16) if law == "virtual-damper" else rng.choice([0.0, 0.002, 0.0144, 0.1], 16)
    results = [pt.find_contact(scenario, sensor, number, law=each, horizon=5.0) for each in (law, CUSTOM[law])]
    np.testing.assert_array_equal(*(result.status for result in results))
    expected_endings = {ContactStatus.CONTACT, ContactStatus.HORIZON}
    if law == "virtual-drag":
        expected_endings |= {ContactStatus.NEVER}
        np.testing.assert_array_equal(*(result.settling_distance for result in results))
    assert expected_endings >= set(map(ContactStatus, results[0].status))
    with refused("gradients", error=ResultUnavailableError):
        _ = results[0].gradients
    assert results[0].impulse_residual.max() < 1e-11
    for name in ("time", "distance", "position", "velocity", "relative_velocity", "virtual_force", *PEAKS):
        found, expected = (getattr(result.end, name) for result in results)
        np.testing.assert_allclose(found, expected, rtol=TIGHT, atol=2e-9, err_msg=name)
    np.testing.assert_allclose(*(result.closest_distance for result in results), rtol=TIGHT, atol=1e-11)
    motions = [
        pt.solve_motion(scenario, sensor, number, law=each, horizon=5.0, samples=40) for each in (law, CUSTOM[law])
    ]
    for name in ("time", "distance", "position", "velocity", "relative_velocity", "displacement", "virtual_force"):
        found, expected = (getattr(motion, name) for motion in motions)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=5e-9 * np.abs(expected).max(), err_msg=name)


def test_the_impulse_balance_of_a_drag_sees_another_curve() -> None:
    """The residual takes the force from the sensor itself: another curve changes the impulse of the drag."""
    result = pt.find_contact(scene(THROWN), SENSOR, 0.01, law="virtual-drag", horizon=3.0)
    assert result.impulse_residual < 1e-12
    request = result.columns.request  # type: ignore[attr-defined]
    other = replace(request, sensor=replace(SENSOR, exponent=3.32 * 1.01))
    drag = drag_impulses(request)[0]
    assert drag_impulses(other)[0] == pytest.approx(drag, rel=0.5)
    changed = Solution(request)
    changed.request = other
    assert changed.column("impulse_residual") > 1e-3


@pytest.mark.parametrize("law", LAWS)
def test_many_curves_take_a_course(law: str) -> None:
    """Curves that no scaling turns into each other: each encounter is that of its own curve alone."""
    sensor = pt.MittagLeffler(scale=1.0, rate=-40.0, order=0.8)
    values = {"sensor.order": np.array([0.78, 0.8, 0.82]), "obstacle.velocity": np.array([-0.3, -0.25, -0.2])}
    drawn = make_ensemble(scene(THROWN), sensor, values, law=continuous_law(law), horizon=3.0)
    number = LAWS[law][0]
    found = drawn.contacts(number)
    for i in range(3):
        alone = pt.find_contact(*drawn.at(i), number, law=law, horizon=3.0)
        assert found.status[i] == alone.status
        assert found.end.time[i] == pytest.approx(alone.end.time, rel=TIGHT)
        assert found.end.relative_velocity[i] == pytest.approx(alone.end.relative_velocity, rel=TIGHT)
        assert found.impulse_residual[i] < 1e-11


def test_an_obstacle_that_stops_before_contact_has_no_contact() -> None:
    design = pt.design(pt.Task(scene(STOPS), SENSOR, OBJECTIVE, bounds=(-10.0, -0.01), horizon=10.0))
    assert design.status.value == "no-contact"
    assert "without contact" in str(design)
    assert page_of(design).next_step.endswith("even without mitigation, it comes no nearer than 12 mm")
    result = pt.find_contact(scene(STOPS), SENSOR, -0.7, horizon=10.0)
    assert result.status is ContactStatus.NEVER  # the last section of the course lasts forever
    nearest = obstacle_by_hand(STOPS, 10.0)[0]
    assert result.closest_distance == pytest.approx(nearest, rel=1e-12)  # the robot returns to its reference


def test_fronts_robust_designs_and_sweeps_take_a_course() -> None:
    """Each gives what contacts at the same gains give."""
    course = COURSES["comes again"]
    task = pt.Task(scene(course), SENSOR, OBJECTIVE, bounds=(-10.0, -0.01), horizon=3.0)
    front = pt.pareto(task)
    some = slice(None, None, max(1, len(front.gain) // 5))
    contact = pt.find_contact(scene(course), SENSOR, front.gain[some], horizon=3.0).contact
    np.testing.assert_allclose(front.of("relative_velocity")[some], np.abs(contact.relative_velocity), rtol=1e-12)
    swept = pt.sweep(task, {"obstacle.velocity": [-0.3, -0.25]}, results=["gain", "relative_velocity"])
    for i, velocity in enumerate((-0.3, -0.25)):
        alone = pt.design(task.replace(scenario=scene(course, velocity=velocity)))
        assert float(swept["gain"][i]) == pytest.approx(alone.gain, rel=1e-6)
    uncertain = {"obstacle.velocity": pt.uncertainty.Normal(mean=-0.3, deviation=0.02)}
    robust = pt.robust(task.replace(uncertainty=uncertain, robust=pt.designs.RobustOptions(samples=16)))
    assert robust.gain == pytest.approx(pt.design(task).gain, rel=0.3)


def test_a_verdict_takes_a_course() -> None:
    """The gain that is verified is the design in continuous time, and the loop agrees within a few percent."""
    law = pt.control.Controller(
        period=1e-3,
        conditioning=pt.control.Conditioning(floor=1e-3),
        law=pt.control.VirtualDamper(gain=-0.7),
        admittance=pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    loop = pt.ClosedLoop(law=law, chain=pt.SensorChain(rate=1000.0))
    course = (Stretch(until=0.05), Stretch(until=0.1, acceleration=-1.0))
    task = pt.Task(scene(course), SENSOR, OBJECTIVE, bounds=(-10.0, -0.01))
    verdict = pt.verify(task.replace(loop=loop, verify=pt.designs.VerifyOptions(runs=20)), changes=False)
    design = pt.design(task)
    assert verdict.gain == pytest.approx(design.gain, rel=1e-9)
    speed = design.result.contact.relative_velocity
    assert verdict.mitigated.relative_velocity.mean() == pytest.approx(speed, rel=0.03)
    assert "predicted" in str(verdict)


def test_a_design_of_the_drag_for_its_effect_needs_a_constant_velocity() -> None:
    with refused("scenario"):
        pt.design(pt.Task(scene(STOPS), SENSOR, drag_effect=pt.DragEffect(ratio=0.2)))


@pytest.mark.parametrize("method", ["closed-form", "uniform-motion"])
def test_the_other_methods_refuse_a_course(method: str) -> None:
    with refused("method"):
        pt.find_contact(scene(STOPS), SENSOR, -0.7, method=method)
