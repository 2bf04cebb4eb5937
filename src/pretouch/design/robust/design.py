"""The gain that is best for encounters that are not known exactly."""

from __future__ import annotations

from typing import Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion.evaluator import with_noise_after
from pretouch.uncertainty import Interval, sample_inputs
from pretouch.uncertainty.sampling import check_draw

from ..certificate import DesignStatus
from ..problem import GainProblem
from ..result import GainDesign
from ..search import EXACT, SAMPLED, GainAxis, search_axis
from ..task import Task, placed
from .measures import Expected, Measure, Required, WorstCase, checked_measure, limits_of
from .problem import RobustProblem
from .result import RobustDesign
from .validation import WorstEncounter, validate
from .worst_case import search_worst_case

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
    axis, task = GainAxis.between(task.stable_bounds()), _settled(task)
    samples, validation, seed, evaluate = task.samples or 0, task.validation or 0, task.seed or 0, task.evaluate
    nominal = GainDesign.of(GainProblem(task=task.replace(evaluate=None), axis=axis)).gain
    unseen = _draw(task, validation, seed + _FRESH, "random")
    later = None if evaluate is None else with_noise_after(evaluate, samples)
    fresh = RobustProblem.over(task, axis, unseen, count=validation, evaluate=later)
    worst: WorstEncounter | None = None
    if isinstance(task.measure, WorstCase):
        problem, searched, minima, worst = search_worst_case(task, axis)
    else:
        problem = RobustProblem.over(task, axis, _draw(task, samples, seed, task.sampling), count=samples)
        effort = EXACT if evaluate is None else SAMPLED
        searched, minima = search_axis(problem.landscape, problem.lowest_needed(), axis.span[1], effort)
    local_minima = tuple((float(axis.gain(m.coordinate)), m.value) for m in minima)
    contact = searched.landscape.reached.any()
    return RobustDesign(
        problem=problem,
        status=DesignStatus.OPTIMAL if minima else DesignStatus.INFEASIBLE if contact else DesignStatus.NO_CONTACT,
        local_minima=local_minima,
        nominal_gain=nominal,
        validation=validate(fresh, local_minima[0][0], nominal) if minima else None,
        worst=worst,
        fresh=fresh,
        scan=searched,
    )


def _settled(task: Task) -> Task:
    """Return the task with what it leaves open decided; refuse what makes no sense as a robust design problem."""
    measure = checked_measure(Expected() if task.measure is None else task.measure)
    limits = limits_of(task.constraints)
    _check(task, measure, limits)
    most = _SAMPLES if task.evaluate is None else _SAMPLES_OF_OTHERS
    samples = most if task.samples is None else task.samples
    fresh = _SAMPLES if task.evaluate is None else 4 * samples
    return task.replace(
        measure=measure,
        constraints=limits,
        samples=samples,
        validation=fresh if task.validation is None else task.validation,
        seed=task.seed or 0,
    )


def _draw(task: Task, count: int, seed: int, sampling: str) -> dict[str, FloatArray]:
    """Draw samples of the inputs; none where only the noise of an evaluator differs."""
    if task.uncertainty:
        return sample_inputs(task.uncertainty, count, seed=seed, sampling=sampling)
    check_draw(count, seed=seed, sampling=sampling)
    return {}


def _check(task: Task, measure: Measure, limits: tuple[Required, ...]) -> None:
    confidence = task.confidence
    if not 0 < confidence < 1:
        raise InvalidInputError(f"confidence: found {confidence:g}, expected a number between 0 and 1, such as 0.95")
    if not task.uncertainty and task.evaluate is None:
        raise InvalidInputError(NOTHING_UNCERTAIN)
    if isinstance(measure, WorstCase):
        if task.evaluate is not None:
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
    for name, known in task.uncertainty.items():
        if type(known) is Interval:
            raise InvalidInputError(
                f"uncertainty {name}: found an interval, which says nothing about what is likely, for the measure "
                f"{measure.label!r}; use Uniform where all of it is equally likely, or the measure WorstCase"
            )
