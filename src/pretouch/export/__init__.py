"""Export a verified control law to a robot: C source or a ROS 2 package."""

from .c import export_c
from .export import Export
from .json import export_json
from .ros2 import export_ros2

__all__ = ["Export", "export_c", "export_json", "export_ros2"]
