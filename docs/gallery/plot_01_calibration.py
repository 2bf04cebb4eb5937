"""
A calibration
=============

Fit sensor curves to readings, and show readings, log signal, slope and residuals.
"""

import pretouch as pt

report = pt.fit(pt.read_calibration("../../examples/sensor.csv"))
figure = pt.plots.calibration(report)
