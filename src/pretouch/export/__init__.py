"""Export a verified control law to a robot: C source and other formats."""

from .c import export_c
from .export import Export

__all__ = ["Export", "export_c"]
