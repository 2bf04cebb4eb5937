"""The figures by name: what a page shows, and `pretouch.plots` offers; each is loaded when it is drawn."""

from __future__ import annotations

from typing import Final

__all__ = ["FIGURES"]

FIGURES: Final[dict[str, str]] = {
    "admittance": "pareto_figures:admittance_figure",
    "calibration": "calibration_figures:calibration_figure",
    "motion": "design_figures:motion_figure",
    "outcome": "robust_figures:outcome_figure",
    "pareto": "pareto_figures:pareto_figure",
    "price": "robust_figures:price_figure",
    "robust": "robust_figures:robust_figure",
    "sensitivity": "design_figures:sensitivity_figure",
    "trade_off": "design_figures:trade_off_figure",
}
"""Module and function of each."""
