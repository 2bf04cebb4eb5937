"""How the optimum follows each input, by the implicit function theorem."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.motion import ContactResult, Scenario
from pretouch.sensors import Recessed, SensorModel

from .certificate import Sensitivity
from .constraints import Constraint
from .gradient import follow_optimum, has_gradients
from .impact import ImpactModel
from .objectives import Objective
from .search import GainAxis

__all__ = ["gain_sensitivities"]

_NODES = np.arange(-2, 3)
_FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12
_SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12


@dataclass(frozen=True, slots=True, kw_only=True)
class _Steps:
    """Of u, between the nodes of the five-point differences; of an input, of its magnitude."""

    gain: float
    relative: float


_SMOOTH = _Steps(gain=0.02, relative=1e-4)
# a loop that samples has ripples over gain and inputs, of (dF_p / dt) T^2 / 8 M in l' at contact: steps reach over them
_RIPPLED = _Steps(gain=0.1, relative=1e-2)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Input:
    """One input: its name, value and unit, and the problem with it changed."""

    name: str
    value: float
    unit: str
    step: float
    changed: Callable[[float], tuple[Scenario, SensorModel]]


def gain_sensitivities(
    *,
    scenario: Scenario,
    sensor: SensorModel,
    objective: Objective,
    constraint: Constraint | None,
    impact: ImpactModel | None,
    evaluate: Callable[[Scenario, SensorModel, Any], ContactResult],
    sampled: bool,
    differentiable: bool,
    axis: GainAxis,
    gain: float,
    at: str,
) -> tuple[Sensitivity, ...]:
    """Differentiate the optimal gain and its objective with respect to every scalar input.

    Inside, f_u = 0 holds along with every change, so du/dp = -f_up / f_uu; on an active constraint G = limit holds,
    so du/dp = -G_p / G_u; on a bound the gain stays. Where objective and constraint are made of quantities at contact
    the derivatives by the inputs are exact. Peaks over the whole motion, and encounters that somebody else solves,
    leave central differences, good to about six digits (three where one side makes no sense). Those of encounters that
    somebody else solves reach over the ripples of a sampled loop, and are good to some percent.

    Args:
        scenario: the encounter.
        sensor: the sensor curve.
        objective: what was minimized.
        constraint: the active constraint, if the optimum sits on one.
        impact: the physical properties, where given.
        evaluate: solves encounters.
        sampled: whether that is somebody else's, such as a loop that samples.
        differentiable: whether what it returns has gradients.
        axis: the coordinate of the gain.
        gain: the optimal gain [N s].
        at: where the optimum sits, as in Certificate.

    Returns:
        One entry per input whose change keeps the contact, largest effect first.
    """
    steps = _RIPPLED if sampled else _SMOOTH
    first, second = _FIRST / steps.gain, _SECOND / steps.gain**2
    inputs = list(_inputs(scenario, sensor, steps.relative))
    if differentiable and has_gradients(objective, constraint):
        shifts = follow_optimum(
            run=lambda gains: evaluate(scenario, sensor, gains),
            scenario=scenario,
            objective=objective,
            constraint=constraint,
            impact=impact,
            axis=axis,
            gain=np.array([gain]),
            names=tuple(item.name for item in inputs),
            held=at != "interior" and constraint is None,
        )
        exact = [(float(shifts[item.name].gain[0]), float(shifts[item.name].objective[0])) for item in inputs]
        if np.isfinite(exact).all():  # beside an edge of contact only one side is left
            return _ranked(inputs, exact)
    center = float(axis.coordinate(gain))
    gains = axis.scale * np.sinh(center + steps.gain * _NODES)

    def sample(changed: tuple[Scenario, SensorModel]) -> FloatArray:
        """Sample the objective and the active constraint's magnitude at the nodes."""
        result = evaluate(*changed, gains)
        value = objective.value(result.end, abs(changed[0].obstacle.velocity), impact)
        limited = constraint.magnitude(result.end, impact) if constraint else np.zeros(len(gains))
        return np.where(result.reached, [value, limited], np.nan)

    middle = sample((scenario, sensor))
    f, g = middle
    found = []
    for item in inputs:
        f_p, g_p = _derivative(sample, item, middle)
        if at == "interior":
            shift = -(f_p @ first) / (f @ second)
        elif constraint is not None:
            shift = -g_p[2] / (g @ first)
        else:
            shift = 0.0
        total = f_p[2] + (0.0 if at == "interior" else (f @ first) * shift)
        found.append((float(shift * axis.stretch(gain)), float(total)))
    return _ranked(inputs, found)


