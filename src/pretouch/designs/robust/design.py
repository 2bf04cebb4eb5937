"""Find the optimal gain for uncertain inputs.

The gain minimizes the mean, a quantile or the worst case of the objective.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion import CustomLaw
from pretouch.motion.evaluator import with_noise_after
from pretouch.uncertainty import Interval, sample_inputs
from pretouch.uncertainty.ensemble import check_draw, check_nominal

from ..certificate import DesignStatus
from ..gain import GainDesign
from ..gain_jump import describe_jump
from ..problem import GainProblem
from ..search import MEASURED, SAMPLED, GainAxis, search_axis
from ..task import Task, with_file_location
from .measures import Expected, Measure, WorstCase, checked_measure
from .problem import RobustProblem
from .required import Required, limits_of
from .result import RobustDesign
from .validation import validate
from .worst_case import WorstEncounter, search_worst_case

NOTHING_UNCERTAIN: Final = (
    'uncertainty: found none, expected distributions of inputs, such as {"obstacle.velocity": Uniform(low=-0.4, '
    'high=-0.2)}; in a scenario file, [uncertainty] with obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }'
)
_FRESH: Final = 1  # added to the seed for the samples of the validation
_SAMPLES: Final = 4096
_FEW_SAMPLES: Final = 256  # a sampled loop or a custom law needs a hundred times the computing time or more


@check_arguments
@with_file_location
def robust(task: Task) -> RobustDesign:
    """Find the optimal gain for uncertain encounters.

    The gain D_p minimizes a risk measure of the objective. A risk measure is the mean, a quantile, the tail mean or the
    worst case.

    The measure is taken over samples of the uncertain inputs, which are the same for every gain. The gain is searched
    as by `design_gain`, and then validated on fresh samples. A worst case is not sampled: the worst encounter is
    searched for and certified.

    With `evaluate`, the encounters run on a sampled loop. The i-th sample has the noise of run i at every gain, and the
    validation uses later runs. The nominal gain is still that of `design_gain` in continuous time, so that
    `loss_of_nominal` is the loss of the ideal design on the loop.

    Args:
        task: the encounter with every input at its likeliest value, the objective, the bounds and the uncertainty,
            which may be empty with `evaluate` (then only the noise varies); optionally the options `robust`,
            constraints, impact, method, horizon and `evaluate`.

    Returns:
        The design; infeasible and no-contact are statuses, not errors.

    Examples:
        >>> from pretouch.designs import excursion_objective
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
        >>> design = robust(task)
        >>> round(design.gain, 3)
        -0.778
    """
    task.refuse_free_admittance("a robust design chooses only the gain")
    axis, task = GainAxis.between(task.stable_bounds(), task.law.number), _with_defaults(task)
    options, evaluate = task.robust, task.evaluate
    samples, validation, seed = options.samples or 0, options.validation or 0, options.seed
    nominal = GainDesign.of(GainProblem(task=task.replace(evaluate=None), axis=axis)).gain
    # Evenly spread encounters make no seed lucky, and the intervals for independent encounters cautious.
    unseen = _draw(task, validation, seed + _FRESH, options.sampling)
    later = None if evaluate is None else with_noise_after(evaluate, samples)
    fresh = RobustProblem.over(task, axis, unseen, count=validation, evaluate=later)
    worst: WorstEncounter | None = None
    if isinstance(options.measure, WorstCase):
        problem, searched, minima, worst = search_worst_case(task, axis)
    else:
        problem = RobustProblem.over(task, axis, _draw(task, samples, seed, options.sampling), count=samples)
        effort = MEASURED if evaluate is None else SAMPLED
        searched, minima = search_axis(
            problem.landscape, problem.lowest_needed(), axis.span[1], effort, reserve=axis.reserve
        )
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
        jump=describe_jump(problem, minima[0].jump, contact=False) if minima else None,
    )


def _with_defaults(task: Task) -> Task:
    """Check the task of a robust design, and add defaults."""
    options = task.robust
    measure = checked_measure(Expected() if options.measure is None else options.measure)
    limits = limits_of(task.constraints)
    _check(task, measure, limits)
    custom = isinstance(task.law, CustomLaw) and task.evaluate is None
    default = _FEW_SAMPLES if custom or task.evaluate is not None else _SAMPLES
    samples = default if options.samples is None else options.samples
    fresh = 4 * max(samples, _FEW_SAMPLES) if custom else _SAMPLES if task.evaluate is None else 4 * samples
    validation = fresh if options.validation is None else options.validation
    options = replace(options, measure=measure, samples=samples, validation=validation)
    return task.replace(constraints=limits, robust=options)


def _draw(task: Task, count: int, seed: int, sampling: str) -> dict[str, FloatArray]:
    """Draw random samples of the uncertain inputs."""
    if task.uncertainty:
        return sample_inputs(task.uncertainty, count, seed=seed, sampling=sampling)
    check_draw(count, seed=seed, sampling=sampling)
    return {}


def _check(task: Task, measure: Measure, limits: tuple[Required, ...]) -> None:
    if not task.uncertainty and task.evaluate is None:
        raise InvalidInputError(NOTHING_UNCERTAIN)
    check_nominal(task.uncertainty, task.scenario, task.sensor)
    if isinstance(measure, WorstCase):
        if task.evaluate is not None or task.scenario.obstacle.course:
            what = "an obstacle with a course" if task.evaluate is None else "evaluate"
            raise InvalidInputError(
                f"measure: WorstCase does not work with {what}; use Expected, Quantile or ConditionalValueAtRisk. "
                "WorstCase needs gradients of the objective. These gradients exist only in continuous time and for "
                "obstacles with constant acceleration"
            )
        for limit in limits:
            if limit.probability < 1:
                raise InvalidInputError(
                    f"constraint {limit.constraint.name}: found a probability of {limit.probability:g}, but a "
                    "worst-case design does not use probabilities; pass the Constraint without a probability",
                    value=limit.probability,
                )
        return
    for name, distribution in task.uncertainty.items():
        if type(distribution) is Interval:
            raise InvalidInputError(
                f"uncertainty {name}: an interval has no probabilities, but the risk measure {measure.label!r} "
                "needs probabilities. Use Uniform if all values are equally likely, or the risk measure "
                "WorstCase"
            )
