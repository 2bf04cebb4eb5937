"""
Gain and admittance together
============================

The objective over natural frequency and damping ratio, with the gain optimal everywhere.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/tradeoff.toml")
figure = pt.plots.admittance(pt.design(task))
