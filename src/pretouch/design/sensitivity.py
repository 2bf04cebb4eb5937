"""How optimal gains follow each input, by the implicit function theorem: exactly, or by differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray, chebyshev_basis, chebyshev_sum
from pretouch.motion.gradients import input_names
from pretouch.motion.scenario import SCENARIO_INPUTS, scenario_with, sensor_inputs, sensor_with
from pretouch.sensors import Recessed

from .certificate import Sensitivity
from .constraints import Constraint
from .problem import Criterion, GainProblem, along, ratio

_BASIS: Final = chebyshev_basis(9)
_HALF: Final = 0.08  # of u, from the optimum to the outermost samples: its eighth power is below the rounding of those
_BESIDE: Final = 0.5  # of that: no search is this far from its optimum


# Gradients of contacts go through the objective term by term. Along the coordinate u of the gain they are sampled at
# Chebyshev's nodes beside the optimum, which gives f_up and f_uu as first derivatives of what is exact: no difference
# is formed by any input.
def has_gradients(problem: GainProblem, constraint: Constraint | None) -> bool:
    """Tell whether encounters, objective and the active constraint, if any, have gradients."""
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
    """Differentiate optimal gains, shape (n,), and their objectives by inputs, as `ContactGradients` names them."""
    # Inside, f_u = 0 holds along with every change, so du/dp = -f_up / f_uu; on an active constraint G = limit holds,
    # so du/dp = -G_p / G_u; on a bound, where it is held, the gain stays. Each field of the scenario is a number or of
    # shape (n, 1). By name d D_p / d input [N s per unit] and d f / d input at the optimum, shape (n,); NaN where a
    # sample does not end in contact.
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
    found = {}
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
        found[name] = shift * at, total
    return found


def _value(samples: FloatArray, place: FloatArray) -> FloatArray:
    return chebyshev_sum(_BASIS.to_terms @ samples.T, place)


def _rise(samples: FloatArray, place: FloatArray) -> FloatArray:
    """Return the derivative by u of what was sampled at the nodes, at a place in [-1, 1]."""
    return chebyshev_sum(_BASIS.to_slope @ samples.T, place) / _HALF


def _root(slope: FloatArray) -> FloatArray:
    """Return where f_u = 0, in [-1, 1] about the gain that the search has found, to more digits than it has."""
    place = np.zeros(len(slope))
    for _ in range(4):
        step = _value(slope, place) / _rise(slope, place) / _HALF
        place = np.clip(place - np.where(np.isfinite(step), step, 0.0), -1.0, 1.0)
    return np.where(np.abs(place) < _BESIDE, place, np.nan)


_NODES: Final = np.arange(-2, 3)
_FIRST: Final = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12
_SECOND: Final = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12
_BLOCK: Final = 4096  # designs at a time: nine encounters each
_ACTIVE: Final = 1e-6  # of a limit, as in Certificate
_INSIDE, _BOUND, _UNKNOWN = -1, -2, -3


# steps of the five-point differences: of u between the nodes, and of an input, in parts of its magnitude
_SMOOTH: Final = (0.02, 1e-4)
# a loop that samples has ripples over gain and inputs, of (dF_p / dt) T^2 / 8 M in l' at contact: steps reach over them
_RIPPLED: Final = (0.1, 1e-2)

_Inputs: TypeAlias = dict[str, tuple[float, str, float]]
"""Value, unit and typical magnitude of inputs by name."""


def gain_sensitivities(problem: GainProblem, gain: float, at: str) -> tuple[Sensitivity, ...]:
    """Differentiate the optimal gain and its objective with respect to every scalar input.

    Inside, f_u = 0 holds along with every change, so du/dp = -f_up / f_uu; on an active constraint G = limit holds,
    so du/dp = -G_p / G_u; on a bound the gain stays. Where objective and constraint are made of quantities at contact
    the derivatives by the inputs are exact. Peaks over the whole motion, and encounters that somebody else solves,
    leave central differences, good to about six digits (three where one side makes no sense). Those of encounters that
    somebody else solves reach over the ripples of a sampled loop, and are good to some percent.

    Args:
        problem: what was designed, for one encounter.
        gain: the optimal gain [N s].
        at: where the optimum sits, as in Certificate.

    Returns:
        One entry per input whose change keeps the contact, largest effect first.
    """
    constraint = next((c for c in problem.task.limits if c.name == at and c.quantity != "gain"), None)
    inputs = _inputs(problem)
    if has_gradients(problem, constraint):
        held = at != "interior" and constraint is None
        shifts = follow_optimum(problem, constraint, gain=np.array([gain]), names=tuple(inputs), held=held)
        exact = [(float(shift[0]), float(total[0])) for shift, total in shifts.values()]
        if np.isfinite(exact).all():  # beside an edge of contact only one side is left
            return _ranked(inputs, exact)
    (step, relative), axis = _SMOOTH if problem.task.evaluate is None else _RIPPLED, problem.axis
    first, second = _FIRST / step, _SECOND / step**2
    gains = axis.scale * np.sinh(float(axis.coordinate(gain)) + step * _NODES)

    def sample(changed: GainProblem) -> FloatArray:
        """Sample the objective and the active constraint's magnitude at the nodes."""
        result = changed.run(gains)
        value = changed.task.goal.value(result.end, abs(changed.task.scenario.obstacle.velocity), changed.task.impact)
        limited = constraint.magnitude(result.end, changed.task.impact) if constraint else np.zeros(len(gains))
        return np.where(result.reached, [value, limited], np.nan)

    middle = sample(problem)
    f, g = middle
    found = []
    for name, (value, _, typical) in inputs.items():
        f_p, g_p = _derivative(lambda v, n=name: sample(_with(problem, n, v)), value, relative * typical, middle)  # type: ignore[misc]
        if at == "interior":
            shift = -(f_p @ first) / (f @ second)
        elif constraint is not None:
            shift = -g_p[2] / (g @ first)
        else:
            shift = 0.0
        total = f_p[2] + (0.0 if at == "interior" else (f @ first) * shift)
        found.append((float(shift * axis.stretch(gain)), float(total)))
    return _ranked(inputs, found)


