"""
How fast must the sensor be?
============================

The strongest stable gain over the sensor rate.
"""

import numpy as np

import pretouch as pt
from pretouch.report import Curve, Panel, panel_figure
from pretouch.simulation import LoopTiming, gain_limit

task = pt.load_scenario("../../examples/approach.toml")
rates = np.geomspace(20.0, 1000.0, 30)
limits = [
    -gain_limit(task.sensor, task.scenario.admittance, LoopTiming(rate=rate), distance=0.0).strongest for rate in rates
]
figure = panel_figure(
    Panel(
        x_label="sensor rate [Hz]",
        y_label="strongest stable gain, |D_p| [N s]",
        curves=[Curve(x=rates, y=limits)],
        levels={"optimal gain": 0.746},
        x_log=True,
        y_log=True,
    ),
    columns=1,
)
