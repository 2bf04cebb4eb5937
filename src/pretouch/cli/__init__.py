"""The command line of pretouch: one file per verb."""

from .app import main

__all__ = ["main"]
