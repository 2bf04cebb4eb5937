"""Implement the command line of pretouch."""

from .app import main

__all__ = ["main"]
