"""Define results of a robust design: random encounters with one gain, and the risk measure for each gain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactState

from ..impact import ImpactModel
from ..quantities import quantity_of, size_of


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustOutcomes(Value):
    """Results of one gain in many new random encounters, which the design did not use.

    Args:
        gain: the law's number, such as D_p [N s].
        objective: the objective, shape (n,); infinite without contact.
        reached: which encounters end in contact, shape (n,).
        state: the state at the end of each encounter, fields of shape (n,).
        inputs: the uncertain inputs by name, in SI, shape (n,) each.
        impact: the physical properties, or None.
    """

    gain: float
    objective: FloatArray
    reached: BoolArray
    state: ContactState
    inputs: dict[str, FloatArray]
    impact: ImpactModel | None

    def magnitude(self, quantity: str) -> FloatArray:
        """Return the magnitude of one quantity in every encounter, in SI units; infinite without contact."""
        values = np.asarray(size_of(quantity, quantity_of(quantity, self.state, self.impact)))
        return np.where(self.reached, np.broadcast_to(values, self.reached.shape), np.inf)

    def reaches(self, quantity: str, share: float) -> float:
        """Return the value that a quantity does not exceed in the given share of the encounters, in SI units."""
        return float(np.sort(self.magnitude(quantity))[math.ceil(share * len(self.objective)) - 1])

    def __repr__(self) -> str:
        return f"<RobustOutcomes: {len(self.objective)} encounters with gain {self.gain:.4g}>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustTradeOff(Value):
    """The risk measure of the objective as a function of the gain, computed for the random encounters of the design.

    Args:
        gain: the law's number, such as D_p [N s], ascending, shape (n,).
        value: the measure; infinite if relevant encounters end without contact.
        feasible: whether every constraint holds with its required probability.
    """

    gain: FloatArray
    value: FloatArray
    feasible: BoolArray

    def __repr__(self) -> str:
        return f"<RobustTradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g}>"
