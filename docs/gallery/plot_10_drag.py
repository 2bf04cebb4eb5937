"""
The virtual drag
================

One drag and the optimal damper over the approach speed.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/approach.toml")
drag = pt.design(task.replace(drag_effect=pt.DragEffect(ratio=0.15)))
figure = pt.plots.drag(drag)
