"""The gain that is best for encounters that are not known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion import Scenario
from pretouch.motion.evaluator import Evaluator, with_noise_after
from pretouch.sensors import SensorModel
from pretouch.uncertainty import Interval, Uncertainty, make_ensemble, sample_inputs
from pretouch.uncertainty.sampling import check_draw

from ..certificate import DesignStatus
from ..constraints import Constraint, each_once
from ..gain import design
from ..impact import ImpactModel
from ..own_objective import AnyObjective, as_objective
from ..problem import GainProblem
from ..search import EXACT, SAMPLED, GainAxis, search_axis
from .evidence import RobustEvidence
from .importance import rank_uncertain_inputs
from .measures import Expected, Measure, Required, WorstCase, checked_measure
from .price import price_of_robustness
from .problem import RobustProblem
from .result import RobustDesign
from .validation import validate
from .worst_case import WorstEncounter, search_worst_case

__all__ = ["design_robust_gain"]

_FRESH: Final = 1  # what is added to the seed for the samples of the validation
_SAMPLES: Final = 4096
_SAMPLES_OF_OTHERS: Final = 256  # where somebody else solves the encounters: a loop takes a hundred times as long


def design_robust_gain(
    scenario: Scenario,
    sensor: SensorModel,
    objective: AnyObjective,
    *,
    bounds: tuple[float, float],
    uncertainty: Uncertainty,
    measure: Measure | None = None,
    constraints: Sequence[Constraint | Required] = (),
    impact: ImpactModel | None = None,
    samples: int | None = None,
    validation: int | None = None,
    seed: int = 0,
    confidence: float = 0.95,
    sampling: str = "sobol",
    method: str = "auto",
    horizon: float = 600.0,
    evaluate: Evaluator | None = None,
) -> RobustDesign:
    """Find the gain D_p that minimizes a measure of an objective over encounters that are not known exactly.

    The measure is taken over samples of the uncertain inputs, the same for every gain; the gain is sought as
    `design_gain` seeks it. Its promise is then held against fresh samples. A worst case is not sampled: the worst
    encounter is searched for, and certified.

    With `evaluate` the encounters are run on a sampled loop: the i-th sample meets the noise of run i with every gain,
    and the validation that of later runs. The nominal gain stays that of `design_gain` in continuous time, so that
    `loss_of_nominal` says what the ideal design loses on the loop.

    Args:
        scenario: the encounter with every input at its likeliest value.
        sensor: the sensor curve.
        objective: what is minimized in each encounter, as in `design_gain`.
        bounds: smallest and largest gain [N s].
        uncertainty: what is known of inputs, by name, such as `{"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}`;
            beside `evaluate` it may be empty: then only noise differs.
        measure: what is made of the objectives: Expected() by default, Quantile, ConditionalValueAtRisk or WorstCase.
        constraints: limits: a Constraint must hold in every encounter, a Required with its probability.
        impact: physical properties, for objectives and constraints on forces.
        samples: how many encounters the measure is taken over; 4096, or 256 with `evaluate`.
        validation: how many fresh ones the gain is held against; 4096, or four times the samples with `evaluate`.
        seed: of all samples of inputs.
        confidence: of the intervals.
        sampling: how samples are drawn, as in `sample_inputs`.
        method: how encounters are solved, as in `find_contact`.
        horizon: how long to wait for contact [s].
        evaluate: solves encounters in the place of `find_contact`, as in `design_gain`: a `ClosedLoop`, or a function.

    Returns:
        The design; infeasible and no-contact are statuses of it, not errors.

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
    axis = GainAxis.between(bounds)
    objective, chosen = as_objective(objective), checked_measure(Expected() if measure is None else measure)
    limits = tuple(c if isinstance(c, Required) else Required(constraint=c) for c in constraints)
    _check(uncertainty, chosen, limits, confidence, evaluate)
    if samples is None:
        samples = _SAMPLES if evaluate is None else _SAMPLES_OF_OTHERS
    if validation is None:
        validation = _SAMPLES if evaluate is None else 4 * samples
    make = partial(make_ensemble, scenario, sensor, method=method, horizon=horizon, evaluate=evaluate)
    pose = partial(RobustProblem, objective=objective, measure=chosen, limits=limits, impact=impact, axis=axis)
    unseen = _draw(uncertainty, validation, seed + _FRESH, "random", evaluate)
    later = None if evaluate is None else with_noise_after(evaluate, samples)
    fresh = pose(ensemble=make(unseen, count=validation, evaluate=later))
    worst: WorstEncounter | None = None
    if isinstance(chosen, WorstCase):
        problem, searched, minima, worst = search_worst_case(uncertainty, make, pose)
    else:
        drawn = _draw(uncertainty, samples, seed, sampling, evaluate)
        problem = pose(ensemble=make(drawn, count=samples))
        effort = EXACT if evaluate is None else SAMPLED
        searched, minima = search_axis(problem.landscape, problem.lowest_needed(), axis.span[1], effort)
    ideal = GainProblem(
        scenario=scenario,
        sensor=sensor,
        objective=objective,
        constraints=tuple(limit.constraint for limit in limits),
        impact=impact,
        axis=axis,
        method=method,
        horizon=horizon,
        evaluator=None,
    )
    nominal = design(ideal)
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
        bounds=axis.ends,
        scenario=scenario,
        sensor=sensor,
        uncertainty=uncertainty,
        definition=objective,
        limits=limits,
        impact=impact,
        ranking=partial(rank_uncertain_inputs, problem, make, uncertainty, samples=samples, seed=seed),
        pricing=partial(price_of_robustness, ideal, uncertainty),
        evidence=RobustEvidence(problem=problem, fresh=fresh, scanned=searched),
    )


def _draw(
    uncertainty: Uncertainty, count: int, seed: int, sampling: str, evaluate: Evaluator | None
) -> dict[str, FloatArray]:
    """Draw samples of the inputs; none where only the noise of an evaluator differs."""
    if uncertainty or evaluate is None:
        return sample_inputs(uncertainty, count, seed=seed, sampling=sampling)
    check_draw(count, seed=seed, sampling=sampling)
    return {}


def _check(
    uncertainty: Uncertainty,
    measure: Measure,
    limits: tuple[Required, ...],
    confidence: float,
    evaluate: Evaluator | None,
) -> None:
    """Refuse what makes no sense as a robust design problem."""
    if not 0 < confidence < 1:
        raise InvalidInputError(f"confidence: found {confidence:g}, expected a number between 0 and 1, such as 0.95")
    each_once(limit.constraint for limit in limits)
    if isinstance(measure, WorstCase):
        if evaluate is not None:
            raise InvalidInputError(
                "measure: found WorstCase beside evaluate, expected Expected, Quantile or ConditionalValueAtRisk: the "
                "search for the worst encounter needs the gradients of L(1), which others do not give"
            )
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
