"""Extreme numbers end with a status or an error that names the value, after few evaluations and without a warning."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.designs import excursion_objective
from pretouch.motion import ContactStatus, CustomLaw, LawNumber, Reference
from pretouch.sensors import SensorModel
from refusals import refused

SENSORS: dict[str, SensorModel] = {
    "inverse-power": pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "exponential-1": pt.ExponentialFirstOrder(scale=0.458, rate=-61.0),
}
SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
SIZES = (1e-200, 1e-30, 1e30, 1e200)
FIELDS = {
    "admittance": {"mass": (1,), "damping": (1,), "stiffness": (1,)},
    "obstacle": {"position": (1,), "velocity": (1, -1), "acceleration": (1, -1)},
    "plant": {"position": (1, -1), "velocity": (1, -1)},
    "reference": {"position": (1, -1), "velocity": (1, -1), "acceleration": (1, -1)},
}
EXTREMES = [
    (part, name, sign * size) for part, of in FIELDS.items() for name in of for sign in of[name] for size in SIZES
]
MOST = 60_000  # states at which one encounter evaluates a custom force; an ordinary one needs about 2,000


def encounter(part: str, name: str, value: float) -> pt.Scenario:
    return replace(SCENARIO, **{part: replace(getattr(SCENARIO, part), **{name: value})})


def outcome(solve: Any) -> Any:
    """Return a result whose numbers are not NaN, or None if an error of the package refuses the request."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            result = solve()
        except pt.errors.InvalidInputError:
            return None
        assert not any(np.isnan(values).any() for values in result.end.as_dict().values())
        return result


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("extreme", EXTREMES, ids=lambda extreme: "-".join(map(str, extreme)))
def test_contacts(extreme: tuple[str, str, float], sensor: str) -> None:
    """One encounter and several together end in the same way."""
    try:
        scenario = encounter(*extreme)
    except pt.errors.InvalidInputError:
        return  # such as a robot behind the obstacle
    one = outcome(lambda: pt.find_contact(scenario, SENSORS[sensor], -0.7))
    several = outcome(lambda: pt.find_contact(scenario, SENSORS[sensor], np.full(9, -0.7)))
    assert (one is None) == (several is None)
    outcome(lambda: pt.find_contact(scenario, SENSORS[sensor], 0.014, law="virtual-drag"))


@pytest.mark.slow(keep=5)
@pytest.mark.parametrize("extreme", EXTREMES, ids=lambda extreme: "-".join(map(str, extreme)))
def test_custom_laws_need_few_evaluations(extreme: tuple[str, str, float]) -> None:
    count = 0

    def force(value: Any, output: Any, rate: Any) -> Any:
        nonlocal count
        count += rate.size
        return value * rate

    law = CustomLaw(kind="own", number=LawNumber("gain", "D_p", "N*s", -1), force=force, vectorized=True)
    try:
        scenario = encounter(*extreme)
    except pt.errors.InvalidInputError:
        return
    outcome(lambda: pt.find_contact(scenario, SENSORS["inverse-power"], -0.7, law=law, horizon=2.0))
    assert count < MOST


@pytest.mark.parametrize("value", [1e30, 1e200])
def test_a_distance_lost_to_rounding_is_refused_by_the_value(value: float) -> None:
    for name in ("position", "velocity"):
        scenario = replace(SCENARIO, reference=Reference(**{name: value}))
        for law, number in (("virtual-damper", -0.7), ("virtual-drag", 0.01)):
            with refused(f"reference {name}"):
                pt.find_contact(scenario, SENSORS["inverse-power"], number, law=law)


def test_a_fast_oscillation_is_unresolved() -> None:
    """At K = 1e30 N/m the robot oscillates 1e14 times before contact."""
    scenario = encounter("admittance", "stiffness", 1e30)
    result = pt.find_contact(scenario, SENSORS["exponential-1"], -0.7)
    assert result.status is ContactStatus.UNRESOLVED


@pytest.mark.parametrize("number", [1e30, 1e200])
def test_a_drag_that_stops_an_object_at_once(number: float) -> None:
    """The intervals of the distance would be too many, so the contact is unresolved, and nothing is concluded."""
    result = pt.find_contact(SCENARIO, SENSORS["inverse-power"], number, law="virtual-drag")
    assert result.status is ContactStatus.UNRESOLVED


def test_a_huge_push_leaves_no_trace_of_the_initial_speed() -> None:
    """With a weak drag, l' at contact is sqrt(2 a l) rho; both are known to rounding for a start at rest."""
    pushed = encounter("obstacle", "acceleration", -1e200)
    result = pt.find_contact(pushed, SENSORS["inverse-power"], 0.0, law="virtual-drag")
    assert result.contact.relative_velocity == pytest.approx(-math.sqrt(2e200 * 0.0422), rel=1e-12)
    assert result.contact.time == pytest.approx(math.sqrt(2 * 0.0422 / 1e200), rel=1e-12)


@pytest.mark.parametrize(
    "extreme", [extreme for extreme in EXTREMES if extreme[1] in {"velocity", "stiffness", "mass"}]
)
def test_designs_end_with_a_status(extreme: tuple[str, str, float]) -> None:
    try:
        scenario = encounter(*extreme)
    except pt.errors.InvalidInputError:
        return
    objective = excursion_objective(position_scale=0.5, velocity_scale=0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            design = pt.design(pt.Task(scenario, SENSORS["inverse-power"], objective, bounds=(-10.0, -0.01)))
        except pt.errors.InvalidInputError:
            return
    assert design.status.value in {"optimal", "no-contact", "at-bound", "infeasible"}
