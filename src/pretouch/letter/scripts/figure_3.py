"""Figure 3: the three curves of Table I over the distance, and their slopes g, which are what the motion feels."""

import numpy as np

import pretouch as pt

sensors = {
    "inverse power L(3)": pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "first order L(5)": pt.ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "second order L(6)": pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
}
distance = np.linspace(0.0, 0.0422, 200)
x, x_label = 1e3 * distance, "distance l [mm]"
outputs = [pt.Curve(x=x, y=sensor.output(distance), label=name) for name, sensor in sensors.items()]
slopes = [pt.Curve(x=x, y=sensor.log_slope(distance), label=name) for name, sensor in sensors.items()]
figure = pt.panel_figure(
    pt.Panel(x_label=x_label, y_label="sensor output ξ [V]", curves=outputs),
    pt.Panel(x_label=x_label, y_label="slope g = d ln ξ / dl [1/m]", curves=slopes),
)
