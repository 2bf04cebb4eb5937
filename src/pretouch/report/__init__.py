"""HTML reports of every result, and panels of one's own; Matplotlib is loaded when something is drawn."""

from .html import report_html, write_report
from .panel_figure import panel_figure
from .panels import Curve, Map, Mark, Panel, Span

__all__ = ["Curve", "Map", "Mark", "Panel", "Span", "panel_figure", "report_html", "write_report"]
