"""List the inputs of the experiments in the published letter.

The values and units are as printed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.designs import Objective, Task, design_gain, excursion_objective, time_objective
from pretouch.motion import Admittance, Obstacle, Plant, Scenario
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel

from .printed import Parameter, resolution


def _parameters(place: str, *lines: str) -> tuple[Parameter, ...]:
    """Parse inputs of the published letter. Each line has the form `name: symbol = value unit`."""
    matches = [re.fullmatch(r"(.+): (.+) = (\S+) ?(.*)", text) for line in lines for text in line.split("; ")]
    return tuple(Parameter(m[1], m[2], m[3], m[4], place) for m in matches if m)


SENSORS: Final[Mapping[str, tuple[Parameter, ...]]] = {
    "inverse-power": _parameters(
        "Table I", "scale: αβψ = 1.30e-5 V m^n; distance_offset: l_0 = 0.0419 m; exponent: n = 3.32"
    ),
    "exponential-1": _parameters("Table I", "scale: a_1 = 0.458 V; rate: c_1 = -61.0 1/m"),
    "exponential-2": _parameters("Table I", "scale: a_2 = 0.480 V; curvature: b_2 = 474 1/m^2; rate: c_2 = -74.0 1/m"),
    "fingertip": _parameters("Section V-B", "scale: a_1 = 1.25 V; rate: c_1 = -63.46 1/m"),
}
"""The sensor curves by name; parameters have the names of the sensor models of pretouch."""

ADMITTANCE: Final = _parameters(
    "Section IV-B", "virtual mass: M_a = 1 kg; virtual damping: D_a = 10 N s/m; virtual stiffness: K_a = 25 N/m"
)
APPROACH: Final = ADMITTANCE + _parameters(
    "Section IV-B",
    "reference position: x_d = 0 m; initial distance: ε = 0.0422 m; initial position of the obstacle: x_o,i = 0.0422 m",
    "velocity of the obstacle: v_o = -0.3 m/s; acceleration of the obstacle: a_o = 0 m/s^2",
)
"""Sections IV-B and V-A: an obstacle approaches the plant, which rests at its reference."""

EXPERIMENT_GAIN: Final = _parameters("Section IV-B", "virtual force gain: D_p = -1.0 N s")[0]
F_1: Final = _parameters(
    "Section V-A",
    "weight of the position: w_1 = 1; weight of the velocity: w_2 = 1",
    "typical position: x_typ = -0.5 m; typical relative velocity: l'_typ = -0.3 m/s",
)
DISRUPTION: Final = ADMITTANCE + _parameters(
    "Section V-B",
    "reference position: x_d = 0 m; initial distance: ε = 0.065 m; position of the obstacle: x_o,i = -0.035 m",
    "velocity of the obstacle: v_o = 0 m/s; initial relative velocity: μ = 0 m/s",
    "acceleration of the obstacle: a_o = 0 m/s^2",
)
"""Section V-B: the plant moves to its reference, and an obstacle at rest is in the way."""

F_2: Final = _parameters(
    "Section V-C",
    "weight of the time: w_3 = 1; weight of the velocity: w_4 = 1",
    "typical time: t_typ = 1 s; typical relative velocity: l'_typ = -0.01 m/s",
)
BOUNDS: Final = (-20.0, -0.01)
"""Bounds of the gain [N s] in the search for an optimum; the letter prints none."""


def sensor(name: str, values: Sequence[float] | None = None) -> SensorModel:
    """Create a sensor curve of the published letter.

    The parameter values are as printed, unless other values are given.

    Returns:
        The curve.

    Examples:
        >>> sensor("exponential-1").constant_log_slope
        -61.0
    """
    models: dict[str, Callable[..., SensorModel]] = {
        "inverse-power": InversePower,
        "exponential-2": ExponentialSecondOrder,
    }
    parameters = SENSORS[name]
    numbers = [p.value for p in parameters] if values is None else values
    arguments = {p.name: float(v) for p, v in zip(parameters, numbers, strict=True)}
    return models.get(name, ExponentialFirstOrder)(**arguments)


def approach(speed: float | FloatArray | None = None) -> Scenario:
    """Create the encounter of the letter's Sections IV-B and V-A, with an approaching obstacle."""
    values = {p.symbol: p.value for p in APPROACH}
    return _encounter(values, values["v_o"] if speed is None else -speed)


def disruption() -> Scenario:
    """Create the encounter in Section V-B of the letter."""
    values = {p.symbol: p.value for p in DISRUPTION}
    return _encounter(values, values["v_o"], values["v_o"] - values["μ"])


def _encounter(
    values: Mapping[str, float], obstacle_velocity: float | FloatArray, plant_velocity: float = 0.0
) -> Scenario:
    return Scenario(
        admittance=Admittance(mass=values["M_a"], damping=values["D_a"], stiffness=values["K_a"]),
        obstacle=Obstacle(position=values["x_o,i"], velocity=obstacle_velocity),
        plant=Plant(position=values["x_o,i"] - values["ε"], velocity=plant_velocity),
    )


def f_1() -> Objective:
    """Create the published letter's objective f_1. Equation L(20) has weights and typical values from Section V-A."""
    w_1, w_2, x_typ, v_typ = (p.value for p in F_1)
    return excursion_objective(position_scale=x_typ, velocity_scale=v_typ, position_weight=w_1, velocity_weight=w_2)


def f_2() -> Objective:
    """Create the published letter's objective f_2. Equation L(22) has weights and typical values from Section V-C."""
    w_3, w_4, t_typ, v_typ = (p.value for p in F_2)
    return time_objective(time_scale=t_typ, velocity_scale=v_typ, time_weight=w_3, velocity_weight=w_4)


def best_gain(
    curve: SensorModel, scenario: Scenario | None = None, objective: Objective | None = None, method: str = "auto"
) -> float:
    """Return the optimal gain for an encounter of the letter.

    The gain is in N s. It is NaN if there is none.
    """
    gain = design_gain(Task(scenario or approach(), curve, objective or f_1(), bounds=BOUNDS, method=method)).gain
    return float("nan") if gain is None else gain


def over_rounding(name: str, evaluate: Callable[[SensorModel], Any]) -> Any:
    """Return the range of a result due to rounded parameters.

    The sensor parameters vary within the rounding of the published values. The scale of the sensor is fixed, because it
    cancels in the virtual force.

    Returns:
        The smallest and the largest value over the ends and the middle of every parameter's rounding interval: a pair
        of floats for one number, else an array of the shape (..., 2).

    Examples:
        >>> over_rounding("exponential-1", lambda s: s.constant_log_slope)
        (-61.05, -60.95)
    """
    steps = [
        (0.0,) if p.name == "scale" else tuple(k * resolution(p.printed) / 2 for k in (-1, 0, 1)) for p in SENSORS[name]
    ]
    middle = [p.value for p in SENSORS[name]]
    shifted = ([m + s for m, s in zip(middle, shift, strict=True)] for shift in product(*steps))
    values = np.array([evaluate(sensor(name, numbers)) for numbers in shifted])
    ends = np.stack([values.min(axis=0), values.max(axis=0)], axis=-1)
    return (float(ends[0]), float(ends[1])) if ends.ndim == 1 else ends


ONE_APPROACH: Final = {"admittance": approach().admittance, "scenario": approach(), "sensor": sensor("inverse-power")}
"""Inputs of most programs, by their variable names."""
