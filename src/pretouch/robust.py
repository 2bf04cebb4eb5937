"""Design robust gains for inputs with probability distributions.

Limits are met with a required probability.
"""

from .design.robust import *
from .design.robust import __all__
