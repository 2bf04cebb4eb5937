"""The verbs: does the designed gain hold on this loop, and if not, what does? And one run of it, looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite
from pretouch.calibration import CalibrationReport
from pretouch.design import Constraint, GainDesign, ImpactModel, design_gain
from pretouch.design.own_objective import AnyObjective, as_objective
from pretouch.design.robust import Required
from pretouch.motion import Scenario, find_contact
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop
from pretouch.simulation.stability import passed_distances
from pretouch.uncertainty import Uncertainty

from .appraisal import LoopProblem
from .calibration_check import check_calibration, unknown_calibration
from .checks import VerdictStatus, check_limits, check_reached, compare_quantities
from .encounter import SimulatedEncounter
from .improvement import Verified, compared_runs, find_improvements
from .judging import judge
from .remarks import assumptions_of, cautions_of
from .request import VerdictRequest, draw_encounters
from .result import Verdict
from .stability import acts_as_damper, check_stability, limit_of, no_stability_in_words

__all__ = ["simulate_encounter", "verify_gain"]

_HORIZON: Final = 600.0  # s


def verify_gain(
    scenario: Scenario,
    sensor: SensorModel,
    objective: AnyObjective,
    loop: ClosedLoop,
    *,
    bounds: tuple[float, float],
    gain: float | None = None,
    constraints: Sequence[Constraint | Required] = (),
    impact: ImpactModel | None = None,
    uncertainty: Uncertainty | None = None,
    runs: int = 1000,
    seed: int | None = None,
    confidence: float = 0.95,
    method: str = "auto",
    horizon: float = _HORIZON,
    changes: bool = True,
    calibration: CalibrationReport | None = None,
) -> Verdict:
    """Find out whether a gain designed in continuous time, L(1) and L(2), holds on a loop, and what would help.

    Args:
        scenario: one encounter, the nominal one.
        sensor: the sensor curve.
        objective: what the gain was chosen by, as in `design_gain`.
        loop: sensor chain, controller, robot and contact.
        bounds: smallest and largest gain [N s], for the ideal design and for the best gain on the loop.
        gain: D_p [N s] to be verified; the ideal design's where none is given.
        constraints: limits; a plain one must hold in every run, a `Required` one with its probability.
        impact: physical properties, for predicted forces; from the contact of the loop where none is given.
        uncertainty: what is known of inputs of encounter and sensor; each run then is another encounter.
        runs: how many runs.
        seed: of encounters and noise; that of the loop by default.
        confidence: of the lower bounds of shares.
        method: how encounters are solved in continuous time, as in `find_contact`.
        horizon: how long to wait for contact there [s].
        changes: whether to look for the best gain on the loop and for the change that helps most.
        calibration: the report of the fit that the sensor comes from; the gain is then tried on what else its readings
            allow.

    Returns:
        The verdict. That a gain does not hold, or that there is none, is its status, not an error.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.design import excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import SensorChain
        >>> verdict = verify_gain(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     ClosedLoop(
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
        ...     changes=False,
        ... )
        >>> verdict.status.value, round(verdict.gain, 4), round(verdict.stability.margin, 1)
        ('holds', -0.7463, 6.3)
    """
    asked = VerdictRequest(
        scenario=scenario,
        sensor=sensor,
        objective=as_objective(objective),
        loop=loop if seed is None else replace(loop, seed=seed),
        bounds=bounds,
        limits=tuple(c if isinstance(c, Required) else Required(constraint=c) for c in constraints),
        impact=impact,
        uncertainty=uncertainty or {},
        runs=runs,
        confidence=confidence,
        method=method,
        horizon=horizon,
        calibration=calibration,
    )
    design = design_gain(
        scenario,
        sensor,
        asked.objective,
        bounds=bounds,
        constraints=[limit.constraint for limit in asked.limits],
        impact=asked.foreseen_impact,
        method=method,
        horizon=horizon,
    )
    chosen = design.gain if gain is None else float(finite(gain, "gain", "N*s"))
    if chosen is None:
        reason = f"the ideal design is {design.status.value}"
        return Verdict.of(asked, 0, status=VerdictStatus.NO_GAIN, gain=None, reasons=(reason,), design=design)
    return _verdict(asked, design, chosen, changes)


def _verdict(asked: VerdictRequest, design: GainDesign, gain: float, changes: bool) -> Verdict:
    loop, predicted = asked.loop, asked.predicted(gain)
    asked.check_horizon(predicted)
    draws = draw_encounters(asked)
    unmitigated = draws.run(loop, 0.0)
    problem = LoopProblem(draws=draws, predicted=draws.predicted(gain), unmitigated=unmitigated)
    outcomes = problem.appraise(loop, gain)
    runs, foreseen = (outcomes.result, unmitigated), (predicted, asked.predicted(0.0))
    distance = passed_distances(asked.sensor, float(draws.distance.max()))
    limit = limit_of(loop, asked.sensor, distance) if acts_as_damper(loop) else None
    stability = check_stability(loop, asked.sensor, distance, gain, limit)
    reached = check_reached(outcomes.result, problem.predicted, asked.confidence)
    limits = check_limits(asked, outcomes, predicted, gain)
    calibrated = check_calibration(asked, gain)
    status, reasons = judge(
        asked, reached=reached, effect=outcomes.effect, limits=limits, stability=stability, calibration=calibrated
    )
    comparisons = compare_quantities(asked, runs, foreseen)
    ends = np.abs(unmitigated.relative_velocity)
    known = Verified(
        gain=gain,
        predicted=predicted,
        outcomes=outcomes,
        design=design,
        stability=stability,
        limit=limit,
        distance=distance,
        fastest=float(max(np.max(ends, initial=0.0, where=np.isfinite(ends)), draws.approach.max())),
    )
    loss, tried = find_improvements(problem, known) if changes else (None, ())
    compared = compared_runs(problem)
    return Verdict.of(
        asked,
        compared,
        status=status,
        gain=gain,
        reasons=reasons,
        design=design,
        predicted=predicted,
        reached=reached,
        effect=outcomes.effect,
        comparisons=comparisons,
        limits=limits,
        stability=stability,
        stability_text=no_stability_in_words(gain, limit is not None) if stability is None else stability.text,
        calibration_check=calibrated,
        loss=loss,
        changes=tried,
        assumptions=assumptions_of(asked, compared),
        warnings=(*cautions_of(draws, runs, comparisons, design), *unknown_calibration(asked.calibration)),
        mitigated=outcomes.result,
        unmitigated=unmitigated,
    )


def simulate_encounter(
    scenario: Scenario,
    sensor: SensorModel,
    loop: ClosedLoop,
    gain: float,
    *,
    impact: ImpactModel | None = None,
    method: str = "auto",
    horizon: float = _HORIZON,
) -> SimulatedEncounter:
    """Run one encounter on the sampled loop, and put it beside the continuous solution of L(1) with L(2).

    The loop is run with the gain and with gain 0, with the same noise; the prediction is made for both.

    Args:
        scenario: one encounter.
        sensor: the sensor curve.
        loop: the loop: sensor chain, law, robot and contact.
        gain: D_p [N s]; negative gains mitigate.
        impact: the physical properties, from which an elastic impact force is predicted.
        method: of the prediction, as `find_contact` takes it.
        horizon: how long the prediction waits for contact [s]; the loop has a horizon of its own.

    Returns:
        The runs, the predictions, and what they come to side by side.

    Raises:
        InvalidInputError: the scenario or the gain is an array.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import SensorChain
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
        >>> encounter = simulate_encounter(scenario, sensor, loop, -0.7463)
        >>> round(encounter.comparison("relative_velocity").relative_difference, 3)
        0.001
    """
    if scenario.shape:
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {scenario.shape}, expected one; ClosedLoop.run takes many"
        )
    one = finite(gain, "gain", "N*s")
    if not isinstance(one, float):
        raise InvalidInputError("gain: found an array, expected one number: a controller runs with one gain")
    predictions = [find_contact(scenario, sensor, g, method=method, horizon=horizon) for g in (one, 0.0)]
    return SimulatedEncounter(
        scenario=scenario,
        sensor=sensor,
        loop=loop,
        gain=one,
        impact=impact,
        method=method,
        horizon=horizon,
        run=loop.run(scenario, sensor, one),
        unmitigated=loop.run(scenario, sensor, 0.0),
        prediction=predictions[0],
        unmitigated_prediction=predictions[1],
    )
