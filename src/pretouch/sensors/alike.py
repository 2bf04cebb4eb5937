"""Curves that are one curve in other units of length and gain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["Alike"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alike:
    """How many curves of one kind are one: with X = s x the equation of motion keeps its form if the force does.

    Args:
        curve: the one.
        length: s of each curve, by which its lengths are multiplied; 1 where they stay.
        gain: the factor of its gain.
        parameters: those that matter: the derivatives of the logarithms of both factors by each.
    """

    curve: Any
    length: Any
    gain: Any
    parameters: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)
