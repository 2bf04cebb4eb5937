"""Write HTML reports and draw figures of results.

Matplotlib is imported when the first figure is drawn.
"""

from .html import report_html, write_report
from .panel_figure import panel_figure
from .panels import Curve, Map, Mark, Panel, Span

__all__ = ["Curve", "Map", "Mark", "Panel", "Span", "panel_figure", "report_html", "write_report"]
