"""Solve encounters or optimize gains on a grid of inputs.

The computation is parallel, and interrupted runs can be resumed.
"""

from .axes import Axes, Axis
from .executors import Progress
from .run import sweep

__all__ = ["Axes", "Axis", "Progress", "sweep"]
