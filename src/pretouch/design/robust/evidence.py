"""What lies behind a robust gain: the measure over all gains, and the encounters that a gain leads to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion import ContactState

from ..impact import ImpactModel
from ..quantities import quantity_of
from ..search import Scan
from .measures import Required
from .problem import RobustProblem

__all__ = ["Reachable", "RobustEvidence", "RobustOutcomes", "RobustTradeOff"]

_BEYOND: Final = 17  # gains between the end of the scan and the strongest that is wanted


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
        """Return the magnitude of a quantity of the contact.

        Args:
            quantity: a key of QUANTITY_UNITS, such as `relative_velocity`.

        Returns:
            |quantity| in SI, shape (n,); infinite where there is no contact.
        """
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Reachable(Value):
    """How far a limit can be held, taken alone.

    Args:
        required: the limit and the probability with which it must hold.
        magnitude: the smallest |quantity| that any scanned gain keeps with that probability, SI.
        gain: the gain that does [N s].
    """

    required: Required
    magnitude: float
    gain: float

    def to_dict(self) -> dict[str, Any]:
        """Return it as one JSON object, in SI."""
        return {"name": self.required.constraint.name, "magnitude": self.magnitude, "gain": self.gain}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobustEvidence(Value):
    """What the parts of a robust design are computed from when they are first asked for.

    Args:
        problem: the problem on the samples of the design.
        fresh: the problem on samples that the design has not seen.
        scanned: the gains that were scanned, and what they lead to.
    """

    problem: RobustProblem
    fresh: RobustProblem
    scanned: Scan

    def nearest_gain(self) -> float | None:
        """Return the gain that exceeds the limits least, in proportion; None where none ends in contact."""
        worst = self.scanned.landscape.worst_ratio
        best = int(np.argmin(worst))
        return float(self.problem.axis.gain(self.scanned.coordinate[best])) if np.isfinite(worst[best]) else None

    def reachable(self) -> tuple[Reachable, ...]:
        """Return how far each limit can be held, taken alone."""
        found = []
        for limit, ratios in zip(self.problem.limits, self.scanned.landscape.ratios, strict=True):
            best = int(np.argmin(ratios))
            if np.isfinite(ratios[best]):
                gain = float(self.problem.axis.gain(self.scanned.coordinate[best]))
                size = float(ratios[best]) * limit.constraint.limit
                found.append(Reachable(required=limit, magnitude=size, gain=gain))
        return tuple(found)

    def outcomes(self, gain: float) -> RobustOutcomes:
        """Return what a gain leads to in each of the fresh encounters.

        Args:
            gain: D_p [N s].

        Returns:
            The outcomes.
        """
        problem = self.fresh
        result = problem.ensemble.contacts(gain)
        value: Any = problem.objective.value(result.end, problem.ensemble.speed, problem.impact)
        return RobustOutcomes(
            gain=float(gain),
            objective=np.where(result.reached, value, np.inf),
            reached=result.reached,
            state=result.end,
            inputs={name: np.asarray(v) for name, v in problem.ensemble.values.items()},
            impact=problem.impact,
        )

    def trade_off(self, *gains: float) -> RobustTradeOff:
        """Return the measure over the gains of the scan, as far as some other gains where these lie beyond.

        Args:
            gains: gains that the curve should reach [N s].

        Returns:
            The curve.
        """
        axis, u, found = self.problem.axis, self.scanned.coordinate, self.scanned.landscape
        value, feasible = found.objective, found.feasible
        end = float(axis.coordinate(np.clip(np.array([axis.gain(u[0]), *gains]), *axis.ends)).min())
        if end < u[0]:
            beyond = np.linspace(end, float(u[0]), _BEYOND)[:-1]
            more = self.problem.landscape(beyond)
            u = np.concatenate([beyond, u])
            value = np.concatenate([more.objective, value])
            feasible = np.concatenate([more.feasible, feasible])
        return RobustTradeOff(gain=axis.gain(u), value=value, feasible=feasible)
