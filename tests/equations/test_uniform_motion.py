"""L(14)-(19): the uniform motion of the second-order exponential curve."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from pretouch._core.errors import InvalidInputError
from pretouch.motion import Admittance, ContactStatus, Obstacle, Scenario, find_contact
from pretouch.motion.uniform_motion import uniform_motion
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower


def test_the_uniform_motion_solves_its_differential_equation() -> None:
    """L(16) with (17), (18) in L(15), symbolically; and L(19) at l = 0 is the position at contact."""
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


def test_its_root_is_the_one_the_letter_chooses(letter_encounter: Scenario) -> None:
    """Both roots of L(17) from NumPy; 0 <= |A| <= |v_o| and an approach single ours out."""
    gains = -np.geomspace(0.01, 10, 50)
    values = np.broadcast_to(letter_encounter.relative(), (50, 10))
    a, _ = uniform_motion(values, 474.0, -74.0, gains)
    for gain, chosen in zip(gains, a, strict=True):
        roots = np.roots([2 * 474.0 * gain, 25.0, -25.0 * -0.3])
        allowed = [r.real for r in roots if abs(r) <= 0.3 and r.real < 0]
        assert allowed == [pytest.approx(chosen, rel=1e-12)]


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
    with pytest.raises(InvalidInputError, match="second-order exponential"):
        find_contact(letter_encounter, letter_power, -1.0, method="uniform-motion")
    falling = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.04, velocity=-0.3, acceleration=-9.81),
    )
    with pytest.raises(InvalidInputError, match="without acceleration"):
        find_contact(falling, ExponentialFirstOrder(scale=1.0, rate=-61.0), -1.0, method="uniform-motion")


def test_the_general_motion_is_drawn_to_it(
    letter_encounter: Scenario, letter_second_order: ExponentialSecondOrder
) -> None:
    """Integration of L(14) does not start on the uniform motion, and ends 3 to 6 % from it: not the same answer."""
    motion = find_contact(letter_encounter, letter_second_order, -1.0).contact
    uniform = find_contact(letter_encounter, letter_second_order, -1.0, method="uniform-motion").contact
    assert 0.03 < abs(motion.relative_velocity / uniform.relative_velocity - 1) < 0.07
