"""
A calibration
=============

Fit sensor curves to readings, and show readings, log signal, slope and residuals.
"""

import pretouch as pt

report = pt.rank_models(pt.read_calibration("../../examples/sensor.csv"))
figure = pt.plots.calibration(report)
