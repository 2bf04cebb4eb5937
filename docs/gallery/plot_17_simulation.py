"""
One encounter on the sampled loop
=================================

Readings, force, motion and contact of one simulated run.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/loop.toml")
figure = pt.plots.simulation(pt.simulate(task.replace(gain=-0.86)))
