"""The scenario file: TOML with units, checked against a schema, to a task."""

from .loading import load_scenario
from .source import ScenarioSource

__all__ = ["ScenarioSource", "load_scenario"]
