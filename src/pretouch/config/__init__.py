"""The scenario file: TOML with units, checked against a schema, to a design problem."""

from .loading import load_scenario
from .problem import DesignProblem
from .source import ScenarioSource

__all__ = ["DesignProblem", "ScenarioSource", "load_scenario"]
