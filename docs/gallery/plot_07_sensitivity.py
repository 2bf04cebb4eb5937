"""
Which input matters
===================

Relative change of the optimal gain for one percent of each input.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/approach.toml")
figure = pt.plots.sensitivity(pt.design(task))
