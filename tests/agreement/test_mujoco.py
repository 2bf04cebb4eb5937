"""The sampled loop with robot and contact against MuJoCo: another integrator, another contact, the same law."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from loop_samples import BareLaw
from mujoco_witness import WitnessResult, witness_encounter
from pretouch import control
from pretouch.letter.inputs import approach, disruption, f_1, f_2, sensor

STEPS = (2e-4, 1e-4, 5e-5)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0)
CONTACT = pt.simulation.SpringDamper(stiffness=3e4, damping=60.0, obstacle_mass=1.0)
ENCOUNTERS: dict[str, tuple[pt.Scenario, pt.sensors.SensorModel, Any, float]] = {
    "an obstacle approaches": (approach(), sensor("inverse-power"), f_1(), -3.0),
    "the robot moves": (disruption(), sensor("fingertip"), f_2(), -2.0),
}


@pytest.fixture
def _mujoco() -> None:
    pytest.importorskip("mujoco", reason="needs mujoco-core")


needs_mujoco = pytest.mark.usefixtures("_mujoco")


def controller(gain: float, period: float = 1e-3) -> control.Controller:
    return control.Controller(
        period=period,
        conditioning=control.Conditioning(floor=1e-9),
        law=control.VirtualDamper(gain=gain),
        admittance=control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )


def gain_of(name: str, strength: str) -> float:
    scenario, curve, objective, strong = ENCOUNTERS[name]
    if strength == "optimum":
        return float(pt.design(pt.Task(scenario, curve, objective, bounds=(-20.0, -0.01))).gain)
    return {"none": 0.0, "strong": strong}[strength]


def rate_of(contact: pt.simulation.SpringDamper, mass: float) -> float:
    """How fast the force of a contact can change, relative to it [1/s]: of its spring and of its damper."""
    inverse = 1 / mass + 1 / contact.obstacle_mass
    return math.sqrt(contact.stiffness * inverse) + contact.damping * inverse


def bounds_of(found: WitnessResult, step: float, contact: pt.simulation.SpringDamper, mass: float) -> dict[str, float]:
    """By how much MuJoCo may differ from the exact motion, absolutely.

    Its method is of the first order: x is moved with x' from the end of a step and x' with the force from its start,
    so before contact they are off by x' and x'' over one step at most; the drive damps what is older. A contact begins
    up to a step late, and its force is that of a step's start: it is off by what it changes in a step. The impedance
    of 1e-4 adds so much of the force that would keep the bodies together.
    """
    free = found.trace.time < found.time
    speed, drive = np.abs(found.trace.velocity[free]).max(), np.abs(found.trace.drive_force[free]).max() / mass
    force = step * rate_of(contact, mass) * found.peak_force + 1e-4 * np.abs(found.trace.drive_force).max()
    rounding = 1e-12
    return {
        "time": step * speed / -found.relative_velocity + rounding,
        "relative_velocity": step * drive + rounding,
        "impact_force": force,
        "peak_force": force,
        "impulse": step * rate_of(contact, mass) * found.impulse,
    }


@pytest.mark.slow(keep=2)
@needs_mujoco
@pytest.mark.parametrize("strength", ["none", "optimum", "strong"])
@pytest.mark.parametrize("name", ENCOUNTERS)
def test_mujoco_comes_to_the_same_encounter_the_closer_the_shorter_its_step(name: str, strength: str) -> None:
    scenario, curve, _, _ = ENCOUNTERS[name]
    law = controller(gain_of(name, strength))
    ours = pt.simulation.simulate_loop(scenario, curve, law, plant=ROBOT, contact=CONTACT)
    errors: dict[str, list[float]] = {"time": [], "relative_velocity": []}
    for step in STEPS:
        found = witness_encounter(scenario, curve, law, plant=ROBOT, contact=CONTACT, time_step=step)
        assert found.status is pt.motion.ContactStatus.CONTACT
        for quantity, bound in bounds_of(found, step, CONTACT, ROBOT.mass).items():
            assert abs(getattr(found, quantity) - getattr(ours, quantity)) <= bound, (quantity, step)
        for quantity, values in errors.items():
            values.append(getattr(found, quantity) - getattr(ours, quantity))
    if name == "an obstacle approaches" and strength == "none":
        return  # the robot is at rest: nothing is integrated before the contact, and both are exact
    second = STEPS[1] * ROBOT.damping / ROBOT.mass  # of the first order: the step over the drive's time scale of 11 ms
    for quantity, values in errors.items():
        ratios = np.array(values[:-1]) / np.array(values[1:])
        assert ratios == pytest.approx([2.0, 2.0], rel=0.03), quantity
        # without it the two agree, to some 1e-10 that stem from the steps of `simulate`
        assert abs(2 * values[2] - values[1]) <= second * abs(values[1]) + 1e-9, quantity


@needs_mujoco
@pytest.mark.parametrize("obstacle_mass", [1.0, math.inf])
def test_a_course_is_that_of_mujoco(obstacle_mass: float) -> None:
    """It slows down, then comes again; the breakpoints lie within periods of the law and within steps of MuJoCo."""
    scenario, curve, _, _ = ENCOUNTERS["an obstacle approaches"]
    course = (
        pt.motion.Stretch(until=0.03337),
        pt.motion.Stretch(until=0.10003, acceleration=2.5),
        pt.motion.Stretch(until=0.25011, acceleration=-2.0),
    )
    scenario = replace(scenario, obstacle=replace(scenario.obstacle, course=course))
    contact, law, step = replace(CONTACT, obstacle_mass=obstacle_mass), controller(-0.7463), STEPS[-1]
    ours = pt.simulation.simulate_loop(scenario, curve, law, plant=ROBOT, contact=contact)
    found = witness_encounter(scenario, curve, law, plant=ROBOT, contact=contact, time_step=step)
    assert found.status is pt.motion.ContactStatus.CONTACT
    for quantity, bound in bounds_of(found, step, contact, ROBOT.mass).items():
        assert abs(getattr(found, quantity) - getattr(ours, quantity)) <= bound, quantity


@needs_mujoco
def test_a_driven_obstacle_pushes_as_in_mujoco() -> None:
    """It does not yield: after the impact it presses the robot away, ever harder, until the run ends."""
    scenario, curve, _, _ = ENCOUNTERS["an obstacle approaches"]
    wall = pt.simulation.SpringDamper(stiffness=3e4, damping=60.0)
    law = controller(-0.7463)
    ours = pt.simulation.simulate_loop(scenario, curve, law, plant=ROBOT, contact=wall)
    impulses = []
    for step in STEPS:
        found = witness_encounter(scenario, curve, law, plant=ROBOT, contact=wall, time_step=step)
        for quantity, bound in bounds_of(found, step, wall, ROBOT.mass).items():
            assert abs(getattr(found, quantity) - getattr(ours, quantity)) <= bound, (quantity, step)
        impulses.append(found.impulse - ours.impulse)
    assert 2 * impulses[2] - impulses[1] == pytest.approx(0.0, abs=1e-4 * ours.impulse)  # without the first order
    assert np.diff(np.abs(impulses)).max() < 0


@needs_mujoco
@pytest.mark.parametrize(
    "plant",
    [
        pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=50.0, feedforward=False),
        pt.simulation.ImpedancePlant(
            mass=2.0, stiffness=4000.0, damping=180.0, viscous_friction=5.0, coulomb_friction=1.0, friction_speed=0.01
        ),
        pt.simulation.PositionPlant(mass=1.5, bandwidth=20.0),
    ],
)
def test_robots_that_lag_and_rub_come_to_the_same_contact_in_mujoco(plant: Any) -> None:
    """Everything of the scenario moves: plant, reference and an accelerated obstacle."""
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.05, velocity=-0.1, acceleration=-0.3),
        plant=pt.Plant(position=0.001, velocity=0.02),
        reference=pt.Reference(position=0.0, velocity=0.03, acceleration=0.1),
    )
    curve, law = sensor("exponential-2"), controller(-0.5, 5e-4)
    ours = pt.simulation.simulate_loop(scenario, curve, law, plant=plant, contact=CONTACT, follow_time=0.05)
    errors = []
    for step in STEPS[1:]:
        found = witness_encounter(scenario, curve, law, plant=plant, contact=CONTACT, time_step=step, follow_time=0.05)
        for quantity, bound in bounds_of(found, step, CONTACT, plant.mass).items():
            assert abs(getattr(found, quantity) - getattr(ours, quantity)) <= bound, quantity
        errors.append([found.time - ours.time, found.relative_velocity - ours.relative_velocity])
    assert np.divide(*errors) == pytest.approx([2.0, 2.0], rel=0.05)


def kelvin_and_voigt(contact: pt.simulation.SpringDamper, mass: float, speed: float) -> tuple[float, float, float]:
    """Peak force, impulse and relative speed at release of a mass that flies against a spring with a damper.

    delta = v / w exp(-s t) sin(w t) with s = c / 2 m until the force is 0; from then on nothing acts.
    """
    s = contact.damping / 2 / mass
    w = math.sqrt(contact.stiffness / mass - s**2)
    t = np.linspace(0, math.pi / w, 200_001)
    depth = speed / w * np.exp(-s * t) * np.sin(w * t)
    rate = speed * np.exp(-s * t) * (np.cos(w * t) - s / w * np.sin(w * t))
    force = contact.stiffness * depth + contact.damping * rate
    last = int(np.argmax(force[1:] <= 0)) if (force[1:] <= 0).any() else len(t) - 1
    return float(force.max()), mass * (speed - float(rate[last])), -float(rate[last])


@needs_mujoco
@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.3, 0.6])
@pytest.mark.parametrize(("speed", "obstacle_mass"), [(0.05, math.inf), (1.0, math.inf), (0.3, 0.6)])
def test_the_contact_of_mujoco_is_a_spring_with_a_damper(ratio: float, speed: float, obstacle_mass: float) -> None:
    """Alone, without robot and law: `solref` = (-k / m, -c / m) and the impedance do what the module says."""
    mass, step = 1.7, 1e-5
    reduced = 1 / (1 / mass + 1 / obstacle_mass)
    contact = pt.simulation.SpringDamper(
        stiffness=3e4, damping=2 * ratio * math.sqrt(3e4 * reduced), obstacle_mass=obstacle_mass
    )
    free = pt.simulation.ImpedancePlant(mass=mass, stiffness=1e-9, damping=0.0, feedforward=False)
    admittance = pt.Admittance(mass=1.0, damping=0.0, stiffness=0.0)
    scenario = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.01), plant=pt.Plant(velocity=speed))
    law = BareLaw(-1e-12, 1e-3, damping=0.0, stiffness=0.0)
    curve = pt.ExponentialFirstOrder(scale=1.0, rate=-1.0)
    found = witness_encounter(scenario, curve, law, plant=free, contact=contact, time_step=step, follow_time=0.05)
    peak, impulse, rebound = kelvin_and_voigt(contact, reduced, speed)
    error = step * rate_of(contact, mass)  # as in bounds_of: 0.1 to 0.6 %
    assert found.peak_force == pytest.approx(peak, rel=error)
    assert found.impulse == pytest.approx(impulse, rel=error)
    assert found.rebound_velocity == pytest.approx(rebound, rel=2 * error)  # touch and release, a step each
    ours = pt.simulation.simulate_loop(scenario, curve, law, plant=free, contact=contact, follow_time=0.05)
    assert found.peak_force == pytest.approx(ours.peak_force, rel=error)


@needs_mujoco
def test_the_contact_of_mujoco_is_pressed_in_by_a_part_in_ten_thousand_less() -> None:
    """At rest a_1 = 0: k delta = (1 - d) F with d = 1e-4, and the contact carries all of F."""
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=40.0, stiffness=400.0),
        obstacle=pt.Obstacle(position=0.01),
        plant=pt.Plant(position=0.005),
        reference=pt.Reference(position=0.03),
    )
    law = BareLaw(-1e-12, 1e-3, damping=40.0, stiffness=400.0)
    curve = pt.ExponentialFirstOrder(scale=1.0, rate=-1.0)
    wall = pt.simulation.SpringDamper(stiffness=3e4, damping=60.0)
    found = witness_encounter(scenario, curve, law, plant=ROBOT, contact=wall, time_step=1e-4, follow_time=2.0).trace
    drive, push, depth = found.drive_force[-1], found.contact_force[-1], -found.distance[-1]
    # all of it decays as exp(-20 t) or faster: 1e-16 of 80 N is left
    # the wall of 1e9 times the mass gives way, with 7e-8 m/s after 2 s: 1e-5 N of the drive's damping
    assert drive == pytest.approx(4000.0 * (0.03 - found.position[-1]), rel=1e-6)
    assert push == pytest.approx(drive, rel=1e-6)
    assert 3e4 * depth / push == pytest.approx(1 - 1e-4, abs=1e-6)


@needs_mujoco
def test_a_witness_that_sees_no_contact_says_so() -> None:
    scenario, curve, _, _ = ENCOUNTERS["an obstacle approaches"]
    found = witness_encounter(scenario, curve, controller(-0.7), plant=ROBOT, contact=CONTACT, horizon=0.05)
    assert found.status is pt.motion.ContactStatus.HORIZON
    assert math.isnan(found.time)
    assert math.isnan(found.relative_velocity)
    assert found.peak_force == found.impulse == 0.0
    assert found.trace.time[-1] == pytest.approx(0.05 - 2e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"plant": pt.simulation.IdealPlant()}, "expected one encounter, a plant with mass"),
        ({"contact": pt.simulation.HuntCrossley(stiffness=1e6)}, "and a SpringDamper"),
        ({"scenario": approach(np.array([0.1, 0.3]))}, "expected one encounter"),
        (
            {"contact": pt.simulation.SpringDamper(stiffness=1e9)},
            r"time_step: found 2e-05 s, too long for the shortest time scale .* use at most 8\.9\de-06 s",
        ),
        ({"time_step": 3e-5}, r"time_step: found 3e-05 s, expected an integer fraction of 0\.001 s"),
    ],
)
def test_a_witness_of_what_makes_no_sense_is_refused(change: dict[str, Any], message: str) -> None:
    scenario, curve, _, _ = ENCOUNTERS["an obstacle approaches"]
    asked = {"scenario": scenario, "plant": ROBOT, "contact": CONTACT} | change
    run: Callable[..., WitnessResult] = witness_encounter
    with pytest.raises(ValueError, match=message):
        run(asked.pop("scenario"), curve, controller(-0.7), **asked)
