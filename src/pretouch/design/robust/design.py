"""The gain that is best for encounters that are not known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite
from pretouch.motion import Scenario
from pretouch.sensors import SensorModel
from pretouch.uncertainty import Interval, Uncertainty, make_ensemble, sample_inputs

from ..constraints import Constraint
from ..gain import design_gain
from ..impact import ImpactModel
from ..objectives import Objective
from ..result import DesignStatus
from ..search import GainAxis, Minimum, Scan, refine, scan
from .evidence import RobustEvidence
from .importance import rank_uncertain_inputs
from .measures import Expected, Measure, Required, WorstCase
from .price import price_of_robustness
from .problem import RobustProblem
from .result import RobustDesign, WorstEncounter
from .validation import validate
from .worst_case import search_worst_case

__all__ = ["design_robust_gain"]

_FRESH: Final = 1  # what is added to the seed for the samples of the validation


def design_robust_gain(
    scenario: Scenario,
    sensor: SensorModel,
    objective: Objective,
    *,
    bounds: tuple[float, float],
    uncertainty: Uncertainty,
    measure: Measure | None = None,
    constraints: Sequence[Constraint | Required] = (),
    impact: ImpactModel | None = None,
    samples: int = 4096,
    validation: int = 4096,
    seed: int = 0,
    confidence: float = 0.95,
    sampling: str = "sobol",
    method: str = "auto",
    horizon: float = 600.0,
) -> RobustDesign:
    """Find the gain D_p that minimizes a measure of an objective over encounters that are not known exactly.

    The measure is taken over samples of the uncertain inputs, the same for every gain; the gain is sought as
    `design_gain` seeks it. Its promise is then held against fresh samples. A worst case is not sampled: the worst
    encounter is searched for, and certified.

    Args:
        scenario: the encounter with every input at its likeliest value.
        sensor: the sensor curve.
        objective: what is minimized in each encounter.
        bounds: smallest and largest gain [N s].
        uncertainty: what is known of inputs, by name, such as `{"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}`.
        measure: what is made of the objectives: Expected() by default, Quantile, ConditionalValueAtRisk or WorstCase.
        constraints: limits: a Constraint must hold in every encounter, a Required with its probability.
        impact: physical properties, for objectives and constraints on forces.
        samples: how many encounters the measure is taken over.
        validation: how many fresh ones the gain is held against.
        seed: of all samples.
        confidence: of the intervals.
        sampling: how samples are drawn, as in `sample_inputs`.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].

    Returns:
        The design; infeasible and no-contact are statuses of it, not errors.

    Raises:
        InvalidInputError: the request makes no sense.

    Examples:
        >>> from pretouch.design import excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.uncertainty import Uniform
        >>> design = design_robust_gain(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     bounds=(-10.0, -0.01),
        ...     uncertainty={"obstacle.velocity": Uniform(low=-0.5, high=-0.1)},
        ... )
        >>> round(design.gain, 3)
        -0.778
    """
    low, high = (finite(b, "bounds", "N*s") for b in bounds)
    if not low < high:
        raise InvalidInputError(f"bounds: found [{low:g}, {high:g}] N*s, expected the smaller gain first")
    chosen = Expected() if measure is None else measure
    limits = tuple(c if isinstance(c, Required) else Required(constraint=c) for c in constraints)
    _check(uncertainty, chosen, limits, confidence)
    make = partial(make_ensemble, scenario, sensor, method=method, horizon=horizon)
    common: dict[str, Any] = {
        "objective": objective,
        "measure": chosen,
        "limits": limits,
        "impact": impact,
        "axis": GainAxis(low=low, high=high),
    }
    unseen = sample_inputs(uncertainty, validation, seed=seed + _FRESH, sampling="random")
    fresh = RobustProblem(ensemble=make(unseen), **common)
    worst: WorstEncounter | None = None
    if isinstance(chosen, WorstCase):
        problem, searched, minima, worst = search_worst_case(uncertainty, make, common)
    else:
        drawn = sample_inputs(uncertainty, samples, seed=seed, sampling=sampling)
        problem = RobustProblem(ensemble=make(drawn), **common)
        searched, minima = _search(problem)
    nominal = design_gain(
        scenario,
        sensor,
        objective,
        bounds=(low, high),
        constraints=[limit.constraint for limit in limits],
        impact=impact,
        method=method,
        horizon=horizon,
    )
    gain = float(problem.axis.gain(minima[0].coordinate)) if minima else None
    checked = None if gain is None else validate(fresh, gain, nominal.gain, confidence=confidence)
    contact = searched.landscape.reached.any()
    return RobustDesign(
        status=DesignStatus.OPTIMAL if minima else DesignStatus.INFEASIBLE if contact else DesignStatus.NO_CONTACT,
        gain=gain,
        value=minima[0].value if minima else None,
        measure=chosen,
        nominal_gain=nominal.gain,
        validation=checked,
        worst=worst,
        local_minima=tuple((float(problem.axis.gain(m.coordinate)), m.value) for m in minima),
        scanned=len(searched.coordinate),
        strongest=float(problem.axis.gain(searched.coordinate[0])),
        samples=len(problem.ensemble),
        seed=seed,
        bounds=(low, high),
        scenario=scenario,
        sensor=sensor,
        uncertainty=uncertainty,
        definition=objective,
        limits=limits,
        impact=impact,
        ranking=partial(rank_uncertain_inputs, problem, make, uncertainty, samples=samples, seed=seed),
        pricing=partial(
            price_of_robustness,
            scenario=scenario,
            sensor=sensor,
            objective=objective,
            bounds=(low, high),
            impact=impact,
            uncertainty=uncertainty,
            gain=gain,
            options={"method": method, "horizon": horizon},
        ),
        evidence=RobustEvidence(problem=problem, fresh=fresh, scanned=searched),
    )


def _search(problem: RobustProblem) -> tuple[Scan, list[Minimum]]:
    """Scan the gains that may be the optimum until neighbors predict each other, and refine the minima."""
    _, high = map(float, problem.axis.coordinate(np.array(problem.axis.ends)))
    searched = scan(problem.landscape, problem.lowest_needed(), high)
    return searched, refine(lambda u: problem.landscape(u).merit, searched.coordinate, searched.landscape.merit)


def _check(uncertainty: Uncertainty, measure: Measure, limits: tuple[Required, ...], confidence: float) -> None:
    """Refuse what makes no sense as a robust design problem."""
    if not 0 < confidence < 1:
        raise InvalidInputError(f"confidence: found {confidence:g}, expected a number between 0 and 1, such as 0.95")
    names = [limit.constraint.name for limit in limits]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f"constraint {name}: found twice, expected once")
    if isinstance(measure, WorstCase):
        for limit in limits:
            if limit.probability < 1:
                raise InvalidInputError(
                    f"constraint {limit.constraint.name}: found a probability of {limit.probability:g} beside a worst "
                    "case, which knows none; give the Constraint itself"
                )
        return
    for name, known in uncertainty.items():
        if type(known) is Interval:
            raise InvalidInputError(
                f"uncertainty {name}: found an interval, which says nothing about what is likely, for the measure "
                f"{measure.label!r}; use Uniform where all of it is equally likely, or the measure WorstCase"
            )
