"""
A motion that you solve
=======================

The motion with a gain of your choice.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/approach.toml")
motion = pt.solve_motion(task.scenario, task.sensor, -0.5)
figure = pt.plots.sampled_motion(motion)