def _ranked(inputs: list[_Input], found: list[tuple[float, float]]) -> tuple[Sensitivity, ...]:
    """Return what is finite, largest effect first."""
    entries = [
        Sensitivity(
            name=item.name,
            value=item.value,
            unit=item.unit,
            gain_derivative=derivative,
            objective_derivative=total,
            gain_change_per_percent=derivative * 0.01 * abs(item.value),
        )
        for item, (derivative, total) in zip(inputs, found, strict=True)
        if np.isfinite(derivative) and np.isfinite(total)
    ]
    return tuple(sorted(entries, key=lambda s: -abs(s.gain_change_per_percent)))


def _derivative(
    sample: Callable[[tuple[Scenario, SensorModel]], FloatArray], item: _Input, middle: FloatArray
) -> FloatArray:
    """Differentiate samples by an input: centrally, or to one side where the other makes no sense."""
    sides = []
    for sign in (1, -1):
        try:
            side = sample(item.changed(item.value + sign * item.step))
        except InvalidInputError:  # such as an object farther away than the sensor's range
            continue
        if np.isfinite(side).all():
            sides.append((sign, side))
    if len(sides) == 2:
        return np.asarray((sides[0][1] - sides[1][1]) / (2 * item.step))
    if len(sides) == 1:
        sign, side = sides[0]
        return np.asarray(sign * (side - middle) / item.step)
    return np.full_like(middle, np.nan)


def _inputs(scenario: Scenario, sensor: SensorModel, relative: float) -> Iterator[_Input]:
    """Yield every scalar input of the scenario and the sensor."""
    length = float(scenario.distance)
    speed = max(abs(float(scenario.relative_velocity)), abs(float(scenario.obstacle.velocity)), 1e-3)
    typical = {"position": length, "velocity": speed, "acceleration": speed**2 / length}
    units = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}
    for part in ("obstacle", "plant", "reference"):
        body = getattr(scenario, part)
        for f in fields(body):
            yield _Input(
                name=f"{part}.{f.name}",
                value=getattr(body, f.name),
                unit=units[f.name],
                step=relative * typical[f.name],
                changed=_scenario_with(scenario, sensor, part, f.name),
            )
    for name, unit in (("mass", "kg"), ("damping", "N*s/m"), ("stiffness", "N/m")):
        value = getattr(scenario.admittance, name)
        if value > 0:
            changed = _scenario_with(scenario, sensor, "admittance", name)
            yield _Input(name=f"admittance.{name}", value=value, unit=unit, step=relative * value, changed=changed)
    yield from _sensor_inputs(scenario, sensor, relative)


def _scenario_with(
    scenario: Scenario, sensor: SensorModel, part: str, name: str
) -> Callable[[float], tuple[Scenario, SensorModel]]:
    def changed(value: float) -> tuple[Scenario, SensorModel]:
        body = replace(getattr(scenario, part), **{name: value})
        return replace(scenario, **{part: body}), sensor

    return changed


def _sensor_inputs(scenario: Scenario, sensor: SensorModel, relative: float) -> Iterator[_Input]:
    """Yield the parameters of the curve, and how far it is recessed."""
    inner = sensor.sensor if isinstance(sensor, Recessed) else sensor

    def rebuilt(curve: SensorModel, recess: float | None) -> SensorModel:
        if not isinstance(sensor, Recessed):
            return curve
        # the curve's own range decides where the changed one holds
        return Recessed(sensor=curve, recess=sensor.recess if recess is None else recess)

    for f in fields(inner):
        value = getattr(inner, f.name)
        if "unit" not in f.metadata or not isinstance(value, float) or value == 0:
            continue
        yield _Input(
            name=f"sensor.{f.name}",
            value=value,
            unit=f.metadata["unit"],
            step=relative * abs(value),
            changed=lambda v, name=f.name: (  # type: ignore[misc]
                scenario,
                rebuilt(replace(inner, **{name: v}), None),
            ),
        )
    if isinstance(sensor, Recessed):
        yield _Input(
            name="sensor.recess",
            value=sensor.recess,
            unit="m",
            step=relative * float(scenario.distance),
            changed=lambda v: (scenario, rebuilt(inner, v)),
        )