def _ranked(inputs: _Inputs, found: list[tuple[float, float]]) -> tuple[Sensitivity, ...]:
    """Return what is finite, largest effect first."""
    entries = [
        Sensitivity(
            name=name,
            value=value,
            unit=unit,
            gain_derivative=derivative,
            objective_derivative=total,
            gain_change_per_percent=derivative * 0.01 * abs(value),
        )
        for (name, (value, unit, _)), (derivative, total) in zip(inputs.items(), found, strict=True)
        if np.isfinite(derivative) and np.isfinite(total)
    ]
    return tuple(sorted(entries, key=lambda s: -abs(s.gain_change_per_percent)))


def _derivative(sample: Callable[[float], FloatArray], value: float, step: float, middle: FloatArray) -> FloatArray:
    """Differentiate samples by the value of an input: centrally, or to one side where the other makes no sense."""
    sides = []
    for sign in (1, -1):
        try:
            side = sample(value + sign * step)
        except InvalidInputError:  # such as an object farther away than the sensor's range
            continue
        if np.isfinite(side).all():
            sides.append((sign, side))
    if len(sides) == 2:
        return np.asarray((sides[0][1] - sides[1][1]) / (2 * step))
    if len(sides) == 1:
        sign, side = sides[0]
        return np.asarray(sign * (side - middle) / step)
    return np.full_like(middle, np.nan)


