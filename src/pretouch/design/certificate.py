"""How a design ended, its constraints and trade-off, and why it is believed: no stronger gain does better."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactState, Scenario
from pretouch.motion.curve import farthest
from pretouch.sensors import SensorModel
from pretouch.sensors.model import cache_by_curve

from .objectives import Objective


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


_PROBES: Final = 257


def touches_later(scenario: Scenario, sensor: SensorModel) -> BoolArray:
    """Tell for which encounters a stronger mitigating gain is known to touch later (docs/fast-designs.md)."""
    known = sensor.valid_range[0] <= 0 and falls(sensor, farthest(scenario, sensor))
    return np.asarray(premises_hold(scenario) & known)


def premises_hold(scenario: Scenario) -> BoolArray:
    """Tell for which encounters the premises of the same proof hold, but that ln xi falls with the distance."""
    m, d, k, x0, u0, _, v, a, _, _ = scenario.relative_columns()
    room = np.asarray(d) * d - 4.0 * np.asarray(m) * k
    sigma = 0.5 * (d - np.sqrt(np.maximum(room, 0.0)))
    holds = (room >= 0) & (v < 0) & (np.asarray(a) <= 0) & (np.asarray(u0) > v) & (-d * v - k * x0 >= sigma * (u0 - v))
    return np.asarray(np.broadcast_to(holds, scenario.shape))


def least_objective(objective: Objective, state: ContactState, obstacle_speed: Any) -> FloatArray:
    """Bound an objective of every stronger gain from below where that touches later, given any state at contact."""
    # It is the part that time can only enlarge; obstacle_speed is |x_o'| at the start [m/s].
    total = np.zeros(np.shape(state.time))
    if type(objective) is not Objective:
        return total
    for term in objective.terms:
        if term.quantity not in {"time", "displacement"}:
            continue
        value = getattr(state, term.quantity)
        counts = value if term.quantity == "time" else np.minimum(value, 0.0)
        total = total + term.weight * (counts / term.scale_for(obstacle_speed)) ** 2
    return np.asarray(total)


@cache_by_curve(256)
def falls(sensor: SensorModel, reach: float) -> bool:
    """Tell whether ln xi falls with the distance, from contact to a distance [m]."""
    return bool((np.asarray(sensor.log_slope(np.linspace(0.0, reach, _PROBES))) < 0).all())
