"""What the readings tell of the curve, whatever the model: g with its uncertainty, and all curves that they allow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

__all__ = ["AllowedCurves", "DrawnCurve", "SlopeKnowledge"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SlopeKnowledge(Value):
    """What all curves that the readings allow say about g, in the part where most of the virtual force is given.

    Args:
        distances: from the nearest usable one to where the signal is a tenth of that there [m], shape (N,).
        slope: the mean of g over all curves [1/m], shape (N,).
        uncertainty: half the width of the 95 % interval of g, relative to it, shape (N,).
        worst_at: where that is largest [m].
    """

    distances: FloatArray
    slope: FloatArray
    uncertainty: FloatArray
    worst_at: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnCurve(Value):
    """One curve that the readings allow, with the offset that goes with it.

    Args:
        sensor: the curve, valid on the window.
        offset: what would have to be subtracted for it, in the unit of the outputs.
    """

    sensor: SensorModel
    offset: float


class AllowedCurves(Protocol):
    """All curves that the readings allow."""

    def draw(self, count: int, seed: int) -> tuple[DrawnCurve, ...]:
        """Draw some, each as likely as the readings make it."""
