"""Robust gain design: minimize a measure of the objective over uncertain encounters."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion.evaluator import with_noise_after
from pretouch.uncertainty import Distribution, Interval, Uncertainty, sample_inputs
from pretouch.uncertainty.ensemble import check_draw

from ..certificate import DesignStatus
from ..gain import GainDesign
from ..problem import GainProblem
from ..search import EXACT, SAMPLED, GainAxis, Minimum, Scan, search_axis
from ..search.minima import CertifiedMaximum, Function, maximize_on_box
from ..task import Task, with_file_location
from .measures import Expected, Measure, Required, WorstCase, checked_measure, limits_of
from .problem import RobustProblem, WorstEncounter, validate
from .result import RobustDesign

_MOST_INPUTS: Final = 8
_INSIDE: Final = 64  # initial points inside the box
_ROUNDS: Final = 30
_SAME: Final = 1e-9  # two objectives within this relative difference are equal
_TOLERANCE: Final = 1e-7  # relative tolerance of the certified maximum
_DECIDING: Final = 1e-7  # encounters within this relative difference of the worst one are reported as deciding
_STEP: Final = 1e-4  # step of differences that replace a gradient, as a share of an input's range


def box_of(uncertainty: Uncertainty) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each input; raise an error for unbounded or too many inputs."""
    if len(uncertainty) > _MOST_INPUTS:
        raise InvalidInputError(
            f"uncertainty: found {len(uncertainty)} inputs for a worst case, expected at most {_MOST_INPUTS}: "
            "the search evaluates 2^n corners"
        )
    box = {}
    for name, distribution in uncertainty.items():
        support = distribution.support if isinstance(distribution, Distribution) else (-np.inf, np.inf)
        if not np.isfinite(support).all():
            raise InvalidInputError(
                f"uncertainty {name}: found {type(distribution).__name__}, which has no bounds, expected bounds for a "
                "worst case; use an Interval, or a TruncatedNormal with both bounds"
            )
        box[name] = support
    return box


# The largest objective over a finite set of encounters is minimized: the corners of the box of inputs, its middle and
# points inside. At the optimal gain, the worst encounter of the whole box is searched for and certified
# (`search.box_maximum`). If it is worse than the set, it joins the set, and the gain is optimized again (Blankenship and
# Falk, J. Optim. Theory Appl. 19 (1976) 261). So the last minimum is a lower bound for all gains, and the certified
# maximum is an upper bound for the optimal gain. Their difference is the optimality gap.
def search_worst_case(task: Task, axis: GainAxis) -> tuple[RobustProblem, Scan, list[Minimum], WorstEncounter | None]:
    """Find the gain with the best worst case; return the last problem, its scan and minima, and the worst encounter."""
    box = box_of(task.uncertainty)
    low, high = (np.array(ends) for ends in zip(*box.values(), strict=True))
    points = _first_points(box)
    for _ in range(_ROUNDS):
        problem = RobustProblem.over(task, axis, dict(zip(box, points.T, strict=True)))
        scanned, minima = search_axis(problem.landscape, problem.lowest_needed(), problem.axis.span[1])
        if not minima:
            return problem, scanned, minima, None
        gain, lower = float(problem.axis.gain(minima[0].coordinate)), minima[0].value
        maxima = [
            maximize_on_box(_function(problem, box, gain, which), low, high, tolerance=_TOLERANCE)
            for which in range(-1, len(problem.limits))
        ]
        allowed = (lower, *(1.0 for _ in problem.limits))
        worse = [m.point for m, most in zip(maxima, allowed, strict=True) if m.value > most * (1 + _SAME)]
        if not worse:
            break
        points = np.concatenate([points, worse])
    return problem, scanned, minima, _worst(maxima[0], lower, tuple(box), problem, gain)


def _first_points(box: Mapping[str, tuple[float, float]]) -> FloatArray:
    """Return the corners of a box, its middle, and points inside."""
    corners = np.array(list(product(*box.values())))
    middle = np.array([[0.5 * (low + high) for low, high in box.values()]])
    inside = sample_inputs({name: Interval(low=low, high=high) for name, (low, high) in box.items()}, _INSIDE)
    return np.concatenate([corners, middle, np.stack([inside[name] for name in box], axis=1)])


