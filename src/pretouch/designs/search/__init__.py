"""Search for the globally optimal gain and other parameters.

`search_axis` scans one coordinate, looks for feasible bands between infeasible coordinates (`bands`), and refines each
minimum. Compiled code solves the problems that it supports
(`compiled`), and families of encounters that differ in one input are interpolated (`family`); arrays of other
encounters are scanned together (`many`). Over several free parameters, `local` searches from a grid of `Trials`.
`box_maximum` computes a certified maximum on a box.
"""

from .gain_axis import GainAxis
from .landscape import HELD, Landscape
from .minima import Minimum, refine, scan_feasible, search_axis
from .scan import MEASURED, RUNS, SAMPLED, Effort, Scan, scan

__all__ = [
    "HELD",
    "MEASURED",
    "RUNS",
    "SAMPLED",
    "Effort",
    "GainAxis",
    "Landscape",
    "Minimum",
    "Scan",
    "refine",
    "scan",
    "scan_feasible",
    "search_axis",
]
