"""Section VI-B: the peak force of the impact in place of the speed, where mass and stiffness are known."""

import numpy as np

import pretouch as pt

admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
scenario = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
impacts = {
    "linear spring": pt.SpringImpact(robot_mass=1.0, stiffness=62.7**2),
    "sphere by Hertz's law": pt.HertzImpact(robot_mass=1.0, effective_modulus=1e6, radius=0.01),
}
gains, excursion = -np.geomspace(0.05, 10.0, 200), pt.Term(quantity="displacement", scale=0.5)
speeds = pt.find_contact(scenario, sensor, gains).contact.relative_velocity
designs, curves, marks = {}, [], []
for name, impact in impacts.items():
    force = pt.Term(quantity="impact_force", scale=impact.peak_force(0.3))
    goal = pt.Objective(terms=(excursion, force))
    found = designs[name] = pt.design_gain(scenario, sensor, goal, bounds=(-10.0, -0.01), impact=impact)
    curves.append(pt.Curve(x=-gains, y=impact.peak_force(speeds), label=name))
    least = impact.peak_force(found.result.contact.relative_velocity)
    marks.append(pt.Mark(x=-found.gain, y=least, label=f"optimum {found.gain:.3f} N s", shape="ring"))
labels = {"x_label": "gain −D_p [N s]", "y_label": "peak force [N]", "x_log": True}
figure = pt.panel_figure(pt.Panel(curves=curves, marks=marks, **labels))
