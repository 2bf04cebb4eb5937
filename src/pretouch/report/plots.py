"""Provide short names for the functions that plot results, such as `plots.motion(design)`."""

from .calibration_figures import calibration
from .candidate_figures import candidates
from .design_figures import sensitivity, trade_off
from .drag_figures import drag
from .fit_figures import sensor_fit
from .motion_figures import motion, sampled_motion
from .pareto_figures import admittance, pareto
from .replay_figures import replay
from .robot_figures import robot, workspace
from .robot_film import robot_film
from .robust_figures import outcome, price, robust
from .simulation_figures import simulation
from .sweep_figures import sweep
from .verdict_figures import verdict, verdict_run
from .verdict_gains import verdict_gain, verdict_stability

__all__ = [
    "admittance",
    "calibration",
    "candidates",
    "drag",
    "motion",
    "outcome",
    "pareto",
    "price",
    "replay",
    "robot",
    "robot_film",
    "robust",
    "sampled_motion",
    "sensitivity",
    "sensor_fit",
    "simulation",
    "sweep",
    "trade_off",
    "verdict",
    "verdict_gain",
    "verdict_run",
    "verdict_stability",
    "workspace",
]
