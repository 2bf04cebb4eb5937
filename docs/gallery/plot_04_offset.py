"""
What a wrong offset does
========================

The slope of ln(ξ + e) for offsets that are wrong by e.
"""

import numpy as np

import pretouch as pt
from pretouch.report import Curve, Panel, panel_figure

curve = pt.InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
l = np.linspace(0.0, 0.1, 200)
xi, g = curve.output(l), curve.log_slope(l)
figure = panel_figure(
    Panel(
        x_label="distance l [mm]",
        y_label="slope that the controller sees [1/m]",
        curves=[Curve(x=1e3 * l, y=g * xi / (xi + e), label=f"wrong by {e} counts") for e in (0, 50, 150, 500)],
    ),
    columns=1,
)
