"""One loop appraised over the drawn encounters: objective and limits of every run, and how well it stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.design import ImpactModel, Objective
from pretouch.design.own_objective import OwnObjective, appraise
from pretouch.design.robust import Required
from pretouch.simulation import ClosedLoop, SimulationResult

from .draws import Draws
from .parts import Effect
from .simulated import simulated_quantity, simulated_state

__all__ = ["LoopProblem", "Outcomes", "Requirement", "effect_of", "mean_and_error"]

_ROUNDING: Final = 1e-12  # of a limit, as in the validation of robust designs
_IN_CONTACT: Final = frozenset({"impact_force", "peak_force"})  # the quantities that tell of what comes after a touch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Requirement:
    """Something that must come true in a share of the runs.

    Args:
        name: what it is called: that of a limit, or `contact`.
        held: in which runs it does.
        probability: the share that is required.
    """

    name: str
    held: BoolArray
    probability: float

    @property
    def standing(self) -> float:
        """The share that holds beside the one required, at most 1."""
        return min(float(self.held.mean()) / self.probability, 1.0) if len(self.held) else 1.0

    @property
    def is_met(self) -> bool:
        """Whether it holds in as many runs as it must."""
        return self.standing >= 1 - _ROUNDING


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcomes:
    """What one gain leads to on one loop.

    Args:
        result: the runs.
        objective: of each; infinite without contact.
        ratios: |quantity| / limit of each limit and run; infinite without contact.
        requirements: contact where it is predicted, and every limit.
        effect: on the speed at contact, beside no mitigation; None where it cannot be compared.
    """

    result: SimulationResult
    objective: FloatArray
    ratios: tuple[FloatArray, ...]
    requirements: tuple[Requirement, ...]
    effect: Effect | None

    @property
    def standing(self) -> float:
        """The least share held beside the one required, or of the speed without mitigation where it is less; <= 1."""
        return min(self.softness, *(r.standing for r in self.requirements))

    @property
    def softness(self) -> float:
        """The speed at contact without mitigation beside that with it, where mitigation makes it harder; else 1."""
        effect = self.effect
        return effect.unmitigated / effect.speed if effect is not None and effect.is_harder else 1.0

    @property
    def is_kept(self) -> bool:
        """Whether everything holds in as many runs as it must, and mitigation makes contact no harder."""
        return self.softness == 1 and all(r.is_met for r in self.requirements)

    @property
    def mean(self) -> float:
        """The mean objective; infinite where a run ends without contact."""
        return float(self.objective.mean())

    @property
    def whole_share(self) -> float:
        """The share of runs in which all holds at once."""
        held = [r.held for r in self.requirements if r.name != "contact"]
        return float(np.all([self.result.touched, *held], axis=0).mean())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopProblem:
    """What a loop is appraised by.

    Args:
        draws: the encounters.
        objective: what is minimized.
        limits: what must hold, each with its probability.
        impact: physical properties, where given.
        predicted: which encounters come to a contact in continuous time.
        unmitigated: the encounters on the loop with D_p = 0; changes of the loop are held against it too.
    """

    draws: Draws
    objective: Objective
    limits: tuple[Required, ...]
    impact: ImpactModel | None
    predicted: BoolArray
    unmitigated: SimulationResult

    def compared(self, loop: ClosedLoop) -> ClosedLoop:
        """Return a loop as far as gains and changes are compared on it: to the contact, unless its forces count.

        Args:
            loop: the loop.

        Returns:
            The loop; what it says of each run until contact is the same to the bit.
        """
        own = isinstance(self.objective, OwnObjective)
        asked = {limit.constraint.quantity for limit in self.limits}
        asked |= set() if own else {term.quantity for term in self.objective.terms}
        return loop if own or asked & _IN_CONTACT else replace(loop, follow=0.0)

    def appraise(self, loop: ClosedLoop, gain: float, count: int | None = None) -> Outcomes:
        """Run encounters and appraise each.

        Args:
            loop: the loop.
            gain: D_p [N s].
            count: how many of the encounters, the first ones; all by default.

        Returns:
            What they come to.
        """
        return self.appraised(self.draws.run(loop, gain, count), loop, gain)

    def appraised(self, result: SimulationResult, loop: ClosedLoop, gain: float) -> Outcomes:
        """Appraise runs.

        Args:
            result: the runs, of the first encounters.
            loop: what they ran on.
            gain: D_p [N s].

        Returns:
            What they come to.
        """
        n = result.shape[0]
        ratios = tuple(self._ratio(limit, result, loop, gain) for limit in self.limits)
        expected = self.predicted[:n]
        found = [Requirement(name="contact", held=result.touched[expected], probability=1.0)]
        found += [
            Requirement(name=limit.constraint.name, held=ratio <= 1 + _ROUNDING, probability=limit.probability)
            for limit, ratio in zip(self.limits, ratios, strict=True)
        ]
        return Outcomes(
            result=result,
            objective=self._objective(result, loop, gain),
            ratios=ratios,
            requirements=tuple(found),
            effect=effect_of(result, self.unmitigated) if gain < 0 else None,
        )

    def _ratio(self, limit: Required, result: SimulationResult, loop: ClosedLoop, gain: float) -> FloatArray:
        found = simulated_quantity(limit.constraint.quantity, result, gain, loop, self.impact)
        return np.where(result.touched & np.isfinite(found), np.abs(found) / limit.constraint.limit, np.inf)

    def _objective(self, result: SimulationResult, loop: ClosedLoop, gain: float) -> FloatArray:
        speed, value = self.draws.speed[: result.shape[0]], np.zeros(result.shape)
        if isinstance(self.objective, OwnObjective):
            state = simulated_state(result, gain, loop, self.impact)
            return appraise(self.objective, state, result.touched, speed, self.impact)
        for term in self.objective.terms:
            found = simulated_quantity(term.quantity, result, gain, loop, self.impact)
            value = value + term.weight * (found / term.scale_for(speed)) ** 2
        return np.where(result.touched & np.isfinite(value), value, np.inf)


def effect_of(result: SimulationResult, unmitigated: SimulationResult) -> Effect | None:
    """Hold the speed at contact against that of the same runs without mitigation.

    Args:
        result: the runs, of the first encounters.
        unmitigated: the encounters with D_p = 0.

    Returns:
        What mitigation does to it; None where no run comes to a contact both with and without.
    """
    n = result.shape[0]
    both = result.touched & unmitigated.touched[:n]
    if not both.any():
        return None
    speed, free = (np.abs(np.asarray(r.relative_velocity)[:n][both]) for r in (result, unmitigated))
    difference, error = mean_and_error(speed - free)
    return Effect(
        speed=float(speed.mean()),
        unmitigated=float(free.mean()),
        difference=difference,
        standard_error=error,
        runs=len(speed),
    )


def mean_and_error(values: FloatArray) -> tuple[float, float]:
    """Return the mean of values and its standard error; NaN for either where a value is infinite.

    Args:
        values: the values of independent runs.

    Returns:
        Both.
    """
    if not len(values) or not np.isfinite(values).all():
        return float("nan"), float("nan")
    error = float(np.std(values, ddof=1)) / np.sqrt(len(values)) if len(values) > 1 else float("nan")
    return float(np.mean(values)), float(error)
