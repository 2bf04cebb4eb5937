"""Export a verified control law for robots and co-simulation.

The targets are C source, JSON parameters, a ROS 2 package and co-simulation units (FMI).
"""

from .result import Export
from .targets import TARGETS, export

__all__ = ["TARGETS", "Export", "export"]