def _inputs(problem: GainProblem) -> _Inputs:
    """Return every scalar input of scenario and sensor; what is 0 has a typical magnitude only in a motion."""
    scenario, sensor = problem.task.scenario, problem.task.sensor
    length = float(scenario.distance)
    speed = max(abs(float(scenario.relative_velocity)), abs(float(scenario.obstacle.velocity)), 1e-3)
    typical = {"m": length, "m/s": speed, "m/s^2": speed**2 / length}
    found = {}
    for name, unit in SCENARIO_INPUTS.items():
        part, _, rest = name.partition(".")
        value = getattr(getattr(scenario, part), rest)
        if part != "admittance" or (rest not in {"natural_frequency", "damping_ratio"} and value > 0):
            found[name] = (value, unit, typical.get(unit, value))
    for name, unit in sensor_inputs(sensor).items():
        place = name == "sensor.recess" and isinstance(sensor, Recessed)
        curve = sensor if place or not isinstance(sensor, Recessed) else sensor.sensor
        value = getattr(curve, name.removeprefix("sensor."))
        if place or (isinstance(value, float) and value != 0):
            found[name] = (value, unit, length if place else abs(value))
    return found


def _with(problem: GainProblem, name: str, value: float) -> GainProblem:
    """Return the problem with another value of an input."""
    if name in SCENARIO_INPUTS:
        return problem.changed(scenario=scenario_with(problem.task.scenario, {name: value}))
    return problem.changed(sensor=sensor_with(problem.task.sensor, {name.removeprefix("sensor."): value}))


def gain_gradient(problem: GainProblem, gain: Any, name: str, one: Callable[[tuple[int, ...]], Any]) -> FloatArray:
    """Differentiate optimal gains by one input, as `ContactGradients` names it: in N s per unit of the input."""
    # `one` gives the design of the encounter at an index, for those without exact derivatives. NaN where there is no
    # gain, and where the optimum lies so close to an edge of contact that it has no derivative.
    flat = np.asarray(gain, dtype=np.float64).reshape(-1)
    found = np.full(flat.shape, np.nan)
    where = np.flatnonzero(np.isfinite(flat))
    left = where
    if problem.is_differentiable:
        known = [n for n in input_names(problem.task.sensor) if n != "gain"]
        if name not in known:
            raise InvalidInputError(f"by: found {name!r}, expected one of {', '.join(known)}")
        parts = [_exact(problem, flat, where[i : i + _BLOCK], name, found) for i in range(0, len(where), _BLOCK)]
        left = np.concatenate(parts) if parts else where
    for i in left:
        index = tuple(int(k) for k in np.unravel_index(i, np.shape(gain)))
        entries = {s.name: s.gain_derivative for s in one(index).sensitivities}
        found[i] = entries.get(name, np.nan)
    return found.reshape(np.shape(gain))


def _exact(problem: GainProblem, gain: FloatArray, where: IntArray, name: str, found: FloatArray) -> IntArray:
    """Fill what has exact derivatives; return what is left."""
    kinds = _kinds(problem.column(where), gain[where])
    left = [where[kinds == _UNKNOWN]]
    for kind in np.unique(kinds[kinds != _UNKNOWN]):
        constraint = problem.task.limits[kind] if kind >= 0 else None
        these = where[kinds == kind]
        if has_gradients(problem, constraint):
            several, held = problem.column(these), bool(kind == _BOUND)
            found[these] = follow_optimum(several, constraint, gain=gain[these], names=(name,), held=held)[name][0]
        left.append(these[np.isnan(found[these])])
    return np.concatenate(left)


def _kinds(problem: GainProblem, gain: FloatArray) -> Any:
    """Tell where each optimum sits: the number of the active constraint, or one of the three above."""
    kinds = np.where(problem.axis.is_end(problem.axis.coordinate(gain)), _BOUND, _INSIDE)
    if problem.task.limits:
        end = problem.run(gain[:, None]).end
        for i, constraint in enumerate(problem.task.limits):
            ratio = np.reshape(constraint.magnitude(end, problem.task.impact) / constraint.limit, -1)
            kinds[np.abs(ratio - 1) < _ACTIVE] = _BOUND if constraint.quantity == "gain" else i
    return kinds
