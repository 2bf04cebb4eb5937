"""Evaluate the objective and the limits in simulated random encounters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.designs import ElasticImpact, ImpactModel, Task
from pretouch.designs.custom_objectives import CustomObjective, appraise
from pretouch.designs.quantities import quantity_of, size_of
from pretouch.designs.robust.required import Required, least_probability, limits_of
from pretouch.motion import ContactResult, ContactState, Scenario
from pretouch.motion.layout import PEAKS
from pretouch.motion.scenario import map_fields
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Ensemble, make_ensemble, sample_inputs
from pretouch.uncertainty.ensemble import check_nominal

from .effect import EFFECT, Effect, VerdictStatus, contact_speeds, effect_of

USUAL_MARGIN: Final = 2.0  # gain margin: 6 dB
AT_CONTACT: Final = frozenset({"relative_velocity", "impact_force", "peak_force"})  # quantities that a gain reduces
ROOM: Final = 0.03  # share of a limit; a smaller margin counts as narrow
_ALMOST: Final = 1 - EFFECT  # score of a gain without effect: better than a gain that does harm
_ROUNDING: Final = 1e-12  # share of a limit, as in the validation of robust designs
_COMPARED: Final = 200  # runs on which changes are compared
_COMPARED_SENSORS: Final = 100  # the same if each run has its own sensor curve, which is tabulated first
_FIRST: Final = 0.16  # share of these runs after which gains that certainly miss a requirement are given up
_LEAST_FIRST: Final = 16  # fewer runs than that are not worth a separate call
_WHOLE_MOTION: Final = frozenset({*PEAKS, "drive_force", "gain"})
_COUNT_ROUNDING: Final = 1e-9  # a share times a number of runs may be just above a whole number
_SLOWEST: Final = 1e-9  # m/s: a smaller speed is not divided by
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
    starts: FloatArray | None = None  # distance at which each run begins [m], if some begin before their encounter

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
        """Return simulations of the encounters with one or several gains.

        By default, all encounters are simulated, otherwise only those from `first` to `count`. Several gains have the
        shape (m, 1).
        """
        which = slice(first, self.task.verify.runs if count is None else count)
        several = map_fields(self.scenarios, lambda v: v[which] if np.ndim(v) else v)
        later = loop.after(first)
        if self.starts is not None:
            later = replace(later, start_distance=self.starts[which])
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
    """Return random encounters, drawn with the random seed of the loop.

    The uncertain inputs are points of a scrambled Sobol sequence, so that no seed is lucky: evenly spread encounters
    make exact bounds of probabilities cautious. The noise of each run is independent.

    Raises:
        InvalidInputError: a setting of the controller is uncertain.
    """
    if not task.uncertainty:
        obstacle = task.scenario.obstacle
        alike = replace(obstacle, position=np.full(task.verify.runs, obstacle.position))
        return Draws(task=task, scenarios=replace(task.scenario, obstacle=alike))
    check_nominal(task.uncertainty, task.scenario, task.sensor)
    drawn = sample_inputs(task.uncertainty, task.verify.runs, seed=task.loop.seed)
    values = task.from_detection(drawn)  # the prediction must begin where the law acts
    starts = _undetected_starts(task, drawn, values)
    certain = [name for name in values if name.startswith("admittance.")]
    if certain:
        raise InvalidInputError(
            f"uncertainty: the input {certain[0]} is a setting of the controller and therefore known exactly; "
            "remove this input from the uncertain inputs"
        )
    several = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon, law=task.law)
    sensors = several.sensors() if any(name.startswith("sensor.") for name in values) else ()
    return Draws(task=task, scenarios=several.scenario, ensemble=several, sensors=sensors, starts=starts)


def _undetected_starts(task: Task, drawn: dict[str, FloatArray], values: dict[str, FloatArray]) -> FloatArray | None:
    """Return the drawn distances at which the runs begin [m]. None if all encounters begin where they are drawn."""
    name = "obstacle.position"
    if name not in drawn or not np.any(drawn[name] > values[name]):
        return None
    distance = np.asarray(drawn[name] - drawn.get("plant.position", task.scenario.plant.position), dtype=np.float64)
    return distance if task.loop.start_distance is None else np.maximum(distance, task.loop.start_distance)


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

    def shown(self, confidence: float) -> float:
        """Return the lower confidence bound of the probability that a run meets the condition."""
        return least_probability(int(self.held.sum()), len(self.held), confidence)


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

    def shortfalls(self, total: int, confidence: float, room: float = 0.0) -> FloatArray:
        """Return how far each requirement is from being met with a reserve: at most 1 if it is met.

        A limit with a required probability has a reserve if the runs demonstrate the probability: a lower confidence
        bound reaches it. The smallest number of runs that is needed for this decides which quantile of |quantity| /
        limit is returned. The quantile at the required probability must also keep a share `room` of the limit free.

        Args:
            total: number of runs that count. If fewer were simulated, the others are assumed to meet every requirement;
                the result is then a lower bound.
            confidence: confidence level of the lower bound.
            room: share of a limit that must remain free.

        Returns:
            The ratios for contact, contact speed and each limit, in this order.
        """
        contact, *limited = self.requirements
        missing = int((~contact.held).sum())
        is_whole = self.result.shape[0] >= total  # the mean speed of the first runs is no bound of that of all runs
        ratios = [1 + missing / max(total, 1) if missing else 0.0, self._speed_ratio if is_whole else 0.0]
        for requirement, ratio in zip(limited, self.ratios, strict=True):
            p, values = requirement.probability, np.sort(ratio)
            further = total - len(values)
            free = 1 - (0.0 if requirement.name == "gain" else room)
            at_least = math.ceil(p * total - _COUNT_ROUNDING)
            needed = total if p == 1 else min(count_to_show(total, p, confidence), total)
            shown, reached = (
                float(values[i]) if i >= 0 else 0.0 for i in (k - 1 - further for k in (needed, at_least))
            )
            ratios.append(max(shown, reached / free))
        return np.array(ratios)

    @property
    def _speed_ratio(self) -> float:
        """Contact speed, divided by the highest speed that counts as mitigated; 0 without a comparison."""
        effect = self.effect
        if effect is None:
            return 0.0
        ratio = effect.speed / max((1 - EFFECT) * effect.unmitigated, _SLOWEST)
        return ratio if self.softness == 1 else max(ratio, 1 / self.softness)

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


@cache
def count_to_show(total: int, probability: float, confidence: float) -> int:
    """Return how many of the runs must meet a limit to demonstrate its probability.

    It is more than all runs if there are too few.

    Examples:
        >>> count_to_show(299, 0.99, 0.95), count_to_show(298, 0.99, 0.95), count_to_show(500, 0.95, 0.95)
        (299, 299, 484)
    """
    few, many = math.ceil(probability * total) - 1, total + 1  # as many as `few` never suffice
    while many - few > 1:
        middle = (few + many) // 2
        shown = least_probability(middle, total, confidence) >= probability
        few, many = (few, middle) if shown else (middle, many)
    return many


def status_of(task: Task, outcomes: LoopOutcomes) -> VerdictStatus:
    """Return the status of a gain, such as `holds`.

    Only limits, contact speed and gain margin are judged. Prediction, sensor speed and calibration are ignored.
    """
    effect, margin = outcomes.effect, outcomes.margin
    if not outcomes.is_kept or outcomes.stable < 1:
        return VerdictStatus.DOES_NOT_HOLD
    near = margin is None or margin < USUAL_MARGIN or effect is None or not effect.is_clear
    limits, (_, *requirements) = limits_of(task.constraints), outcomes.requirements
    for limit, ratio, requirement in zip(limits, outcomes.ratios, requirements, strict=True):
        near |= requirement.shown(task.verify.confidence) < limit.probability < 1
        near |= limit.constraint.name != "gain" and 1 - ROOM < float(limit.share(ratio)) <= 1 + _ROUNDING
    return VerdictStatus.HOLDS_NARROWLY if near else VerdictStatus.HOLDS


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopProblem:
    """Random encounters for comparing loops and gains."""

    draws: Draws
    predicted: BoolArray  # which of the encounters end in contact in continuous time
    unmitigated: SimulationResult | None  # runs with gain 0 on the unchanged loop, with which all runs are compared

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
        sensor, c = self.draws.task.sensor, self.draws.task.loop.chain
        slope, xi = np.abs(np.asarray(sensor.log_slope(distance))), np.exp(np.asarray(sensor.log_output(distance)))
        noise = np.hypot(np.hypot(c.noise, c.relative_noise * xi) / xi, slope * c.distance_noise)
        free = self.unmitigated
        ends = np.zeros(0) if free is None else contact_speeds(free)
        fastest = max(ends.max(initial=0.0), np.abs(self.draws.scenarios.relative_velocity).max())  # [m/s]
        return float(fastest * slope.max()), float(noise.max())

    def appraise(self, loop: ClosedLoop, gain: float, count: int | None = None) -> LoopOutcomes:
        """Simulate and evaluate the encounters with one gain; if `count` is given, only the first ones."""
        return self.appraised(self.draws.run(loop, gain, count), loop, gain)

    def appraise_each(
        self, loop: ClosedLoop, gains: FloatArray, runs: int, is_open: Callable[[LoopOutcomes], bool] | None = None
    ) -> list[LoopOutcomes]:
        """Evaluate several gains in the same simulated encounters.

        Args:
            loop: the loop.
            gains: the gains.
            runs: number of runs of each gain.
            is_open: whether a gain can still meet the requirements, judged by its first runs. Other gains are given up
                after these runs. By default, no gain is given up.

        Returns:
            The outcomes of each gain, over its simulated runs.
        """
        draws, loop = self.draws, self.compared(loop)
        first = math.ceil(_FIRST * runs)
        first = runs if first < _LEAST_FIRST or is_open is None else first
        result = draws.run(loop, gains[:, None], first)
        outcomes = [self.appraised(part_of(result, i), loop, gain) for i, gain in enumerate(gains.tolist())]
        if first == runs or is_open is None:
            return outcomes
        open_ones = [i for i, one in enumerate(outcomes) if is_open(one)]
        if not open_ones:
            return outcomes
        rest = draws.run(loop, gains[open_ones, None], runs, first=first)
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
            effect=None if self.unmitigated is None else effect_of(result, self.unmitigated),
        )

    def _ratio(self, limit: Required, result: SimulationResult, loop: ClosedLoop, gain: float) -> FloatArray:
        quantity = limit.constraint.quantity
        magnitude = simulated_quantity(quantity, result, gain, loop, self.draws.task.impact)
        ratio = np.where(np.isfinite(magnitude), size_of(quantity, magnitude) / limit.constraint.limit, np.inf)
        # A gain that avoids a contact also avoids its speed and force, but not the motion before it.
        avoided = 0.0 if quantity in AT_CONTACT else ratio if quantity in _WHOLE_MOTION else np.inf
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


def make_problem(task: Task, gain: float) -> LoopProblem:
    """Draw the encounters of a task, and simulate them without mitigation.

    Args:
        task: the task.
        gain: the gain for which contacts are predicted.

    Returns:
        The encounters, with their runs without mitigation.
    """
    draws = draw_encounters(task)
    predicted = np.isfinite(draws.predicted(gain)[0])
    return LoopProblem(draws=draws, predicted=predicted, unmitigated=draws.run(task.loop, 0.0))


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
