"""Provide short names for the functions that plot results, such as `plots.motion(design)`.

A function is imported when it is first used, because each one needs other parts of pretouch.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
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

_MODULES: Final = {
    "calibration_figures": ("calibration",),
    "candidate_figures": ("candidates",),
    "design_figures": ("sensitivity", "trade_off"),
    "drag_figures": ("drag",),
    "fit_figures": ("sensor_fit",),
    "motion_figures": ("motion", "sampled_motion"),
    "pareto_figures": ("admittance", "pareto"),
    "replay_figures": ("replay",),
    "robot_figures": ("robot", "workspace"),
    "robot_film": ("robot_film",),
    "robust_figures": ("outcome", "price", "robust"),
    "simulation_figures": ("simulation",),
    "sweep_figures": ("sweep",),
    "verdict_figures": ("verdict", "verdict_run"),
    "verdict_gains": ("verdict_gain", "verdict_stability"),
}
_MODULE_OF: Final = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a plot function when it is first used."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    function = getattr(import_module(f".{_MODULE_OF[name]}", __package__), name)
    globals()[name] = function
    return function


def __dir__() -> list[str]:
    return [*globals(), *_MODULE_OF]
