"""The sampled law of a schedule of the drag against the schedule in continuous time, as the period tends to 0."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import pretouch as pt
from pretouch import control
from pretouch.design.schedule import DragSchedule, schedule_drag

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
ADMITTANCE = {"mass": 1.0, "damping": 10.0, "stiffness": 25.0}
DISTANCE, SPEED = 0.0422, 0.3


@cache
def schedule() -> DragSchedule:
    return schedule_drag(SENSOR, DISTANCE, 1.0, ratio=0.26, reflectance=(1 / 1.2, 1.2))


def simulated(period: float, reflectance: float) -> tuple[float, float]:
    """Contact speed over approach speed, and excursion, without noise, filter and delay."""
    law = schedule().sampled(control.VirtualDrag(drag=0.0, noise=0.0, smoothing_time=0.0))
    controller = control.Controller(
        period=period,
        conditioning=control.Conditioning(floor=1e-9),
        law=law,
        admittance=control.VirtualAdmittance(**ADMITTANCE),
    )
    scenario = pt.Scenario(
        admittance=pt.Admittance(**ADMITTANCE), obstacle=pt.Obstacle(position=DISTANCE, velocity=-SPEED)
    )
    run = pt.simulate(scenario, replace(SENSOR, scale=reflectance * SENSOR.scale), controller)
    return float(run.relative_velocity) / -SPEED, float(run.largest_excursion)


def largest_error(period: float, reflectance: float) -> float:
    """The largest possible error of Q.

    An impulse takes phi g^2 at the reading at the end of a period, and acts in the next one. So phi g^2/M is shifted
    by at most two periods of travel, and its integral changes by at most this shift times its total variation.
    """
    distance = np.linspace(DISTANCE, 0.0, 20_001)
    reading = SENSOR.log_output(distance) + np.log(reflectance)
    pull = schedule().drag_at(reading) * SENSOR.log_slope(distance) ** 2
    return 2 * SPEED * period * float(np.abs(np.diff(pull, prepend=0.0, append=0.0)).sum())


@pytest.mark.parametrize("which", [0, 40, -1])
def test_the_sampled_schedule_tends_to_the_predicted_one(which: int) -> None:
    predicted = schedule()
    reflectance = float(predicted.reflectance[which])
    errors = []
    for period in (8e-4, 1e-4):
        ratio, excursion = simulated(period, reflectance)
        limit = largest_error(period, reflectance)
        errors.append(abs(np.log(ratio / predicted.ratio[which])))
        assert errors[-1] <= limit
        # E = int (e^Q - 1) dl changes by at most dQ int e^Q dl
        assert abs(excursion - predicted.excursion[which]) <= np.expm1(limit) * (predicted.excursion[which] + DISTANCE)
    assert errors[1] <= errors[0] / 4  # first order: about an eighth


def test_the_schedule_is_followed_and_not_the_drag_that_carries_it() -> None:
    """The constant drag of the same ratio retreats farther from the brightest object, by a seventh."""
    predicted = schedule()
    _, excursion = simulated(1e-4, float(predicted.reflectance[-1]))
    assert excursion < 0.95 * predicted.constant.excursion


def test_a_law_made_of_a_schedule_is_a_value() -> None:
    drag = control.VirtualDrag(drag=0.0, noise=1.0)
    assert schedule().sampled(drag) == schedule().sampled(drag)
    assert schedule().sampled(drag) != schedule().sampled(replace(drag, noise=2.0))
