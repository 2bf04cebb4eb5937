"""Evaluate the objective and the limits in simulated random encounters."""

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
from pretouch.design.custom_objectives import CustomObjective, appraise
from pretouch.design.quantities import quantity_of, size_of
from pretouch.design.robust import Required
from pretouch.design.robust.required import least_probability, limits_of
from pretouch.motion import ContactResult, ContactState, Scenario
from pretouch.motion.layout import PEAKS
from pretouch.motion.scenario import map_fields
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Ensemble, make_ensemble, sample_inputs
from pretouch.uncertainty.ensemble import check_nominal

from .effect import EFFECT, Effect, VerdictStatus, effect_of

USUAL_MARGIN: Final = 2.0  # gain margin: 6 dB
ROOM: Final = 0.03  # share of a limit; a smaller margin counts as narrow
_ALMOST: Final = 1 - EFFECT  # score of a gain without effect: better than a gain that does harm
_ROUNDING: Final = 1e-12  # share of a limit, as in the validation of robust designs
_COMPARED: Final = 200  # runs on which changes are compared
_COMPARED_SENSORS: Final = 100  # the same if each run has its own sensor curve, which is tabulated first
_FIRST: Final = 0.16  # share of these runs after which gains that certainly miss a requirement are given up
_LEAST_FIRST: Final = 16  # fewer runs than that are not worth a separate call
_AT_CONTACT: Final = frozenset({"relative_velocity", "impact_force", "peak_force"})
_WHOLE_MOTION: Final = frozenset({*PEAKS, "drive_force", "gain"})
_IN_CONTACT: Final = frozenset({"impact_force", "peak_force"})  # quantities that arise after the first touch


def foreseen_impact(task: Task) -> ImpactModel | None:
    """Return the impact model that predicts the impact force.

    It is the impact model of the task. By default, it is a lossless impact with the simulated contact stiffness, or
    None if contact forces are not simulated.
    """
    contact, mass = task.loop.contact, task.loop.plant.coefficients()[0]
    if task.impact is not None or contact is None or mass == 0:  # an ideal robot has no mass and no contact force
        return task.impact
    stiffness, _, exponent, _, inverse = contact.numbers()
    obstacle = 1 / inverse if inverse else math.inf
    return ElasticImpact(robot_mass=mass, obstacle_mass=obstacle, stiffness=stiffness, exponent=exponent)


def predicted_contact(task: Task, gain: float) -> ContactResult:
    """Predict the contact of the nominal encounter with a gain.

    Returns:
        The contact in continuous time, with a perfect sensor.
    """
    return task.law.contact(task.scenario, task.sensor, gain, method=task.method, horizon=task.horizon)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draws:
    """Random encounters of robot and object, each with its own sensor noise.

    Encounter i always has the i-th noise sequence.
    """

    task: Task  # with the nominal encounter and sensor curve
    scenarios: Scenario  # shape () or (runs,)
    ensemble: Ensemble | None = None  # None if every run has the nominal encounter
    sensors: tuple[SensorModel, ...] = ()  # one for each run if sensor parameters are uncertain

    @property
    def compared(self) -> int:
        """Number of runs in which gains and changed loops are compared."""
        return min(self.task.verify.runs, _COMPARED_SENSORS if self.sensors else _COMPARED)

    @property
    def speed(self) -> FloatArray:
        """Speed of the obstacle at the start of each encounter [m/s]."""
        return self._each(np.abs(self.scenarios.obstacle.velocity))

    @property
    def distance(self) -> FloatArray:
        """Distance at the start of each encounter [m]."""
        return self._each(self.scenarios.distance)

    def run(self, loop: ClosedLoop, gain: ArrayLike, count: int | None = None, *, first: int = 0) -> SimulationResult:
        """Simulate the encounters with one or several gains."""
        # By default, all encounters are simulated, otherwise only those from `first` to `count`. Several gains have the
        # shape (m, 1).
        which = slice(first, self.task.verify.runs if count is None else count)
        several = map_fields(self.scenarios, lambda v: v[which] if np.ndim(v) else v)
        later = loop.after(first)
        if not self.sensors:
            return later.run(several, self.task.sensor, gain)
        return later.run_each(several, self.sensors[which], gain)

    def predicted(self, gain: float) -> tuple[FloatArray, FloatArray]:
        """Return the predicted speed [m/s] and time [s] of each contact.

        The prediction is in continuous time. Both are NaN without contact.
        """
        result = predicted_contact(self.task, gain) if self.ensemble is None else self.ensemble.contacts(gain)
        speed, time = np.abs(result.end.relative_velocity), result.end.time
        return self._each(np.where(result.reached, speed, np.nan)), self._each(np.where(result.reached, time, np.nan))

    def _each(self, value: Any) -> FloatArray:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (self.task.verify.runs,))


