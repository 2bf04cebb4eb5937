"""Compare simulated runs with the prediction and with the limits of the task."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.designs import ImpactModel, Task, quantity_of
from pretouch.designs.quantities import size_of
from pretouch.designs.robust.required import least_probability, limits_of
from pretouch.motion import ContactResult
from pretouch.motion.page_sections import mounting_in_words
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.simulation.closed_loop import loop_sentences
from pretouch.simulation.detection import DetectionRange, moved_on, time_at
from pretouch.uncertainty.ensemble import uncertainty_in_words

from .appraisal import LoopOutcomes, LoopProblem, foreseen_impact
from .effect import mean_and_error
from .result import ApproachCheck, Comparison, LimitCheck, Reached, RunSpread

_COMPARED: Final = ("relative_velocity", "time", "largest_excursion", "largest_virtual_force", "largest_speed")
_ROUNDING: Final = 1e-9  # relative rounding error of a force
_NEAR_END: Final = 0.9  # share of the horizon after which a predicted contact may come too late for the runs


def compare_quantities(
    task: Task,
    runs: tuple[SimulationResult, SimulationResult],
    foreseen: tuple[ContactResult, ContactResult],
) -> tuple[Comparison, ...]:
    """Compare simulated and predicted contact quantities, with and without impact mitigation."""
    contact, impact = task.loop.contact, foreseen_impact(task)
    names = [*_COMPARED, *(["impact_force"] if contact is not None else [])]
    if contact is not None and any(np.any(r.peak_force > (1 + _ROUNDING) * r.impact_force) for r in runs):
        names.append("peak_force")
    comparisons = []
    for name in names:
        predicted = [None if name == "peak_force" else _magnitude(name, r, impact) for r in foreseen]
        simulated = [_spread_of(np.abs(np.asarray(getattr(r, name))), r.touched) for r in runs]
        ideal: dict[str, Any] = {"predicted": predicted[0], "predicted_unmitigated": predicted[1]}
        real: dict[str, Any] = {"simulated": simulated[0], "unmitigated": simulated[1]}
        comparisons.append(Comparison(name=name, label=words_for(name), unit=unit_of(name), **ideal, **real))
    return tuple(comparisons)


def _spread_of(values: FloatArray, counted: BoolArray) -> RunSpread | None:
    """Return statistics of a quantity over selected runs."""
    some = values[counted]
    if not len(some):
        return None
    mean, error = mean_and_error(some)
    low, median, high = (float(q) for q in np.quantile(some, [0.05, 0.5, 0.95]))
    statistics = {"low": low, "median": median, "high": high, "worst": float(some.max())}
    return RunSpread(mean=mean, standard_error=error, **statistics, runs=len(some))


def check_limits(task: Task, outcomes: LoopOutcomes, predicted: ContactResult, gain: float) -> tuple[LimitCheck, ...]:
    """Check how often the simulated runs meet each limit.

    Returns:
        The result for each limit, with the predicted value for the nominal encounter.
    """
    checks, impact = [], foreseen_impact(task)
    limits, (_, *requirements) = limits_of(task.constraints), outcomes.requirements
    for required, ratio, requirement in zip(limits, outcomes.ratios, requirements, strict=True):
        constraint = required.constraint
        reached = float(required.share(ratio)) * constraint.limit
        value = reached if math.isfinite(reached) else None
        own = constraint.quantity == "gain"
        checks.append(
            LimitCheck(
                required=required,
                limited=task.law.number.entry(constraint.quantity).in_words(),
                predicted=abs(gain) if own else _magnitude(constraint.quantity, predicted, impact),
                held=float(requirement.held.mean()),
                low=requirement.shown(task.verify.confidence),
                value=value,
                margin=None if value is None else constraint.limit - value,
                source=_source_of(constraint.quantity, task.loop),
            )
        )
    return tuple(checks)


def _source_of(name: str, loop: ClosedLoop) -> str:
    """Describe how a quantity of a run is computed."""
    if name == "impact_force":
        return "impact model at the simulated speed of contact" if loop.contact is None else "simulated contact force"
    return "robot mass times largest simulated acceleration" if name == "drive_force" else "simulated"


def check_reached(result: SimulationResult, times: FloatArray, horizon: float, confidence: float) -> Reached:
    """Count the simulated and the predicted encounters with contact."""
    predicted = np.isfinite(times)
    expected, came = int(predicted.sum()), int(result.touched[predicted].sum())
    return Reached(
        predicted=float(predicted.mean()),
        simulated=float(result.touched.mean()),
        missing=expected - came,
        late=int((~result.touched[predicted] & (times[predicted] > _NEAR_END * horizon)).sum()),
        low=least_probability(came, expected, confidence) if expected else None,
        latest=float(times[predicted].max(initial=0.0)),
    )


def _magnitude(name: str, result: ContactResult, impact: ImpactModel | None) -> float | None:
    if not result.reached.all():
        return None
    value: Any = quantity_of(name, result.end, impact)
    return float(size_of(name, float(value))) if math.isfinite(float(value)) else None


def assumptions_of(task: Task, compared: int) -> tuple[str, ...]:
    """Return sentences that state the assumptions of a verification.

    `compared` is the number of runs that compare changes.
    """
    loop, runs = task.loop, task.verify.runs
    uncertain = [f"Uncertain: {name} {text}." for name, text in uncertainty_in_words(task.uncertainty, task.sensor)]
    number = "a single run" if runs == 1 else f"{runs} independent runs"
    others = "Every other gain and every change of the loop is simulated with the same noise."
    if compared < runs:
        others += f" These simulations repeat only the first {compared} runs."
    return (
        *mounting_in_words(task.sensor),
        *loop_sentences(loop),
        *_force(task),
        *(uncertain or ["Encounter: the nominal one in every run; nothing is uncertain."]),
        f"Simulated: {number} with the random seed {loop.seed}. {others}",
        "Prediction: the nominal encounter in continuous time, with a perfect sensor and a robot that follows exactly.",
        "Stability: computed for the loop linearized at each distance of the nominal curve, without noise, misfit, "
        "jitter, limits and friction.",
        "Not modeled: changes of the sensor curve (color, shape and angle of the object, other light) that are not "
        "listed as uncertain, elasticity between drive and contact surface, and contact elsewhere on the robot.",
    )


def _force(task: Task) -> Iterator[str]:
    """Yield a sentence that says how the impact force is predicted."""
    if task.loop.contact is None:
        if task.impact is not None:
            yield "The impact force is computed by the impact model from the simulated speed at contact."
        return
    model = "the given impact model"
    if task.impact is None:
        model = "the same contact stiffness without loss, and the mass of the robot"
    yield (
        f"The predicted impact force is computed with {model}. Energy loss in the contact lowers the simulated "
        "force, but the robot's drive and a driven obstacle raise it."
    )


def check_approach(
    problem: LoopProblem, detection: DetectionRange | None, predicted: ContactResult, gain: float
) -> ApproachCheck | None:
    """Repeat the runs from the detection distance, if it lies clearly beyond the start of the encounter.

    Returns:
        The result; None if the runs begin there anyway, or if the sensor curve does not reach farther.
    """
    draws = problem.draws
    task: Task = draws.task
    if detection is None or not detection.is_early or detection.moved is None:
        return None
    begins = detection.start if task.loop.start_distance is None else float(np.max(task.loop.start_distance))
    if not detection.distance > begins or not task.start_warnings(gain):
        return None
    times = _earlier(time_at(draws.scenarios, detection.distance))
    farther = replace(draws, scenarios=moved_on(draws.scenarios, times), ensemble=None)
    loop = replace(task.loop, horizon=task.loop.horizon + float(-times.min()), start_distance=None)
    outcomes = replace(problem, draws=farther).appraise(loop, gain)
    return ApproachCheck(
        start=detection.start,
        distance=detection.distance,
        cures=detection.cures,
        limits=check_limits(task, outcomes, predicted, gain),
        is_harder=outcomes.effect is not None and outcomes.effect.is_harder,
    )


def _earlier(times: FloatArray) -> FloatArray:
    """Return the times before the start [s]; 0 for an object that does not approach or starts farther away."""
    return np.asarray(np.where(np.isnan(times), 0.0, np.minimum(times, 0.0)))
