"""
A Pareto front
==============

Choices that cannot be improved in one quantity without a loss in the other.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/tradeoff.toml")
figure = pt.plots.pareto(pt.pareto(task))
