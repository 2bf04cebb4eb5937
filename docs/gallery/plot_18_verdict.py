"""
Does the gain hold?
===================

Distributions over simulated runs, with the limits and the required shares.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/loop.toml")
figure = pt.plots.verdict(pt.verify(task.replace(gain=-0.86), changes=False))
