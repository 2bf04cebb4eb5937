"""Table II: the objective f_1 of L(20) over the whole range of gains, with the gains of the table on it."""

import numpy as np

import pretouch as pt

scenario = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
design = pt.design_gain(scenario, sensor, objective, bounds=(-10.0, -0.01))
gains, tabulated = -np.geomspace(0.01, 10.0, 400), np.array([-0.1, -0.6, -0.7, -0.8, -0.9, -1.0, -10.0])
terms = objective.parts(pt.find_contact(scenario, sensor, gains).contact, 0.3)
values = objective.value(pt.find_contact(scenario, sensor, tabulated).contact, 0.3)
names = {"position term (x / 0.5 m)²": "displacement", "velocity term (l′ / 0.3 m/s)²": "relative_velocity"}
curves = [pt.Curve(x=-gains, y=sum(terms.values()))]
curves += [pt.Curve(x=-gains, y=terms[quantity], label=name) for name, quantity in names.items()]
curves += [pt.Curve(x=-tabulated, y=values, label="f₁, gains of Table II", kind="points", style=0)]
best = pt.Mark(x=-design.gain, y=design.objective, label=f"optimum {design.gain:.4f} N s", shape="ring")
labels = {"x_label": "virtual force gain −D_p [N s]", "y_label": "objective f₁ and its terms [1]"}
panel = pt.Panel(curves=curves, marks=[best], x_log=True, y_log=True, y_limits=(1e-3, 3.0), **labels)
figure = pt.panel_figure(panel)
