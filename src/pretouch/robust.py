"""Robust gain design for uncertain inputs: distributions, measures of the objective, chance constraints."""

from .design.robust import *
from .design.robust import __all__
