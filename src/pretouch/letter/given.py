"""The letter's experiments as data: every input as printed, with its unit and the place where it stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.design import Objective, excursion_objective, time_objective
from pretouch.motion import Admittance, Obstacle, Plant, Scenario
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel

from .comparison import Parameter, resolution

__all__ = [
    "ADMITTANCE",
    "APPROACH",
    "BOUNDS",
    "DISRUPTION",
    "EXPERIMENT_GAIN",
    "F_1",
    "F_2",
    "SENSORS",
    "approach",
    "disruption",
    "f_1",
    "f_2",
    "over_rounding",
    "sensor",
]


def _parameters(place: str, *rows: tuple[str, str, str, str]) -> tuple[Parameter, ...]:
    return tuple(Parameter(name=n, symbol=s, printed=p, unit=u, place=place) for n, s, p, u in rows)


SENSORS: Final[Mapping[str, tuple[Parameter, ...]]] = {
    "inverse-power": _parameters(
        "Table I",
        ("scale", "αβψ", "1.30e-5", "V m^n"),
        ("distance_offset", "l_0", "0.0419", "m"),
        ("exponent", "n", "3.32", ""),
    ),
    "exponential-1": _parameters("Table I", ("scale", "a_1", "0.458", "V"), ("rate", "c_1", "-61.0", "1/m")),
    "exponential-2": _parameters(
        "Table I",
        ("scale", "a_2", "0.480", "V"),
        ("curvature", "b_2", "474", "1/m^2"),
        ("rate", "c_2", "-74.0", "1/m"),
    ),
    "fingertip": _parameters("Section V-B", ("scale", "a_1", "1.25", "V"), ("rate", "c_1", "-63.46", "1/m")),
}
"""The sensor curves by name: names of parameters are those of our own models."""

ADMITTANCE: Final = _parameters(
    "Section IV-B",
    ("virtual mass", "M_a", "1", "kg"),
    ("virtual damping", "D_a", "10", "N s/m"),
    ("virtual stiffness", "K_a", "25", "N/m"),
)
APPROACH: Final = (
    *ADMITTANCE,
    *_parameters(
        "Section IV-B",
        ("reference position", "x_d", "0", "m"),
        ("initial distance", "ε", "0.0422", "m"),
        ("initial position of the obstacle", "x_o,i", "0.0422", "m"),
        ("velocity of the obstacle", "v_o", "-0.3", "m/s"),
        ("acceleration of the obstacle", "a_o", "0", "m/s^2"),
    ),
)
"""Sections IV-B and V-A: an obstacle approaches the plant, which rests at its reference."""

EXPERIMENT_GAIN: Final = _parameters("Section IV-B", ("virtual force gain", "D_p", "-1.0", "N s"))[0]
F_1: Final = _parameters(
    "Section V-A",
    ("weight of the position", "w_1", "1", ""),
    ("weight of the velocity", "w_2", "1", ""),
    ("typical position", "x_typ", "-0.5", "m"),
    ("typical relative velocity", "l'_typ", "-0.3", "m/s"),
)
DISRUPTION: Final = (
    *ADMITTANCE,
    *_parameters(
        "Section V-B",
        ("reference position", "x_d", "0", "m"),
        ("initial distance", "ε", "0.065", "m"),
        ("position of the obstacle", "x_o,i", "-0.035", "m"),
        ("velocity of the obstacle", "v_o", "0", "m/s"),
        ("initial relative velocity", "μ", "0", "m/s"),
        ("acceleration of the obstacle", "a_o", "0", "m/s^2"),
    ),
)
"""Section V-B: the plant moves to its reference, and an obstacle at rest is in the way."""

F_2: Final = _parameters(
    "Section V-C",
    ("weight of the time", "w_3", "1", ""),
    ("weight of the velocity", "w_4", "1", ""),
    ("typical time", "t_typ", "1", "s"),
    ("typical relative velocity", "l'_typ", "-0.01", "m/s"),
)
BOUNDS: Final = (-20.0, -0.01)
"""The range of gains [N s] in which an optimum is sought; the letter names none."""


def sensor(name: str, values: Sequence[float] | None = None) -> SensorModel:
    """Make a sensor curve of the letter.

    Args:
        name: a key of SENSORS.
        values: its parameters, where they are not the printed ones.

    Returns:
        The curve.

    Examples:
        >>> sensor("exponential-1").constant_log_slope
        -61.0
    """
    given = SENSORS[name]
    numbers = [p.value for p in given] if values is None else values
    keywords = {p.name: float(v) for p, v in zip(given, numbers, strict=True)}
    models: dict[str, Callable[..., SensorModel]] = {
        "inverse-power": InversePower,
        "exponential-2": ExponentialSecondOrder,
    }
    return models.get(name, ExponentialFirstOrder)(**keywords)


def approach(speed: float | FloatArray | None = None) -> Scenario:
    """Make the encounter of Sections IV-B and V-A.

    Args:
        speed: the obstacle's speed [m/s], where it is not the printed one.

    Returns:
        The encounter.
    """
    given = {p.symbol: p.value for p in APPROACH}
    return Scenario(
        admittance=_admittance(),
        obstacle=Obstacle(position=given["x_o,i"], velocity=given["v_o"] if speed is None else -speed),
        plant=Plant(position=given["x_o,i"] - given["ε"]),
    )


def disruption() -> Scenario:
    """Make the encounter of Section V-B.

    Returns:
        The encounter.
    """
    given = {p.symbol: p.value for p in DISRUPTION}
    return Scenario(
        admittance=_admittance(),
        obstacle=Obstacle(position=given["x_o,i"], velocity=given["v_o"]),
        plant=Plant(position=given["x_o,i"] - given["ε"], velocity=given["v_o"] - given["μ"]),
    )


def f_1() -> Objective:
    """Make the objective of Section V-A, L(20) with the printed weights and typical values.

    Returns:
        The objective.
    """
    w_1, w_2, x_typ, v_typ = (p.value for p in F_1)
    return excursion_objective(position_scale=x_typ, velocity_scale=v_typ, position_weight=w_1, velocity_weight=w_2)


def f_2() -> Objective:
    """Make the objective of Section V-C, L(22) with the printed weights and typical values.

    Returns:
        The objective.
    """
    w_3, w_4, t_typ, v_typ = (p.value for p in F_2)
    return time_objective(time_scale=t_typ, velocity_scale=v_typ, time_weight=w_3, velocity_weight=w_4)


def over_rounding(
    name: str, evaluate: Callable[[SensorModel], FloatArray | Sequence[float]]
) -> tuple[FloatArray, FloatArray]:
    """Evaluate something over all sensors whose parameters round to the printed ones.

    Args:
        name: a key of SENSORS.
        evaluate: takes a sensor, returns numbers.

    Returns:
        The smallest and the largest of each number over the ends and the middle of every parameter's rounding; the
        scale is held, for it cancels.

    Examples:
        >>> low, high = over_rounding("exponential-1", lambda s: [s.constant_log_slope])
        >>> float(low[0]), float(high[0])
        (-61.05, -60.95)
    """
    steps = [
        (0.0,) if p.name == "scale" else tuple(k * resolution(p.printed) / 2 for k in (-1, 0, 1)) for p in SENSORS[name]
    ]
    middle = [p.value for p in SENSORS[name]]
    values = np.array(
        [evaluate(sensor(name, [m + s for m, s in zip(middle, shift, strict=True)])) for shift in product(*steps)]
    )
    return values.min(axis=0), values.max(axis=0)


def _admittance() -> Admittance:
    mass, damping, stiffness = (p.value for p in ADMITTANCE)
    return Admittance(mass=mass, damping=damping, stiffness=stiffness)
