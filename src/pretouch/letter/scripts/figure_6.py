"""Figure 6: the optimal gain over the obstacle's speed, for both readings of the typical velocity l'_typ."""

import numpy as np

import pretouch as pt

models = {
    "inverse power": (pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32), "integration"),
    "first order": (pt.ExponentialFirstOrder(scale=0.458, rate=-61.0), "closed-form"),
    "second order": (pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0), "uniform-motion"),
}
admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
speeds = np.arange(1, 101) / 100
encounters = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-speeds))
gains = {}
for scale in ("obstacle speed", 0.3):
    f_1 = pt.excursion_objective(position_scale=0.5, velocity_scale=scale)
    for name, (sensor, way) in models.items():
        designs = pt.design_gain(encounters, sensor, f_1, bounds=(-20.0, -0.01), method=way)
        gains[scale, name] = designs.gain
labels = {"x_label": "obstacle speed [m/s]", "y_label": "optimal gain −D_p [N s]", "y_log": True}
titles = {"obstacle speed": "l′_typ follows the obstacle", 0.3: "l′_typ fixed at 0.3 m/s"}
curves = {scale: [pt.Curve(x=speeds, y=-gains[scale, name], label=name) for name in models] for scale in titles}
figure = pt.panel_figure(*[pt.Panel(curves=curves[scale], title=title, **labels) for scale, title in titles.items()])
