"""One search: a scan that resolves a function, a zoom into each of its minima, and what certifies them.

`search_axis` is the engine along one coordinate. Compiled code takes the problems that it knows (`compiled`, `family`);
arrays of others are scanned side by side (`many`). Over several coordinates, `Trials` on a cube are searched from a
grid by local steps (`local`); `box_maximum` certifies the largest value on a box.
"""

from .minima import Minimum, refine, search_axis
from .scan import EXACT, HELD, RUNS, SAMPLED, Effort, GainAxis, Landscape, Scan, scan

__all__ = [
    "EXACT",
    "HELD",
    "RUNS",
    "SAMPLED",
    "Effort",
    "GainAxis",
    "Landscape",
    "Minimum",
    "Scan",
    "refine",
    "scan",
    "search_axis",
]
