"""Compute derivatives of optimal gains with respect to inputs.

The method is the implicit function theorem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray, IntArray, chebyshev_basis, chebyshev_sum
from pretouch.motion.gradients import input_names
from pretouch.motion.scenario import SCENARIO_INPUTS, scenario_with, sensor_inputs, sensor_with
from pretouch.sensors import Recessed

from .certificate import ACTIVE, Sensitivity
from .constraints import Constraint
from .objectives import Objective
from .problem import Criterion, GainProblem, along, ratio

_BASIS: Final = chebyshev_basis(9)
_HALF: Final = 0.08  # half width in u of the sampled interval around the optimum: its eighth power is below rounding
_FARTHEST: Final = 0.5  # largest error of a searched optimum, as a share of that half width


# The chain rule gives the derivatives of each term of the objective from the gradients of contacts. They are sampled at
# Chebyshev nodes in the coordinate u of the gain around the optimum. Differentiating the polynomials through these
# samples by u gives f_up and f_uu, so that no finite difference by an input is needed.
def has_gradients(problem: GainProblem, constraint: Constraint | None) -> bool:
    """Return True if the design of a gain has exact derivatives.

    Contact quantities, objective and active constraint need exact derivatives.
    """
    limited = constraint is None or ratio(constraint, problem.task.impact).has_gradients
    return problem.is_differentiable and problem.merit.has_gradients and limited


def follow_optimum(
    problem: GainProblem,
    constraint: Constraint | None,
    *,
    gain: FloatArray,
    names: tuple[str, ...],
    held: bool = False,
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return the derivatives of optimal gains and their objectives.

    The derivatives are with respect to each input. At an interior optimum f_u = 0 stays true under every change, so
    du/dp = -f_up / f_uu. On an active constraint G = limit stays true, so du/dp = -G_p / G_u. On a bound (held=True)
    the gain stays. Each field of the scenario is a number or of shape (n, 1). The result holds d gain / d input and d f
    / d input, shape (n,); NaN if a sample does not end in contact.
    """
    axis = problem.axis
    center = axis.coordinate(gain)
    gains = axis.scale * np.sinh(center[:, None] + _HALF * _BASIS.nodes)
    stretch = np.hypot(gains, axis.scale)
    result = problem.run(gains)
    merit, velocity = problem.merit, problem.task.scenario.obstacle.velocity
    limited = None if constraint is None else ratio(constraint, problem.task.impact)

    def by(name: str, criterion: Criterion) -> FloatArray:
        return criterion.slope(result.end, along(result.gradients.of, name, velocity))

    slope = by("gain", merit) * stretch  # f_u
    free = limited is None and not held
    place = _root(slope) if free else np.zeros(len(gain))
    derivatives = {}
    for name in names:
        by_input = by(name, merit)
        if limited is not None and not held:
            shift = -_value(by(name, limited), place) / _value(by("gain", limited) * stretch, place)
        elif held:
            shift = np.where(np.isfinite(_value(by_input, place)), 0.0, np.nan)
        else:
            shift = -_rise(by_input, place) / _rise(slope, place)
        total = _value(by_input, place) + _value(slope, place) * shift
        at = np.hypot(axis.scale * np.sinh(center + _HALF * place), axis.scale)
        derivatives[name] = shift * at, total
    return derivatives


def _value(samples: FloatArray, place: FloatArray) -> FloatArray:
    return chebyshev_sum(_BASIS.to_terms @ samples.T, place)


def _rise(samples: FloatArray, place: FloatArray) -> FloatArray:
    return chebyshev_sum(_BASIS.to_slope @ samples.T, place) / _HALF


def _root(slope: FloatArray) -> FloatArray:
    """Refine the optimal gain by Newton's method."""
    place = np.zeros(len(slope))
    for _ in range(4):
        step = _value(slope, place) / _rise(slope, place) / _HALF
        place = np.clip(place - np.where(np.isfinite(step), step, 0.0), -1.0, 1.0)
    return np.where(np.abs(place) < _FARTHEST, place, np.nan)


_NODES: Final = np.arange(-2, 3)
_FIRST: Final = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12
_SECOND: Final = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12
_BLOCK: Final = 4096  # designs per block, with nine encounters each
_INSIDE, _BOUND, _UNKNOWN = -1, -2, -3


# Steps of the five-point differences: in u, and in an input relative to its magnitude.
_SMOOTH: Final = (0.02, 1e-4)
# On a sampled loop, l' at contact has ripples of (dF_p / dt) T^2 / 8 M over gain and inputs; these steps are wider.
_RIPPLED: Final = (0.1, 1e-2)

_Inputs: TypeAlias = dict[str, tuple[float, str, float]]
"""Value, unit and typical magnitude of each input, by name."""

_Side: TypeAlias = tuple[str, int]
"""An input that is changed, and the direction of the change, 1 or -1."""


