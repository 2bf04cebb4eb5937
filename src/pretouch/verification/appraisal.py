"""The encounters that are drawn, and one loop appraised over them: objective and limits of every run, how it stands."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.design import ElasticImpact, ImpactModel, Task
from pretouch.design.custom_objectives import OwnObjective, appraise
from pretouch.design.robust import Required
from pretouch.design.robust.required import least_probability, limits_of
from pretouch.motion import ContactResult, ContactState, Scenario
from pretouch.motion.scenario import map_fields
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Ensemble, make_ensemble, sample_inputs

from .effect import EFFECT, Effect, VerdictStatus, effect_of

USUAL_MARGIN: Final = 2.0  # of the gain to instability: 6 dB
ROOM: Final = 0.03  # of a limit: with less it is near
_ALMOST: Final = 1 - EFFECT  # how well a gain without effect stands: better than one that does harm
_ROUNDING: Final = 1e-12  # of a limit, as in the validation of robust designs
_COMPARED: Final = 200
_COMPARED_SENSORS: Final = 100  # where each run has a sensor curve of its own, which is tabulated first
_IN_CONTACT: Final = frozenset({"impact_force", "peak_force"})  # the quantities that tell of what comes after a touch


def foreseen_impact(task: Task) -> ImpactModel | None:
    """Return the impact that is predicted with: the given one, else the loop's contact without its loss."""
    contact, mass = task.loop.contact, task.loop.plant.coefficients()[0]
    if task.impact is not None or contact is None or mass == 0:  # of an ideal robot, which meets no contact
        return task.impact
    stiffness, _, exponent, _, inverse = contact.numbers()
    obstacle = 1 / inverse if inverse else math.inf
    return ElasticImpact(robot_mass=mass, obstacle_mass=obstacle, stiffness=stiffness, exponent=exponent)


def predicted_contact(task: Task, gain: float) -> ContactResult:
    """Return how the nominal encounter ends with a gain [N s], in continuous time with a perfect sensor."""
    return task.law.contact(task.scenario, task.sensor, gain, method=task.method, horizon=task.horizon)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draws:
    """Encounters that may happen, the i-th of which always meets the i-th noise."""

    task: Task  # with the nominal encounter and sensor curve
    scenarios: Scenario  # of the shape () or (runs,)
    ensemble: Ensemble | None = None  # None where each is the nominal one
    sensors: tuple[SensorModel, ...] = ()  # where each has one of its own

    @property
    def compared(self) -> int:
        """How many of the runs changes and other gains are compared by."""
        return min(self.task.runs, _COMPARED_SENSORS if self.sensors else _COMPARED)

    @property
    def speed(self) -> FloatArray:
        """|x_o'| of each encounter at the start [m/s]."""
        return self._each(np.abs(self.scenarios.obstacle.velocity))

    @property
    def distance(self) -> FloatArray:
        """The distance of each encounter at the start [m]."""
        return self._each(self.scenarios.distance)

    def run(self, loop: ClosedLoop, gain: ArrayLike, count: int | None = None) -> SimulationResult:
        """Run the first encounters on a loop, `count` or all, with D_p [N s]; several gains have the shape (m, 1)."""
        n = self.task.runs if count is None else count
        several = map_fields(self.scenarios, lambda v: v[:n] if np.ndim(v) else v)
        if not self.sensors:
            return loop.run(several, self.task.sensor, gain)
        return loop.run_each(several, self.sensors[:n], gain)

    def predicted(self, gain: float) -> FloatArray:
        """Return |l'| of each encounter with a gain in continuous time with a perfect sensor [m/s], NaN without one."""
        found = predicted_contact(self.task, gain) if self.ensemble is None else self.ensemble.contacts(gain)
        return self._each(np.where(found.reached, np.abs(found.end.relative_velocity), np.nan))

    def _each(self, value: Any) -> FloatArray:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (self.task.runs,))


