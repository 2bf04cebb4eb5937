"""One loop appraised over the drawn encounters: objective and limits of every run, and how well it stands."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.design import ImpactModel
from pretouch.design.own_objective import OwnObjective, appraise
from pretouch.design.robust import Required
from pretouch.design.robust.design import limits_of
from pretouch.motion import ContactState
from pretouch.simulation import ClosedLoop, SimulationResult

from .request import Draws

__all__ = [
    "Effect",
    "LoopOutcomes",
    "LoopProblem",
    "Requirement",
    "effect_of",
    "mean_and_error",
    "part_of",
    "simulated_quantity",
]

_ERRORS: Final = 2.0  # standard errors: one in twenty differences is larger by chance, and half of these harder
_SAME: Final = 1e-9  # of a speed: without noise, runs that do the same differ by less
_ROUNDING: Final = 1e-12  # of a limit, as in the validation of robust designs
_IN_CONTACT: Final = frozenset({"impact_force", "peak_force"})  # the quantities that tell of what comes after a touch


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect(Value):
    """What mitigation does to the speed at contact, over the runs that come to a contact both with and without it.

    Args:
        speed: mean |l'| with mitigation [m/s].
        unmitigated: mean |l'| with D_p = 0 [m/s].
        difference: mean of the one less the other, run by run [m/s].
        standard_error: of that mean; NaN for a single run.
        runs: how many.

    Examples:
        >>> Effect(speed=0.39, unmitigated=0.3, difference=0.09, standard_error=0.01, runs=20).is_harder
        True
    """

    speed: float
    unmitigated: float
    difference: float
    standard_error: float
    runs: int

    @property
    def is_harder(self) -> bool:
        """Whether contact is harder with mitigation, by more than two standard errors and rounding."""
        return self.difference > self._chance

    @property
    def is_softer(self) -> bool:
        """Whether contact is softer with mitigation, by more than two standard errors and rounding."""
        return -self.difference > self._chance

    def to_dict(self) -> dict[str, Any]:
        """Return the effect as one JSON object, in SI."""
        return {**asdict(self), "is_harder": self.is_harder}

    @property
    def _chance(self) -> float:
        chance = _ERRORS * self.standard_error if math.isfinite(self.standard_error) else 0.0
        return max(chance, _SAME * self.unmitigated)


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
class LoopOutcomes:
    """What one gain leads to on one loop.

    Args:
        result: the runs.
        objective: of each; infinite without contact.
        ratios: |quantity| / limit of each limit and run; infinite without contact.
        requirements: contact where it is predicted, and every limit.
        effect: on the speed at contact, beside no mitigation; None where it cannot be compared.
        margin: to instability, which must be 1 at least; None where it is not known.
    """

    result: SimulationResult
    objective: FloatArray
    ratios: tuple[FloatArray, ...]
    requirements: tuple[Requirement, ...]
    effect: Effect | None
    margin: float | None = None

    @property
    def standing(self) -> float:
        """How well it stands, at most 1: what is missed most of requirements, stability and softness."""
        return min(self.softness, self.stable, *(r.standing for r in self.requirements))

    @property
    def stable(self) -> float:
        """The margin to instability, at most 1; 1 where it is not known."""
        return 1.0 if self.margin is None else min(self.margin, 1.0)

    @property
    def worst(self) -> Requirement:
        """The requirement that is missed most, or the first where none is."""
        return min(self.requirements, key=lambda r: r.standing)

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
        draws: the encounters, with what was asked.
        predicted: which of them come to a contact in continuous time.
        unmitigated: the encounters on the loop with D_p = 0; changes of the loop are held against it too.
    """

    draws: Draws
    predicted: BoolArray
    unmitigated: SimulationResult

    def compared(self, loop: ClosedLoop) -> ClosedLoop:
        """Return a loop as far as gains and changes are compared on it: to the contact, unless its forces count.

        What it says of each run until contact is the same to the bit.
        """
        task = self.draws.task
        own = isinstance(task.goal, OwnObjective)
        needed = {constraint.quantity for constraint in task.limits}
        needed |= set() if own else {term.quantity for term in task.goal.terms}
        return loop if own or needed & _IN_CONTACT else replace(loop, follow=0.0)

    def appraise(self, loop: ClosedLoop, gain: float, count: int | None = None) -> LoopOutcomes:
        """Run encounters, the first `count` or all, and appraise each; the gain is D_p [N s]."""
        return self.appraised(self.draws.run(loop, gain, count), loop, gain)

    def appraise_each(self, gains: FloatArray) -> list[LoopOutcomes]:
        """Run the encounters that gains [N s] are compared by with each of them, shape (m,), and appraise all runs."""
        loop = self.compared(self.draws.task.loop)
        runs = self.draws.run(loop, gains[:, None], self.draws.compared)
        return [self.appraised(part_of(runs, i), loop, gain) for i, gain in enumerate(gains.tolist())]

    def appraised(self, result: SimulationResult, loop: ClosedLoop, gain: float) -> LoopOutcomes:
        """Return what runs of the first encounters come to, on the loop and with the gain [N s] that they ran with."""
        limits = limits_of(self.draws.task)
        ratios = tuple(self._ratio(limit, result, loop, gain) for limit in limits)
        expected = self.predicted[: result.shape[0]]
        found = [Requirement(name="contact", held=result.touched[expected], probability=1.0)]
        found += [
            Requirement(name=limit.constraint.name, held=ratio <= 1 + _ROUNDING, probability=limit.probability)
            for limit, ratio in zip(limits, ratios, strict=True)
        ]
        return LoopOutcomes(
            result=result,
            objective=self._objective(result, loop, gain),
            ratios=ratios,
            requirements=tuple(found),
            effect=effect_of(result, self.unmitigated) if gain < 0 else None,
        )

    def _ratio(self, limit: Required, result: SimulationResult, loop: ClosedLoop, gain: float) -> FloatArray:
        found = simulated_quantity(limit.constraint.quantity, result, gain, loop, self.draws.task.impact)
        return np.where(result.touched & np.isfinite(found), np.abs(found) / limit.constraint.limit, np.inf)

    def _objective(self, result: SimulationResult, loop: ClosedLoop, gain: float) -> FloatArray:
        objective, impact = self.draws.task.goal, self.draws.task.impact
        speed, value = self.draws.speed[: result.shape[0]], np.zeros(result.shape)
        if isinstance(objective, OwnObjective):
            state = ContactState(_Runs(result, gain, loop, impact))
            return appraise(objective, state, result.touched, speed, impact)
        for term in objective.terms:
            found = simulated_quantity(term.quantity, result, gain, loop, impact)
            value = value + term.weight * (found / term.scale_for(speed)) ** 2
        return np.where(result.touched & np.isfinite(value), value, np.inf)