def draw_encounters(task: Task) -> Draws:
    """Sample independent random encounters, using the random seed of the loop."""
    # Exact confidence bounds need independent encounters.
    if not task.uncertainty:
        obstacle = task.scenario.obstacle
        alike = replace(obstacle, position=np.full(task.verify.runs, obstacle.position))
        return Draws(task=task, scenarios=replace(task.scenario, obstacle=alike))
    check_nominal(task.uncertainty, task.scenario, task.sensor)
    values = sample_inputs(task.uncertainty, task.verify.runs, seed=task.loop.seed, sampling="random")
    certain = [name for name in values if name.startswith("admittance.")]
    if certain:
        raise InvalidInputError(
            f"uncertainty: the input {certain[0]} is a setting of the controller and therefore known exactly; "
            "remove this input from the uncertain inputs"
        )
    several = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon, law=task.law)
    sensors = several.sensors() if any(name.startswith("sensor.") for name in values) else ()
    return Draws(task=task, scenarios=several.scenario, ensemble=several, sensors=sensors)


class Requirement(NamedTuple):
    """A requirement on the simulated runs, such as a limit.

    The required share of the runs must meet its condition.
    """

    name: str  # name of a limit, or `contact`
    held: BoolArray  # the runs in which the condition holds
    probability: float  # the required share of the runs

    @property
    def standing(self) -> float:
        """How well the runs meet the requirement, from 0 to 1.

        It is the share of the runs that meet the condition, divided by the required share.
        """
        return min(float(self.held.mean()) / self.probability, 1.0) if len(self.held) else 1.0

    @property
    def is_met(self) -> bool:
        """True if enough simulated runs meet the condition."""
        return self.standing >= 1 - _ROUNDING

    def after(self, further: int) -> Requirement:
        """Return the requirement as if further runs met its condition."""
        return self._replace(held=np.concatenate([self.held, np.ones(further, dtype=bool)]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopOutcomes:
    """Results of one gain in many simulated runs of one control loop."""

    result: SimulationResult
    objective: FloatArray  # objective of each run; infinite without contact
    ratios: tuple[FloatArray, ...]  # |quantity| / limit of each limit and run; infinite without a predicted contact
    requirements: tuple[Requirement, ...]  # contact in the encounters for which it is predicted, and every limit
    effect: Effect | None  # change of the speed at contact by the gain; None if no run ends in contact
    margin: float | None = None  # gain margin, at least 1 if stable; None if it is not known

    @property
    def standing(self) -> float:
        """Score of the gain, from 0 (worst) to 1 (best).

        It is the smallest of the scores for limits, stability and softer contact.
        """
        return min(self.softness, self.stable, *(r.standing for r in self.requirements))

    @property
    def stable(self) -> float:
        """Score for stability, from 0 (worst) to 1 (best).

        It is the gain margin, but at most 1. If the margin is unknown, it is 1.
        """
        return 1.0 if self.margin is None else min(self.margin, 1.0)

    @property
    def worst(self) -> Requirement:
        """The requirement with the lowest score.

        If all requirements are met, it is the first one.
        """
        return min(self.requirements, key=lambda r: r.standing)

    @property
    def softness(self) -> float:
        """Score of the contact speed, from 0 (worst) to 1 (best).

        It is 1 if the gain makes contact softer than without mitigation, or if no run ends in contact. It is
        unmitigated speed / speed if contact is harder with the gain, and 0.99 if the gain has no effect.
        """
        effect = self.effect
        if effect is None or not (effect.is_harder or effect.is_absent):
            return 1.0
        return min(effect.unmitigated / effect.speed, _ALMOST) if effect.is_harder else _ALMOST

    def best_standing(self, further: int) -> float:
        """Return the largest possible score after further simulated runs."""
        return min(r.after(further).standing for r in self.requirements)

    @property
    def is_kept(self) -> bool:
        """True if the gain meets all requirements and makes contact softer."""
        return self.softness == 1 and all(r.is_met for r in self.requirements)

    @property
    def mean(self) -> float:
        """Mean objective over the simulated runs.

        It is infinite if a run ends without contact.
        """
        return float(self.objective.mean())

    @property
    def whole_share(self) -> float:
        """Share of the runs with contact and all limits met."""
        held = [r.held for r in self.requirements if r.name != "contact"]
        return float(np.all([self.result.touched, *held], axis=0).mean())


def status_of(task: Task, outcomes: LoopOutcomes) -> VerdictStatus:
    """Return the status of a gain, such as `holds`.

    Only limits, contact speed and gain margin are judged.
    """
    # Prediction, sensor speed and calibration are ignored.
    effect, margin = outcomes.effect, outcomes.margin
    if not outcomes.is_kept or outcomes.stable < 1:
        return VerdictStatus.DOES_NOT_HOLD
    near = margin is None or margin < USUAL_MARGIN or effect is None or not effect.is_clear
    for limit, ratio in zip(limits_of(task.constraints), outcomes.ratios, strict=True):
        count, p = int((ratio <= 1 + _ROUNDING).sum()), limit.probability
        near |= least_probability(count, len(ratio), task.verify.confidence) < p < 1
        near |= limit.constraint.name != "gain" and 1 - ROOM < float(limit.share(ratio)) <= 1 + _ROUNDING
    return VerdictStatus.HOLDS_NARROWLY if near else VerdictStatus.HOLDS


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopProblem:
    """Random encounters for comparing loops and gains."""

    draws: Draws
    predicted: BoolArray  # which of the encounters end in contact in continuous time
    unmitigated: SimulationResult  # runs with gain 0 on the unchanged loop; changed loops are compared with them, too

    def compared(self, loop: ClosedLoop) -> ClosedLoop:
        """Return a copy of the loop whose runs end at contact.

        If the objective or the limits need contact forces, the loop is unchanged.
        """
        task = self.draws.task
        custom = isinstance(task.goal, CustomObjective)
        needed = {constraint.quantity for constraint in task.limits}
        needed |= set() if custom else {term.quantity for term in task.goal.terms}
        # up to contact, the results are bit-identical with those of the whole loop
        return loop if custom or needed & _IN_CONTACT else replace(loop, follow_time=0.0)

    def changes_of_level(self, distance: FloatArray) -> tuple[float, float]:
        """Return the largest rate of change and noise of the log output.

        They are the largest rate of change [1/s], and the largest standard deviation of the noise at the distances.
        """
        sensor, c, free = self.draws.task.sensor, self.draws.task.loop.chain, self.unmitigated
        slope, xi = np.abs(np.asarray(sensor.log_slope(distance))), np.exp(np.asarray(sensor.log_output(distance)))
        noise = np.hypot(np.hypot(c.noise, c.relative_noise * xi) / xi, slope * c.distance_noise)
        ends = np.abs(free.relative_velocity[free.touched])
        fastest = max(ends.max(initial=0.0), np.abs(self.draws.scenarios.relative_velocity).max())  # [m/s]
        return float(fastest * slope.max()), float(noise.max())

    def appraise(self, loop: ClosedLoop, gain: float, count: int | None = None) -> LoopOutcomes:
        """Simulate the encounters with one gain, and evaluate the runs."""
        # If `count` is given, only the first `count` encounters are simulated.
        return self.appraised(self.draws.run(loop, gain, count), loop, gain)

    def appraise_each(self, gains: FloatArray) -> list[LoopOutcomes]:
        """Evaluate several gains in the same simulated encounters."""
        # A gain is given up if its first runs miss a requirement so often that all runs together must miss it. All
        # runs would give the same decision, so it has no error.
        draws, loop = self.draws, self.compared(self.draws.task.loop)
        several = draws.compared
        first = math.ceil(_FIRST * several)
        first = several if first < _LEAST_FIRST else first
        runs = draws.run(loop, gains[:, None], first)
        outcomes = [self.appraised(part_of(runs, i), loop, gain) for i, gain in enumerate(gains.tolist())]
        open_ones = [i for i, one in enumerate(outcomes) if one.best_standing(several - first) >= 1 - _ROUNDING]
        if first == several or not open_ones:
            return outcomes
        rest = draws.run(loop, gains[open_ones, None], several, first=first)
        for k, i in enumerate(open_ones):
            outcomes[i] = self.appraised(joined(outcomes[i].result, part_of(rest, k)), loop, float(gains[i]))
        return outcomes

    def appraised(self, result: SimulationResult, loop: ClosedLoop, gain: float) -> LoopOutcomes:
        """Evaluate the simulated runs of one gain."""
        limits, touched = limits_of(self.draws.task.constraints), result.touched
        ratios = tuple(self._ratio(limit, result, loop, gain) for limit in limits)
        requirements = (
            Requirement(limit.constraint.name, ratio <= 1 + _ROUNDING, limit.probability)
            for limit, ratio in zip(limits, ratios, strict=True)
        )
        return LoopOutcomes(
            result=result,
            objective=self._objective(result, loop, gain),
            ratios=ratios,
            requirements=(Requirement("contact", touched[self.predicted[: len(touched)]], 1.0), *requirements),
            effect=effect_of(result, self.unmitigated),
        )

    def _ratio(self, limit: Required, result: SimulationResult, loop: ClosedLoop, gain: float) -> FloatArray:
        quantity = limit.constraint.quantity
        magnitude = simulated_quantity(quantity, result, gain, loop, self.draws.task.impact)
        ratio = np.where(np.isfinite(magnitude), size_of(quantity, magnitude) / limit.constraint.limit, np.inf)
        # A gain that avoids a contact also avoids its speed and force, but not the motion before it.
        avoided = 0.0 if quantity in _AT_CONTACT else ratio if quantity in _WHOLE_MOTION else np.inf
        without = np.where(self.predicted[: len(ratio)], np.inf, avoided)
        return np.where(result.touched, ratio, without)

    def _objective(self, result: SimulationResult, loop: ClosedLoop, gain: float) -> FloatArray:
        objective, impact = self.draws.task.goal, self.draws.task.impact
        speed, value = self.draws.speed[: result.shape[0]], np.zeros(result.shape)
        if isinstance(objective, CustomObjective):
            state = ContactState(_Runs(result, gain, loop, impact))
            return appraise(objective, state, result.touched, speed, impact)
        for term in objective.terms:
            quantity = simulated_quantity(term.quantity, result, gain, loop, impact)
            value = value + term.weight * (quantity / term.scale_for(speed)) ** 2
        return np.where(result.touched & np.isfinite(value), value, np.inf)


def part_of(result: SimulationResult, which: int | slice) -> SimulationResult:
    """Return the results of selected simulated runs.

    Do not use the method `trace` of the returned result.
    """
    columns = {name: column[which] for name, column in result.columns.items()}
    return SimulationResult(columns, result.contact_list[which], result.trace_of)


def joined(first: SimulationResult, rest: SimulationResult) -> SimulationResult:
    """Return the joined results of two sets of simulated runs.

    Do not use the method `trace` of the joined result.
    """
    columns = {name: np.concatenate([column, rest.columns[name]]) for name, column in first.columns.items()}
    return SimulationResult(columns, np.concatenate([first.contact_list, rest.contact_list]), first.trace_of)


def simulated_quantity(
    name: str, result: SimulationResult, gain: float, loop: ClosedLoop, impact: ImpactModel | None
) -> FloatArray:
    """Return one quantity of every simulated run.

    NaN if the quantity needs a contact that did not happen.
    """
    if name == "gain":
        return np.full(result.shape, gain)
    model: Any = impact  # not None if needed: the ideal design refuses objectives that lack physical properties
    if name == "impact_force" and loop.contact is None:
        return np.asarray(model.peak_force(result.relative_velocity))
    if name == "impact_force":
        return np.where(result.touched, result.impact_force, np.nan)
    if name == "drive_force":
        mass = loop.plant.coefficients()[0] or model.robot_mass  # an ideal robot has no mass
        return mass * np.asarray(result.largest_acceleration)
    if name not in result.columns:  # a user-defined quantity, computed from others
        return np.asarray(quantity_of(name, ContactState(_Runs(result, gain, loop, impact)), impact), dtype=np.float64)
    return np.asarray(getattr(result, name), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _Runs(Value):
    """Quantities of simulated runs, named as in `ContactState`."""

    result: SimulationResult
    gain: float
    loop: ClosedLoop
    impact: ImpactModel | None

    def column(self, name: str) -> FloatArray:
        """Return one quantity of every simulated run."""
        return simulated_quantity(name, self.result, self.gain, self.loop, self.impact)