def draw_encounters(task: Task) -> Draws:
    """Draw independent encounters, for which exact bounds of a probability hold, by the seed of the task's loop."""
    if not task.uncertainty:
        obstacle = task.scenario.obstacle
        alike = replace(obstacle, position=np.full(task.runs, obstacle.position))
        return Draws(task=task, scenarios=replace(task.scenario, obstacle=alike))
    values = sample_inputs(task.uncertainty, task.runs, seed=task.loop.seed, sampling="random")
    known = [name for name in values if name.startswith("admittance.")]
    if known:
        raise InvalidInputError(
            f"uncertainty: found {known[0]}, which is a number in the law of the loop and known exactly; leave it out"
        )
    several = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon, law=task.law)
    own = several.sensors() if any(name.startswith("sensor.") for name in values) else ()
    return Draws(task=task, scenarios=several.scenario, ensemble=several, sensors=own)


class Requirement(NamedTuple):
    """Something that must come true in a share of the runs."""

    name: str  # of a limit, or `contact`
    held: BoolArray  # in which runs it does
    probability: float  # the share that is required

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
    """What one gain leads to on one loop."""

    result: SimulationResult
    objective: FloatArray  # of each run; infinite without contact
    ratios: tuple[FloatArray, ...]  # |quantity| / limit of each limit and run; infinite without contact
    requirements: tuple[Requirement, ...]  # contact where it is predicted, and every limit
    effect: Effect | None  # on the speed at contact, beside no mitigation; None where no run comes to a contact
    margin: float | None = None  # to instability, which must be 1 at least; None where it is not known

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
        """The speed without mitigation over that with it, where that is harder; 0.99 without effect; else 1."""
        effect = self.effect
        if effect is None or not (effect.is_harder or effect.is_absent):
            return 1.0
        return min(effect.unmitigated / effect.speed, _ALMOST) if effect.is_harder else _ALMOST

    @property
    def is_kept(self) -> bool:
        """Whether everything holds in as many runs as it must, and contact is softer than without mitigation."""
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


def status_of(task: Task, outcomes: LoopOutcomes) -> VerdictStatus:
    """Return the status by limits, effect and margin alone: not by prediction, sensor speed and calibration."""
    effect, margin = outcomes.effect, outcomes.margin
    if not outcomes.is_kept or outcomes.stable < 1:
        return VerdictStatus.DOES_NOT_HOLD
    near = margin is None or margin < USUAL_MARGIN or effect is None or not effect.is_clear
    for limit, ratio in zip(limits_of(task.constraints), outcomes.ratios, strict=True):
        count, p = int((ratio <= 1 + _ROUNDING).sum()), limit.probability
        near |= least_probability(count, len(ratio), task.confidence) < p < 1
        near |= limit.constraint.name != "gain" and 1 - ROOM < float(limit.share(ratio)) <= 1 + _ROUNDING
    return VerdictStatus.HOLDS_NARROWLY if near else VerdictStatus.HOLDS


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopProblem:
    """What a loop is appraised by."""

    draws: Draws
    predicted: BoolArray  # which of the encounters come to a contact in continuous time
    unmitigated: SimulationResult  # of them on the loop with D_p = 0; changes of the loop are held against it too

    def compared(self, loop: ClosedLoop) -> ClosedLoop:
        """Return a loop as far as gains and changes are compared on it: to the contact, unless its forces count."""
        task = self.draws.task
        own = isinstance(task.goal, OwnObjective)
        needed = {constraint.quantity for constraint in task.limits}
        needed |= set() if own else {term.quantity for term in task.goal.terms}
        # what is said of each run until contact is the same to the bit
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
        limits, touched = limits_of(self.draws.task.constraints), result.touched
        ratios = tuple(self._ratio(limit, result, loop, gain) for limit in limits)
        met = (
            Requirement(limit.constraint.name, ratio <= 1 + _ROUNDING, limit.probability)
            for limit, ratio in zip(limits, ratios, strict=True)
        )
        return LoopOutcomes(
            result=result,
            objective=self._objective(result, loop, gain),
            ratios=ratios,
            requirements=(Requirement("contact", touched[self.predicted[: len(touched)]], 1.0), *met),
            effect=effect_of(result, self.unmitigated),
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


def simulated_quantity(
    name: str, result: SimulationResult, gain: float, loop: ClosedLoop, impact: ImpactModel | None
) -> FloatArray:
    """Read a quantity of objectives and limits, or `peak_force`, of every run; NaN where it speaks of no contact."""
    if name == "gain":
        return np.full(result.shape, gain)
    known: Any = impact  # the ideal design has refused what needs physical properties and has none
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
