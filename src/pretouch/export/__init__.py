"""Export a verified control law as C source, JSON parameters, a ROS 2 package, or co-simulation units (FMI)."""

from .export import Export
from .targets import TARGETS, export_law

__all__ = ["TARGETS", "Export", "export_law"]
