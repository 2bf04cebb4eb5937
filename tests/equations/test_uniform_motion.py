"""The uniform motion of the second-order exponential curve, L(14)-(19)."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy
from mpmath import mpf
from printed_letter import differences, distance_motion, exact

from pretouch.motion import Admittance, ContactStatus, Obstacle, Plant, Reference, Scenario, find_contact, solve_motion
from pretouch.motion.guaranteed import uniform_motion
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower
from refusals import refused

EPS = np.finfo(float).eps
CARRIED = Scenario(
    admittance=Admittance(mass=1.3, damping=8.0, stiffness=60.0),
    obstacle=Obstacle(position=0.05, velocity=-0.35),
    plant=Plant(position=0.01),
    reference=Reference(position=0.015, velocity=-0.1),
)
CASES = [(-0.05, 474.0, -74.0), (-1.0, 474.0, -74.0), (-8.0, 474.0, -74.0), (-0.7, 60.0, -61.0)]
"""D_p, b_2 and c_2."""


def printed_constants(scenario: Scenario, gain: float, b2: float, c2: float) -> tuple[mpf, mpf]:
    """A and B of L(17) and L(18) as printed, with the sign for which 0 <= |A| <= |v_o|."""
    _, d, k, _, _, p, v, *_ = (exact(number) for number in scenario.relative())
    dp, b2, c2 = exact(gain), exact(b2), exact(c2)
    roots = [(-k + sign * mpmath.sqrt(8 * b2 * dp * v * k + k**2)) / (4 * b2 * dp) for sign in (1, -1)]
    a = next(root for root in roots if 0 <= abs(root) <= abs(v) and root * v > 0)
    return a, (d * v + k * p - c2 * dp * a - d * a) / (2 * b2 * dp * a + k)


def rounding_of_b(scenario: Scenario, gain: float, b2: float, c2: float, a: float) -> float:
    """The error of B [m] due to ten roundings of the terms of L(18)."""
    _, d, k, _, _, p, v, *_ = scenario.relative()
    terms = abs(d * v) + abs(k * p) + abs(c2 * gain * a) + abs(d * a)
    return 10 * EPS * terms / (2 * b2 * gain * a + k)


def test_the_uniform_motion_solves_its_differential_equation() -> None:
    """The uniform motion L(16)-(18) satisfies L(15), symbolically; L(19) at l = 0 is the position at contact."""
    t, m, d, k, gain, b2, c2, v, p = sympy.symbols("t M D K D_p b_2 c_2 v p")
    a = (-k + sympy.sqrt(8 * b2 * gain * v * k + k**2)) / (4 * b2 * gain)
    b = (d * v + k * p - c2 * gain * a - d * a) / (2 * b2 * gain * a + k)
    l = a * t + b  # noqa: E741
    residual = m * l.diff(t, 2) + d * l.diff(t) + k * l + 2 * b2 * gain * l.diff(t) * l + c2 * gain * l.diff(t)
    assert sympy.simplify(residual - (k * v * t + d * v + k * p)) == 0
    contact_position = v * (-b / a) + p
    l19 = (c2 * gain * v * a - d * v**2 + d * v * a) / ((2 * b2 * gain * a + k) * a)
    numbers = {m: 1, d: 10, k: 25, gain: -1, b2: 474, c2: -74, v: sympy.Rational(-3, 10), p: sympy.Rational(211, 5000)}
    assert abs(sympy.N((contact_position - l19).subs(numbers), 50)) < 1e-45


@pytest.mark.equation("L(17)", "L(18)", by="the printed formulas in 50 digits")
@pytest.mark.parametrize(("gain", "b2", "c2"), CASES)
def test_its_constants_are_the_printed_ones(letter_encounter: Scenario, gain: float, b2: float, c2: float) -> None:
    for scenario in (letter_encounter, CARRIED):
        (a,), (b,) = uniform_motion(scenario.relative()[None], b2, c2, np.array([gain]))
        with mpmath.workdps(50):
            printed_a, printed_b = printed_constants(scenario, gain, b2, c2)
            errors = float(exact(a) - printed_a), float(exact(b) - printed_b)
        # A is a quotient of three roundings, and those of the root count half
        assert abs(errors[0]) <= 5 * EPS * abs(a)
        assert abs(errors[1]) <= rounding_of_b(scenario, gain, b2, c2, a)


@pytest.mark.equation("L(15)", "L(16)", "L(18)", by="the coefficients of 1 and t in exact rational arithmetic")
@pytest.mark.parametrize(("gain", "b2", "c2"), CASES)
def test_its_constants_make_an_identity_of_the_equation(gain: float, b2: float, c2: float) -> None:
    (a,), (b,) = uniform_motion(CARRIED.relative()[None], b2, c2, np.array([gain]))
    _, d, k, _, _, p, v, *_ = (Fraction(float(number)) for number in CARRIED.relative())
    A, B, dp, b_2, c_2 = (Fraction(float(number)) for number in (a, b, gain, b2, c2))
    at_t = k * A + 2 * b_2 * dp * A * A - k * v
    at_1 = d * A + k * B + 2 * b_2 * dp * A * B + c_2 * dp * A - d * v - k * p
    # both are off by what the roundings of A and B, bounded in the test above, make of them
    slope = float(k + 4 * b_2 * dp * A)
    assert abs(float(at_t)) <= 5 * EPS * abs(a) * slope
    stiffness = float(k + 2 * b_2 * dp * A)
    assert abs(float(at_1)) <= rounding_of_b(CARRIED, gain, b2, c2, a) * stiffness + 5 * EPS * abs(a) * abs(
        float(d + 2 * b_2 * dp * B + c_2 * dp)
    )


@pytest.mark.equation("L(15)", "L(16)", by="the printed equation integrated by mpmath's Taylor method in 25 digits")
@pytest.mark.parametrize(("gain", "b2", "c2"), CASES)
def test_who_starts_on_it_stays_on_it(letter_encounter: Scenario, gain: float, b2: float, c2: float) -> None:
    """Integrate L(15) from l = B and l' = A, and compare both of our solvers from the same start."""
    (a,), (b,) = uniform_motion(letter_encounter.relative()[None], b2, c2, np.array([gain]))
    obstacle = letter_encounter.obstacle
    scenario = replace(letter_encounter, plant=Plant(position=obstacle.position - b, velocity=obstacle.velocity - a))
    sensor = ExponentialSecondOrder(scale=0.480, rate=c2, curvature=b2)
    _, d, k, _, _, p, v, *_ = (exact(number) for number in scenario.relative())
    bb, cc, dp = exact(b2), exact(c2), exact(gain)
    printed = distance_motion(
        scenario,
        lambda t, ell, dl: k * v * t + d * v + k * p - d * dl - k * ell - 2 * bb * dp * dl * ell - cc * dp * dl,
    )
    for method in ("uniform-motion", "integration"):
        motion = solve_motion(scenario, sensor, gain, method=method, samples=6)
        # the start is rounded as A and B are, and the motion is drawn to the exact one; the integrator adds some
        # fifty steps of four roundings of l'
        tolerance = rounding_of_b(scenario, gain, b2, c2, a) + 5 * EPS * abs(a) + 4 * EPS * abs(b)
        tolerance += 200 * EPS * abs(a) * motion.time[-1]
        distance, relative_velocity = zip(*(printed(t) for t in motion.time), strict=True)
        assert np.abs(differences(motion.distance, list(distance))).max() <= tolerance
        # a displacement of the start shows in l' times the fastest rate of the motion
        fastest = abs(gain * (c2 + 2 * b2 * b)) + 10.0
        assert np.abs(differences(motion.relative_velocity, list(relative_velocity))).max() <= (
            200 * EPS * abs(a) + tolerance * fastest
        )


