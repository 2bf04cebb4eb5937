"""The verbs: does the designed gain hold on this loop, and if not, what does? And one run of it, looked at."""

from __future__ import annotations

from dataclasses import replace

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite
from pretouch.design import GainDesign, Task, design_gain
from pretouch.design.task import placed
from pretouch.motion import ContactResult
from pretouch.simulation import ClosedLoop
from pretouch.simulation.stability import passed_distances

from .appraisal import LoopProblem
from .calibration_check import check_calibration, unknown_calibration
from .checks import VerdictStatus, check_limits, check_reached, compare_quantities
from .encounter import SimulatedEncounter
from .improvement import Verified, find_improvements
from .judging import judge
from .remarks import assumptions_of, cautions_of
from .request import checked_task, draw_encounters, foreseen_impact, loop_of, predicted_contact
from .result import Verdict
from .stability import (
    acts_as_damper,
    check_stability,
    limit_of,
    no_stability_in_words,
    stability_margin,
)

__all__ = ["simulate_encounter", "verify_gain"]


@placed
def verify_gain(task: Task, *, changes: bool = True) -> Verdict:
    """Find out whether a gain designed in continuous time, L(1) and L(2), holds on a loop, and what would help.

    Args:
        task: one encounter, the nominal one, with the loop, the objective that the gain was chosen by, the bounds, for
            the ideal design and for the best gain on the loop, and where given the gain (else that of the ideal
            design), constraints, impact (else from the contact of the loop), uncertainty of encounter and sensor, runs,
            confidence, stability margin, calibration, method and horizon.
        changes: whether to look for the best gain on the loop and for the change that helps most.

    Returns:
        The verdict. That a gain does not hold, or that there is none, is its status, not an error.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.design import Constraint, Task, excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import ClosedLoop, SensorChain
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     loop=ClosedLoop(
        ...         law=Controller(
        ...             period=1e-3,
        ...             conditioning=Conditioning(floor=1e-3, sensor_period=4e-3),
        ...             law=VirtualDamper(gain=0.0),
        ...             admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         ),
        ...         chain=SensorChain(rate=250.0, exposure=170e-6, delay=120e-6, relative_noise=2e-3),
        ...     ),
        ...     bounds=(-10.0, -0.01),
        ...     constraints=[Constraint(name="relative_velocity", limit=0.1)],
        ...     runs=100,
        ... )
        >>> verdict = verify_gain(task, changes=False)
        >>> verdict.status.value, round(verdict.gain, 4), round(verdict.stability.margin, 1)
        ('holds', -0.7463, 6.3)
    """
    task = checked_task(task)
    design = design_gain(task.replace(impact=foreseen_impact(task)))
    chosen = design.gain if task.gain is None else float(finite(task.gain, "gain", "N*s"))
    if chosen is None:
        reason = f"the ideal design is {design.status.value}"
        return Verdict.of(task, 0, status=VerdictStatus.NO_GAIN, gain=None, reasons=(reason,), design=design)
    return _verdict(task, design, chosen, changes)


