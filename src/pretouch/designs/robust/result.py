"""Define the result of a robust design.

It contains the gain, its validation and the most important inputs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import finite
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution
from pretouch.uncertainty import Uncertainty
from pretouch.uncertainty.ensemble import names_of, share_in_words

from ..certificate import DesignStatus
from ..gain_jump import GainJump
from ..problem import Answer
from ..relaxation import Relaxation, relax_on_axis
from ..search import MEASURED, SAMPLED, Scan
from ..task import at_bound_in_words
from .importance import InputImportance, rank_uncertain_inputs
from .measures import Measure, WorstCase
from .outcomes import RobustOutcomes, RobustTradeOff
from .price import Price, price_of_gain, price_of_robustness
from .problem import RobustProblem
from .required import Required
from .validation import LossOfNominal, Validation
from .worst_case import WorstEncounter, confirm_relaxations

_BEYOND: Final = 17  # gains between the end of the scan and the strongest shown gain


@dataclass(frozen=True, kw_only=True, repr=False)
class RobustDesign(Answer):
    """Result of `robust`: the robust gain and its validation.

    The validation uses new random encounters.

    Args:
        status: optimal, infeasible (no gain meets all constraints) or no-contact.
        local_minima: the local minima of the measure, as (gain, value), best first.
        nominal_gain: the gain that is optimal in continuous time if every input has its given value: the law's
            number, such as D_p [N s]; None without such a gain.
        validation: the validation on fresh samples; None unless optimal.
        worst: the worst encounter, for a worst case; else None.
        problem: the problem on the samples of the design.
        fresh: the problem on fresh samples, independent of the design.
        scan: the scanned gains with measure and constraints.
        jump: the jump from which the gain keeps a distance; None without one.
    """

    problem: RobustProblem
    status: DesignStatus
    local_minima: tuple[tuple[float, float], ...]
    nominal_gain: float | None
    validation: Validation | None
    worst: WorstEncounter | None
    fresh: RobustProblem
    scan: Scan
    jump: GainJump | None

    @property
    def gain(self) -> float | None:
        """The robust gain, such as D_p [N s].

        None if there is no optimum.
        """
        return self.local_minima[0][0] if self.local_minima else None

    @property
    def value(self) -> float | None:
        """The smallest risk measure of any feasible gain.

        None if there is no optimum.
        """
        return self.local_minima[0][1] if self.local_minima else None

    @property
    def measure(self) -> Measure:
        """The risk measure of the objective that the design minimizes."""
        return self.problem.measure

    @property
    def limits(self) -> tuple[Required, ...]:
        """The constraints with their required probabilities."""
        return self.problem.limits

    @property
    def uncertainty(self) -> Uncertainty:
        """The distributions of the uncertain inputs."""
        return self.problem.task.uncertainty

    @property
    def samples(self) -> int:
        """Number of random encounters for which the gain was optimized."""
        return len(self.problem.ensemble)

    @property
    def seed(self) -> int:
        """The seed of the random number generator."""
        return self.problem.task.robust.seed

    @property
    def scanned(self) -> int:
        """Number of gains that the search evaluated."""
        return len(self.scan.coordinate)

    @property
    def strongest(self) -> float:
        """The strongest gain that the search evaluated.

        No stronger gain within the bounds can be optimal.
        """
        return float(self.problem.axis.gain(self.scan.coordinate[0 if self.number.sign < 0 else -1]))

    @property
    def loss_of_nominal(self) -> LossOfNominal | None:
        """The loss of the nominal gain compared with the robust gain.

        Both are tested in new random encounters. None if the loss is not finite.
        """
        return None if self.validation is None else self.validation.loss

    @cached_property
    def method(self) -> str:
        """Name of the method that computed the motions.

        It is `closed-form`, `integration`, `uniform-motion` or `loop`.
        """
        ensemble = self.problem.ensemble
        if self.on_evaluator:
            return ensemble.contacts(0.0 if self.gain is None else self.gain).method
        constant = self.sensor.constant_log_slope is not None
        return ensemble.method if ensemble.method != "auto" else "closed-form" if constant else "integration"

    @cached_property
    def trade_off(self) -> RobustTradeOff:
        """The risk measure of the objective for many gains.

        The robust gain and the nominal gain are included.
        """
        axis, u = self.problem.axis, self.scan.coordinate
        middle = 0.5 * (u[:-1] + u[1:])  # a curve of straight lines needs more gains than the search
        order = np.argsort(np.concatenate([u, middle]), kind="stable")
        u, landscape = (
            np.concatenate([u, middle])[order],
            self.scan.landscape.joined(self.problem.landscape(middle), order),
        )
        value, feasible = landscape.objective, landscape.feasible
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
        """The gain with the smallest limit violation, if no gain is feasible.

        None unless the design is infeasible.
        """
        coordinate = self.scan.least_violation
        if self.status is not DesignStatus.INFEASIBLE or coordinate is None:
            return None
        return float(self.problem.axis.gain(coordinate))

    @property
    def reachable(self) -> tuple[tuple[Required, float, float], ...]:
        """The smallest achievable limit of each constraint.

        Each entry has the constraint, this limit, and a gain that meets it with the required probability.
        """
        reachable = []
        for limit, ratios in zip(self.limits, self.scan.landscape.ratios, strict=True):
            best = int(np.argmin(ratios))
            if np.isfinite(ratios[best]):
                gain = float(self.problem.axis.gain(self.scan.coordinate[best]))
                reachable.append((limit, float(ratios[best]) * limit.constraint.limit, gain))
        return tuple(reachable)

    @cached_property
    def relaxations(self) -> tuple[Relaxation, ...]:
        """The limits that must be raised, and to what values, if no gain is feasible.

        Returns:
            The smallest value of each limit, with the other limits and all required probabilities kept; the values of
            several limits if no limit alone suffices. Empty unless the design is infeasible.
        """
        if self.status is not DesignStatus.INFEASIBLE:
            return ()
        limits, effort = [required.constraint for required in self.limits], SAMPLED if self.on_evaluator else MEASURED
        problem = self.problem
        found = relax_on_axis(problem.landscape, problem.axis, self.scan, limits, number=self.number, effort=effort)
        return confirm_relaxations(problem, found) if isinstance(self.measure, WorstCase) else found

    def outcomes(self, gain: float | None = None) -> RobustOutcomes:
        """Test one gain in new random encounters.

        The design did not use these encounters.

        Args:
            gain: the law's number, such as D_p [N s]; the robust gain by default.

        Returns:
            The outcomes, one per fresh sample.

        Raises:
            ResultUnavailableError: there is no gain argument and no robust gain.
        """
        chosen = self.gain if gain is None else float(finite(gain, "gain", self.number.unit))
        if chosen is None:
            raise ResultUnavailableError("outcomes: there is no robust gain; see the status, or pass a gain")
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
        """Compare a gain with exact knowledge of one uncertain input.

        With this knowledge, another gain would be optimal.

        Args:
            name: an uncertain input, such as `obstacle.velocity`.
            count: number of values of the input.
            gain: a gain instead of the robust one, such as the nominal gain.

        Returns:
            The comparison over the input. The other inputs have their given values; inputs that were estimated together
            with it take their likeliest values.

        Raises:
            ResultUnavailableError: the gain was designed with `evaluate`.
        """
        if self.on_evaluator:
            raise ResultUnavailableError(
                "price: found a gain that was designed with evaluate, expected a gain designed in continuous time; "
                "call design_gain with the same evaluate at the values of interest"
            )
        return price_of_robustness(self.problem, name, count, self.gain if gain is None else gain)

    def price_of(self, gain: float, price: Price) -> Price:
        """Compare a different gain with the optimal gains of an earlier comparison.

        Args:
            gain: the compared gain.
            price: a comparison of this design over an uncertain input.

        Returns:
            The comparison over the same values of the input.
        """
        return price_of_gain(self.problem, price, gain)

    @cached_property
    def importance(self) -> tuple[InputImportance, ...]:
        """Influence of each uncertain input on the objective.

        Each share in the variance is computed at the robust gain, largest share first. The shares are Sobol indices
        from as many samples as in the design, and first-order estimates from gradients. The first input is the one to
        measure better. Empty without a robust gain.
        """
        return () if self.gain is None else rank_uncertain_inputs(self.problem, self.gain)

    @cached_property
    def compared(self) -> dict[str, RobustOutcomes]:
        """Results of the robust gain and of other gains.

        All results come from the same new random encounters. The other gains are the nominal gain and no mitigation.
        Without a robust gain, the gain that exceeds the limits least replaces it.
        """
        first = ("nearest gain", self.nearest_gain) if self.gain is None else ("robust gain", self.gain)
        gains = (first, (self.nominal_name, self.nominal_gain), ("no mitigation", 0.0))
        return {name: self.outcomes(gain) for name, gain in gains if gain is not None}

    @property
    def nominal_name(self) -> str:
        """The name that reports use for the nominal gain."""
        return "gain of the ideal design" if self.on_evaluator else "nominal gain"

    @cached_property
    def prices(self) -> tuple[Price, ...]:
        """The loss that exact knowledge of each uncertain input would avoid.

        It is a loss of the robust gain. The largest loss comes first. Empty without a robust gain,
        and with `evaluate`.
        """
        if self.gain is None or self.on_evaluator:
            return ()
        prices = [self.price(name) for name in names_of(self.uncertainty)]
        finite = [price for price in prices if np.isfinite(price.loss).any()]
        return tuple(sorted(finite, key=lambda price: -float(np.nanmax(price.loss))))

    @property
    def headline(self) -> str:
        """A summary of the design in one or two sentences."""
        v = self.validation
        if self.gain is None:
            no_contact = (
                f"The {self.measure.label} of the objective cannot be computed: for every gain within the bounds, too "
                "few encounters end in contact."
            )
            return no_contact if self.status is DesignStatus.NO_CONTACT else f"Infeasible: {_conflict(self)}."
        text = f"Robust {self.number.name} {self.number.equals(self.gain)}: {self.measure.label} of the objective "
        text += f"{self.value:.4g}."
        if v is None or self.nominal_gain is None or v.nominal is None or not math.isfinite(v.value):
            return text
        nominal = f"the {self.nominal_name} {self.number.text(self.nominal_gain)}"
        if not math.isfinite(v.nominal):
            return (
                f"{text} The robust gain cannot be compared with {nominal}: with the {self.nominal_name}, too many "
                "encounters end without contact."
            )
        change = 100 * (v.nominal / v.value - 1)
        worse, conjunction = ("worse", "and") if change >= 0 else ("better", "but")
        several = "s" if len(v.nominal_breaks) > 1 else ""
        broken = (o.limited.words for o in v.limits if o.required.constraint.name in v.nominal_breaks)
        violated = " and ".join(f"the {words}" for words in broken)
        violation = f", {conjunction} exceeds the limit{several} of {violated} too often" if violated else ""
        return f"{text} On fresh samples, {nominal} is {abs(change):.2g} % {worse}{violation}."

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the robust gain, most important first."""
        return tuple(_warnings(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the robust design as a JSON object.

        Numbers are in SI units. Missing numbers are None.
        """
        names = ("status", "gain", "measure", "value", "method", "nominal_gain", "nearest_gain", "validation", "worst")
        more = ("importance", "local_minima", "scanned", "bounds", "samples", "seed", "uncertainty", "warnings")
        others = {
            "objective_name": self.definition.name,
            "relaxations": self.relaxations,
            "jump": self.jump,
            "reachable": [{"name": r.constraint.name, "magnitude": m, "gain": g} for r, m, g in self.reachable],
            "strongest_gain_needed": self.strongest,
        }
        document: dict[str, Any] = plain({**{name: getattr(self, name) for name in (*names, *more)}, **others})
        return document

    def __repr__(self) -> str:
        if self.gain is None:
            return f"<RobustDesign: {self.status.value}>"
        return f"<RobustDesign: {self.number.equals(self.gain)}, {self.measure.label} {self.value:.4g}>"


def _conflict(design: RobustDesign) -> str:
    """Explain why no gain meets all limits."""
    reasons = []
    for required, magnitude, gain in design.reachable:
        c, p = required.constraint, required.probability
        words, unit = design.number.entry(c.quantity).words, design.number.entry(c.quantity).unit
        if magnitude > c.limit:
            reasons.append(
                f"{words} cannot be limited to {format_quantity(c.limit, unit)} "
                f"in {100 * p:g} % of the samples. The smallest possible limit for this percentage is "
                f"{format_quantity(magnitude, unit)}, with {design.number.equals(gain)}"
            )
    if reasons:
        return f"the {'. The '.join(reasons)}"
    limited = (design.number.entry(required.constraint.quantity) for required, *_ in design.reachable)
    names = " and ".join(entry.words for entry in limited)
    return f"no gain meets the limits of {names} together; each limit alone can be met with the required probability"


def _warnings(design: RobustDesign) -> Iterator[str]:
    """Yield the warnings about a robust gain, most important first."""
    yield from design.problem.task.start_warnings(design.gain)
    yield from design.problem.task.warnings
    v = design.validation
    if v is None or design.gain is None:
        return
    if design.jump is not None:
        yield design.jump.warning(design.number)
    if v.reached < 1:
        yield caution(
            "PT309",
            f"{100 * (1 - v.reached):.3g} % of the fresh encounters end without contact: truncate the distributions, "
            f"or accept these encounters. The {design.measure.label} of the objective excludes these encounters or is "
            "infinite",
        )
    for o in v.limits:
        if not v.may_hold(o):
            yield caution(
                "PT310",
                f"the limit of the {o.limited.words} is met in only {share_in_words(o.held)} of the fresh samples "
                f"({100 * o.required.probability:g} % required): use more samples or a slightly larger probability",
            )
    if design.gain in design.bounds:
        yield caution(
            "PT301",
            at_bound_in_words(design.problem.task, design.gain),
        )