@pytest.mark.equation("L(19)", by="the printed formula in 50 digits")
@pytest.mark.parametrize(("gain", "b2", "c2"), CASES)
def test_the_plant_is_where_the_printed_relation_puts_it(
    letter_encounter: Scenario, gain: float, b2: float, c2: float
) -> None:
    """x~ as a function of l, during the motion and at its contact."""
    sensor = ExponentialSecondOrder(scale=0.480, rate=c2, curvature=b2)
    for scenario in (letter_encounter, CARRIED):
        motion = solve_motion(scenario, sensor, gain, method="uniform-motion", samples=7)
        contact = motion.result.contact
        _, d, k, _, _, _, v, *_ = (exact(number) for number in scenario.relative())
        for ell, x in [*zip(motion.distance, motion.displacement, strict=True), (0.0, contact.displacement)]:
            with mpmath.workdps(50):
                a, _ = printed_constants(scenario, gain, b2, c2)
                bb, cc, dp = exact(b2), exact(c2), exact(gain)
                constant = (cc * dp * v * a - d * v**2 + d * v * a) / ((2 * bb * dp * a + k) * a)
                error = float(exact(x) - (v - a) / a * exact(ell) - constant)
            # x~ = x_o - l at t = (l - B) / A: B, A and t carry their roundings into it at the speed v_o
            a, t = float(a), float(contact.time)
            late = (rounding_of_b(scenario, gain, b2, c2, a) + 5 * EPS * abs(a) * t) / abs(a)
            assert abs(error) <= abs(float(v)) * late + 8 * EPS * abs(float(v)) * t


