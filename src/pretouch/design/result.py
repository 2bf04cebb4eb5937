"""What a design comes to: the gain, what it leads to, and why it is believed to be the best."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion.contact import ContactResult, ContactState
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel

from .impact import ImpactModel
from .objectives import Objective

__all__ = ["Certificate", "ConstraintOutcome", "DesignStatus", "GainDesign", "Sensitivity", "TradeOff"]


class DesignStatus(StrEnum):
    """How a design ended."""

    OPTIMAL = "optimal"
    INFEASIBLE = "infeasible"
    NO_CONTACT = "no-contact"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstraintOutcome:
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


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TradeOff:
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

    def __repr__(self) -> str:
        return f"<TradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g} N s>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """Why the gain is believed to be the global optimum within the bounds.

    Args:
        scanned: how many gains the scan that covers the bounds came to.
        resolution: largest error of predicting a scanned objective from its neighbors, relative to the range of the
            objective there: how well the scan resolves the curve.
        local_minima: the local minima found by the scan and refined, as (gain, objective), best first.
        bracket: the gains around the optimum between which it is enclosed.
        stationarity: |df/d ln|D_p|| at the optimum over the objective, where it lies inside; None on a limit.
        at: "interior", "bound", "edge of contact" or the name of the active constraint.
    """

    scanned: int
    resolution: float
    local_minima: tuple[tuple[float, float], ...]
    bracket: tuple[float, float]
    stationarity: float | None
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
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


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class GainDesign:
    """What `design_gain` returns.

    Args:
        status: optimal, infeasible (a constraint cannot be met) or no-contact (no gain within the bounds ends in
            contact).
        method: how the encounters were solved: "closed-form", "integration" or "uniform-motion".
        gain: the optimal gain D_p [N s]; None unless optimal.
        objective: the objective there; None unless optimal.
        objective_parts: its terms by quantity.
        result: the encounter at the optimal gain; None unless optimal.
        nearest: where infeasible, the encounter at the gain that exceeds the constraints least; else None.
        no_mitigation: the encounter with D_p = 0.
        damping_at_contact: D_p g(0) [N s/m], what the motion feels of gain and sensor together at contact.
        constraints: each constraint with its margin.
        trade_off: objective and contact over the bounds.
        certificate: why this is believed to be the optimum; None unless optimal.
        sensitivities: the derivative of the optimum with respect to each input.
        warnings: sentences that a user should read before relying on the gain.
        bounds: the gains between which the optimum was sought [N s].
        scenario: the encounter that was designed for.
        sensor: the sensor curve.
        definition: the objective's definition.
        impact: the physical properties, where given.
    """

    status: DesignStatus
    method: str
    gain: float | None
    objective: float | None
    objective_parts: dict[str, float]
    result: ContactResult | None
    nearest: ContactResult | None
    no_mitigation: ContactResult
    damping_at_contact: float | None
    constraints: tuple[ConstraintOutcome, ...]
    trade_off: TradeOff
    certificate: Certificate | None
    sensitivities: tuple[Sensitivity, ...]
    warnings: tuple[str, ...]
    bounds: tuple[float, float]
    scenario: Scenario
    sensor: SensorModel
    definition: Objective
    impact: ImpactModel | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the design as one JSON object: numbers in SI, None where there is none."""
        return design_as_dict(self)

    def __repr__(self) -> str:
        return f"<GainDesign: {headline(self)}>"

    def __str__(self) -> str:
        return design_as_text(self)

    def _repr_html_(self) -> str:
        return design_as_html(self)


from .summary import design_as_dict, design_as_html, design_as_text, headline  # noqa: E402 - it describes the class above
