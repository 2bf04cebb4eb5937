"""The motion of the first-order exponential L(5): the printed closed form L(10)-(13) compared with ours, which is
accurate to rounding also where the printed form loses digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from pretouch.motion import Admittance, Obstacle, Plant, Scenario, find_contact, solve_motion
from pretouch.motion.kernels import respond_many
from pretouch.sensors import ExponentialFirstOrder
from properties import examples


def printed_solution(scenario: Scenario, rate: float, gain: float, t: mpmath.mpf) -> mpmath.mpf:
    """The closed form L(10)-(13) as printed, in extended precision."""
    m, d, k, x0, u0, p, v, a, _, _ = (mpmath.mpf(float(x)) for x in scenario.relative())
    cd = mpmath.mpf(rate) * mpmath.mpf(gain)
    epsilon, mu = p - x0, v - u0
    x1 = epsilon - p + cd / k * (v - a / k * (d + cd))
    x2 = mu - v + cd / k * a
    root = mpmath.sqrt((d + cd) ** 2 - 4 * m * k)
    l1, l2 = (-(d + cd) + root) / (2 * m), (-(d + cd) - root) / (2 * m)
    free = (l2 * x1 - x2) / (l2 - l1) * mpmath.exp(l1 * t) + (x2 - l1 * x1) / (l2 - l1) * mpmath.exp(l2 * t)
    obstacle = a / 2 * t**2 + v * t + p
    return (free - cd / k * (a * t + v - a / k * (d + cd)) + obstacle).real


def test_the_printed_solution_solves_the_differential_equation() -> None:
    """The closed form L(10)-(13) satisfies the equation of motion L(8), symbolically, for any acceleration."""
    t, m, d, k, cd, a, v, p, epsilon, mu = sympy.symbols("t M D K cD a v p epsilon mu")
    x1 = epsilon - p + cd / k * (v - a / k * (d + cd))
    x2 = mu - v + cd / k * a
    root = sympy.sqrt((d + cd) ** 2 - 4 * m * k)
    l1, l2 = (-(d + cd) + root) / (2 * m), (-(d + cd) - root) / (2 * m)
    xo = a * t**2 / 2 + v * t + p
    free = (l2 * x1 - x2) / (l2 - l1) * sympy.exp(l1 * t) + (x2 - l1 * x1) / (l2 - l1) * sympy.exp(l2 * t)
    solution = free - cd / k * (a * t + v - a / k * (d + cd)) + xo
    residual = (
        m * solution.diff(t, 2)
        + (d + cd) * solution.diff(t)
        + k * solution
        - (m * xo.diff(t, 2) + d * xo.diff(t) + k * xo)
    )
    numbers = {m: 2, d: 3, k: 5, cd: 7, a: 11, v: -13, p: 17, epsilon: 19, mu: -23}
    assert sympy.simplify(residual.subs(numbers)) == 0
    assert sympy.simplify((solution.subs(t, 0) - epsilon).subs(numbers)) == 0
    assert sympy.simplify((solution.diff(t).subs(t, 0) - mu).subs(numbers)) == 0


@pytest.mark.equation("L(10)", "L(11)", "L(12)", "L(13)", by="the printed formulas in 60 digits")
@pytest.mark.parametrize("gain", [-0.05, -0.8, -5.0, 0.1])
@pytest.mark.parametrize("acceleration", [0.0, -9.81, 2.0])
@pytest.mark.parametrize("damping", [1.0, 10.0, 40.0])
def test_the_motion_is_the_printed_solution(gain: float, acceleration: float, damping: float) -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.3, damping=damping, stiffness=25.0),
        obstacle=Obstacle(position=0.05, velocity=-0.3, acceleration=acceleration),
        plant=Plant(position=0.01, velocity=0.05),
    )
    sensor = ExponentialFirstOrder(scale=1.0, rate=-61.0)
    motion = solve_motion(scenario, sensor, gain, horizon=1.0, samples=40)
    with mpmath.workdps(60):
        exact = [float(printed_solution(scenario, -61.0, gain, mpmath.mpf(float(t)))) for t in motion.time]
    # l is a difference of positions up to 10 m here, each exact to a few units in the last place
    scale = np.abs(motion.position).max() + 0.1
    assert np.abs(motion.distance - exact).max() < 2e-14 * scale


def exact_response(m: float, d: float, k: float, start: tuple, force: tuple, t: float) -> list:
    """An independent solution: the exponential of the extended companion matrix, in 60 digits."""
    with mpmath.workdps(60):
        matrix = mpmath.zeros(5)
        mm, dd, kk = mpmath.mpf(m), mpmath.mpf(d), mpmath.mpf(k)
        matrix[0, 1] = 1
        matrix[1, 0], matrix[1, 1], matrix[1, 2] = -kk / mm, -dd / mm, 1 / mm
        matrix[2, 3] = matrix[4, 0] = 1
        state = mpmath.matrix([*map(mpmath.mpf, (*start, *force)), 0])
        y = mpmath.expm(matrix * mpmath.mpf(t)) * state
        return [y[0], y[1], y[4]]


@pytest.mark.slow
@pytest.mark.equation("L(8)", "L(10)", "L(13)", by="the exponential of a matrix in 60 digits")
@examples(50)
@given(
    mass=st.floats(0.1, 10),
    stiffness=st.sampled_from([0.0, 1e-12, 1e-6, 1e-3, 1.0, 25.0, 400.0]),
    ratio=st.one_of(
        st.floats(0, 30),
        st.integers(-16, -3).map(lambda e: 1 + 10.0**e),
        st.integers(-16, -3).map(lambda e: 1 - 10.0**e),
        st.just(1.0),
    ),
    time=st.floats(1e-4, 10),
    values=st.tuples(*[st.floats(-1, 1)] * 4),
)
def test_the_response_is_exact_to_rounding_for_every_damping(
    mass: float, stiffness: float, ratio: float, time: float, values: tuple
) -> None:
    """At critical damping, where L(10) divides by zero, and for K -> 0, where its particular solution does."""
    damping = 2 * ratio * np.sqrt(mass * max(stiffness, 1e-2))
    start, force = values[:2], values[2:]
    got = np.empty((1, 1, 5))
    respond_many(np.array([[mass, damping, stiffness, *start, *force]]), np.array([[time]]), got)
    exact = exact_response(mass, damping, stiffness, start, force, time)
    parts = []
    for i in range(4):
        one = [0.0] * 4
        one[i] = values[i]
        parts.append([abs(float(p)) for p in exact_response(mass, damping, stiffness, one[:2], one[2:], time)])
    # rounding of the input alone turns the phase w t by its own size: that is what the result can be worth, beside the
    # size of the terms that cancel where the result passes zero
    phase = 1 + time * (np.sqrt(stiffness / mass) + damping / mass)
    for index, which in enumerate((0, 1, 4)):
        scale = sum(p[index] for p in parts) + 0.1 * sum(map(abs, values))
        assert abs(float(exact[index] - mpmath.mpf(got[0, 0, which]))) <= 8e-16 * phase * scale


@pytest.mark.equation("L(13)", by="eigenvalues of the companion matrix by NumPy")
@pytest.mark.equation("L(11)", "L(12)", by="least squares of the sampled motion on the eigenmotions")
@pytest.mark.parametrize("damping", [2.0, 40.0])
@pytest.mark.parametrize("acceleration", [0.0, -2.0])
def test_a_sampled_motion_is_made_of_the_printed_exponentials(damping: float, acceleration: float) -> None:
    """Its free response has the rates lambda_1, lambda_2, the start X_1 and the initial velocity X_2."""
    m, k, c1, gain, p, v, a = 1.3, 400.0, -61.0, -0.1, 0.05, -0.3, acceleration
    scenario = Scenario(
        admittance=Admittance(mass=m, damping=damping, stiffness=k),
        obstacle=Obstacle(position=p, velocity=v, acceleration=a),
        plant=Plant(position=0.01, velocity=0.05),
    )
    motion = solve_motion(scenario, ExponentialFirstOrder(scale=1.0, rate=c1), gain, samples=40)
    t, c1_dp = motion.time, c1 * gain
    forced = p + v * t + a / 2 * t**2 - c1_dp / k * (a * t + v - a / k * (damping + c1_dp))
    rates = np.linalg.eigvals([[0.0, 1.0], [-k / m, -(damping + c1_dp) / m]])
    modes = np.exp(np.outer(t, rates))
    amplitudes, *_ = np.linalg.lstsq(modes, (motion.distance - forced).astype(complex), rcond=None)
    # the samples are differences of terms up to 0.1 m, rounded some ten times each; least squares, and the rates in
    # L(12), pass that on with the condition of the modes
    rounding = 10 * np.finfo(float).eps * 0.1 * np.linalg.cond(modes)
    assert np.abs(modes @ amplitudes - (motion.distance - forced)).max() <= rounding
    x1 = (p - 0.01) - p + c1_dp / k * (v - a / k * (damping + c1_dp))
    x2 = (v - 0.05) - v + c1_dp / k * a
    assert abs(amplitudes.sum() - x1) <= rounding
    assert abs((rates * amplitudes).sum() - x2) <= np.abs(rates).max() * rounding


def test_without_a_sensor_force_the_free_motion_remains(letter_encounter: Scenario) -> None:
    """D_p = 0: the plant stays at rest, and the obstacle arrives after l(0) / |v|."""
    sensor = ExponentialFirstOrder(scale=1.0, rate=-61.0)
    contact = find_contact(letter_encounter, sensor, 0.0).contact
    assert contact.time == pytest.approx(0.0422 / 0.3, rel=1e-15)
    assert contact.relative_velocity == pytest.approx(-0.3, rel=1e-15)
