"""Contact forces of the loop compared with restitution in closed form, conservation laws, and SciPy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pretouch as pt
from loop_samples import BareLaw

# The step resolves a contact's time scale by 1/50. Where the force is cut off at 0 within a step, its impulse is off by
# the square of that, 4e-4, times the share of the last step in the whole: below 1e-3 of the speed in any case.
STEP = 1e-3
SENSOR = pt.ExponentialFirstOrder(scale=1.0, rate=-1.0)
ADMITTANCE = pt.Admittance(mass=1.0, damping=0.0, stiffness=0.0)


def throw(contact: Any, speed: float, mass: float = 1.7) -> pt.simulation.SimulationResult:
    """A mass that nothing pulls flies against an obstacle at rest."""
    scenario = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.01), plant=pt.Plant(velocity=speed))
    free = pt.simulation.ImpedancePlant(mass=mass, stiffness=1e-9, damping=0.0, feedforward=False)
    law = BareLaw(-1e-12, 1e-3, damping=0.0, stiffness=0.0)
    return pt.simulation.simulate_loop(scenario, SENSOR, law, plant=free, contact=contact, horizon=1.0, follow_time=0.5)


def restitution_of_hunt_crossley(loss: float, speed: float) -> float:
    """From m v dv/dd = -k d^n (1 + a v): a v - ln(1 + a v) is the same before and after."""
    before = loss * speed - math.log1p(loss * speed)
    return float(
        brentq(
            lambda e: -loss * e * speed - math.log1p(-loss * e * speed) - before, 1e-9, min(1, 1 / loss / speed - 1e-9)
        )
    )


@pytest.mark.parametrize("speed", [0.02, 0.3, 2.0])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("loss", [0.1, 1.0, 5.0])
@pytest.mark.parametrize("obstacle_mass", [math.inf, 0.6])
def test_hunt_and_crossley_give_back_the_speed_that_the_closed_form_says(
    speed: float, exponent: float, loss: float, obstacle_mass: float
) -> None:
    contact = pt.simulation.HuntCrossley(
        stiffness=2e5, dissipation=loss, exponent=exponent, obstacle_mass=obstacle_mass
    )
    run = throw(contact, speed)
    e = restitution_of_hunt_crossley(loss, speed)
    assert run.rebound_velocity == pytest.approx(e * speed, rel=STEP)
    reduced = 1 / (1 / 1.7 + 1 / obstacle_mass)
    assert run.impulse == pytest.approx(reduced * (1 + e) * speed, rel=STEP)
    # the deepest point, where all energy is in the contact or lost
    energy = (loss * speed - math.log1p(loss * speed)) / loss**2
    depth = ((exponent + 1) * reduced * energy / 2e5) ** (1 / (exponent + 1))
    assert -run.closest_distance == pytest.approx(depth, rel=STEP)


@pytest.mark.parametrize("stiffness", [1e3, 1e7, 1e11])
def test_no_contact_is_too_stiff_for_the_step_before_it(stiffness: float) -> None:
    """A contact that is over within a hundredth of the loop's period is found, and gives back the same."""
    run = throw(pt.simulation.HuntCrossley(stiffness=stiffness, dissipation=1.0), 0.3)
    assert run.rebound_velocity == pytest.approx(restitution_of_hunt_crossley(1.0, 0.3) * 0.3, rel=STEP)
    assert run.time == pytest.approx(0.01 / 0.3, abs=1e-9)


