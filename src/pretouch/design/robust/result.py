"""What a robust design comes to: the gain, what it promises, and what fresh samples say to that."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import finite
from pretouch._core.units import format_quantity
from pretouch.uncertainty import Uncertainty
from pretouch.uncertainty.ensemble import names_of, share_in_words

from ..certificate import DesignStatus
from ..problem import Answer
from ..search import Scan
from .beside import InputImportance, Price, RobustOutcomes, RobustTradeOff, price_of_robustness, rank_uncertain_inputs
from .measures import Measure, Required
from .problem import LossOfNominal, RobustProblem, Validation, WorstEncounter

_BEYOND: Final = 17  # gains between the end of the scan and the strongest that is wanted


@dataclass(frozen=True, kw_only=True, repr=False)
class RobustDesign(Answer):
    """What `design_robust_gain` returns.

    Args:
        status: optimal, infeasible (a constraint cannot be met) or no-contact.
        local_minima: the local minima of the measure, as (gain, value), best first.
        nominal_gain: the gain that is optimal where every input has its given value, always in continuous time: the
            ideal design [N s]; None where there is none.
        validation: what fresh samples say; None unless optimal.
        worst: the worst encounter, for a worst case; else None.
        problem: the problem on the samples of the design.
        fresh: the problem on samples that the design has not seen.
        scan: the gains that were scanned, and what they lead to.
    """

    problem: RobustProblem
    status: DesignStatus
    local_minima: tuple[tuple[float, float], ...]
    nominal_gain: float | None
    validation: Validation | None
    worst: WorstEncounter | None
    fresh: RobustProblem
    scan: Scan

    page: ClassVar[str] = "pretouch.design.robust.page:robust_page"

    @property
    def gain(self) -> float | None:
        """D_p [N s]; None unless optimal."""
        return self.local_minima[0][0] if self.local_minima else None

    @property
    def value(self) -> float | None:
        """The measure of the objective that was minimized; None unless optimal."""
        return self.local_minima[0][1] if self.local_minima else None

    @property
    def measure(self) -> Measure:
        """What was made of the objectives of all encounters."""
        return self.problem.measure

    @property
    def limits(self) -> tuple[Required, ...]:
        """The constraints, each with the probability with which it must hold."""
        return self.problem.limits

    @property
    def uncertainty(self) -> Uncertainty:
        """What is known of the inputs."""
        return self.problem.task.uncertainty

    @property
    def samples(self) -> int:
        """How many encounters the measure was taken over."""
        return len(self.problem.ensemble)

    @property
    def seed(self) -> int:
        """The seed of the samples."""
        return self.problem.task.seed or 0

    @property
    def scanned(self) -> int:
        """How many gains were appraised to find the minima."""
        return len(self.scan.coordinate)

    @property
    def strongest(self) -> float:
        """The gain beyond which none is needed: none stronger can be the optimum [N s]."""
        return float(self.problem.axis.gain(self.scan.coordinate[0 if self.number.sign < 0 else -1]))

    @property
    def loss_of_nominal(self) -> LossOfNominal | None:
        """What the nominal gain, that of the ideal design, loses on fresh samples; None where it is not known."""
        return None if self.validation is None else self.validation.loss

    @cached_property
    def method(self) -> str:
        """How the encounters were solved, as in ContactResult."""
        ensemble = self.problem.ensemble
        if self.on_evaluator:
            return ensemble.contacts(0.0 if self.gain is None else self.gain).method
        constant = self.sensor.constant_log_slope is not None
        return ensemble.method if ensemble.method != "auto" else "closed-form" if constant else "integration"

    @cached_property
    def trade_off(self) -> RobustTradeOff:
        """The measure over the gain, on the samples of the design, as far as the robust and the nominal gain."""
        axis, u, found = self.problem.axis, self.scan.coordinate, self.scan.landscape
        value, feasible = found.objective, found.feasible
        gains = [axis.gain(u[0]), *(g for g in (self.gain, self.nominal_gain) if g is not None)]
        end = float(axis.coordinate(np.clip(np.array(gains), *axis.ends)).min())
        if end < u[0]:
            beyond = np.linspace(end, float(u[0]), _BEYOND)[:-1]
            more = self.problem.landscape(beyond)
            u = np.concatenate([beyond, u])
            value = np.concatenate([more.objective, value])
            feasible = np.concatenate([more.feasible, feasible])
        return RobustTradeOff(gain=axis.gain(u), value=value, feasible=feasible)

    @property
    def nearest_gain(self) -> float | None:
        """Where infeasible, the gain that exceeds the limits least, in proportion [N s]; else None."""
        worst = self.scan.landscape.worst_ratio
        best = int(np.argmin(worst))
        known = self.status is DesignStatus.INFEASIBLE and np.isfinite(worst[best])
        return float(self.problem.axis.gain(self.scan.coordinate[best])) if known else None

    @property
    def reachable(self) -> tuple[tuple[Required, float, float], ...]:
        """Each limit, the least |quantity| that a gain keeps as often as it must, taken alone, and that gain [N s]."""
        found = []
        for limit, ratios in zip(self.limits, self.scan.landscape.ratios, strict=True):
            best = int(np.argmin(ratios))
            if np.isfinite(ratios[best]):
                gain = float(self.problem.axis.gain(self.scan.coordinate[best]))
                found.append((limit, float(ratios[best]) * limit.constraint.limit, gain))
        return tuple(found)

    def outcomes(self, gain: float | None = None) -> RobustOutcomes:
        """Tell what a gain leads to in each of the fresh encounters.

        Args:
            gain: D_p [N s]; the robust gain where none is given.

        Returns:
            The outcomes, one per fresh sample.

        Raises:
            ResultUnavailableError: no gain is given, and there is no robust one.
        """
        chosen = self.gain if gain is None else float(finite(gain, "gain", self.number.unit))
        if chosen is None:
            raise ResultUnavailableError("outcomes: there is no robust gain; see the status, or give a gain")
        result, speed = self.fresh.ensemble.contacts(chosen), self.fresh.ensemble.speed
        return RobustOutcomes(
            gain=chosen,
            objective=np.where(result.reached, self.definition.value(result.end, speed, self.impact), np.inf),
            reached=result.reached,
            state=result.end,
            inputs={name: np.asarray(v) for name, v in self.fresh.ensemble.values.items()},
            impact=self.impact,
        )

    def price(self, name: str, *, count: int = 101, gain: float | None = None) -> Price:
        """Tell what knowing one input exactly would have gained, as a curve over that input.

        Args:
            name: an uncertain input, such as `obstacle.velocity`.
            count: at how many values.
            gain: another gain D_p than the robust one [N s], such as the nominal gain.

        Returns:
            The curve; the other inputs have their given values, those that were estimated together with it follow.

        Raises:
            ResultUnavailableError: the gain was designed on encounters of another kind.
        """
        if self.on_evaluator:
            raise ResultUnavailableError(
                "price: it is known in continuous time only, and this gain was designed with evaluate; call "
                "design_gain with the same evaluate at the values that matter"
            )
        return price_of_robustness(self.problem, name, count, self.gain if gain is None else gain)

    @cached_property
    def importance(self) -> tuple[InputImportance, ...]:
        """Which uncertain input the objective varies with most at the robust gain: what is worth measuring better.

        Sobol indices from as many samples as the design was made with, and the same to first order from gradients, the
        largest first; empty where there is no robust gain.
        """
        return () if self.gain is None else rank_uncertain_inputs(self.problem, self.gain)

    @cached_property
    def compared(self) -> dict[str, RobustOutcomes]:
        """What the gains that matter lead to in the fresh encounters, by the names of these gains.

        The robust gain (where there is none, the one that exceeds the limits least), the nominal one, and none at all.
        """
        first = ("nearest gain", self.nearest_gain) if self.gain is None else ("robust gain", self.gain)
        gains = (first, (self.nominal_name, self.nominal_gain), ("no mitigation", 0.0))
        return {name: self.outcomes(gain) for name, gain in gains if gain is not None}

    @property
    def nominal_name(self) -> str:
        """What the nominal gain is called: where encounters are not ideal, it is that of the ideal design."""
        return "gain of the ideal design" if self.on_evaluator else "nominal gain"

    @cached_property
    def prices(self) -> tuple[Price, ...]:
        """What knowing each uncertain input would gain, the dearest first.

        Empty where there is no robust gain, and where encounters were solved by what was given as `evaluate`: what the
        best gain for each value would be is known in continuous time only.
        """
        if self.gain is None or self.on_evaluator:
            return ()
        prices = [self.price(name) for name in names_of(self.uncertainty)]
        known = [price for price in prices if np.isfinite(price.loss).any()]
        return tuple(sorted(known, key=lambda price: -float(np.nanmax(price.loss))))

    @property
    def headline(self) -> str:
        """The answer in a sentence or two."""
        v = self.validation
        if self.gain is None:
            often = (
                f"No gain within the bounds ends in contact as often as the measure asks for ({self.measure.label})."
            )
            return often if self.status is DesignStatus.NO_CONTACT else f"Infeasible: {_conflict(self)}."
        text = f"Robust {self.number.name} {self.number.equals(self.gain)}: {self.measure.label} of the objective "
        text += f"{self.value:.4g}"
        if v is None or self.nominal_gain is None or v.nominal is None or not math.isfinite(v.value):
            return text + "."
        which = "that of the ideal design" if self.on_evaluator else "optimal where nothing is uncertain"
        beside = f"the {self.number.name} {self.number.text(self.nominal_gain)}, {which}"
        if not math.isfinite(v.nominal):
            return f"{text}; with {beside}, too many encounters end without contact."
        change = 100 * (v.nominal / v.value - 1)
        worse, but = ("worse", "and") if change >= 0 else ("better", "but")
        broken = " and ".join(v.nominal_breaks)
        too = f", {but} does not hold {broken} as often as it must" if broken else ""
        return f"{text}. On fresh samples {beside}, is {abs(change):.2g} % {worse}{too}."

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that a user should read before relying on the gain, in order of weight."""
        return tuple(_warnings(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the design as one JSON object: numbers in SI, None where there is none."""
        names = ("status", "gain", "measure", "value", "method", "nominal_gain", "nearest_gain", "validation", "worst")
        more = ("importance", "local_minima", "scanned", "bounds", "samples", "seed", "uncertainty", "warnings")
        others = {
            "objective_name": self.definition.name,
            "reachable": [{"name": r.constraint.name, "magnitude": m, "gain": g} for r, m, g in self.reachable],
            "strongest_gain_needed": self.strongest,
        }
        told: dict[str, Any] = plain({**{name: getattr(self, name) for name in (*names, *more)}, **others})
        return told

    def __repr__(self) -> str:
        if self.gain is None:
            return f"<RobustDesign: {self.status.value}>"
        return f"<RobustDesign: {self.number.equals(self.gain)}, {self.measure.label} {self.value:.4g}>"


def _conflict(design: RobustDesign) -> str:
    """Name the limits that no gain holds as often as it must, or say that they exclude each other."""
    said = []
    for required, magnitude, gain in design.reachable:
        c, p = required.constraint, required.probability
        if magnitude > c.limit:
            said.append(
                f"{c.name} cannot be held at {format_quantity(c.limit, c.unit)} "
                f"{'in every sample' if p == 1 else f'in {100 * p:g} %'}: the least that is, is "
                f"{format_quantity(magnitude, c.unit)}, at {design.number.equals(gain)}"
            )
    return "; ".join(said) or "each constraint can be held as often as it must, but no gain holds all of them"


def _warnings(design: RobustDesign) -> Iterator[str]:
    """Yield what should be read before relying on a gain, in order of weight."""
    v = design.validation
    if v is None or design.gain is None:
        return
    if v.reached < 1:
        yield (
            f"{100 * (1 - v.reached):.3g} % of the fresh encounters end without contact: the measure leaves them out, "
            "or is infinite"
        )
    for o in v.limits:
        if not v.may_hold(o):
            yield (
                f"the fresh samples hold {o.required.constraint.name} in {share_in_words(o.held)} only, less often "
                f"than the {100 * o.required.probability:g} % that the design held in its own samples: take more "
                "samples, or ask for a slightly larger probability"
            )
    if design.gain in design.bounds:
        yield (
            f"the optimum lies on the bound {design.number.text(design.gain)}: a wider range of gains may hold a "
            "better one"
        )
