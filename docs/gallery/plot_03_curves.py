"""
Sensor curves and their slopes
==============================

Four families of curves through the same two readings have different slopes.
"""

import numpy as np

import pretouch as pt
from pretouch.report import Curve, Panel, panel_figure

l = np.linspace(0.0, 0.05, 200)
curves = {
    "inverse power": pt.InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32),
    "exponential": pt.ExponentialFirstOrder(scale=0.488, rate=-55.0),
    "exponential, second order": pt.ExponentialSecondOrder(scale=0.488, rate=-75.0, curvature=400.0),
    "Mittag-Leffler": pt.MittagLeffler(scale=0.488, rate=-80.0, order=0.85),
}
figure = panel_figure(
    Panel(
        x_label="distance l [mm]",
        y_label="sensor output ξ [V]",
        curves=[Curve(x=1e3 * l, y=c.output(l), label=name) for name, c in curves.items()],
        y_log=True,
    ),
    Panel(
        x_label="distance l [mm]",
        y_label="slope g [1/m]",
        curves=[Curve(x=1e3 * l, y=c.log_slope(l), label=name) for name, c in curves.items()],
    ),
    columns=2,
)
