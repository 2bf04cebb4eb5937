"""Objectives L(20)-(23) at the first contact and their optimal gains, compared with a solution by SciPy."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from pretouch.designs import DesignStatus, Task, design_gain, excursion_objective, time_objective
from pretouch.motion import Admittance, Obstacle, Plant, Scenario, find_contact
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel

EPS = np.finfo(float).eps
Force = Callable[[float, float, float], float]  # of l, l' and D_p: the right-hand side of L(4), L(7) or L(14)

TRACKING = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=Obstacle(position=-0.035),
    plant=Plant(position=-0.1),
)


def distances_over_time(scenario: Scenario, force: Force, gain: float, end: float) -> Callable:
    """Integrate the printed equation in x with x_d = 0 by DOP853; return l and l' over time."""
    a, o, p = scenario.admittance, scenario.obstacle, scenario.plant

    def slope(t: float, y: np.ndarray) -> list[float]:
        distance, relative_velocity = o.position + o.velocity * t - y[0], o.velocity - y[1]
        return [y[1], (force(distance, relative_velocity, gain) - a.damping * y[1] - a.stiffness * y[0]) / a.mass]

    exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    # the steps are as long as stability lets them be, and between their ends the method is then good to 1e-8 only
    run = solve_ivp(slope, (0.0, end), (p.position, p.velocity), **exact, max_step=0.005, dense_output=True)
    assert run.success

    def distance(t: float, order: int = 0) -> float:
        return [o.position + o.velocity * t, o.velocity][order] - run.sol(t)[order]

    return distance


def zeros_of(distance: Callable, end: float) -> list[float]:
    """Find every zero of l by its sign on a grid that resolves all oscillations, then by Brent's method."""
    grid = np.linspace(0.0, end, 4001)
    sign = np.sign([distance(t) for t in grid])
    return [brentq(distance, grid[i], grid[i + 1], xtol=1e-15) for i in np.flatnonzero(sign[1:] != sign[:-1])]


SWINGS = {
    # an obstacle that creeps on against a plant that swings with hardly any damping: how often is it missed before?
    "at the first approach": (0.038, -0.01),
    "at the second approach": (0.055, -0.02),
    "after several": (0.062, -0.012),
    "by a hair, just after the turn of a swing": (0.06542, -0.1),
}


@pytest.mark.slow(keep=3)
@pytest.mark.equation("L(21)", "L(23)", by="all zeros of l on SciPy's dense output, the first of them taken")
@pytest.mark.parametrize("curve", ["exponential-1", "exponential-2"])
@pytest.mark.parametrize("name", SWINGS)
def test_contact_is_the_first_zero_of_the_distance(name: str, curve: str) -> None:
    position, velocity = SWINGS[name]
    curvature = {"exponential-1": 0.0, "exponential-2": 200.0}[curve]
    sensor: SensorModel = (
        ExponentialSecondOrder(scale=1.0, rate=-61.0, curvature=curvature)
        if curvature
        else ExponentialFirstOrder(scale=1.0, rate=-61.0)
    )
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=0.05, stiffness=400.0),
        obstacle=Obstacle(position=position, velocity=velocity),
        plant=Plant(position=-0.05),
    )
    gain = -0.001
    distance = distances_over_time(scenario, lambda ell, dl, dp: dp * (2 * curvature * ell - 61.0) * dl, gain, end=2.0)
    zeros = zeros_of(distance, 2.0)
    found = find_contact(scenario, sensor, gain).contact
    assert len(zeros) > 2, "what comes later must not be taken for the first"
    # steps accepted at 1e-12 of positions up to 0.1 m, a hundred or two of them; the interpolant is one order below
    tolerance = 1e-10 * 0.1
    assert abs(distance(found.time)) <= tolerance
    assert abs(found.time - zeros[0]) <= tolerance / abs(found.relative_velocity)
    assert found.distance == 0.0
    assert found.relative_velocity < 0


