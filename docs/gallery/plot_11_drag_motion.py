"""
Damper and drag, the same object
================================

The distance over the time with the optimal damper, with the drag, and without mitigation.
"""

import numpy as np

import pretouch as pt
from pretouch.report import Curve, Panel, panel_figure

task = pt.load_scenario("../../examples/approach.toml")
drag = pt.design(task.replace(drag_effect=pt.DragEffect(ratio=0.15)))
gain = pt.design(task)
speeds = np.linspace(0.05, 0.8, 60)
many = pt.Scenario(admittance=task.scenario.admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-speeds))
share = {
    "damper for 0.3 m/s": pt.find_contact(many, task.sensor, gain.gain).contact,
    "drag": pt.find_contact(many, task.sensor, drag.drag, law="virtual-drag").contact,
}
figure = panel_figure(
    Panel(
        x_label="approach speed [m/s]",
        y_label="share of the speed that is left [%]",
        curves=[Curve(x=speeds, y=-100 * c.relative_velocity / speeds, label=n) for n, c in share.items()],
    ),
    columns=1,
)
