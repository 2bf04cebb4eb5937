"""One gain for all speeds: what it costs beside the best gain for each speed."""

import numpy as np

import pretouch as pt

sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
admittance, speeds = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0), np.arange(1, 101) / 100
f_1 = pt.excursion_objective(position_scale=0.5, velocity_scale="obstacle speed")
encounters = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-speeds))
designs = pt.design_gain(encounters, sensor, f_1, bounds=(-20.0, -0.01))
candidates = -np.geomspace(0.5, 5.0, 500)
contact = pt.find_contact(encounters, sensor, candidates[:, None]).contact
losses = f_1.value(contact, speeds) / designs.objective - 1
ranges = {"one gain for all speeds": speeds > 0, "one gain from 0.2 m/s on": speeds >= 0.2}
best = {name: losses[:, part].max(axis=1).argmin() for name, part in ranges.items()}
left = {name: -contact.relative_velocity[i] for name, i in best.items()}
left["best gain for each speed"] = -pt.find_contact(encounters, sensor, designs.gain).contact.relative_velocity
curves = [pt.Curve(x=speeds, y=100 * losses[i], label=name) for name, i in best.items()]
contacts = [pt.Curve(x=speeds, y=y, label=name) for name, y in left.items()]
panels = {"loss in f₁ [%]": curves, "speed at contact [m/s]": contacts}
x_label = "obstacle speed [m/s]"
figure = pt.panel_figure(*[pt.Panel(x_label=x_label, y_label=y, curves=c) for y, c in panels.items()])
