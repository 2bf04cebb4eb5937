"""
A map of optimal gains
======================

The optimal gain over speed and distance.
"""

import numpy as np

import pretouch as pt

task = pt.load_scenario("../../examples/approach.toml")
grid = pt.sweep(
    task,
    {"obstacle.velocity": np.linspace(-0.6, -0.1, 16), "obstacle.position": np.linspace(0.03, 0.06, 12)},
)
figure = pt.plots.sweep(grid)
