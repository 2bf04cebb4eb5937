"""What a design is made of: how it ended, its constraints, its trade-off, and why it is believed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion.contact import ContactState


class DesignStatus(StrEnum):
    """How a design ended."""

    OPTIMAL = "optimal"
    INFEASIBLE = "infeasible"
    NO_CONTACT = "no-contact"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstraintOutcome(Value):
    """One constraint at the chosen gain.

    Args:
        name: short name, as in a scenario file.
        quantity: the quantity that is limited.
        unit: its SI unit.
        limit: the largest allowed magnitude.
        value: the magnitude at the chosen gain, or at the nearest one where infeasible; None without contact.
        margin: limit - value; negative where the limit is exceeded.
        active: whether the optimum sits on this limit.
        best_value: the smallest magnitude that any gain within the bounds reaches, this constraint taken alone.
        best_gain: the gain that reaches it [N s].
    """

    name: str
    quantity: str
    unit: str
    limit: float
    value: float | None
    margin: float | None
    active: bool
    best_value: float | None
    best_gain: float | None

    @property
    def achievable(self) -> bool:
        """Whether some gain within the bounds meets this constraint, taken alone."""
        return self.best_value is not None and self.best_value <= self.limit

    def to_dict(self) -> dict[str, Any]:
        """Return the outcome as one JSON object, in SI."""
        return {**asdict(self), "achievable": self.achievable}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TradeOff(Value):
    """Objective and contact over the whole range of gains: the scan that the optimum was chosen from.

    Args:
        gain: D_p [N s], ascending, shape (n,).
        objective: the objective; infinite where there is no contact.
        reached: where the encounter ends in contact.
        feasible: where it ends in contact and every constraint holds.
        state: the state at the end of each run, fields of shape (n,).
    """

    gain: FloatArray
    objective: FloatArray
    reached: BoolArray
    feasible: BoolArray
    state: ContactState

    def to_dict(self) -> dict[str, Any]:
        """Return the scan as columns; what there is not without contact is infinite, which JSON writes as null."""
        state = {name: getattr(self.state, name) for name in ("time", "displacement", "relative_velocity")}
        known = {"objective": self.objective, **state}
        found = {name: np.where(self.reached, values, np.inf) for name, values in known.items()}
        return {"gain": self.gain, "feasible": self.feasible, **found}

    def __repr__(self) -> str:
        return f"<TradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g}>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate(Value):
    """Why the gain is believed to be the global optimum within the bounds.

    Args:
        scanned: how many gains the scan that covers the bounds came to.
        resolution: largest error of predicting a scanned objective from its neighbors, relative to the range of the
            objective there: how well the scan resolves the curve.
        local_minima: the local minima found by the scan and refined, as (gain, objective), best first.
        bracket: the gains around the optimum between which it is enclosed.
        stationarity: |df/d ln|D_p|| at the optimum over the objective, where it lies inside; None on a limit.
        at: "interior", "bound", "edge of contact", "corner" (inside, where the objective has a corner or a jump, as
            that of a sampled loop may have) or the name of the active constraint.
    """

    scanned: int
    resolution: float
    local_minima: tuple[tuple[float, float], ...]
    bracket: tuple[float, float]
    stationarity: float | None
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity(Value):
    """How the optimum follows one input.

    Args:
        name: the input, such as `obstacle.velocity` or `sensor.exponent`.
        value: its value in SI.
        unit: its SI unit.
        gain_derivative: d D_p / d input, in N s per unit of the input.
        objective_derivative: d f / d input at the optimum, per unit of the input.
        gain_change_per_percent: change of the optimal gain when the input grows by 1 % of its magnitude [N s].
    """

    name: str
    value: float
    unit: str
    gain_derivative: float
    objective_derivative: float
    gain_change_per_percent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class IdealDesign(Value):
    """The gain that is optimal in continuous time, where another was designed on a sampled loop.

    Args:
        gain: the optimal gain of L(1) with a perfect sensor [N s].
        objective: what it comes to on the loop; infinite where it ends without contact.
        loss: by how much that exceeds the objective of the design on the loop, as a share of the latter; below 0 only
            where it breaks a limit.
        feasible: whether it keeps the limits on the loop.
    """

    gain: float
    objective: float
    loss: float
    feasible: bool
