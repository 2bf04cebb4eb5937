"""Table III: contact times and impact forces measured on hardware beside the model's contact times and speeds."""

import numpy as np
from scipy.stats import t

import pretouch as pt

admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
obstacle, plant = pt.Obstacle(position=-0.035), pt.Plant(position=-0.1)
scenario = pt.Scenario(admittance=admittance, obstacle=obstacle, plant=plant)
sensor = pt.ExponentialFirstOrder(scale=1.25, rate=-63.46)
gains = np.array([-0.1, -0.5, -0.6, -0.7, -1.0, -10.0])
time, force = np.array([0.94, 2.24, 2.61, 2.76, 3.52, 38.9]), np.array([3.65, 1.82, 1.00, 0.89, 0.80])
contact = pt.find_contact(scenario, sensor, gains).contact
speed = -contact.relative_velocity[:5]
slope = speed @ force / (speed @ speed)
error = np.sqrt(np.sum((force - slope * speed) ** 2) / 4 / (speed @ speed))
interval = slope + np.array([-1, 1]) * t.ppf(0.975, df=4) * error
x = np.linspace(0.0, 0.065, 60)
line = pt.Curve(x=x, y=slope * x, low=interval[0] * x, high=interval[1] * x, label=f"{slope:.1f} N s/m × speed")
points = pt.Curve(x=speed, y=force, label="measured", kind="points")
times = [pt.Curve(x=-gains, y=y, label=n, kind="both") for n, y in {"model": contact.time, "measured": time}.items()]
force_panel = pt.Panel(x_label="model speed at contact [m/s]", y_label="impact force [N]", curves=[line, points])
labels = {"x_label": "gain −D_p [N s]", "y_label": "time of contact [s]"}
figure = pt.panel_figure(force_panel, pt.Panel(curves=times, x_log=True, y_log=True, **labels))