@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.3, 0.6])
@pytest.mark.parametrize("speed", [0.05, 1.0])
def test_spring_and_damper_give_back_the_speed_that_the_closed_form_says(ratio: float, speed: float) -> None:
    """The force ends where k d + c d' = 0, that is d'' = 0: e = exp(-z (pi - atan(2 z s / (1 - 2 z^2))) / s)."""
    stiffness, mass = 3e4, 1.7
    damping = 2 * ratio * math.sqrt(stiffness * mass)
    run = throw(pt.simulation.SpringDamper(stiffness=stiffness, damping=damping), speed)
    root = math.sqrt(1 - ratio**2)
    angle = math.pi - math.atan2(2 * ratio * root, 1 - 2 * ratio**2)
    e = math.exp(-ratio / root * angle)
    assert run.rebound_velocity == pytest.approx(e * speed, rel=STEP)
    if ratio == 0:
        assert run.peak_force == pytest.approx(speed * math.sqrt(stiffness * mass), rel=STEP)
        assert run.peak_force == pytest.approx(
            pt.SpringImpact(robot_mass=mass, stiffness=stiffness).peak_force(speed), rel=STEP
        )


@pytest.mark.parametrize("ratio", [0.5, 0.6, 2.0])
def test_a_strong_damper_has_its_peak_at_the_touch(ratio: float) -> None:
    """There F = c v, and F' = k v (1 - 4 zeta^2): for zeta >= 1/2 it only falls. MuJoCo found it to be missed."""
    damping = 2 * ratio * math.sqrt(3e4 * 1.7)
    run = throw(pt.simulation.SpringDamper(stiffness=3e4, damping=damping), 0.4)
    assert run.peak_force == pytest.approx(0.4 * damping, rel=1e-9)
    assert run.impact_force == run.contact_list[0, 2] == run.peak_force


def test_an_elastic_sphere_has_the_peak_of_hertz() -> None:
    hertz = pt.HertzImpact(robot_mass=1.7, effective_modulus=1e7, radius=0.01)
    stiffness = 4 / 3 * 1e7 * math.sqrt(0.01)
    run = throw(pt.simulation.HuntCrossley(stiffness=stiffness), 0.4)
    assert run.peak_force == pytest.approx(hertz.peak_force(0.4), rel=STEP)
    assert run.rebound_velocity == pytest.approx(0.4, rel=STEP)


def test_a_pulled_mass_in_contact_follows_scipy() -> None:
    """Servo lag, friction, Hunt and Crossley's force and a light obstacle: position after 60 ms, before any rebound."""
    plant = pt.simulation.ImpedancePlant(mass=2.0, stiffness=3000.0, damping=120.0, bandwidth=40.0,
                                         coulomb_friction=1.5, friction_speed=0.01, feedforward=False)  # fmt: skip
    contact = pt.simulation.HuntCrossley(stiffness=5e5, dissipation=0.8, obstacle_mass=0.9)
    scenario = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.004), plant=pt.Plant(velocity=0.25))
    law = BareLaw(-1e-12, 1e-3, damping=0.0, stiffness=0.0)  # x_v goes on at 0.25 m/s
    run = pt.simulation.simulate_loop(
        scenario, SENSOR, law, plant=plant, contact=contact, horizon=0.0605, follow_time=1.0
    )
    trace = run.trace()

    def slopes(t: float, s: Any) -> list[float]:
        x, v, f, x_o, v_o = s
        depth = x - x_o
        push = 5e5 * depth**1.5 * (1 + 0.8 * (v - v_o)) if depth > 0 else 0.0
        push = max(push, 0.0)
        command = 3000.0 * (0.25 * t - x) + 120.0 * (0.25 - v)
        return [v, (f - 1.5 * math.tanh(v / 0.01) - push) / 2.0, 2 * math.pi * 40.0 * (command - f), v_o, push / 0.9]

    found = solve_ivp(
        slopes, (0, trace.time[-1]), [0, 0.25, 0, 0.004, 0], method="DOP853", rtol=1e-10, atol=1e-13,
        t_eval=trace.time, max_step=1e-4,
    )  # fmt: skip
    # of the obstacle's way of some mm: the two see the touches as corners at different places of their steps
    assert np.abs(trace.position - found.y[0]).max() < 1e-6
    assert np.abs(trace.obstacle_position - found.y[3]).max() < 2e-6
    assert run.contacts >= 1


