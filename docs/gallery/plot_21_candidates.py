"""
Which sensor should I buy?
==========================

The eight built-in sensor parts in the same encounter with a virtual drag.
"""

import pretouch as pt
from pretouch.config.parts import load_with_parts
from pretouch.verification import compare

tasks = load_with_parts("../../examples/drag.toml")
figure = pt.plots.candidates(compare(tasks, runs=100))