def gain_sensitivities(problem: GainProblem, gain: float, at: str) -> tuple[Sensitivity, ...]:
    """Return the sensitivity of the optimal gain to all inputs.

    The derivatives of gain and objective are with respect to every scalar input.

    At an interior optimum f_u = 0 stays true under every change, so du/dp = -f_up / f_uu. On an active constraint
    G = limit stays true, so du/dp = -G_p / G_u. On a bound the gain stays. The derivatives are exact if objective and
    constraint depend only on quantities at contact. Peaks over the whole motion need central differences, with about
    six digits (three if only one side is valid). With a user-defined evaluator, the steps are wider than the ripples
    of a sampled loop, and the derivatives have errors of a few percent.

    Args:
        problem: the problem of one encounter.
        gain: the optimal gain: the law's number, such as D_p [N s].
        at: location of the optimum, as in Certificate.

    Returns:
        One entry per input whose change keeps the contact, largest effect first.
    """
    constraint = next((c for c in problem.task.limits if c.name == at and c.quantity != "gain"), None)
    inputs = _inputs(problem)
    if has_gradients(problem, constraint):
        held = at != "interior" and constraint is None
        shifts = follow_optimum(problem, constraint, gain=np.array([gain]), names=tuple(inputs), held=held)
        exact = [(float(shift[0]), float(total[0])) for shift, total in shifts.values()]
        if np.isfinite(exact).all():  # next to an edge of contact, only one-sided differences exist
            return _rank(inputs, exact)
    (step, relative), axis = _SMOOTH if problem.task.evaluate is None else _RIPPLED, problem.axis
    first, second = _FIRST / step, _SECOND / step**2
    gains = axis.scale * np.sinh(float(axis.coordinate(gain)) + step * _NODES)

    def sample(changed: GainProblem) -> FloatArray:
        task, result = changed.task, changed.run(gains)
        value = task.goal.value(result.end, abs(task.scenario.obstacle.velocity), task.impact)
        limited = constraint.magnitude(result.end, task.impact) if constraint else np.zeros(np.shape(value))
        return np.where(result.reached, [value, limited], np.nan)

    middle, derivatives = sample(problem), []
    f, g = middle
    steps = {name: relative * typical for name, (_, _, typical) in inputs.items()}
    sides = {(name, sign): inputs[name][0] + sign * steps[name] for name in inputs for sign in (1, -1)}
    samples = _samples_at(problem, inputs, sides, sample)
    for name in inputs:
        f_p, g_p = _derivative(samples.get((name, 1)), samples.get((name, -1)), steps[name], middle)
        if at == "interior":
            shift = -(f_p @ first) / (f @ second)
        elif constraint is not None:
            shift = -g_p[2] / (g @ first)
        else:
            shift = 0.0
        total = f_p[2] + (0.0 if at == "interior" else (f @ first) * shift)
        derivatives.append((float(shift * axis.stretch(gain)), float(total)))
    return _rank(inputs, derivatives)


def _rank(inputs: _Inputs, derivatives: list[tuple[float, float]]) -> tuple[Sensitivity, ...]:
    """Sort sensitivities by their effect, largest first."""
    entries = [
        Sensitivity(
            name=name,
            value=value,
            unit=unit,
            gain_derivative=derivative,
            objective_derivative=total,
            gain_change_per_percent=derivative * 0.01 * value,
        )
        for (name, (value, unit, _)), (derivative, total) in zip(inputs.items(), derivatives, strict=True)
        if np.isfinite(derivative) and np.isfinite(total)
    ]
    return tuple(sorted(entries, key=lambda s: -abs(s.gain_change_per_percent)))


def _samples_at(
    problem: GainProblem, inputs: _Inputs, sides: Mapping[_Side, float], sample: Callable[[GainProblem], FloatArray]
) -> dict[_Side, FloatArray]:
    """Evaluate input changes: as one array of encounters, or singly for functions of the user."""
    task, samples = problem.task, {}
    if task.evaluate is None and type(task.goal) is Objective:
        together = [side for side in sides if side[0] in SCENARIO_INPUTS]
        columns = {name: np.full((len(together), 1), inputs[name][0]) for name, _ in together}
        for i, side in enumerate(together):
            columns[side[0]][i] = sides[side]
        try:
            rows = sample(problem.changed(scenario=scenario_with(task.scenario, columns)))
            samples = dict(zip(together, np.moveaxis(rows, 1, 0), strict=True))
        except InvalidInputError:  # for example an object beyond the sensor's range: each change for itself
            pass
    for name, sign in [side for side in sides if side not in samples]:
        with suppress(InvalidInputError):
            samples[name, sign] = sample(_with(problem, name, sides[name, sign]))
    return {side: values for side, values in samples.items() if np.isfinite(values).all()}


