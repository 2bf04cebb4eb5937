"""
Two runs of a verification
==========================

A fast and a slow contact among the runs, and the prediction.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/loop.toml")
figure = pt.plots.verdict_run(pt.verify(task.replace(gain=-0.86), changes=False))
