"""Section VI-B: limits on the range of motion and on the relative velocity as inequality constraints."""

import numpy as np

import pretouch as pt

admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
scenario = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
f_1 = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
limits = np.linspace(0.05, 0.13, 41)
excursions = [pt.Constraint(name="excursion", limit=limit) for limit in limits]
velocity = pt.Constraint(name="relative_velocity", limit=0.09)
cases = {"range of motion limited": [], "relative velocity, too": [velocity]}
gains, speeds = {}, {}
for name, more in cases.items():
    designs = [pt.design_gain(scenario, sensor, f_1, bounds=(-10, -0.01), constraints=[e, *more]) for e in excursions]
    gains[name] = [d.gain or np.nan for d in designs]
    speeds[name] = [-d.result.contact.relative_velocity if d.result else np.nan for d in designs]
panels = {"optimal gain D_p [N s]": (gains, {}), "speed at contact [m/s]": (speeds, {"limit of the velocity": 0.09})}
curves = [[pt.Curve(x=1e3 * limits, y=y, label=n) for n, y in values.items()] for values, _ in panels.values()]
labels = {"x_label": "largest excursion allowed [mm]"}
drawn = [pt.Panel(y_label=y, curves=c, levels=p[1], **labels) for c, (y, p) in zip(curves, panels.items())]
figure = pt.panel_figure(*drawn)
