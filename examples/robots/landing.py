"""Design a gain for a hopping leg and let the leg land: free fall is a known acceleration of the ground.

python examples/robots/landing.py
"""

from __future__ import annotations

from pathlib import Path

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
DISTANCE, SPEED, GRAVITY = 0.0422, 0.7, 9.81  # the sole detects the ground at 42.2 mm, while the leg falls at 0.7 m/s


def main() -> pt.robots.RobotSimulation:
    """Project the leg, design the gain, and simulate the landing."""
    model = pt.robots.load_model(Path(__file__).with_name("leg.xml"))
    data = pt.robots.make_data(model, keyframe="crouched")
    site = pt.robots.SensorSite("sole", SENSOR)
    projection = pt.robots.project_site(model, data, site, joint_speeds=dict.fromkeys(("hip", "knee", "ankle"), 20.0))
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=DISTANCE, velocity=-SPEED, acceleration=-GRAVITY),
    )
    objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    task = projection.task(scenario, objective, bounds=(-10.0, -0.01))  # the workspace of the leg limits the excursion
    design = pt.design(task)
    print(design)

    data = pt.robots.make_data(model, keyframe="crouched")
    data.qpos[0] -= data.site("sole").xpos[2] - DISTANCE
    data.qvel[0] = -SPEED
    controller = Controller(
        period=1e-3,
        conditioning=Conditioning(floor=1e-6),
        law=VirtualDamper(gain=design.gain),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    law = pt.robots.SiteLaw(site=site, controller=controller)
    landing = pt.robots.simulate_robot(model, data, [law])
    print(landing)
    return landing


if __name__ == "__main__":
    main()
