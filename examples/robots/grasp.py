"""Close a gripper with two fingers around an object that is off center, with and without centering.

python examples/robots/grasp.py
"""

from __future__ import annotations

from pathlib import Path

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
FINGERS = ("left", "right")


def main() -> tuple[pt.robots.RobotSimulation, pt.robots.RobotSimulation]:
    """Simulate both grasps at 0.1 m/s, and print when each finger touches and how far the object is pushed."""
    model = pt.robots.load_model(Path(__file__).with_name("gripper.xml"))  # the object is 10 mm off center
    controller = Controller(
        period=1e-3,
        conditioning=Conditioning(floor=1e-6),
        law=VirtualDamper(gain=-0.05),
        admittance=VirtualAdmittance(mass=0.2, damping=4.0, stiffness=25.0),
    )
    laws = [
        pt.robots.SiteLaw(site=pt.robots.SensorSite(name, SENSOR), controller=controller, approach=0.1)
        for name in FINGERS
    ]
    centering = pt.robots.Centering(sites=FINGERS, equal_reflectance=True)
    plain, centered = (
        pt.robots.simulate_robot(model, pt.robots.make_data(model), laws, centering=law) for law in (None, centering)
    )
    place = model.jnt_qposadr[model.body("object").jntadr[0]]
    for title, result in (("without centering", plain), ("with centering", centered)):
        times = [float(result.simulated(name, "time")[0]) for name in FINGERS]
        trace = result.trace()
        path = trace.configuration[trace.time <= max(times), place]
        print(
            f"{title}: {result.order()[0]} touches first, {1e3 * abs(times[0] - times[1]):.3g} ms before the other "
            f"finger, and the object is pushed by {1e3 * abs(path - path[0]).max():.2g} mm"
        )
    return plain, centered


if __name__ == "__main__":
    main()
