"""Figures and self-contained HTML reports; Matplotlib and Jinja are loaded when something is drawn or written."""

from .calibration_figures import calibration_figure
from .design_figures import motion_figure, sensitivity_figure, trade_off_figure
from .html import report_html, write_report
from .panels import Curve, Mark, Panel, panel_figure
from .pareto_figures import admittance_figure, pareto_figure
from .robust_figures import outcome_figure, price_figure, robust_figure
from .simulation_figures import simulation_figure
from .sweep_figures import sweep_figure
from .verdict_figures import verdict_figure, verdict_run_figure
from .verdict_gains import verdict_gain_figure, verdict_stability_figure

__all__ = [
    "Curve",
    "Mark",
    "Panel",
    "admittance_figure",
    "calibration_figure",
    "motion_figure",
    "outcome_figure",
    "panel_figure",
    "pareto_figure",
    "price_figure",
    "report_html",
    "robust_figure",
    "sensitivity_figure",
    "simulation_figure",
    "simulation_report_html",
    "sweep_figure",
    "trade_off_figure",
    "verdict_figure",
    "verdict_gain_figure",
    "verdict_report_html",
    "verdict_run_figure",
    "verdict_stability_figure",
    "write_report",
    "write_simulation_report",
    "write_verdict_report",
]
