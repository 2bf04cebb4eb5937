"""Define parts of a gain design: status, constraints, optimality and sensitivities."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactState

ACTIVE: Final = 1e-6
"""A constraint is active if its value is within this relative distance of the limit."""


class DesignStatus(StrEnum):
    """Outcome of a gain design, such as optimal or infeasible.

    The design is infeasible if no gain meets all constraints. It is no-contact if no gain results in contact.
    """

    OPTIMAL = "optimal"
    INFEASIBLE = "infeasible"
    NO_CONTACT = "no-contact"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstraintOutcome(Value):
    """Value, limit and margin of one constraint at the designed gain.

    Args:
        name: short name, as in a scenario file.
        quantity: the quantity that is limited.
        unit: its SI unit.
        limit: the largest allowed magnitude.
        value: the magnitude at the chosen gain; if infeasible, at the gain that exceeds the limits least; None without
            contact.
        margin: limit - value; negative if the limit is exceeded.
        active: whether the optimum lies on this limit.
        best_value: the smallest magnitude that any gain within the bounds reaches, without regard to other constraints.
        best_gain: the gain that reaches `best_value`: the law's number, such as D_p [N s].
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
        """True if some gain within the bounds meets the constraint.

        This gain may violate other constraints.
        """
        return self.best_value is not None and self.best_value <= self.limit

    def to_dict(self) -> dict[str, Any]:
        """Return the constraint and its margin as a JSON object.

        Numbers are in SI units.
        """
        return {**asdict(self), "achievable": self.achievable}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TradeOff(Value):
    """Objective and quantities at contact for every gain that the search evaluated.

    Args:
        gain: the law's number, such as D_p [N s], ascending, shape (n,).
        objective: the objective; infinite without contact.
        reached: whether the encounter ends in contact.
        feasible: whether it ends in contact and meets every constraint.
        state: the state at the end of each run, fields of shape (n,).
    """

    gain: FloatArray
    objective: FloatArray
    reached: BoolArray
    feasible: BoolArray
    state: ContactState

    def to_dict(self) -> dict[str, Any]:
        """Return the evaluated gains and their results as columns.

        Infinite values mean no contact.
        """
        state = {name: getattr(self.state, name) for name in ("time", "displacement", "relative_velocity")}
        columns = {"objective": self.objective, **state}
        finite = {name: np.where(self.reached, values, np.inf) for name, values in columns.items()}
        return {"gain": self.gain, "feasible": self.feasible, **finite}

    def __repr__(self) -> str:
        return f"<TradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g}>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate(Value):
    """Evidence that the designed gain is the global optimum within the bounds.

    Args:
        scanned: number of gains of the scan, which covers the bounds.
        resolution: largest error of interpolating a scanned objective from its neighbors, relative to the objective:
            how well the scan resolves the curve.
        local_minima: all local minima, refined, as (gain, objective), best first.
        bracket: two gains that enclose the optimum.
        stationarity: |df/d ln|D_p|| / f at an optimum inside the bounds, which should be 0; None on a limit.
        at: location of the optimum: "interior", "bound", "edge of contact", "corner" (inside, at a corner or a jump of
            the objective, as a sampled loop may have), "reserve" (at the smallest distance from a jump) or the name of
            the active constraint.
    """

    scanned: int
    resolution: float
    local_minima: tuple[tuple[float, float], ...]
    bracket: tuple[float, float]
    stationarity: float | None
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity(Value):
    """Sensitivity of the optimal gain to one input.

    Args:
        name: the input, such as `obstacle.velocity` or `sensor.exponent`.
        value: its value in SI.
        unit: its SI unit.
        gain_derivative: d gain / d input, in the unit of the law's number (such as N s) per unit of the input.
        objective_derivative: d f / d input at the optimum, per unit of the input.
        gain_change_per_percent: change of the optimal gain if the magnitude of the input grows by 1 %, in the unit of
            the law's number.
    """

    name: str
    value: float
    unit: str
    gain_derivative: float
    objective_derivative: float
    gain_change_per_percent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class IdealDesign(Value):
    """Comparison with the optimal gain in continuous time.

    The designed gain is for a sampled control loop.

    Args:
        gain: the optimal gain in continuous time, L(1), with a perfect sensor: the law's number, such as D_p [N s].
        objective: the objective of the ideal gain on the loop; infinite without contact.
        loss: relative increase of this objective over that of the gain designed on the loop; negative only if the
            ideal gain violates a constraint.
        feasible: whether the ideal gain meets the constraints on the loop.
    """

    gain: float
    objective: float
    loss: float
    feasible: bool
