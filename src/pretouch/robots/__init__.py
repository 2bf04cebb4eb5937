"""Compute limits of MuJoCo robots, and simulate their encounters with objects."""

from .centering import Centering
from .drives import AxisLimits
from .encounter import simulate_robot
from .model import make_data
from .path import Excursion
from .projection import Projection, project_site
from .result import BodyContact, RobotSimulation, RobotTrace, SiteContact
from .robot_file import RobotFile, SiteOnBody, load_model, site_on_body
from .site import SensorSite
from .site_law import SiteLaw
from .sweep import sweep_robot
from .table import ProjectionTable, project
from .tracking import ComputedTorque, OperationalSpace, PositionControl, Tracking
from .viewer import view_robot
from .workspace import Workspace, project_workspace, random_postures

__all__ = [
    "AxisLimits",
    "BodyContact",
    "Centering",
    "ComputedTorque",
    "Excursion",
    "OperationalSpace",
    "PositionControl",
    "Projection",
    "ProjectionTable",
    "RobotFile",
    "RobotSimulation",
    "RobotTrace",
    "SensorSite",
    "SiteContact",
    "SiteLaw",
    "SiteOnBody",
    "Tracking",
    "Workspace",
    "load_model",
    "make_data",
    "project",
    "project_site",
    "project_workspace",
    "random_postures",
    "simulate_robot",
    "site_on_body",
    "sweep_robot",
    "view_robot",
]
