"""What a design comes to: the gain, what it leads to, and why it is believed to be the best."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion.contact import ContactResult, ContactState
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel

from .impact import ImpactModel
from .objectives import Objective

__all__ = [
    "Certificate",
    "ConstraintOutcome",
    "DesignStatus",
    "GainDesign",
    "IdealDesign",
    "Sensitivity",
    "TradeOff",
]


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

    def __repr__(self) -> str:
        return f"<TradeOff: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g} N s>"


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


@dataclass(frozen=True, kw_only=True, repr=False)
class GainDesign(Value):
    """What `design_gain` returns: the gain at once, its evidence when it is first read.

    Args:
        status: optimal, infeasible (a constraint cannot be met) or no-contact (no gain within the bounds ends in
            contact); for an array of encounters an array of these words.
        gain: the optimal gain D_p [N s]; None unless optimal, NaN in an array.
        objective: the objective there; None unless optimal, NaN in an array.
        bounds: the gains between which the optimum was sought [N s].
        scenario: the encounter that was designed for, or an array of them.
        sensor: the sensor curve.
        definition: the objective's definition.
        impact: the physical properties, where given.
        evidence: what the parts below are computed from.
    """

    status: Any
    gain: Any
    objective: Any
    bounds: tuple[float, float]
    scenario: Scenario
    sensor: SensorModel
    definition: Objective
    impact: ImpactModel | None
    evidence: Any

    def at(self, *index: int) -> GainDesign:
        """Return the design of one encounter of an array, with its evidence.

        Args:
            index: one integer per axis.

        Returns:
            The design.
        """
        found: GainDesign = self.evidence.design_one(index) if self.scenario.shape else self
        return found

    @property
    def method(self) -> str:
        """How the encounters were solved: "closed-form", "integration", "uniform-motion", or "loop" by a ClosedLoop."""
        return self.no_mitigation.method

    @property
    def on_evaluator(self) -> bool:
        """Whether encounters were solved by what was given as `evaluate`, such as a ClosedLoop."""
        return self.evidence.problem.evaluator is not None

    @property
    def ideal(self) -> IdealDesign | None:
        """What the ideal design, that of continuous time, loses where this one was made; None where they are the same.

        None, too, where either of the two has no gain.
        """
        found: IdealDesign | None = self.evidence.ideal
        return found

    @property
    def result(self) -> ContactResult | None:
        """The encounter at the optimal gain; None unless optimal."""
        found: ContactResult | None = self.evidence.result
        return found

    @property
    def nearest(self) -> ContactResult | None:
        """Where infeasible, the encounter at the gain that exceeds the constraints least; else None."""
        found: ContactResult | None = self.evidence.nearest
        return found

    @property
    def no_mitigation(self) -> ContactResult:
        """The encounter with D_p = 0."""
        found: ContactResult = self.evidence.no_mitigation
        return found

    @property
    def objective_parts(self) -> dict[str, float]:
        """The terms of the objective by quantity, which add up to it; empty unless optimal.

        Of an objective of a user's own what it declares by `parts`; empty where that does not add up to its value.
        """
        if self.result is None:
            return {}
        speed = abs(self.scenario.obstacle.velocity)
        return {k: float(v) for k, v in self.definition.parts(self.result.end, speed, self.impact).items()}

    @property
    def damping_at_contact(self) -> Any:
        """D_p g(0) [N s/m], what the motion feels of gain and sensor together at contact; an array for an array."""
        if self.gain is None:
            return None
        return self.gain * self.sensor.log_slope(max(self.sensor.valid_range[0], 0.0))

    @property
    def constraints(self) -> tuple[ConstraintOutcome, ...]:
        """Each constraint with its margin."""
        found: tuple[ConstraintOutcome, ...] = self.evidence.constraints
        return found

    @property
    def trade_off(self) -> TradeOff:
        """Objective and contact over the bounds."""
        found: TradeOff = self.evidence.trade_off
        return found

    @property
    def certificate(self) -> Certificate | None:
        """Why the gain is believed to be the optimum; None unless optimal."""
        found: Certificate | None = self.evidence.certificate
        return found

    @property
    def sensitivities(self) -> tuple[Sensitivity, ...]:
        """The derivative of the optimum with respect to each input."""
        found: tuple[Sensitivity, ...] = self.evidence.sensitivities
        return found

    def gradient(self, by: str) -> Any:
        """Return how the optimal gain follows one input, exact where objective and limits are those of the contact.

        Args:
            by: the input, such as `obstacle.velocity` or `sensor.exponent`: one of `ContactGradients.inputs`, the gain
                excepted.

        Returns:
            d D_p / d input, in N s per unit of the input: a float, or an array of the scenario's shape. NaN where there
            is no optimal gain, beside an edge of contact, and where the objective has a corner or a jump.
        """
        if self.scenario.shape:
            return self.evidence.gradient(self.gain, by)
        return math.nan if self.gain is None else float(self.evidence.gradient(self.gain, by))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that a user should read before relying on the gain, in order of weight."""
        return tuple(design_warnings(self, self.evidence.scan_result))

    def to_dict(self) -> dict[str, Any]:
        """Return the design as one JSON object: numbers in SI, None where there is none."""
        if self.scenario.shape:
            return {"status": self.status, "gain": self.gain, "objective": self.objective}
        return design_as_dict(self)

    def __repr__(self) -> str:
        if self.scenario.shape:
            return f"<GainDesign: {(self.status == DesignStatus.OPTIMAL).sum()} of {self.status.size} optimal>"
        return f"<GainDesign: {headline(self)}>"

    def __str__(self) -> str:
        return repr(self) if self.scenario.shape else design_as_text(self)

    def _repr_html_(self) -> str | None:
        return None if self.scenario.shape else design_as_html(self)


from .advice import design_warnings  # noqa: E402 - it describes the class above
from .summary import design_as_dict, design_as_html, design_as_text, headline  # noqa: E402 - it describes the class above
