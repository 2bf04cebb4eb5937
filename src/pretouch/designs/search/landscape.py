"""Objective and constraints at values of a search variable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch._core.values import Value

HELD: Final = 1 - 1e-11
"""Largest share of a limit that the search uses, so that a repeated solution at the optimal gain meets the limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Landscape(Value):
    """Objective and constraints at many values of the search variable.

    Args:
        objective: the objective, shape (n,), or several, shape (k, n); infinite without contact.
        ratios: |quantity| / limit of each constraint, shape (constraints, n); infinite without contact.
    """

    objective: FloatArray
    ratios: FloatArray

    @property
    def reached(self) -> BoolArray:
        """True for values of the search variable that result in contact."""
        return np.isfinite(self.objective)

    @property
    def worst_ratio(self) -> FloatArray:
        """The largest constraint ratio for each value of the search variable.

        The ratio is |quantity| / limit. It is infinite without contact, and 0 without constraints.
        """
        worst = self.ratios.max(axis=0) if len(self.ratios) else np.zeros_like(self.objective)
        return np.where(self.reached, worst, np.inf)

    @property
    def violation(self) -> FloatArray:
        """The largest constraint ratio for each value of the search variable, of all objectives together.

        Like `worst_ratio`, but it has one dimension, and is infinite unless every objective is finite.
        """
        worst = self.worst_ratio
        return np.asarray(worst.reshape(-1, worst.shape[-1]).max(axis=0))

    @property
    def feasible(self) -> BoolArray:
        """True for feasible values of the search variable.

        These values result in contact and meet every constraint.
        """
        return self.reached & (self.worst_ratio <= HELD)

    @property
    def merit(self) -> FloatArray:
        """The objective at feasible values of the search variable.

        It is infinite at all other values.
        """
        return np.where(self.feasible, self.objective, np.inf)

    def joined(self, other: Landscape, order: IntArray) -> Landscape:
        """Combine two sets of evaluated points in a given order."""
        return Landscape(
            objective=np.concatenate([self.objective, other.objective], axis=-1)[..., order],
            ratios=np.concatenate([self.ratios, other.ratios], axis=1)[:, order],
        )


Evaluate = Callable[[FloatArray], Landscape]
"""Function that maps coordinates to a Landscape; deterministic, because every coordinate has the same noise."""
