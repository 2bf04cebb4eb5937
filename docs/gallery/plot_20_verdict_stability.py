"""
Stability over the distance
===========================

The strongest stable gain of the loop at each distance.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/loop.toml")
figure = pt.plots.verdict_stability(pt.verify(task.replace(gain=-0.86), changes=False))
