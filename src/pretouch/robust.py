"""Design robust gains: inputs have probability distributions, and limits are met with a required probability."""

from .design.robust import *
from .design.robust import __all__
