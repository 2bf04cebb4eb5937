"""Project a robot model in MuJoCo to the axis of a sensor, so that a gain can be designed for the robot."""

from .drives import AxisLimits
from .model import load_model, make_data
from .path import Excursion
from .projection import Projection, project
from .site import SensorSite
from .table import ProjectionTable, project_all

__all__ = [
    "AxisLimits",
    "Excursion",
    "Projection",
    "ProjectionTable",
    "SensorSite",
    "load_model",
    "make_data",
    "project",
    "project_all",
]