def _verdict(task: Task, design: GainDesign, gain: float, changes: bool) -> Verdict:
    loop, sensor = task.loop, task.sensor
    foreseen = predicted_contact(task, gain), predicted_contact(task, 0.0)
    _check_horizon(loop, foreseen[0])
    draws = draw_encounters(task)
    unmitigated = draws.run(loop, 0.0)
    problem = LoopProblem(draws=draws, predicted=draws.predicted(gain), unmitigated=unmitigated)
    distance = passed_distances(sensor, float(draws.distance.max()))
    limit = limit_of(loop, sensor, distance) if acts_as_damper(loop) else None
    outcomes = replace(problem.appraise(loop, gain), margin=stability_margin(limit, gain))
    stability = check_stability(loop, sensor, distance, gain, limit)
    reached = check_reached(outcomes.result, problem.predicted, task.confidence)
    limits = check_limits(task, outcomes, foreseen[0], gain)
    calibrated = check_calibration(task, gain)
    status, reasons = judge(
        task, reached=reached, effect=outcomes.effect, limits=limits, stability=stability, calibration=calibrated
    )
    runs = outcomes.result, unmitigated
    comparisons = compare_quantities(task, runs, foreseen)
    known = Verified(
        gain=gain,
        predicted=foreseen[0],
        outcomes=outcomes,
        design=design,
        stability=stability,
        limit=limit,
        distance=distance,
    )
    loss, tried = find_improvements(problem, known) if changes else (None, ())
    return Verdict.of(
        task,
        draws.compared,
        status=status,
        gain=gain,
        reasons=reasons,
        design=design,
        predicted=foreseen[0],
        reached=reached,
        effect=outcomes.effect,
        comparisons=comparisons,
        limits=limits,
        stability=stability,
        stability_text=no_stability_in_words(gain, limit is not None) if stability is None else stability.text,
        calibration_check=calibrated,
        loss=loss,
        changes=tried,
        assumptions=assumptions_of(task, draws.compared),
        warnings=(*cautions_of(draws, runs, comparisons, design), *unknown_calibration(task.calibration)),
        mitigated=outcomes.result,
        unmitigated=unmitigated,
    )


def _check_horizon(loop: ClosedLoop, predicted: ContactResult) -> None:
    """Refuse a loop that would be stopped before the contact that is predicted."""
    if predicted.reached.all() and float(predicted.end.time) >= loop.horizon:
        raise InvalidInputError(
            f"loop horizon: found {loop.horizon:g} s, before the contact that is predicted after "
            f"{float(predicted.end.time):.4g} s; give the loop a longer one"
        )


@placed
def simulate_encounter(task: Task) -> SimulatedEncounter:
    """Run one encounter on the sampled loop, and put it beside the continuous solution of L(1) with L(2).

    The loop is run with the gain and with gain 0, with the same noise; the prediction is made for both.

    Args:
        task: one encounter, the loop, and the gain, or objective and bounds, by which it is then designed; where given
            impact, from which an elastic impact force is predicted, method and horizon of the prediction.

    Returns:
        The runs, the predictions, and what they come to side by side.

    Raises:
        InvalidInputError: the scenario or the gain is an array, or there is no loop or no gain.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import ClosedLoop, SensorChain
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> loop = ClosedLoop(
        ...     law=Controller(
        ...         period=1e-3,
        ...         conditioning=Conditioning(floor=1e-3, sensor_period=4e-3),
        ...         law=VirtualDamper(gain=0.0),
        ...         admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     ),
        ...     chain=SensorChain(rate=250.0, exposure=170e-6, delay=120e-6),
        ... )
        >>> encounter = simulate_encounter(Task(scenario, sensor, loop=loop, gain=-0.7463))
        >>> round(encounter.comparison("relative_velocity").relative_difference, 3)
        0.001
    """
    scenario, sensor, loop = task.scenario, task.sensor, loop_of(task)
    if scenario.shape:
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {scenario.shape}, expected one; ClosedLoop.run takes many"
        )
    one = finite(_gain_of(task), "gain", "N*s")
    if not isinstance(one, float):
        raise InvalidInputError("gain: found an array, expected one number: a controller runs with one gain")
    return SimulatedEncounter(
        scenario=scenario,
        sensor=sensor,
        loop=loop,
        gain=one,
        impact=task.impact,
        run=loop.run(scenario, sensor, one),
        unmitigated=loop.run(scenario, sensor, 0.0),
        prediction=predicted_contact(task, one),
        unmitigated_prediction=predicted_contact(task, 0.0),
        method=task.method,
        horizon=task.horizon,
    )


def _gain_of(task: Task) -> float:
    """Return the gain that is named, else the designed one."""
    if task.gain is not None:
        return task.gain
    design = design_gain(task.replace(evaluate=None))
    if design.gain is None:
        raise InvalidInputError(
            f"gain: the design is {design.status.value}, so there is none to simulate; name one, such as "
            'gain=-0.7, or in a file gain = "-0.7 N*s" in [controller] or --gain'
        )
    return float(design.gain)
