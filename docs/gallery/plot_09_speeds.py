"""
The damper over the approach speed
==================================

Contact speed and retreat of one gain for slow and fast objects.
"""

import numpy as np

import pretouch as pt
from pretouch.report import Curve, Panel, panel_figure

task = pt.load_scenario("../../examples/approach.toml")
v = np.linspace(0.05, 1.0, 80)
many = pt.Scenario(admittance=task.scenario.admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-v))
panels = []
for name, pick in (("contact speed [m/s]", "relative_velocity"), ("retreat [m]", "displacement")):
    curves = []
    for gain in (-0.3, -0.75, -1.5):
        contact = pt.find_contact(many, task.sensor, gain).contact
        curves.append(Curve(x=v, y=-getattr(contact, pick), label=f"{gain} N s"))
    panels.append(Panel(x_label="approach speed [m/s]", y_label=name, curves=curves))
figure = panel_figure(*panels, columns=2)
