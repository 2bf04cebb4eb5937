"""How the optimum follows its inputs, against many digits, against designing again, and for many designs at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp, mpf

from encounters import CURVES
from pretouch.designs import (
    Constraint,
    HertzImpact,
    ImpactModel,
    Objective,
    SpringImpact,
    Task,
    Term,
    design_gain,
    excursion_objective,
)
from pretouch.motion import Admittance, Obstacle, Plant, Scenario, find_contact
from pretouch.sensors import ExponentialFirstOrder
from refusals import refused

F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)
NUMBERS = (1.0, 11.0, 25.0, 0.001, -0.01, 0.0422, -0.3, -61.0)
NAMES = ("admittance.mass", "admittance.damping", "admittance.stiffness", "plant.position", "plant.velocity")
NAMES = (*NAMES, "obstacle.position", "obstacle.velocity", "sensor.rate")


def encounter(**changes: object) -> Scenario:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=11.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-0.3),
        plant=Plant(position=0.001, velocity=-0.01),
    )
    return replace(scenario, **changes)  # type: ignore[arg-type]


def objective_at(q: list, u: object, follows: bool) -> object:
    """L(20) by L(10)-(13) at the gain -e^u, in many digits; the scale of l' may be the obstacle's speed."""
    mass, damping, stiffness, x_0, u_0, p, v, slope = q
    coupling = -slope * mp.exp(u)
    sigma = (damping + coupling) / (2 * mass)
    root = mp.sqrt(sigma**2 - stiffness / mass)
    first, second = -sigma + root, -sigma - root
    rest = coupling * v / stiffness
    c_2 = (u_0 - first * (x_0 - rest)) / (second - first)
    c_1 = x_0 - rest - c_2

    def x(t: object) -> object:
        return c_1 * mp.exp(first * t) + c_2 * mp.exp(second * t) + rest

    t = mp.findroot(lambda t: p + v * t - x(t), mpf("0.45"))
    speed = v - c_1 * first * mp.exp(first * t) - c_2 * second * mp.exp(second * t)
    return (x(t) / mpf(0.5)) ** 2 + (speed / (v if follows else mpf(0.3))) ** 2


@pytest.mark.parametrize("follows", [False, True], ids=["fixed scale", "obstacle speed"])
def test_the_optimum_follows_as_in_many_digits(follows: bool) -> None:
    objective = excursion_objective(position_scale=0.5, velocity_scale="obstacle speed" if follows else 0.3)
    sensor = ExponentialFirstOrder(scale=0.458, rate=NUMBERS[7])
    design = design_gain(Task(encounter(), sensor, objective, bounds=BOUNDS))
    found = {s.name: s for s in design.sensitivities}
    with mp.workdps(50):
        q, step = [mpf(x) for x in NUMBERS], mpf(10) ** -12

        def optimum(changed: list) -> object:
            slope = lambda u: mp.diff(lambda w: objective_at(changed, w, follows), u)  # noqa: E731
            return mp.findroot(slope, mp.log(-mpf(design.gain)))

        best = optimum(q)
        assert design.gain == pytest.approx(-float(mp.exp(best)), rel=1e-9)
        for i, name in enumerate(NAMES):
            ends, values = [], []
            for sign in (1, -1):
                changed = list(q)
                changed[i] += sign * step
                ends.append(-mp.exp(optimum(changed)))
                values.append(objective_at(changed, best, follows))
            # nodes good to 1e-13, differentiated over 0.08 by nine of them: less than 1e-10 of the terms
            derivative, slope = ((e[0] - e[1]) / (2 * step) for e in (ends, values))
            assert found[name].gain_derivative == pytest.approx(float(derivative), rel=1e-9), name
            assert found[name].objective_derivative == pytest.approx(float(slope), rel=1e-9), name
            assert design.gradient(name) == pytest.approx(float(derivative), rel=1e-9), name


SPEED = Objective(terms=(Term(quantity="relative_velocity", scale=0.1), Term(quantity="time", scale=1.0)))
FORCE = Objective(terms=(Term(quantity="impact_force", scale=10.0), Term(quantity="displacement", scale=0.2)))
CASES = {
    "inside": (F1, ()),
    "speed and time": (SPEED, ()),
    "impact force": (FORCE, ()),
    "limit on speed": (F1, (Constraint(name="relative_velocity", limit=0.07),)),
    "limit on time": (F1, (Constraint(name="time", limit=0.3),)),
    "limit on impact force": (F1, (Constraint(name="impact_force", limit=7.0),)),
}
IMPACT = SpringImpact(robot_mass=0.5, stiffness=2e4)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("curve", ["inverse-power", "mittag-leffler", "exponential-1"])
def test_the_optimum_follows_as_designing_again_does(curve: str, case: str) -> None:
    """Optima are found to 1e-9 of u, and a step of 2e-3 leaves its fourth power in a five-point difference."""
    objective, limits = CASES[case]

    def gain(**changes: object) -> float:
        kept = {"bounds": BOUNDS, "constraints": limits, "impact": IMPACT}
        return design_gain(Task(encounter(**changes), CURVES[curve], objective, **kept)).gain  # type: ignore[arg-type]

    design = design_gain(Task(encounter(), CURVES[curve], objective, bounds=BOUNDS, constraints=limits, impact=IMPACT))
    assert design.certificate.at == (limits[0].name if limits else "interior")
    step = 2e-3
    gains = [gain(obstacle=Obstacle(position=0.0422, velocity=-0.3 * (1 + k * step))) for k in (-2, -1, 1, 2)]
    expected = np.dot([1, -8, 8, -1], gains) / (12 * step * -0.3)
    assert design.gradient("obstacle.velocity") == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("limits", [(), (Constraint(name="relative_velocity", limit=0.08),)], ids=["free", "limited"])
def test_many_designs_follow_as_each_of_them(limits: tuple[Constraint, ...]) -> None:
    """Some sit inside, some on the limit, some on a bound; those that cannot be met have no derivative."""
    speeds = np.array([[-0.05, -0.2, -0.3], [-0.5, -1.0, -3.0]])
    scenario = encounter(obstacle=Obstacle(position=0.0422, velocity=speeds))
    designs = design_gain(Task(scenario, CURVES["inverse-power"], F1, bounds=(-1.5, -0.05), constraints=limits))
    for name in ("obstacle.velocity", "sensor.exponent", "reference.acceleration"):
        found = designs.gradient(name)
        assert found.shape == speeds.shape
        for i in np.ndindex(speeds.shape):
            one = designs.at(*i)
            assert one.gradient(name) == pytest.approx(found[i], rel=1e-7, abs=1e-9, nan_ok=True)
            assert np.isnan(found[i]) == (one.gain is None)
    places = {designs.at(*i).certificate.at for i in np.ndindex(speeds.shape) if designs.at(*i).gain is not None}
    assert len(places) > 1


def test_peaks_and_foreign_evaluators_keep_their_differences() -> None:
    sensor = CURVES["inverse-power"]
    peak = Objective(terms=(Term(quantity="largest_acceleration", scale=5.0), Term(quantity="time", scale=0.3)))
    for objective in (peak, F1):
        design = design_gain(Task(encounter(), sensor, objective, bounds=BOUNDS, evaluate=find_contact))
        exact = design_gain(Task(encounter(), sensor, objective, bounds=BOUNDS))
        found = design.gradient("obstacle.velocity")
        assert found == pytest.approx(exact.gradient("obstacle.velocity"), rel=1e-5)  # six digits are promised


def test_an_input_that_is_none_is_refused() -> None:
    design = design_gain(Task(encounter(), CURVES["table"], F1, bounds=BOUNDS))
    with refused("by", value="gain"):
        design.gradient("gain")


def test_an_impact_model_without_a_derivative_gets_one() -> None:
    hertz = HertzImpact(robot_mass=2.0, effective_modulus=3e7, radius=0.008)
    for v in (-0.3, -1e-3, 0.2):
        # (1 + x)^(6/5) by a difference of order 8 over 0.02: some 1e-14, and rounding over the step
        assert ImpactModel.peak_force_slope(hertz, v) == pytest.approx(hertz.peak_force_slope(v), rel=1e-12)
    assert ImpactModel.peak_force_slope(IMPACT, -0.3) == pytest.approx(IMPACT.peak_force_slope(-0.3), rel=1e-12)


def test_a_closed_form_is_followed_by_all_its_inputs() -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=11.0, stiffness=25.0), obstacle=Obstacle(position=0.0422, velocity=-0.3)
    )
    design = design_gain(Task(scenario, ExponentialFirstOrder(scale=1.0, rate=-61.0), F1, bounds=BOUNDS))
    assert len(design.sensitivities) == 13
    assert design.gradient("obstacle.velocity") > 0
