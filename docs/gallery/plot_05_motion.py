"""
The motion until contact
========================

Distance, position, relative velocity and virtual force with the optimal gain and without.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/approach.toml")
figure = pt.plots.motion(pt.design(task))
