"""
One fitted model
================

The fitted points, the curve and the residuals of one model.
"""

import pretouch as pt

report = pt.fit(pt.read_calibration("../../examples/sensor.csv"))
figure = pt.plots.sensor_fit(report.best)
