"""Section VI-A: the deviation from the uniform motion obeys an exact equation, whose energy falls."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import assume, given
from hypothesis import strategies as st

from pretouch.letter import reproduce
from pretouch.motion import Admittance, Obstacle, Plant, Scenario, solve_motion
from pretouch.sensors import ExponentialSecondOrder
from properties import examples

SENSOR = ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)
ADMITTANCE = Admittance(mass=1.0, damping=10.0, stiffness=25.0)


def test_the_equation_of_the_deviation_is_exact() -> None:
    """L(15) less itself on the uniform motion: linear in the deviation, but for the damping that follows l itself."""
    t, m, d, k, gain, b2, c2 = sympy.symbols("t M D K D_p b_2 c_2")
    a, b = sympy.symbols("A B")
    delta = sympy.Function("delta")(t)

    def left_side(l: sympy.Expr) -> sympy.Expr:  # noqa: E741
        return m * l.diff(t, 2) + d * l.diff(t) + k * l + gain * (2 * b2 * l + c2) * l.diff(t)

    l = a * t + b + delta  # noqa: E741
    slope = 2 * b2 * l + c2
    claimed = m * delta.diff(t, 2) + (d + gain * slope) * delta.diff(t) + (k + 2 * b2 * gain * a) * delta
    assert sympy.expand(left_side(l) - left_side(a * t + b) - claimed) == 0


def test_the_stiffness_of_the_deviation_tells_the_roots_apart() -> None:
    """K + 2 b_2 D_p A = K (1 + s)/2 for the root that approaches, K (1 - s)/2 for the other."""
    k, gain, b2, v, s = sympy.symbols("K D_p b_2 v s")
    for sign in (1, -1):
        a = (-k + sign * k * s) / (4 * b2 * gain)  # L(17) with its root K s
        assert sympy.simplify(k + 2 * b2 * gain * a - k * (1 + sign * s) / 2) == 0
        assert sympy.simplify(a.subs(k, 8 * b2 * gain * v / (s**2 - 1)) - 2 * v / (1 + sign * s)) == 0


@examples(40)
@given(
    speed=st.floats(0.02, 1.0),
    gain=st.floats(-5.0, -0.05),
    start=st.floats(0.01, 0.077),
    velocity=st.floats(-1.5, 0.0),
)
def test_the_energy_falls_along_every_orbit(speed: float, gain: float, start: float, velocity: float) -> None:
    obstacle = Obstacle(position=0.0422, velocity=-speed)
    uniform = solve_motion(
        Scenario(admittance=ADMITTANCE, obstacle=obstacle), SENSOR, gain, method="uniform-motion", samples=2
    )
    a, b = float(uniform.relative_velocity[0]), float(uniform.distance[0])
    plant = Plant(position=0.0422 - start, velocity=-speed - velocity)
    motion = solve_motion(Scenario(admittance=ADMITTANCE, obstacle=obstacle, plant=plant), SENSOR, gain, samples=400)
    assume(motion.distance.max() < 0.078)  # beyond, the curve turns around and the damping may change its sign
    apart, rate = motion.distance - a * motion.time - b, motion.relative_velocity - a
    energy = (rate**2 + (25.0 + 2 * 474.0 * gain * a) * apart**2) / 2
    # each sample is exact to 1e-9 of the state, and so the energy to 2e-9 of its first value
    assert np.diff(energy).max() <= 2e-9 * energy[0]


@pytest.mark.parametrize("gain", [-1.0, -3.0, -10.0, -40.0])
def test_what_is_left_of_a_deviation_follows_from_the_slopes(gain: float) -> None:
    """Slow decay, c(l) d' = -k d with c = D + D_p g and dl = A dt: (c(B)/c(0))^((s+1)/(s-1)) is left at contact."""
    speed = 0.3
    obstacle = Obstacle(position=0.0422, velocity=-speed)
    uniform = solve_motion(
        Scenario(admittance=ADMITTANCE, obstacle=obstacle), SENSOR, gain, method="uniform-motion", samples=2
    )
    a, b = float(uniform.relative_velocity[0]), float(uniform.distance[0])
    small = 1e-5 * b
    plant = Plant(position=0.0422 - b + small, velocity=-speed - a)  # closer by `small`, at the uniform velocity
    motion = solve_motion(Scenario(admittance=ADMITTANCE, obstacle=obstacle, plant=plant), SENSOR, gain, samples=2)
    assert motion.result.reached.all()
    left = (motion.distance[-1] - a * motion.time[-1] - b) / (motion.distance[0] - b)
    s = np.sqrt(1 + 8 * 474.0 * gain * -speed / 25.0)
    c_start, c_end = (10.0 + gain * SENSOR.log_slope(at) for at in (b, 0.0))
    slow = (c_start / c_end) ** ((s + 1) / (s - 1))
    # neglected: the mass, which changes the rate k/c by M k/c^2 of itself, most where c is least, at the start
    stiffness = 25.0 * (1 + s) / 2
    assert left == pytest.approx(slow, rel=stiffness / c_start**2)
    ratio = SENSOR.log_slope(b) / SENSOR.log_slope(0.0)
    assert (
        abs(left - ratio) < {-1.0: 0.04, -3.0: 0.03, -10.0: 0.02, -40.0: 0.01}[gain]
    )  # the strong limit is approached


def test_the_reproduction_says_the_same() -> None:
    found = {f.id: f for f in reproduce(["attraction"]).findings}
    assert found[9].holds
    assert found[10].holds
    numbers = reproduce(["attraction"]).reproductions[0].numbers
    assert numbers["effective_stiffness_other_root"] < 0 < numbers["effective_stiffness"]
    assert len(numbers["deviation_left_at_contact"]) == 21
