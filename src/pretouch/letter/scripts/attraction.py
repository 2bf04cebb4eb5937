"""Section VI-A: orbits around the uniform motion l = A t + B are drawn to it, but slower than contact comes."""

import numpy as np

import pretouch as pt

admittance, gain = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0), -1.0
obstacle = pt.Obstacle(position=0.0422, velocity=-0.3)
sensor = pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)
own = pt.Scenario(admittance=admittance, obstacle=obstacle)
uniform = pt.solve_motion(own, sensor, gain, method="uniform-motion")
a, b = uniform.relative_velocity[0], uniform.distance[0]
starts, speeds = (grid.ravel() for grid in np.meshgrid(np.linspace(0.02, 0.075, 7), [-0.3, a, 0.1]))
plants = pt.Plant(position=obstacle.position - starts, velocity=obstacle.velocity - speeds)
around = pt.solve_motion(pt.Scenario(admittance=admittance, obstacle=obstacle, plant=plants), sensor, gain, samples=80)
letter = pt.solve_motion(own, sensor, gain)
curves = [pt.Curve(x=1e3 * l, y=v, quiet=True) for l, v in zip(around.distance, around.relative_velocity)]
named = {"from the letter's start": letter, "uniform motion": uniform}
curves += [pt.Curve(x=1e3 * m.distance, y=m.relative_velocity, label=n, end="contact") for n, m in named.items()]
apart = [pt.Curve(x=t, y=1e3 * (l - a * t - b), quiet=True) for t, l in zip(around.time, around.distance)]
apart += [pt.Curve(x=m.time, y=1e3 * (m.distance - a * m.time - b), label=n) for n, m in named.items()]
figure = pt.panel_figure(
    pt.Panel(x_label="distance l [mm]", y_label="relative velocity l′ [m/s]", curves=curves),
    pt.Panel(x_label="time t [s]", y_label="distance from the uniform motion [mm]", curves=apart),
)