@pytest.mark.equation("L(20)", "L(22)", by="the printed sums in exact rational arithmetic")
def test_an_objective_is_the_printed_sum(letter_encounter: Scenario, letter_power: InversePower) -> None:
    state = find_contact(letter_encounter, letter_power, -0.7).contact
    w1, w2, w3, w4 = 1.5, 0.25, 3.0, 0.125
    x_typ, v_typ, t_typ = -0.5, -0.3, 1.25
    f1 = excursion_objective(position_scale=x_typ, velocity_scale=v_typ, position_weight=w1, velocity_weight=w2)
    f2 = time_objective(time_scale=t_typ, velocity_scale=v_typ, time_weight=w3, velocity_weight=w4)
    x, dl, t = (Fraction(value) for value in (state.position, state.relative_velocity, state.time))
    printed_1 = Fraction(w1) * (x / Fraction(x_typ)) ** 2 + Fraction(w2) * (dl / Fraction(v_typ)) ** 2
    printed_2 = Fraction(w3) * (t / Fraction(t_typ)) ** 2 + Fraction(w4) * (dl / Fraction(v_typ)) ** 2
    # a quotient, a square, a product and a sum of positive terms: the quotient counts twice
    assert float(f1.value(state, 0.3)) == pytest.approx(float(printed_1), rel=5 * EPS / 2, abs=0)
    assert float(f2.value(state, 0.3)) == pytest.approx(float(printed_2), rel=5 * EPS / 2, abs=0)


def letter_f1(distance: Callable, contact: float) -> float:
    """The objective L(20) with x_typ = 0.5 m and l'_typ = 0.3 m/s, for the obstacle of section IV-B."""
    position = 0.0422 - 0.3 * contact
    return (position / 0.5) ** 2 + (distance(contact, 1) / 0.3) ** 2


def letter_f2(distance: Callable, contact: float) -> float:
    """The objective L(22) with t_typ = 1 s and l'_typ = 0.01 m/s."""
    return contact**2 + (distance(contact, 1) / 0.01) ** 2


F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
F2 = time_objective(time_scale=1.0, velocity_scale=0.01)
DESIGNS = {
    "f_1, L(4)": (
        InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        F1,
        letter_f1,
        lambda ell, dl, dp: -3.32 * dp * dl / (ell + 0.0419),
        0.6,
    ),
    "f_1, L(14)": (
        ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
        F1,
        letter_f1,
        lambda ell, dl, dp: dp * (2 * 474.0 * ell - 74.0) * dl,
        0.6,
    ),
    "f_2, L(7)": (
        ExponentialFirstOrder(scale=1.25, rate=-63.46),
        F2,
        letter_f2,
        lambda _, dl, dp: -63.46 * dp * dl,
        4.0,
    ),
}


@pytest.mark.slow
@pytest.mark.equation(
    "L(20)",
    "L(21)",
    "L(22)",
    "L(23)",
    by="SciPy's minimize_scalar on motions of DOP853 with their first zero by brentq",
)
@pytest.mark.parametrize("name", DESIGNS)
def test_the_designed_gain_minimizes_the_printed_objective_at_contact(letter_encounter: Scenario, name: str) -> None:
    sensor, objective, printed, force, end = DESIGNS[name]
    scenario = TRACKING if objective is F2 else letter_encounter

    def value(gain: float) -> float:
        distance = distances_over_time(scenario, force, gain, end)
        return printed(distance, zeros_of(distance, end)[0])

    design = design_gain(Task(scenario, sensor, objective, bounds=(-1.2, -0.2)))
    assert design.status == DesignStatus.OPTIMAL
    best = minimize_scalar(value, bounds=(-1.2, -0.2), method="bounded", options={"xatol": 1e-7})
    # the motions are worth 1e-10, and so is a value; two gains are told apart where theirs differ by more than that
    worth = 1e-9 * best.fun
    step = 0.02
    bend = (value(best.x + step) - 2 * best.fun + value(best.x - step)) / step**2
    assert abs(design.gain - best.x) <= 1e-7 + 2 * np.sqrt(2 * worth / bend)
    assert abs(design.objective - best.fun) <= 2 * worth
    assert abs(design.objective - value(design.gain)) <= worth
