"""Parameter sweeps: contacts or designs over grids of inputs, as datasets; parallel, distributed and resumable."""

from .axes import Axes, Axis
from .executors import Progress
from .run import sweep

__all__ = ["Axes", "Axis", "Progress", "sweep"]
