"""Curves that are one curve in other units of length and gain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["Alike"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alike:
    """How many curves of one kind are one: with X = s x the equation of motion keeps its form if the force does.

    The lengths of each are multiplied by s, its `length`, and its gain by `gain`; of the parameters that matter, the
    derivatives of the logarithms of both factors by each.
    """

    curve: Any
    length: Any
    gain: Any
    parameters: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)
