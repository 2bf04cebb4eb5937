"""A hand that is centered by the ratio of two sensor outputs touches with both fingers at the same time."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from pretouch.control import VirtualAdmittance
from pretouch.robots import Centering, RobotSimulation, SensorSite, SiteLaw, make_data, simulate_robot
from pretouch.robots.centering import centering_gain
from pretouch.simulation import SensorChain
from refusals import refused
from robot_scenes import ARM, CURVE, controller

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

GRIPPER = ARM.with_name("gripper.xml")
CENTERED = Centering(sites=("left", "right"), equal_reflectance=True)


def finger_laws(*, reflectance: float = 1.0, rate: float | None = None) -> list[SiteLaw]:
    """Both fingers close at 0.1 m/s; the object reflects `reflectance` times as much to the right finger."""
    law = replace(controller(-0.05, rate=rate), admittance=VirtualAdmittance(mass=0.2, damping=4.0, stiffness=25.0))
    chain = None if rate is None else SensorChain(rate=rate, random_phase=True, exposure=170e-6, delay=120e-6)
    curves = {"left": CURVE, "right": replace(CURVE, scale=reflectance * CURVE.scale)}
    return [
        SiteLaw(site=SensorSite(name, curve), controller=law, approach=0.1, chain=chain)
        for name, curve in curves.items()
    ]


def scene(offset: float, *, has_hand: bool = False):
    text = GRIPPER.read_text()
    if has_hand:
        joint = '<body name="palm"><joint name="hand" type="slide" axis="1 0 0" range="-0.1 0.1"/>'
        text = text.replace('<body name="palm">', joint)
        text = text.replace("<actuator>", '<actuator><motor joint="hand" ctrlrange="-60 60"/>')
    model = mujoco.MjModel.from_xml_string(text)
    data = make_data(model)
    data.qpos[model.jnt_qposadr[-1]] = offset
    mujoco.mj_forward(model, data)
    return model, data


def apart_and_pushed(result: RobotSimulation, place: int, run: int = 0) -> tuple[float, float]:
    """Time between both touches [s], and motion of the object until the second one [m]."""
    times = [result.simulated(site, "time")[run] for site in result.sites]
    trace = result.trace(run)
    second = int(np.searchsorted(trace.time, max(times)))
    return abs(times[0] - times[1]), abs(float(trace.configuration[second, place] - trace.configuration[0, place]))


@pytest.mark.slow
@pytest.mark.parametrize("has_hand", [False, True])
@pytest.mark.parametrize("offset", [0.01, -0.01, 0.003])
def test_both_fingers_touch_an_object_off_center_together(has_hand: bool, offset: float) -> None:
    model, data = scene(offset, has_hand=has_hand)
    place = int(model.jnt_qposadr[-1])
    apart, pushed = apart_and_pushed(simulate_robot(model, data, finger_laws(), centering=CENTERED), place)
    assert apart < 5e-3
    assert pushed < 1e-3
    if abs(offset) == 0.01:
        assert apart_and_pushed(simulate_robot(model, data, finger_laws()), place)[0] > 50e-3  # without centering


@pytest.mark.slow
def test_a_slow_sensor_centers_as_well() -> None:
    model, data = scene(0.01)
    result = simulate_robot(model, data, finger_laws(rate=250.0), centering=CENTERED, runs=3)
    for run in range(3):
        apart, pushed = apart_and_pushed(result, 2, run)
        assert apart < 5e-3
        assert pushed < 1e-3


@pytest.mark.slow
def test_unequal_reflectances_shift_the_hand() -> None:
    """At the first touch, ln 2 = ln xi(0) - ln xi(l): the other finger is still l_0 (2^(1/n) - 1) = 9.7 mm away."""
    model, data = scene(0.0)
    result = simulate_robot(model, data, finger_laws(reflectance=2.0), centering=CENTERED)
    apart, pushed = apart_and_pushed(result, 2)
    first = int(np.searchsorted(result.trace().time, result.simulated("left", "time")[0]))
    gap = CURVE.distance_offset * (2 ** (1 / CURVE.exponent) - 1)
    assert result.trace().distance[first, 1] == pytest.approx(
        gap, rel=0.15
    )  # the gap shrinks with the distance, and the hand lags by 1 mm
    assert apart > 0.05
    assert pushed > 5e-3
    with refused("equal_reflectance"):
        Centering(sites=("left", "right"))


@pytest.mark.parametrize("ratio", [0.0, 0.1, 1.0, 10.0])
def test_the_gain_keeps_a_margin_for_every_delay(ratio: float) -> None:
    """The deviation d obeys T d'' + d' + K d(t - tau) = 0, K = 2 k |g|. With K (T + tau) = 1/4, the gain margin is at
    least 2 pi: the loop is unstable from K = w sqrt(1 + (w T)^2) with atan(w T) + w tau = pi / 2.

    Without delay, both poles are at -1 / (2 T): critically damped. For the step, see the integration with overshoot.
    """
    filter_time = 5e-3
    delay = ratio * filter_time
    gain = centering_gain(replace(CENTERED, filter_time=filter_time), finger_laws(), 1e-3)
    steepest = CURVE.exponent / CURVE.distance_offset
    assert gain == pytest.approx(1 / (8 * steepest * (filter_time + 2e-3)), rel=1e-9)  # 2 ms from reading to motion
    rate = 1 / (4 * (filter_time + delay))
    if delay:
        w = brentq(lambda w: math.atan(w * filter_time) + w * delay - math.pi / 2, 1e-3, math.pi / 2 / delay)
        assert w * math.sqrt(1 + (w * filter_time) ** 2) / rate > 2 * math.pi * (1 - 1e-9)
    step = 1e-5
    past = round(delay / step)
    d = np.ones(past + 40000)
    velocity = 0.0
    for i in range(past, len(d) - 1):
        velocity += step * (-rate * d[i - past] - velocity) / filter_time
        d[i + 1] = d[i] + step * velocity
    assert d.min() > -1e-3  # no overshoot
    assert abs(d[-1]) < 1e-3 or ratio == 10.0


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"sites": ("left", "thumb")}, {"argument": "centering", "value": "thumb"}),
        ({"sites": ("left", "left")}, {"argument": "sites"}),
        ({"gain": -1.0}, {"argument": "gain", "value": -1.0}),
    ],
)
def test_mistakes_are_refused(change, fields: dict[str, Any]) -> None:
    model, data = scene(0.0)
    with refused(**fields):
        simulate_robot(model, data, finger_laws(), centering=replace(CENTERED, **change))


def test_fingers_side_by_side_are_refused() -> None:
    model = mujoco.MjModel.from_xml_string(GRIPPER.read_text().replace('euler="0 0 180"', ""))
    with refused("centering", value=0.0):
        simulate_robot(model, make_data(model), finger_laws(), centering=CENTERED)
