"""Figures and self-contained HTML reports; Matplotlib and Jinja are loaded when something is drawn or written."""

from .calibration_figures import calibration_figure
from .design_figures import motion_figure, sensitivity_figure, trade_off_figure
from .html import design_report_html, fit_report_html, write_design_report, write_fit_report
from .panels import Curve, Mark, Panel, panel_figure
from .pareto_figures import admittance_figure, pareto_figure
from .pareto_report import pareto_report_html, write_pareto_report
from .robust_figures import outcome_figure, price_figure, robust_figure
from .robust_html import robust_report_html, write_robust_report
from .sweep_figures import sweep_figure

__all__ = [
    "Curve",
    "Mark",
    "Panel",
    "admittance_figure",
    "calibration_figure",
    "design_report_html",
    "fit_report_html",
    "motion_figure",
    "outcome_figure",
    "panel_figure",
    "pareto_figure",
    "pareto_report_html",
    "price_figure",
    "robust_figure",
    "robust_report_html",
    "sensitivity_figure",
    "sweep_figure",
    "trade_off_figure",
    "write_design_report",
    "write_fit_report",
    "write_pareto_report",
    "write_robust_report",
]