@pytest.mark.equation(
    "L(16)", "L(17)", "L(18)", by="the limit of the printed formulas, at a gain of -1e-40 in 100 digits"
)
def test_without_a_gain_the_obstacle_comes_at_its_own_speed(letter_encounter: Scenario) -> None:
    """D_p -> 0, where L(17) as printed is 0 / 0."""
    with mpmath.workdps(100):
        limit = [float(c) for c in printed_constants(letter_encounter, -1e-40, 474.0, -74.0)]
    for gain in (0.0, -1e-300, -1e-30):
        (a,), (b,) = uniform_motion(letter_encounter.relative()[None], 474.0, -74.0, np.array([gain]))
        assert a == pytest.approx(limit[0], rel=5 * EPS)
        assert b == pytest.approx(limit[1], abs=rounding_of_b(letter_encounter, gain, 474.0, -74.0, a))


@pytest.mark.equation("L(17)", by="the roots of the quadratic by NumPy's companion matrix")
def test_its_root_is_the_one_the_letter_chooses(letter_encounter: Scenario) -> None:
    """Both roots of L(17) by NumPy; only ours has 0 <= |A| <= |v_o| and approaches."""
    gains = -np.geomspace(0.01, 10, 50)
    values = np.broadcast_to(letter_encounter.relative(), (50, 10))
    a, _ = uniform_motion(values, 474.0, -74.0, gains)
    for gain, chosen in zip(gains, a, strict=True):
        roots = np.roots([2 * 474.0 * gain, 25.0, -25.0 * -0.3])
        allowed = [r.real for r in roots if abs(r) <= 0.3 and r.real < 0]
        assert allowed == [pytest.approx(chosen, rel=1e-12)]


@pytest.mark.equation("L(17)", "L(18)", by="the particular solution of L(8), by hand")
def test_it_goes_over_into_the_first_order_motion(letter_encounter: Scenario) -> None:
    """b_2 -> 0: A -> v_o without a loss of digits, where L(17) as printed is 0 / 0."""
    values = letter_encounter.relative()[None]
    for curvature in (1e-3, 1e-9, 1e-15, 0.0):
        a, b = uniform_motion(values, curvature, -61.0, np.array([-0.8]))
        assert a[0] == pytest.approx(-0.3, abs=6e-3 * curvature + 1e-16)
        # the particular solution of L(8): K l = K (v t + p) - c D_p v, with c D_p = 61 x 0.8
        assert b[0] == pytest.approx(0.0422 + 61 * 0.8 * 0.3 / 25, abs=1.0 * curvature + 1e-14)


def test_the_position_of_section_4d(letter_encounter: Scenario, letter_second_order: ExponentialSecondOrder) -> None:
    """L(19) gives -0.1378 m where the letter prints -0.136 m."""
    contact = find_contact(letter_encounter, letter_second_order, -1.0, method="uniform-motion").contact
    assert round(contact.position, 4) == -0.1378
    assert round(1 - contact.relative_velocity / -0.3, 3) == 0.744


def test_where_there_is_no_such_motion_the_status_says_so(letter_encounter: Scenario) -> None:
    """b_2 < 0: both roots exceed |v_o| or are complex."""
    bent = ExponentialSecondOrder(scale=1.0, rate=-74.0, curvature=-300.0)
    found = find_contact(letter_encounter, bent, [-1.0, -0.01], method="uniform-motion")
    assert (found.status == ContactStatus.NO_UNIFORM_MOTION).all()


def test_it_is_refused_where_it_does_not_hold(letter_encounter: Scenario, letter_power: InversePower) -> None:
    with refused("method"):
        find_contact(letter_encounter, letter_power, -1.0, method="uniform-motion")
    falling = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.04, velocity=-0.3, acceleration=-9.81),
    )
    with refused("method"):
        find_contact(falling, ExponentialFirstOrder(scale=1.0, rate=-61.0), -1.0, method="uniform-motion")


def test_the_general_motion_is_drawn_to_it(
    letter_encounter: Scenario, letter_second_order: ExponentialSecondOrder
) -> None:
    """Integration of L(14) does not start on the uniform motion, so its result differs from it by 3 to 6 %."""
    motion = find_contact(letter_encounter, letter_second_order, -1.0).contact
    uniform = find_contact(letter_encounter, letter_second_order, -1.0, method="uniform-motion").contact
    assert 0.03 < abs(motion.relative_velocity / uniform.relative_velocity - 1) < 0.07
