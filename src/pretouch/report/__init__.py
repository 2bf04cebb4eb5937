"""HTML reports and figures of results, and panels for custom figures; Matplotlib is imported when needed."""

from .html import report_html, write_report
from .panel_figure import panel_figure
from .panels import Curve, Map, Mark, Panel, Span

__all__ = ["Curve", "Map", "Mark", "Panel", "Span", "panel_figure", "report_html", "write_report"]
