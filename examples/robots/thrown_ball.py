"""Design a gain for a planar arm that meets a thrown ball, and simulate the whole arm.

python examples/robots/thrown_ball.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
DISTANCE, SPEED, GRAVITY = 0.0422, 2.0, 9.81  # the fingertip detects the ball at 42.2 mm
FLIGHT = 0.2  # s from the throw to the detection
RADIUS = 0.035  # m, of the ball


def main() -> pt.robots.RobotSimulation:
    """Project the arm, design the gain, throw the ball, and print the simulated contact next to its prediction."""
    model = pt.robots.load_model(Path(__file__).with_name("thrown_ball.xml"))
    data = pt.robots.make_data(model, keyframe="arm-bent")
    site = pt.robots.SensorSite("arm-fingertip", SENSOR, field_of_view="8 deg")
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=DISTANCE, velocity=-SPEED),
    )
    objective = pt.excursion_objective(position_scale=0.2, velocity_scale=1.0)
    projection = pt.robots.project_site(model, data, site)
    design = pt.design(projection.task(scenario, objective, bounds=(-10.0, -0.01)))
    contact = design.result.contact
    print(f"D_p = {design.gain:.3g} N s, predicted contact at {abs(contact.relative_velocity):.3g} m/s")

    # the fingertip points along x; the ball is at the top of its path halfway between detection and contact
    rise, flown = FLIGHT + contact.time / 2, SPEED * FLIGHT
    ball = model.body("ball").jntadr[0]
    place, speed = model.jnt_qposadr[ball], model.jnt_dofadr[ball]
    start = np.array([DISTANCE + RADIUS + flown, 0.0, -GRAVITY * rise**2 / 2])  # from the fingertip
    data.qpos[place : place + 3] = data.site(site.name).xpos + start
    data.qvel[speed : speed + 3] = -SPEED, 0.0, GRAVITY * rise
    controller = Controller(
        period=1e-3,
        conditioning=Conditioning(floor=float(SENSOR.output(DISTANCE))),
        law=VirtualDamper(gain=design.gain),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    law = pt.robots.SiteLaw(site=site, controller=controller)
    result = pt.robots.simulate_robot(model, data, [law], horizon=1.0)
    print(result)
    return result


if __name__ == "__main__":
    main()
