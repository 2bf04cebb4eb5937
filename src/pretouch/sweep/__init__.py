"""Sweeps: contacts and designs over grids of inputs, as datasets; on one machine or on many, resumable."""

from .axes import Axes, Axis
from .executors import Progress
from .run import sweep

__all__ = ["Axes", "Axis", "Progress", "sweep"]
