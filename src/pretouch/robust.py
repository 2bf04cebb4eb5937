"""Provide robust gain design for uncertain inputs, with distributions and chance constraints."""

from .design.robust import *
from .design.robust import __all__
