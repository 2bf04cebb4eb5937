"""Provide functions that plot results, such as `pt.plots.motion(design)`.

A function is imported when it is first used.
"""

from typing import TYPE_CHECKING, Any

from .report import plots
from .report.plots import __all__

if TYPE_CHECKING:
    from .report.plots import *


def __getattr__(name: str) -> Any:
    """Return a plot function."""
    return getattr(plots, name)


def __dir__() -> list[str]:
    return __all__
