"""Verify a gain on the sampled control loop.

The gain is verified in many simulated runs. Single encounters can be simulated, too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite
from pretouch._core.progress import note_work
from pretouch.control import Controller
from pretouch.designs import DesignStatus, GainDesign, Task, design_gain
from pretouch.designs.gain import designed_number
from pretouch.designs.relaxation import relaxations_in_words
from pretouch.designs.task import with_file_location
from pretouch.motion import ContactResult
from pretouch.motion.page_sections import approach_step
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.simulation.law import TunableLaw
from pretouch.simulation.result import refuse_too_many_runs
from pretouch.simulation.stability import passage

from .advice import search_advice, search_at_rate
from .appraisal import LoopProblem, draw_encounters, foreseen_impact, predicted_contact
from .at_rest import motion_at_rest
from .breakage import check_breakage
from .calibration_check import check_calibration
from .changed_loop import NOISES, plausible_rate
from .checks import assumptions_of, check_approach, check_limits, check_reached, compare_quantities
from .effect import VerdictStatus, compare_with_fast_sensor, effect_of, without_noise
from .encounter import SimulatedEncounter
from .improvement import Verified, find_improvements
from .next_step import next_step
from .reasons import judged, no_gain_with_margin
from .result import Advice, Verdict
from .run_warnings import cautions_of
from .stability import check_stability, limit_of, rates_for_margins, stability_margin

_ONE_ADMITTANCE: Final = "a controller runs with one"
_CALM: Final = 0.3  # share of the distance to an object: a smaller motion by noise stays far from it
_NEAREST_REST: Final = 0.01  # m: a distance at rest at which a motion below 1 mm was found
_NO_LOOP: Final = "loop: found none, expected the sampled loop, loop=ClosedLoop(...)"
_NO_LOOP_IN_FILE: Final = (
    "found no sections [chain] and [controller], expected both, because they describe the sampled loop; add, for "
    'example, [chain] with part = "VCNL4010" and [controller] with rate = "1 kHz". pretouch init writes a file that '
    "has both sections"
)


@check_arguments
@with_file_location
def verify(task: Task, *, changes: bool = True) -> Verdict:
    """Verify a gain in simulations of the sampled control loop.

    The runs show whether a gain that was designed in continuous time meets its limits. Changes of the loop or the gain
    are tried to find out what would help.

    Args:
        task: the nominal encounter with the loop, the objective, and the bounds of the ideal design and of the best
            gain on the loop. Optional: the gain (default: designed by the effect of a drag, or the ideal design),
            constraints, impact (default: the contact of the loop), uncertainty of encounter and sensor, the options
            `verify`, stability margin, calibration, method and horizon.
        changes: whether to search for the best gain on the loop and the change that helps most.

    Returns:
        The verdict. Its status says if the gain does not hold or does not exist; this is not an error.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.designs import Constraint, Task, excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import ClosedLoop, SensorChain
        >>> from pretouch.verification import VerifyOptions
        >>> virtual = VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
        >>> conditioning = Conditioning(floor=0.046, sensor_period=4e-3)
        >>> law = Controller(period=1e-3, conditioning=conditioning, law=VirtualDamper(gain=0.0), admittance=virtual)
        >>> chain = SensorChain(rate=250.0, exposure=170e-6, delay=120e-6, relative_noise=2e-3)
        >>> admittance = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
        >>> task = Task(
        ...     Scenario(admittance=admittance, obstacle=Obstacle(position=0.0422, velocity=-0.3)),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     loop=ClosedLoop(law=law, chain=chain),
        ...     bounds=(-10.0, -0.01),
        ...     constraints=[Constraint(name="relative_velocity", limit=0.1)],
        ...     verify=VerifyOptions(runs=100),
        ... )
        >>> verdict = verify(task, changes=False)
        >>> verdict.status.value, round(verdict.gain, 4), round(verdict.stability.margin, 1)
        ('holds', -0.7463, 6.3)
    """
    requested, task = task, _check_task(task)
    design = design_gain(requested.replace(impact=foreseen_impact(task), evaluate=None))
    chosen = design.gain if task.drag_effect is None else designed_number(task)
    if task.gain is not None:
        chosen = float(finite(task.gain, "gain", task.law.number.unit))
    if chosen is None:
        reason, rate = f"the ideal design is {design.status.value}", _rate_needed(design)
        if rate is not None:
            reason = no_gain_with_margin(design, rate)
        fields = {**_inputs(task, design, None), "needed_rate": rate, "compared_runs": 0, "warnings": task.warnings}
        verdict = Verdict(**fields, status=VerdictStatus.NO_GAIN, reasons=(reason,))

        def search() -> Advice | None:
            at_rate = None if rate is None else search_at_rate(requested, rate, verify)
            advice = at_rate or _advice_without_design(task, design)
            # the step without a search names the rate that is needed
            return None if rate is not None and advice is not None and advice.kind == "none" else advice

        return replace(verdict, advice=next_step(task, verdict, search if changes else None))
    return _verify(task, design, chosen, changes=changes)


def _advice_without_design(task: Task, design: GainDesign) -> Advice | None:
    """Return limits that a gain keeps on the sampled loop, if the ideal design is infeasible.

    The limits that suffice for the ideal design need not suffice on the loop, so that the search of a verdict is used.
    It starts from the gain of the smallest relaxation. If it finds nothing, the advice says so.
    """
    if not design.relaxations:
        return None
    try:
        advice = _verify(task, design, design.relaxations[0].gain, changes=True).advice
    except InvalidInputError:  # for example, contact with this gain is predicted only after the horizon
        return None
    if advice is not None and advice.kind == "none":
        ideal = ", or ".join(relaxations_in_words(design.relaxations))
        limit = "No larger limit helps, unless a robot without mitigation meets it, too"
        return replace(
            advice, sentence=f"{advice.sentence}. {limit}. For the ideal design alone, it would be enough to {ideal}"
        )
    return advice if advice is not None and advice.kind in {"change", "limit"} else None


def _inputs(task: Task, design: GainDesign, gain: float | None) -> dict[str, Any]:
    """Return those fields of a verdict that repeat the verified task."""
    fields: dict[str, Any] = {name: getattr(task.verify, name) for name in ("runs", "confidence", "speed_tolerance")}
    fields |= {name: getattr(task, name) for name in ("scenario", "sensor", "loop", "uncertainty")}
    return fields | {"seed": task.loop.seed, "definition": task.goal, "gain": gain, "design": design}


def _verify(
    task: Task,
    design: GainDesign,
    gain: float,
    *,
    changes: bool = False,
    basis: Verdict | None = None,
    runs: SimulationResult | None = None,
) -> Verdict:
    """Simulate a gain, and judge it.

    Args:
        task: the checked task.
        design: the ideal design.
        gain: the gain.
        changes: whether to search for changes.
        basis: the verdict on another gain or loop of the same encounters. The new verdict then has only what its status
            and reasons depend on, so its runs may end at contact.
        runs: the simulated runs, if they are known.

    Returns:
        The verdict.
    """
    loop, sensor = task.loop, task.sensor
    predicted, free = predicted_contact(task, gain), predicted_contact(task, 0.0)
    _check_horizon(loop, predicted)
    draws = draw_encounters(task)
    note_work(f"simulating {task.verify.runs} encounters, each with and without impact mitigation")
    same = basis is not None and basis.loop == loop and basis.runs == task.verify.runs
    unmitigated = basis.unmitigated if basis is not None and same else None
    unmitigated = draws.run(loop, 0.0) if unmitigated is None else unmitigated
    foreseen, times = draws.predicted(gain)
    problem = LoopProblem(draws=draws, predicted=np.isfinite(foreseen), unmitigated=unmitigated)
    passed = passage(task.law, task.scenario, sensor, gain, float(draws.distance.max()))
    limit = limit_of(loop, sensor, passed)
    if runs is None:
        runs = draws.run(loop if basis is None else problem.compared(loop), gain)
    outcomes = replace(problem.appraised(runs, loop, gain), margin=stability_margin(limit, gain))
    effect = effect_of(outcomes.result, unmitigated, foreseen)
    quiet = draws.run(without_noise(loop), gain, draws.compared)
    fast = compare_with_fast_sensor(
        loop, lambda one: draws.run(one, gain, draws.compared), quiet, task.verify.speed_tolerance
    )
    note_work("computing the stability of the loop")
    stability = check_stability(loop, sensor, passed, gain, limit)
    approach = check_approach(problem, loop.detection(task.scenario, sensor), predicted, gain)
    at_rest = motion_at_rest(task, gain) if basis is None or not _is_calm(basis, loop, gain) else None
    fields = _inputs(task, design, gain) | {
        "reached": check_reached(outcomes.result, times, loop.horizon, task.verify.confidence),
        "effect": effect,
        "noiseless_effect": effect_of(quiet, unmitigated),
        "limits": check_limits(task, outcomes, predicted, gain),
        "approach": approach,
        "stability": stability,
        "sensor_speed": fast,
        "calibration_check": None if task.calibration is None else check_calibration(task, task.calibration, gain),
        "predicted": predicted,
        "at_rest": at_rest,
        "compared_runs": draws.compared,
        "mitigated": outcomes.result,
        "unmitigated": unmitigated,
    }
    verdict = judged(Verdict(**fields, status=VerdictStatus.HOLDS, reasons=()))
    if basis is not None:
        return verdict
    both = outcomes.result, unmitigated
    comparisons = compare_quantities(task, both, (predicted, free))
    largest_rate = plausible_rate(loop, *problem.changes_of_level(passed[0]))
    breakage = check_breakage(draws, gain, unmitigated, largest_rate)
    verdict = replace(
        verdict,
        breakage=breakage,
        comparisons=comparisons,
        no_stability_text="" if stability else _no_stability_in_words(task, gain, limit is not None),
        assumptions=assumptions_of(task, draws.compared),
        warnings=cautions_of(
            draws,
            both,
            comparisons,
            design,
            at_rest=at_rest,
            starts=task.start_warnings(gain),
            largest_rate=largest_rate,
            breakage=breakage,
        ),
    )
    if not changes:
        return replace(verdict, advice=next_step(task, verdict))
    found = find_improvements(problem, Verified(gain, predicted, outcomes, design, stability, limit, passed))
    verdict = replace(verdict, loss=found.loss, changes=found.changes, unchanged=found.unchanged)

    def judge(changed: Task) -> Verdict:
        value, runs = float(changed.gain or 0.0), None
        if found.best is not None and (value, changed.loop, changed.verify.runs) == (found.best[0], loop, verdict.runs):
            runs = found.best[1]  # the search has simulated them
        return _verify(changed, design, value, basis=verdict, runs=runs)

    advice = next_step(task, verdict, lambda: search_advice(task, verdict, found, passed, judge))
    return replace(verdict, advice=advice)


def _is_calm(basis: Verdict, loop: ClosedLoop, gain: float) -> bool:
    """Return True if noise cannot move a robot at rest to an object, as another verdict shows.

    The motion by noise grows about in proportion to the gain; _CALM leaves room for errors of this rule.
    """
    a: Any = basis.loop.law
    b: Any = loop.law
    if not (isinstance(a, Controller) and isinstance(b, Controller)) or not basis.gain:
        return False
    if any(getattr(loop.chain, name) > getattr(basis.loop.chain, name) for name in NOISES):
        return False
    if b.conditioning.floor < a.conditioning.floor or loop.chain.rate > basis.loop.chain.rate:
        return False
    moved, place = (0.001, _NEAREST_REST) if basis.at_rest is None else (basis.at_rest.motion, basis.at_rest.distance)
    return moved * max(abs(gain / basis.gain), 1.0) < _CALM * place


def _rate_needed(design: GainDesign) -> float | None:
    """Return the sensor rate [Hz] needed for the required gain margin. None if other requirements fail as well."""
    task, free = design.problem.task, design.without_margin
    if free is None or task.stability_margin is None:
        return None
    passed = passage(task.law, task.scenario, task.sensor, free.gain, float(task.scenario.distance))
    return rates_for_margins(task.loop, task.sensor, passed, free.gain, (task.stability_margin,))[0]


def _check_task(task: Task) -> Task:
    """Check the task, and narrow its bounds to stable gains."""
    if task.scenario.shape != ():
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {task.scenario.shape}, expected a single encounter"
        )
    law: Any = _loop_of(task).law
    task.refuse_free_admittance(_ONE_ADMITTANCE)
    if not isinstance(law, TunableLaw):
        raise InvalidInputError(
            f"loop: the control law {type(law).__name__} has no method with_value; add a method with_value "
            "that returns the law with another gain"
        )
    refuse_too_many_runs(task.verify.runs)
    if task.drag_effect is not None and (task.objective is None or task.bounds is None):
        raise InvalidInputError(
            "drag_effect: found no objective or no bounds, expected both, because a verdict compares the drag with the "
            "best drag; in a scenario file, add [objective] and [gain]"
        )
    return task.replace(bounds=task.stable_bounds(), stability_margin=None, evaluate=None)


def _loop_of(task: Task) -> ClosedLoop:
    """Return the sampled loop of a task."""
    if task.loop is None:
        raise InvalidInputError(_NO_LOOP if task.source is None else _NO_LOOP_IN_FILE, argument="loop")
    if not isinstance(task.loop, ClosedLoop):
        raise InvalidInputError(f"loop: found {type(task.loop).__name__}, expected a ClosedLoop")
    law = task.loop.continuous
    if law is not None and law != task.law:
        raise InvalidInputError(
            f"law: the task has the law {task.law.kind}, but the controller of the loop has the law {law.kind}; "
            "use the same law in both"
        )
    return task.loop


def _check_horizon(loop: ClosedLoop, predicted: ContactResult) -> None:
    """Raise an error if runs end before the predicted contact."""
    if predicted.reached.all() and float(predicted.end.time) >= loop.horizon:
        raise InvalidInputError(
            f"loop horizon: found {loop.horizon:g} s, but contact is predicted only after "
            f"{float(predicted.end.time):.4g} s; set a longer horizon, or verify a weaker gain",
            value=loop.horizon,
        )


def _no_stability_in_words(task: Task, gain: float, known: bool) -> str:
    """Explain why the stability of a gain is not assessed."""
    if known:
        return (
            f"The stability of the loop is not assessed, because {task.law.number.equals(gain)} does not mitigate "
            "the impact."
        )
    return (
        f"The stability of the loop is unknown, because damping and timing of the control law {task.law.kind} are "
        "unknown."
    )


@check_arguments
@with_file_location
def simulate(task: Task) -> SimulatedEncounter:
    """Simulate one encounter on the sampled control loop.

    The motion is compared with the solution in continuous time. The loop is run twice with the same noise: with the
    gain and with gain 0. Both encounters are also predicted.

    Args:
        task: one encounter, the loop, and the gain. Without a gain, one is designed from objective and bounds, or from
            the effect of a drag. Optional: impact, to predict an elastic impact force; method and horizon of the
            prediction.

    Returns:
        Runs, predictions and their comparison.

    Raises:
        InvalidInputError: the scenario or the gain is an array, or there is no loop or no gain.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import ClosedLoop, SensorChain
        >>> virtual = VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
        >>> conditioning = Conditioning(floor=0.046, sensor_period=4e-3)
        >>> law = Controller(period=1e-3, conditioning=conditioning, law=VirtualDamper(gain=0.0), admittance=virtual)
        >>> loop = ClosedLoop(law=law, chain=SensorChain(rate=250.0, exposure=170e-6, delay=120e-6))
        >>> admittance = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
        >>> scenario = Scenario(admittance=admittance, obstacle=Obstacle(position=0.0422, velocity=-0.3))
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> encounter = simulate(Task(scenario, sensor, loop=loop, gain=-0.7463))
        >>> round(encounter.comparison("relative_velocity").relative_difference, 3)
        0.001
    """
    scenario, sensor, loop = task.scenario, task.sensor, _loop_of(task)
    if scenario.shape:
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {scenario.shape}, expected a single encounter; use "
            "ClosedLoop.run for many encounters"
        )
    task.refuse_free_admittance(_ONE_ADMITTANCE)
    gain = finite(chosen_gain(task), "gain", task.law.number.unit)
    if not isinstance(gain, float):
        raise InvalidInputError("gain: found an array, expected one number: a controller runs with one gain")
    same = ("scenario", "sensor", "loop", "impact", "method", "horizon", "law")
    predicted = [predicted_contact(task, value) for value in (gain, 0.0)]
    return SimulatedEncounter(
        **{name: getattr(task, name) for name in same},
        gain=gain,
        run=loop.run(scenario, sensor, gain),
        unmitigated=loop.run(scenario, sensor, 0.0),
        prediction=predicted[0],
        unmitigated_prediction=predicted[1],
    )


def chosen_gain(task: Task) -> float:
    """Return the gain of the task, or else the optimal gain."""
    if task.gain is not None:
        return task.gain
    designed = designed_number(task)
    if designed is None:
        raise InvalidInputError(f"gain: there is no gain to simulate, because {_why_no_gain(task)}")
    return designed


def _why_no_gain(task: Task) -> str:
    """Explain why a design found no gain, and recommend a remedy."""
    status = design_gain(task.replace(evaluate=None)).status
    step = approach_step(task.scenario)
    if status is DesignStatus.NO_CONTACT and step:
        return f"no gain within the bounds ends in contact. {step[0].upper()}{step[1:]}"
    reason = (
        "the design is infeasible" if status is DesignStatus.INFEASIBLE else "no gain within the bounds ends in contact"
    )
    number = task.law.number
    example = {"gain": -0.7, "drag": 0.014}.get(number.key, float(number.sign))
    value = f"{example:g} {number.unit}"
    advice = f'Choose a gain with the option --gain "{value}", or with gain={example:g} in Python'
    return f"{reason}. {advice}"
