"""Compare simulated runs with the prediction and with the limits of the task."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import unit_of, words_for
from pretouch._core.warning_codes import caution
from pretouch.calibration import CalibrationReport
from pretouch.control import Controller, Status
from pretouch.designs import GainDesign, ImpactModel, Task, quantity_of
from pretouch.designs.quantities import size_of
from pretouch.designs.robust.required import least_probability, limits_of
from pretouch.motion import ContactResult, Scenario
from pretouch.motion.page_sections import mounting_in_words
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.simulation.closed_loop import loop_sentences
from pretouch.uncertainty.ensemble import share_in_words, uncertainty_in_words

from .appraisal import Draws, LoopOutcomes, foreseen_impact
from .at_rest import RestMotion, rest_in_words
from .breakage import Breakage, breakage_in_words
from .effect import SIGNIFICANT, mean_and_error
from .encounter_parts import detection_step
from .result import Comparison, LimitCheck, Reached, RunSpread

_COMPARED: Final = ("relative_velocity", "time", "largest_excursion", "largest_virtual_force", "largest_speed")
_HIDDEN: Final = "at larger distances the reading is below the floor"
_SHARE: Final = 0.1  # a cause is named if it explains at least this share of the time to detection
_LATE: Final = 0.95  # a first detection below this share of the start distance is late
_FORCE_APART: Final = 1.25  # smallest ratio of simulated to predicted impact force that causes a warning
_ROUNDING: Final = 1e-9  # relative rounding error of a force
_NEAR_END: Final = 0.9  # share of the horizon after which a predicted contact may come too late for the runs
_TRACED: Final = 8  # runs that are examined step by step
_FLAGS: Final = {
    Status.SATURATED: "the sensor was saturated",
    Status.INVALID: "readings were not numbers, too old or out of order",
    Status.IMPLAUSIBLE: "readings changed faster than largest_rate allows",
    Status.LOST: "the sensor signal was lost",
    Status.FORCE_LIMITED: "the virtual force was limited",
    Status.MOTION_LIMITED: "a limit of [controller] reduced the motion: widen the limits or use a weaker gain",
    Status.INPUT_FAULT: "contact force or reference were not numbers",
}
_BROKEN_CABLE: Final = (
    "With a broken cable, the reading falls to 0. For the controller, the object suddenly recedes, and the robot "
    "follows. With this largest_rate, the controller rejects a change of ln xi that exceeds largest_rate times one "
    "sensor period. The sensor is lost if this lasts. A smaller change, from a weak signal to 0, is believed. "
    "The recommended value is twice the largest rate |d ln xi / dt| of the sensor signal xi in an approach, plus noise."
)


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


def cautions_of(
    draws: Draws,
    runs: tuple[SimulationResult, SimulationResult],
    comparisons: tuple[Comparison, ...],
    design: GainDesign,
    *,
    at_rest: RestMotion | None,
    starts: tuple[str, ...],
    largest_rate: float,
    breakage: Breakage | None,
) -> tuple[str, ...]:
    """Return the warnings of a verification.

    Args:
        draws: the encounters.
        runs: the runs with the gain and without mitigation.
        comparisons: the quantities, predicted and simulated.
        design: the ideal design.
        at_rest: how far noise moves a robot at rest.
        starts: a warning if the controller detects the object elsewhere than the encounter starts.
        largest_rate: a largest plausible rate of ln xi for the controller [1/s].
        breakage: what the robot does if the sensor fails.

    Returns:
        The warnings, each with its code.
    """
    loop = draws.task.loop
    return (
        *_no_ideal_gain(design),
        *starts,
        *_other_admittance(loop, draws.task.scenario),
        *_failing_sensor(loop, largest_rate, breakage),
        *_detection(loop, draws, runs[0]),
        *rest_in_words(at_rest, loop.law),
        *_push(loop, *runs),
        *_impact(comparisons),
        *_flag_warnings(loop, runs[0]),
        *_unknown_calibration(draws.task.calibration),
        *draws.task.warnings,
    )


def _no_ideal_gain(design: GainDesign) -> Iterator[str]:
    if design.gain is None:
        headline = design.headline.removesuffix(".")
        yield caution("PT401", f"The ideal design has no gain ({headline[:1].lower()}{headline[1:]}).")


def _other_admittance(loop: ClosedLoop, scenario: Scenario) -> Iterator[str]:
    virtual: Any = getattr(loop.law, "admittance", None)
    a, names = scenario.admittance, ("mass", "damping", "stiffness")
    if virtual is None or all(np.allclose(getattr(virtual, n), getattr(a, n), rtol=1e-9, atol=1e-12) for n in names):
        return
    own, other = (
        f"virtual mass {one.mass:g} kg, damping {one.damping:g} N s/m, stiffness {one.stiffness:g} N/m"
        for one in (virtual, a)
    )
    text = "The controller and the prediction use different admittances: use the same admittance in both."
    yield caution("PT402", f"{text} Controller: {own}. Prediction: {other}.")


def _failing_sensor(loop: ClosedLoop, largest_rate: float, breakage: Breakage | None) -> Iterator[str]:
    """Yield a warning if a sensor that fails moves the robot toward the object."""
    jumps = tuple(_recession(loop, largest_rate))
    if breakage is not None and breakage.harder and not (jumps and breakage.is_prevented_by_rate):
        jumps = tuple(breakage_in_words(breakage))
    yield from jumps


def _recession(loop: ClosedLoop, largest_rate: float) -> Iterator[str]:
    law, chain = loop.law, loop.chain
    if not isinstance(law, Controller) or law.conditioning.largest_rate is not None:
        return
    if loop.continuous is not None and loop.continuous.damping(1.0, -1.0, 1.0) == 0:  # no force if the object recedes
        return
    if getattr(law.law, "approach_only", False):  # the same
        return
    if chain.dropout > 0 or chain.lowest <= law.conditioning.offset + law.conditioning.floor:
        remedy = f"set largest_rate of the controller to {format_quantity(largest_rate, '1/s', 3)}"
        text = f"A broken sensor cable makes the robot jump toward the object: {remedy}."
        yield caution("PT404", f"{text} {_BROKEN_CABLE}")


def _detection(loop: ClosedLoop, draws: Draws, result: SimulationResult) -> Iterator[str]:
    seen, s = np.isfinite(result.detection_time), draws.scenarios
    if not seen.all():
        share = _percent(1 - float(seen.mean()))
        yield caution("PT405", f"The object was never detected in {share} of the runs: {detection_step(loop)}.")
    free = np.all(s.plant.position == s.reference.position) and np.all(s.plant.velocity == s.reference.velocity)
    if not (seen.any() and free):
        return
    # Until detection there is no virtual force, so the robot follows its reference.
    t = np.asarray(result.detection_time)
    obstacle = np.asarray(s.obstacle.position_at(t)) - s.obstacle.position
    reference = (np.asarray(s.reference.velocity) + 0.5 * s.reference.acceleration * t) * t
    distance = (draws.distance + obstacle - reference)[seen]
    start, late = float(draws.distance[seen].mean()), float(t[seen].mean())
    why = _why_late(loop, late)
    at = loop.detection(draws.task.scenario, draws.task.sensor)
    if why == _HIDDEN and at is not None and at.is_late:  # PT421 warns unless this has no effect
        return
    if distance.mean() < _LATE * start:
        near, far = format_quantity(float(distance.mean()), "m"), format_quantity(start, "m")
        yield caution(
            "PT405",
            f"The object is detected late, at a mean distance of {near}, because {why}. The mean "
            f"start distance is {far}. The mean time until detection is {format_quantity(late, 's')}.",
        )


def _why_late(loop: ClosedLoop, late: float) -> str:
    """Return the cause of a late detection, as a clause."""
    chain = loop.chain
    phase = chain.period / 2 if chain.random_phase else chain.phase
    wait = phase + chain.exposure + chain.delay + loop.law.period / 2
    if late - wait < _SHARE * late:
        return "the sensor is too slow for an earlier reading"
    return _HIDDEN if wait < _SHARE * late else f"a first reading takes {format_quantity(wait, 's')}, and {_HIDDEN}"


def _push(loop: ClosedLoop, result: SimulationResult, unmitigated: SimulationResult) -> Iterator[str]:
    """Yield a warning if a push after impact increases the force."""
    contact, both = loop.contact, result.touched & unmitigated.touched
    if contact is None or not both.any():
        return
    peak, free, impact, free_impact = (
        np.asarray(values)[both]
        for values in (result.peak_force, unmitigated.peak_force, result.impact_force, unmitigated.impact_force)
    )
    more, error = mean_and_error(peak - free)
    chance = max(SIGNIFICANT * error if np.isfinite(error) else 0.0, _ROUNDING * float(free.mean()))
    if more <= chance or not np.any(peak > (1 + _ROUNDING) * impact):
        return
    driven = contact.obstacle_mass == np.inf
    pushing = "the robot's drive and the driven obstacle push" if driven else "the robot's drive pushes"
    newton = [format_quantity(float(values.mean()), "N") for values in (peak, free, impact, free_impact)]
    after = f"{pushing} with a mean peak force of {newton[0]}, compared with {newton[1]} without mitigation"
    impact_itself = f"a mean force of {newton[2]}, compared with {newton[3]} without mitigation"
    yield caution("PT407", f"After the impact, {after}. The impact itself has {impact_itself}.")


def _impact(comparisons: tuple[Comparison, ...]) -> Iterator[str]:
    force = next((c for c in comparisons if c.name == "impact_force"), None)
    if force is None or not force.predicted or force.simulated is None:
        return
    times = force.simulated.mean / force.predicted
    if 1 / _FORCE_APART < times < _FORCE_APART:
        return
    pushed = "the robot's drive and the obstacle push while the bodies are in contact"
    why = pushed if times > 1 else "the contact loses energy, or the robot yields during it"
    yield caution(
        "PT408",
        f"The simulated impact force is {times:.3g} times the predicted force of an elastic impact, because {why}.",
    )


def _flag_warnings(loop: ClosedLoop, result: SimulationResult) -> Iterator[str]:
    if not isinstance(loop.law, Controller):  # the flags of custom laws are unknown
        return
    for flag, text in _FLAGS.items():
        share = float(np.mean((np.asarray(result.flags) & int(flag)) != 0))
        if share > 0:
            yield caution("PT409", f"In {_percent(share)} of the runs {text}.")
    stale = _stale(result)
    if stale > 0:
        yield caution(
            "PT410",
            f"After detection of the object, the expected sensor reading was missing in {_percent(stale)} of the "
            "controller steps.",
        )


def _stale(result: SimulationResult) -> float:
    """Return the share of controller steps whose expected reading is missing. Only steps after detection count."""
    late = count = 0
    for i in range(min(result.shape[0], _TRACED)):
        flags = result.trace(i).flags.astype(np.int64)
        flags = flags[np.maximum.accumulate((flags & int(Status.DETECTING)) != 0)]
        late, count = late + int(((flags & int(Status.STALE)) != 0).sum()), count + len(flags)
    return late / count if count else 0.0


def _percent(share: float) -> str:
    return share_in_words(share) if share >= 1e-4 else "less than 0.01 %"


def _unknown_calibration(report: CalibrationReport | None) -> Iterator[str]:
    """Yield a warning if the calibration has too few readings."""
    if report is None or report.best is None or report.curves is not None:
        return
    yield caution(
        "PT411",
        f"The calibration has only {len(report.window.distances)} usable distances, too few to check whether "
        "the calibration is good enough: record readings at more distances.",
    )
