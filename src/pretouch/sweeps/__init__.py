"""Compute contacts or designs over grids of inputs; sweeps run in parallel, resume, and return datasets."""

from .axes import Axes, Axis
from .executors import Progress
from .run import sweep

__all__ = ["Axes", "Axis", "Progress", "sweep"]
