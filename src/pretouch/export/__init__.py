"""Export a verified control law to a robot: C source and other formats."""

from .c import export_c
from .export import Export
from .json import export_json

__all__ = ["Export", "export_c", "export_json"]
