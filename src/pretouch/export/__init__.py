"""Export a verified control law: C source, parameters as JSON, a ROS 2 package, or co-simulation units (FMI)."""

from .c import export_c
from .export import Export
from .fmu import export_fmu
from .json import export_json
from .ros2 import export_ros2

__all__ = ["Export", "export_c", "export_fmu", "export_json", "export_ros2"]