def _derivative(above: FloatArray | None, below: FloatArray | None, step: float, middle: FloatArray) -> FloatArray:
    """Compute a derivative by finite differences."""
    sides = (above is not None) + (below is not None)
    if not sides:
        return np.full_like(middle, np.nan)
    high, low = (middle if side is None else side for side in (above, below))
    return np.asarray((high - low) / (sides * step))


def _inputs(problem: GainProblem) -> _Inputs:
    """Return value, unit and typical magnitude of every scalar input. The inputs are those of encounter and sensor."""
    scenario, sensor = problem.task.scenario, problem.task.sensor
    length = float(scenario.distance)
    speed = max(abs(float(scenario.relative_velocity)), abs(float(scenario.obstacle.velocity)), 1e-3)
    typical = {"m": length, "m/s": speed, "m/s^2": speed**2 / length}
    inputs = {}
    for name, unit in SCENARIO_INPUTS.items():
        part, _, attribute = name.partition(".")
        if part == "admittance" and attribute in {"natural_frequency", "damping_ratio"}:
            continue  # they follow from damping and stiffness
        value = getattr(getattr(scenario, part), attribute)
        if part != "admittance" or value > 0:
            inputs[name] = (value, unit, typical.get(unit, value))
    for name, unit in sensor_inputs(sensor).items():
        place = name == "sensor.recess" and isinstance(sensor, Recessed)
        curve = sensor if place or not isinstance(sensor, Recessed) else sensor.sensor
        value = getattr(curve, name.removeprefix("sensor."))
        if place or (isinstance(value, float) and value != 0):
            inputs[name] = (value, unit, length if place else abs(value))
    return inputs


def _with(problem: GainProblem, name: str, value: float) -> GainProblem:
    """Copy the search problem with one changed input."""
    if name in SCENARIO_INPUTS:
        return problem.changed(scenario=scenario_with(problem.task.scenario, {name: value}))
    return problem.changed(sensor=sensor_with(problem.task.sensor, {name.removeprefix("sensor."): value}))


def gain_gradient(problem: GainProblem, gain: Any, name: str, one: Callable[[tuple[int, ...]], Any]) -> FloatArray:
    """Return the derivatives of optimal gains with respect to one input.

    Args:
        problem: the problem.
        gain: the optimal gains.
        name: the input.
        one: returns the design of the encounter at an index, for encounters without exact derivatives.

    Returns:
        The derivatives; NaN without a gain, and next to an edge of contact.

    Raises:
        InvalidInputError: the input is unknown.
    """
    flat = np.asarray(gain, dtype=np.float64).reshape(-1)
    derivative = np.full(flat.shape, np.nan)
    where = np.flatnonzero(np.isfinite(flat))
    remaining = where
    if problem.is_differentiable:
        names = [n for n in input_names(problem.task.sensor) if n != "gain"]
        if name not in names:
            raise InvalidInputError(**not_one_of("by", name, names))
        parts = [_exact(problem, flat, where[i : i + _BLOCK], name, derivative) for i in range(0, len(where), _BLOCK)]
        remaining = np.concatenate(parts) if parts else where
    for i in remaining:
        index = tuple(int(k) for k in np.unravel_index(i, np.shape(gain)))
        entries = {s.name: s.gain_derivative for s in one(index).sensitivities}
        derivative[i] = entries.get(name, np.nan)
    return derivative.reshape(np.shape(gain))


def _exact(problem: GainProblem, gain: FloatArray, where: IntArray, name: str, derivative: FloatArray) -> IntArray:
    """Compute exact derivatives where possible, and return the remaining encounters."""
    kinds = _kinds(problem.column(where), gain[where])
    remaining = [where[kinds == _UNKNOWN]]
    for kind in np.unique(kinds[kinds != _UNKNOWN]):
        constraint = problem.task.limits[kind] if kind >= 0 else None
        these = where[kinds == kind]
        if has_gradients(problem, constraint):
            several, held = problem.column(these), bool(kind == _BOUND)
            derivative[these] = follow_optimum(several, constraint, gain=gain[these], names=(name,), held=held)[name][0]
        remaining.append(these[np.isnan(derivative[these])])
    return np.concatenate(remaining)


def _kinds(problem: GainProblem, gain: FloatArray) -> Any:
    """Return whether optimal gains are between the bounds, at a bound or at a constraint.

    For a gain at a constraint, the result is the index of this constraint.
    """
    kinds = np.where(problem.axis.is_end(problem.axis.coordinate(gain)), _BOUND, _INSIDE)
    if problem.task.limits:
        end = problem.run(gain[:, None]).end
        for i, constraint in enumerate(problem.task.limits):
            ratio = np.reshape(constraint.magnitude(end, problem.task.impact) / constraint.limit, -1)
            kinds[np.abs(ratio - 1) < ACTIVE] = _BOUND if constraint.quantity == "gain" else i
    return kinds
