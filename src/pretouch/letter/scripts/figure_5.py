"""Figure 5: the relative velocity until contact, D_p = -1 N s, by three ways to solve the motion."""

import pretouch as pt

scenario = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
power = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
first = pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)
second = pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)
motions = {
    "inverse power, integrated": pt.solve_motion(scenario, power, -1.0),
    "first order, closed form L(10)": pt.solve_motion(scenario, first, -1.0),
    "second order, uniform motion L(16)": pt.solve_motion(scenario, second, -1.0, method="uniform-motion"),
}
reduction = {name: 1 - m.relative_velocity[-1] / scenario.obstacle.velocity for name, m in motions.items()}
curves = [pt.Curve(x=m.time, y=m.relative_velocity, label=name, end="contact") for name, m in motions.items()]
panel = pt.Panel(
    x_label="time t [s]", y_label="relative velocity l′ [m/s]", curves=curves, levels={"without mitigation": -0.3}
)
figure = pt.panel_figure(panel)
