"""All figures, by short names such as `pt.plots.motion(design)`."""

from .report.plots import *
from .report.plots import __all__
