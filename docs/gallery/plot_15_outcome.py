"""
Outcomes of a robust gain
=========================

Distributions of contact speed and excursion over fresh encounters.
"""

from dataclasses import replace

import pretouch as pt

task = pt.load_scenario("../../examples/robust.toml")
task = task.replace(robust=replace(task.robust, samples=512, validation=512))
figure = pt.plots.outcome(pt.robust(task))
