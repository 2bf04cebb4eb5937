"""The verdict: does the designed gain hold on this loop, and if not, what does?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pretouch._core.numbers import finite
from pretouch.calibration import CalibrationReport
from pretouch.design import Constraint, GainDesign, ImpactModel, design_gain
from pretouch.design.own_objective import AnyObjective, as_objective
from pretouch.design.robust import Required
from pretouch.motion import Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop
from pretouch.simulation.stability import passed_distances
from pretouch.uncertainty import Uncertainty

from .assumptions import assumptions_of
from .calibration_check import check_calibration, unknown_calibration
from .cautions import cautions_of
from .checks import check_limits, check_reached, compare_quantities
from .draws import draw_encounters
from .improvement import compared_runs, find_improvements
from .judging import judge
from .parts import VerdictStatus
from .problem import LoopProblem
from .request import Request, check_horizon, checked_request
from .result import Verdict
from .stability import acts_as_damper, check_stability, limit_of, no_stability_in_words, stability_in_words

__all__ = ["verify_gain"]


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
    horizon: float = 600.0,
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
    objective = as_objective(objective)
    request = checked_request(
        Request(
            scenario=scenario,
            sensor=sensor,
            objective=objective,
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
    )
    design = design_gain(
        scenario,
        sensor,
        objective,
        bounds=bounds,
        constraints=[limit.constraint for limit in request.limits],
        impact=request.foreseen_impact,
        method=method,
        horizon=horizon,
    )
    chosen = design.gain if gain is None else float(finite(gain, "gain", "N*s"))
    if chosen is None:
        return _no_gain(request, design)
    return _verdict(request, design, chosen, changes)


def _verdict(request: Request, design: GainDesign, gain: float, changes: bool) -> Verdict:
    r, loop, impact = request, request.loop, request.foreseen_impact
    predicted = r.contact(gain)
    check_horizon(r, predicted)
    draws = draw_encounters(
        r.scenario, r.sensor, r.uncertainty, count=r.runs, seed=loop.seed, method=r.method, horizon=r.horizon
    )
    unmitigated = draws.run(loop, 0.0)
    problem = LoopProblem(
        draws=draws,
        objective=r.objective,
        limits=r.limits,
        impact=r.impact,
        predicted=draws.predicted(gain, r.method, r.horizon),
        unmitigated=unmitigated,
    )
    outcomes = problem.appraise(loop, gain)
    distance = passed_distances(r.sensor, float(draws.distance.max()))
    limit = limit_of(loop, r.sensor, distance) if acts_as_damper(loop) else None
    stability = check_stability(loop, r.sensor, distance, gain, limit)
    reached = check_reached(outcomes.result, problem.predicted, r.confidence)
    limits = check_limits(r.limits, outcomes, predicted, gain, loop=loop, impact=impact, confidence=r.confidence)
    calibrated = check_calibration(r, gain)
    status, reasons = judge(
        reached, outcomes.effect, limits, stability, calibrated, runs=r.runs, confidence=r.confidence
    )
    comparisons = compare_quantities(outcomes.result, unmitigated, predicted, r.contact(0.0), loop=loop, impact=impact)
    found: dict[str, Any] = {}
    if changes:
        ends = np.abs(unmitigated.relative_velocity)
        fastest = float(max(np.max(ends, initial=0.0, where=np.isfinite(ends)), draws.approach.max()))
        found = find_improvements(
            r,
            problem,
            outcomes,
            gain,
            design=design,
            stability=stability,
            limit=limit,
            distance=distance,
            fastest=fastest,
        )
    return Verdict(
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
        stability_text=no_stability_in_words(gain, limit is not None)
        if stability is None
        else stability_in_words(stability),
        calibration_check=calibrated,
        assumptions=assumptions_of(
            loop, r.sensor, r.uncertainty, impact=impact, runs=r.runs, compared=compared_runs(problem)
        ),
        warnings=(
            *cautions_of(loop, draws, (outcomes.result, unmitigated), comparisons, design),
            *unknown_calibration(r.calibration),
        ),
        mitigated=outcomes.result,
        unmitigated=unmitigated,
        **found,
        **_asked(r, compared_runs(problem)),
    )


def _no_gain(r: Request, design: GainDesign) -> Verdict:
    return Verdict(
        status=VerdictStatus.NO_GAIN,
        gain=None,
        reasons=(f"the ideal design is {design.status.value}",),
        design=design,
        **_asked(r, 0),
    )


def _asked(r: Request, compared: int) -> dict[str, Any]:
    return {
        "runs": r.runs,
        "compared_runs": compared,
        "seed": r.loop.seed,
        "confidence": r.confidence,
        "scenario": r.scenario,
        "sensor": r.sensor,
        "definition": r.objective,
        "loop": r.loop,
        "uncertainty": r.uncertainty,
    }
