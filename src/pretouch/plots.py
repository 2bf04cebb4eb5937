"""Provide functions that plot results, such as `pt.plots.motion(design)`."""

from .report.plots import *
from .report.plots import __all__
