"""
The trade-off of the gain
=========================

Excursion and contact speed over the gain, with the optimum and the limits.
"""

import pretouch as pt

task = pt.load_scenario("../../examples/approach.toml")
figure = pt.plots.trade_off(pt.design(task))