def part_of(result: SimulationResult, which: int | slice) -> SimulationResult:
    """Return some of the runs along the first axis, which are not traced."""
    columns = {name: column[which] for name, column in result.columns.items()}
    return SimulationResult(columns, result.contact_list[which], result.trace_of)


def effect_of(result: SimulationResult, unmitigated: SimulationResult) -> Effect | None:
    """Return what mitigation does to the speed at contact of the first encounters, beside the same with D_p = 0.

    None where no run comes to a contact both with and without.
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
    """Return the mean of the values of independent runs and its standard error; NaN for both where one is infinite."""
    if not len(values) or not np.isfinite(values).all():
        return math.nan, math.nan
    error = float(np.std(values, ddof=1)) / np.sqrt(len(values)) if len(values) > 1 else math.nan
    return float(np.mean(values)), float(error)


def simulated_quantity(
    name: str, result: SimulationResult, gain: float, loop: ClosedLoop, impact: ImpactModel | None
) -> FloatArray:
    """Read a quantity of every run.

    Args:
        name: the quantity, one of those of objectives and limits, or `peak_force`.
        result: the runs.
        gain: D_p of the runs [N s].
        loop: what they ran on.
        impact: physical properties, where given; the ideal design has refused what needs them and has none.

    Returns:
        The quantity in SI with its sign, NaN in runs without contact where it speaks of contact.
    """
    if name == "gain":
        return np.full(result.shape, gain)
    known: Any = impact
    if name == "impact_force" and loop.contact is None:
        return np.asarray(known.peak_force(result.relative_velocity))
    if name == "impact_force":
        return np.where(result.touched, result.impact_force, np.nan)
    if name == "drive_force":
        mass = loop.plant.coefficients()[0] or known.robot_mass  # an ideal robot has no mass of its own
        return mass * np.asarray(result.largest_acceleration)
    return np.asarray(getattr(result, name), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _Runs(Value):
    """The quantities of simulated runs, as a ContactState reads them."""

    result: SimulationResult
    gain: float
    loop: ClosedLoop
    impact: ImpactModel | None

    def column(self, name: str) -> FloatArray:
        """Return a quantity of every run."""
        return simulated_quantity(name, self.result, self.gain, self.loop, self.impact)
