"""Define the results of a robust design for many encounters."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactState

from ..impact import ImpactModel
from ..quantities import contact_value, size_of


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustOutcomes(Value):
    """Results of one gain in many new random encounters.

    The design did not use these encounters.

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
        """Return one quantity in every random encounter.

        The result is its magnitude in SI units. It is infinite without contact.
        """
        values = np.asarray(size_of(quantity, contact_value(quantity, self.state, self.impact)))
        return np.where(self.reached, np.broadcast_to(values, self.reached.shape), np.inf)

    def reaches(self, quantity: str, share: float) -> float:
        """Return the quantile of one quantity over the encounters.

        The given share of the encounters does not exceed this value in SI units.
        """
        return float(np.sort(self.magnitude(quantity))[math.ceil(share * len(self.objective)) - 1])

    def __repr__(self) -> str:
        return f"<RobustOutcomes: {len(self.objective)} encounters with gain {self.gain:.4g}>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustTradeOff(Value):
    """The risk measure as a function of the gain.

    It is computed for the random encounters of the design.

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
