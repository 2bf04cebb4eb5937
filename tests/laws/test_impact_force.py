"""The impact force: continuous in every input, the peak where nothing pushes on, and never more than the peak."""

from __future__ import annotations

import math
from struct import pack
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from loop_samples import BareLaw
from pretouch._core.native import DOUBLE, POINTER, kernel

ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
ROBOTS: dict[str, pt.simulation.PlantModel] = {
    "impedance with a servo": pt.simulation.ImpedancePlant(
        mass=4.0, stiffness=4000.0, damping=250.0, bandwidth=80.0, coulomb_friction=1.0
    ),
    "impedance with feedforward": pt.simulation.ImpedancePlant(mass=2.0, stiffness=2e4, damping=400.0),
    "position": pt.simulation.PositionPlant(mass=2.0, bandwidth=20.0),
}
STIFFNESS = np.geomspace(3e4, 3e8, 81)
STEP = 0.02  # of the contact's time scale: what a step of the integration takes at once
# A force that grows as t^2 grows by 2 steps / T within a step, and T is at least 2.9 time scales: by less than one step
SAMPLED = 1 + STEP
LASTING = kernel("elastic_duration", POINTER, DOUBLE, DOUBLE, result=DOUBLE)


def elastic_duration(contact: pt.simulation.ContactModel, inverse_mass: float, speed: float) -> float:
    """How long the bodies would touch [s], from a relative speed on, without loss and drive: m d'' = -k d^n."""
    return float(LASTING(pack("5d", *contact.numbers()), inverse_mass, speed))


def sphere(stiffness: float, obstacle_mass: float) -> pt.simulation.ContactModel:
    return pt.simulation.HuntCrossley(stiffness=stiffness, dissipation=0.5, obstacle_mass=obstacle_mass)


def pad(stiffness: float, obstacle_mass: float) -> pt.simulation.ContactModel:
    spring = stiffness / 30
    return pt.simulation.SpringDamper(stiffness=spring, damping=0.2 * math.sqrt(spring), obstacle_mass=obstacle_mass)


def meet(
    plant: pt.simulation.PlantModel, contact: pt.simulation.ContactModel, speed: Any = 0.3
) -> pt.simulation.SimulationResult:
    scenario = pt.Scenario(
        admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=-np.asarray(speed, dtype=float))
    )
    return pt.simulation.simulate_loop(
        scenario, SENSOR, BareLaw(-0.7, 1e-3), plant=plant, contact=contact, follow_time=0.1
    )


def until_they_stop(run: pt.simulation.SimulationResult) -> tuple[float, bool]:
    """Return the largest force until the bodies stop approaching, and whether they do before anything else ends."""
    course = run.trace().contact_course
    stops = np.flatnonzero(course[:, 2] >= 0)
    end = int(stops[0]) + 1 if len(stops) else len(course)
    return float(course[:end, 3].max()), bool(len(stops))


@pytest.mark.slow
@pytest.mark.parametrize("contact", [sphere, pad])
@pytest.mark.parametrize("robot", ROBOTS)
def test_the_impact_force_of_a_driven_obstacle_is_continuous_in_the_stiffness(robot: str, contact: Any) -> None:
    """In a soft contact the bodies never stop, in a stiff one they do: what ends there jumps between the two."""
    runs = [meet(ROBOTS[robot], contact(k, math.inf)) for k in STIFFNESS]
    force = np.array([run.impact_force for run in runs])
    assert (force <= [run.peak_force for run in runs]).all()
    assert (force > 0).all()
    # of one course the force is proportional to k; a stiffer contact takes less way and ends earlier
    step = STIFFNESS[1] / STIFFNESS[0]
    assert np.abs(np.diff(np.log(force))).max() <= math.log(step * SAMPLED)
    stopped, ends = zip(*map(until_they_stop, runs), strict=True)
    assert len(set(ends)) == 2  # the grazing case is among them
    assert np.abs(np.diff(np.log(stopped))).max() > math.log(1.5)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "stiffness"), [("impedance with a servo", 9e5), ("position", 7e6)])
def test_the_impact_force_of_a_driven_obstacle_is_continuous_in_its_speed(robot: str, stiffness: float) -> None:
    """With these stiffnesses, fast obstacles stop beside the robot, and slow ones never do."""
    speed = np.geomspace(0.05, 0.6, 401)
    runs = meet(ROBOTS[robot], sphere(stiffness, math.inf), speed)
    assert (runs.impact_force <= runs.peak_force).all()
    assert {until_they_stop(meet(ROBOTS[robot], sphere(stiffness, math.inf), v))[1] for v in speed[[0, -1]]} == {0, 1}
    # F = k (v t)^(3/2) of a robot that stays; of one that gives way before, the speed at contact grows less than v
    most = 1.5 * math.log(speed[1] / speed[0]) + math.log(SAMPLED)
    assert np.abs(np.diff(np.log(runs.impact_force))).max() <= most


@pytest.mark.parametrize("contact", [sphere, pad])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_free_obstacle_is_hit_once_and_its_impact_force_is_the_peak(robot: str, contact: Any) -> None:
    for stiffness in (1e6, 1e8):
        run = meet(ROBOTS[robot], contact(stiffness, 0.5), np.linspace(0.1, 0.6, 26))
        assert (run.impact_force == run.contact_list[:, 0, 2]).all()
        assert (run.impact_force == run.peak_force).all()


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("obstacle_mass", [math.inf, 0.6])
@pytest.mark.parametrize("speed", [0.02, 1.0])
def test_the_time_of_an_impact_is_that_of_free_bodies_without_loss(
    exponent: float, obstacle_mass: float, speed: float
) -> None:
    contact = pt.simulation.HuntCrossley(stiffness=2e5, exponent=exponent, obstacle_mass=obstacle_mass)
    law = BareLaw(-1e-12, 1e-3, damping=0.0, stiffness=0.0)
    plant = pt.simulation.ImpedancePlant(mass=1.7, stiffness=1e-9, damping=0.0, feedforward=False)
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=0.0, stiffness=0.0),
        obstacle=pt.Obstacle(position=0.01),
        plant=pt.Plant(velocity=speed),
    )
    run = pt.simulation.simulate_loop(scenario, SENSOR, law, plant=plant, contact=contact, horizon=2.0, follow_time=0.5)
    lasting = elastic_duration(contact, 1 / 1.7 + 1 / obstacle_mass, speed)
    # the end is seen at the end of a step: one of 1/50 of a time scale, of which an impact lasts 2.9 or more
    assert lasting <= run.contact_list[0, 5] <= lasting * (1 + STEP / 2.9)
    assert run.impact_force == run.peak_force


def test_a_touch_without_speed_has_a_time_of_impact_too() -> None:
    spring = elastic_duration(pt.simulation.SpringDamper(stiffness=4e4), 1 / 2.0, 0.0)
    assert spring == pytest.approx(math.pi * math.sqrt(2.0 / 4e4), rel=1e-12)
    assert math.isfinite(elastic_duration(pt.simulation.HuntCrossley(stiffness=4e4), 1 / 2.0, 0.0))
