"""Solve encounters or find optimal gains over a grid of inputs, in parallel and with the option to resume."""

from .axes import Axes, Axis
from .executors import Progress
from .run import sweep

__all__ = ["Axes", "Axis", "Progress", "sweep"]
