from .html import report_html as report_html
from .html import write_report as write_report
from .panel_figure import panel_figure as panel_figure
from .panels import Curve as Curve
from .panels import Map as Map
from .panels import Mark as Mark
from .panels import Panel as Panel
from .panels import Span as Span
