"""Table I: both exponential curves by least squares on xi, fitted to the inverse power curve over 0 to 42.2 mm."""

import numpy as np
from scipy.optimize import curve_fit

import pretouch as pt

power = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
distance = np.linspace(0.0, 0.0422, 2001)
output = power.output(distance)
(a_1, c_1), _ = curve_fit(lambda l, a, c: a * np.exp(c * l), distance, output, p0=(0.5, -60.0))
(a_2, c_2, b_2), _ = curve_fit(lambda l, a, c, b: a * np.exp(b * l**2 + c * l), distance, output, p0=(0.5, -60.0, 0.0))
fitted = {
    "first order": pt.ExponentialFirstOrder(scale=a_1, rate=c_1),
    "second order": pt.ExponentialSecondOrder(scale=a_2, rate=c_2, curvature=b_2),
}
errors = {name: sensor.output(distance) - output for name, sensor in fitted.items()}
r_squared = {name: 1 - np.sum(e**2) / np.sum((output - output.mean()) ** 2) for name, e in errors.items()}
curves = [pt.Curve(x=1e3 * distance, y=1e3 * e, label=n, style=i) for i, (n, e) in enumerate(errors.items(), start=1)]
panel = pt.Panel(
    x_label="distance l [mm]", y_label="fitted output less inverse power [mV]", curves=curves, levels={"exact": 0.0}
)
figure = pt.panel_figure(panel)
