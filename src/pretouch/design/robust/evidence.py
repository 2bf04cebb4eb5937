"""What a robust gain is seen beside: the measure over all gains, and the encounters that a gain leads to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactState

from ..impact import ImpactModel
from ..quantities import quantity_of

__all__ = ["RobustOutcomes", "RobustTradeOff"]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustOutcomes(Value):
    """What one gain leads to in each of the fresh encounters.

    Args:
        gain: D_p [N s].
        objective: the objective, shape (n,); infinite where there is no contact.
        reached: which encounters end in contact, shape (n,).
        state: the state at the end of each, fields of shape (n,).
        inputs: the uncertain inputs by name, in SI, shape (n,) each.
        impact: the physical properties, where given.
    """

    gain: float
    objective: FloatArray
    reached: BoolArray
    state: ContactState
    inputs: dict[str, FloatArray]
    impact: ImpactModel | None

    def magnitude(self, quantity: str) -> FloatArray:
        """Return |quantity| in SI of one of QUANTITY_UNITS, shape (n,); infinite where there is no contact."""
        found = np.abs(np.asarray(quantity_of(quantity, self.state, self.impact)))
        return np.where(self.reached, np.broadcast_to(found, self.reached.shape), np.inf)

    def reaches(self, quantity: str, share: float) -> float:
        """Return the magnitude of a quantity that is not exceeded in a share of the encounters, in SI."""
        return float(np.sort(self.magnitude(quantity))[math.ceil(share * len(self.objective)) - 1])

    def __repr__(self) -> str:
        return f"<RobustOutcomes: {len(self.objective)} encounters with D_p = {self.gain:.4g} N s>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustTradeOff(Value):
    """The measure of the objective over the gain, on the samples of the design.

    Args:
        gain: D_p [N s], ascending, shape (n,).
        value: the measure; infinite where the encounters that count do not end in contact.
        feasible: where every constraint holds as often as it must.
    """

    gain: FloatArray
    value: FloatArray
    feasible: BoolArray

    def __repr__(self) -> str:
        return f"<RobustTradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g} N s>"