def _function(problem: RobustProblem, box: Mapping[str, tuple[float, float]], gain: float, which: int) -> Function:
    """Return a function of the inputs with its gradient: the objective (-1) or the ratio of a constraint."""
    names = tuple(box)
    low, high = (np.array(ends) for ends in zip(*box.values(), strict=True))

    def at(points: FloatArray) -> RobustProblem:
        return RobustProblem.over(problem.task, problem.axis, dict(zip(names, points.T, strict=True)))

    def value(points: FloatArray) -> FloatArray:
        objective, ratios = at(points).values(gain)
        return objective if which < 0 else ratios[which]

    def both(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        values = value(points)
        if not np.isfinite(values).all():
            return values, np.full(points.shape, np.nan)
        if problem.has_slopes(which):
            inner = at(points)
            result = inner.ensemble.contacts(gain)
            return values, np.stack([inner.slope(result, name, which) for name in names], axis=1)
        slopes = []
        for j, step in enumerate(_STEP * (high - low)):
            ahead, behind = points.copy(), points.copy()
            ahead[:, j] = np.minimum(points[:, j] + step, high[j])
            behind[:, j] = np.maximum(points[:, j] - step, low[j])
            slopes.append((value(ahead) - value(behind)) / (ahead[:, j] - behind[:, j]))
        return values, np.stack(slopes, axis=1)

    return both


def _worst(
    maximum: CertifiedMaximum, lower: float, names: tuple[str, ...], problem: RobustProblem, gain: float
) -> WorstEncounter:
    """Make the worst encounter from the certified maximum and the lower bound for all gains."""
    values = problem.values(gain)[0]
    points = np.stack([problem.ensemble.values[name] for name in names], axis=1)
    deciding = np.unique(points[values >= lower * (1 - _DECIDING)], axis=0)
    return WorstEncounter(
        inputs=dict(zip(names, maximum.point.tolist(), strict=True)),
        value=maximum.value,
        bound=maximum.bound,
        lower=min(lower, maximum.bound),  # equal bounds may differ by rounding, since they are computed differently
        boxes=maximum.boxes,
        monotone={name: sign for name, sign in zip(names, maximum.signs, strict=True) if sign},
        encounters=tuple(map(tuple, deciding.tolist())),
    )


NOTHING_UNCERTAIN: Final = (
    'uncertainty: found none, expected distributions of inputs, such as {"obstacle.velocity": Uniform(low=-0.4, '
    'high=-0.2)}; in a file [uncertainty] with obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }'
)
_FRESH: Final = 1  # added to the seed for the samples of the validation
_SAMPLES: Final = 4096
_SAMPLES_OF_EVALUATOR: Final = 256  # with `evaluate`: a loop takes a hundred times as long


@check_arguments
@with_file_location
def design_robust_gain(task: Task) -> RobustDesign:
    """Find the gain D_p that minimizes a measure of an objective over encounters with uncertain inputs.

    The measure is taken over samples of the uncertain inputs, which are the same for every gain. The gain is searched
    as by `design_gain`, and then validated on fresh samples. A worst case is not sampled: the worst encounter is
    searched for and certified.

    With `evaluate`, the encounters run on a sampled loop. The i-th sample has the noise of run i at every gain, and the
    validation uses later runs. The nominal gain is still that of `design_gain` in continuous time, so that
    `loss_of_nominal` is the loss of the ideal design on the loop.

    Args:
        task: the encounter with every input at its likeliest value, the objective, the bounds and the uncertainty,
            which may be empty with `evaluate` (then only the noise varies); optionally measure, constraints, impact,
            samples, validation, seed, confidence, sampling, method, horizon and `evaluate`.

    Returns:
        The design; infeasible and no-contact are statuses, not errors.

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
    axis, task = GainAxis.between(task.stable_bounds(), task.law.number), _with_defaults(task)
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


def _with_defaults(task: Task) -> Task:
    """Return the task with the default values of a robust design, after checking it."""
    measure = checked_measure(Expected() if task.measure is None else task.measure)
    limits = limits_of(task.constraints)
    _check(task, measure, limits)
    default = _SAMPLES if task.evaluate is None else _SAMPLES_OF_EVALUATOR
    samples = default if task.samples is None else task.samples
    fresh = _SAMPLES if task.evaluate is None else 4 * samples
    return task.replace(
        measure=measure,
        constraints=limits,
        samples=samples,
        validation=fresh if task.validation is None else task.validation,
        seed=task.seed or 0,
    )


def _draw(task: Task, count: int, seed: int, sampling: str) -> dict[str, FloatArray]:
    """Draw samples of the inputs; none if only the noise of an evaluator varies."""
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
                "measure: found WorstCase with evaluate, expected Expected, Quantile or ConditionalValueAtRisk: the "
                "search for the worst encounter needs gradients, which exist only in continuous time, L(1)"
            )
        for limit in limits:
            if limit.probability < 1:
                raise InvalidInputError(
                    f"constraint {limit.constraint.name}: found a probability of {limit.probability:g} with a worst "
                    "case, which has no probabilities; pass the Constraint without a probability"
                )
        return
    for name, distribution in task.uncertainty.items():
        if type(distribution) is Interval:
            raise InvalidInputError(
                f"uncertainty {name}: found an interval, which has no probabilities, for the measure "
                f"{measure.label!r}; use Uniform if all values are equally likely, or the measure WorstCase"
            )