def test_a_robot_that_is_pressed_on_comes_back_after_each_rebound() -> None:
    """Section VI.A: each approach after a separation is one more encounter."""
    plant = pt.simulation.PositionPlant(mass=1.0, bandwidth=0.5)
    contact = pt.simulation.HuntCrossley(stiffness=1e9, dissipation=0.4)
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.02),
        plant=pt.Plant(velocity=0.5),
        reference=pt.Reference(position=0.03),
    )
    run = pt.simulation.simulate_loop(
        scenario, SENSOR, BareLaw(-1e-6, 1e-3), plant=plant, contact=contact, follow_time=2.0
    )
    times, speeds, _, impulses, rebounds, durations = run.trace().contacts.T
    assert run.contacts == len(times) > 3
    assert (np.diff(times) > 0).all()
    assert (np.diff(np.abs(speeds)) < 0).all()
    parted = np.isfinite(rebounds)
    assert parted[:3].all()
    e = [restitution_of_hunt_crossley(0.4, -v) for v in speeds[:3]]
    # during a contact of 2 ms the damping of the position loop, 6.3 N s/m on 1 kg, takes a hundredth
    assert rebounds[:3] == pytest.approx(-np.array(e) * speeds[:3], rel=0.02)
    assert run.impulse == pytest.approx(impulses.sum(), rel=1e-6)
    assert (durations > 0).all()


def test_a_driven_obstacle_pushes_on_after_the_impact() -> None:
    plant = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0)
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.02, velocity=-0.3),
    )
    run = pt.simulation.simulate_loop(
        scenario,
        SENSOR,
        BareLaw(-1e-6, 1e-3),
        plant=plant,
        contact=pt.simulation.SpringDamper(stiffness=1e6),
        follow_time=0.6,
    )
    assert 0 < run.impact_force < run.peak_force
    # of the pair mass, contact: the virtual object stays, so the impedance takes part with 180 N s/m of damping
    assert run.impact_force == pytest.approx(0.3 * math.sqrt(2.0 * 1e6), rel=0.15)


@pytest.mark.parametrize(
    "contact", [pt.simulation.HuntCrossley(stiffness=1e10, dissipation=1.0), pt.simulation.SpringDamper(stiffness=3e7)]
)
def test_a_trace_resolves_contacts_that_are_over_within_a_step_of_the_law(contact: pt.simulation.HuntCrossley) -> None:
    """The force over time of the trace is the one whose impulse and peak the run reports."""
    run = throw(contact, 0.4)
    trace = run.trace()
    (first, *_) = trace.contacts
    course = trace.contact_course
    assert first[5] < STEP
    assert len(course) > 100
    assert course[0] == pytest.approx([run.time, 0.0, run.relative_velocity, 0.0])
    assert course[-1, 0] == pytest.approx(first[0] + first[5])
    assert course[-1, 2] == run.rebound_velocity
    assert course[:, 3].max() == run.peak_force
    assert course[:, 1].min() == run.closest_distance
    # trapezoids over steps of 1/50 of the time scale: 0.02^2 / 12, and as much where the force begins as d^(3/2)
    assert np.trapezoid(course[:, 3], course[:, 0]) == pytest.approx(run.impulse, rel=1e-4)
    # l' is the slope of l: differences in the middle of a step, up to 0.02^2 / 12 of the speed
    slope = np.diff(course[:, 1]) / np.diff(course[:, 0])
    assert slope == pytest.approx((course[1:, 2] + course[:-1, 2]) / 2, abs=1e-4 * abs(run.relative_velocity))


def test_a_run_without_contact_force_has_no_course_of_a_contact() -> None:
    run = pt.simulation.simulate_loop(
        pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.01, velocity=-0.3)),
        SENSOR,
        BareLaw(-0.1, 1e-3),
    )
    assert run.touched
    assert run.trace().contact_course.shape == (0, 4)
