"""The gain that is best for encounters that are not known exactly."""

from __future__ import annotations

from functools import partial
from typing import Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion.evaluator import Evaluator, with_noise_after
from pretouch.uncertainty import Interval, Uncertainty, make_ensemble, sample_inputs
from pretouch.uncertainty.sampling import check_draw

from ..certificate import DesignStatus
from ..constraints import each_once
from ..problem import GainProblem
from ..result import GainDesign
from ..search import EXACT, SAMPLED, GainAxis, search_axis
from ..task import Task, placed
from .evidence import RobustEvidence
from .importance import rank_uncertain_inputs
from .measures import Expected, Measure, Required, WorstCase, checked_measure
from .price import price_of_robustness
from .problem import RobustProblem
from .result import RobustDesign
from .validation import validate
from .worst_case import WorstEncounter, search_worst_case

__all__ = ["design_robust_gain"]

NOTHING_UNCERTAIN: Final = (
    'uncertainty: found none, expected what is known of inputs, such as {"obstacle.velocity": Uniform(low=-0.4, '
    'high=-0.2)}; in a file [uncertainty] with obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }'
)
_FRESH: Final = 1  # what is added to the seed for the samples of the validation
_SAMPLES: Final = 4096
_SAMPLES_OF_OTHERS: Final = 256  # where somebody else solves the encounters: a loop takes a hundred times as long


@placed
def design_robust_gain(task: Task) -> RobustDesign:
    """Find the gain D_p that minimizes a measure of an objective over encounters that are not known exactly.

    The measure is taken over samples of the uncertain inputs, the same for every gain; the gain is sought as
    `design_gain` seeks it. Its promise is then held against fresh samples. A worst case is not sampled: the worst
    encounter is searched for, and certified.

    With `evaluate` the encounters are run on a sampled loop: the i-th sample meets the noise of run i with every gain,
    and the validation that of later runs. The nominal gain stays that of `design_gain` in continuous time, so that
    `loss_of_nominal` says what the ideal design loses on the loop.

    Args:
        task: the encounter with every input at its likeliest value, the objective, the bounds, the uncertainty, which
            beside `evaluate` may be empty (then only noise differs), and where given measure, constraints, impact,
            samples, validation, seed, confidence, sampling, method, horizon and `evaluate`.

    Returns:
        The design; infeasible and no-contact are statuses of it, not errors.

    Examples:
        >>> from pretouch.design import excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.uncertainty import Uniform
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     bounds=(-10.0, -0.01),
        ...     uncertainty={"obstacle.velocity": Uniform(low=-0.5, high=-0.1)},
        ... )
        >>> design = design_robust_gain(task)
        >>> round(design.gain, 3)
        -0.778
    """
    axis, objective, evaluate, seed = GainAxis.between(task.stable_bounds()), task.goal, task.evaluate, task.seed or 0
    uncertainty, samples, validation = task.uncertainty, task.samples, task.validation
    chosen = checked_measure(Expected() if task.measure is None else task.measure)
    limits = limits_of(task)
    _check(uncertainty, chosen, limits, task.confidence, evaluate)
    if samples is None:
        samples = _SAMPLES if evaluate is None else _SAMPLES_OF_OTHERS
    if validation is None:
        validation = _SAMPLES if evaluate is None else 4 * samples
    make = partial(
        make_ensemble, task.scenario, task.sensor, method=task.method, horizon=task.horizon, evaluate=evaluate
    )
    pose = partial(RobustProblem, objective=objective, measure=chosen, limits=limits, impact=task.impact, axis=axis)
    unseen = _draw(uncertainty, validation, seed + _FRESH, "random", evaluate)
    later = None if evaluate is None else with_noise_after(evaluate, samples)
    fresh = pose(ensemble=make(unseen, count=validation, evaluate=later))
    worst: WorstEncounter | None = None
    if isinstance(chosen, WorstCase):
        problem, searched, minima, worst = search_worst_case(uncertainty, make, pose)
    else:
        drawn = _draw(uncertainty, samples, seed, task.sampling, evaluate)
        problem = pose(ensemble=make(drawn, count=samples))
        effort = EXACT if evaluate is None else SAMPLED
        searched, minima = search_axis(problem.landscape, problem.lowest_needed(), axis.span[1], effort)
    ideal = GainProblem(task=task.replace(evaluate=None), axis=axis)
    nominal = GainDesign.of(ideal)
    gain = float(problem.axis.gain(minima[0].coordinate)) if minima else None
    checked = None if gain is None else validate(fresh, gain, nominal.gain, confidence=task.confidence)
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
        scenario=task.scenario,
        sensor=task.sensor,
        uncertainty=uncertainty,
        definition=objective,
        limits=limits,
        impact=task.impact,
        ranking=partial(rank_uncertain_inputs, problem, make, uncertainty, samples=samples, seed=seed),
        pricing=partial(price_of_robustness, ideal, uncertainty),
        evidence=RobustEvidence(problem=problem, fresh=fresh, scanned=searched),
    )


def limits_of(task: Task) -> tuple[Required, ...]:
    """Return the constraints of a task, each with its probability: a plain one must hold in every encounter."""
    return tuple(c if isinstance(c, Required) else Required(constraint=c) for c in task.constraints)


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
    if not uncertainty and evaluate is None:
        raise InvalidInputError(NOTHING_UNCERTAIN)
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
