"""Export a verified control law for robots and co-simulation.

The targets are C source, JSON parameters, a ROS 2 package and co-simulation units (FMI).
"""

from .export import Export
from .targets import TARGETS, export_law

__all__ = ["TARGETS", "Export", "export_law"]
