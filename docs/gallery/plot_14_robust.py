"""
One gain for uncertain inputs
=============================

The risk measure over the gain, compared with the nominal design.
"""

from dataclasses import replace

import pretouch as pt

task = pt.load_scenario("../../examples/robust.toml")
task = task.replace(robust=replace(task.robust, samples=512, validation=512))
figure = pt.plots.robust(pt.robust(task))
