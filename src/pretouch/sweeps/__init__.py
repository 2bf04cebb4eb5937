"""Solve encounters or find optimal gains on a grid of input values, in parallel; interrupted runs can be resumed."""

from .axes import Axes, Axis
from .executors import Progress
from .run import sweep

__all__ = ["Axes", "Axis", "Progress", "sweep"]
