"""Motions compared with the printed differential equations L(4), L(7)-(9), L(14), L(15), integrated by mpmath."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mpmath import mpf
from printed_letter import (
    LETTER_CURVES,
    Curve,
    differences,
    distance_motion,
    exact,
    plant_motion,
    right_side,
    uniformly_accelerated,
)

from pretouch.motion import Admittance, Motion, Obstacle, Plant, Reference, Scenario, solve_motion
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder

EPS = np.finfo(float).eps
SCENARIOS = {
    "of section IV-B": Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-0.3),
    ),
    "of section V-B": Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=-0.035),
        plant=Plant(position=-0.1),
    ),
    "falling, with a reference that moves": Scenario(
        admittance=Admittance(mass=1.3, damping=4.0, stiffness=90.0),
        obstacle=Obstacle(position=0.06, velocity=-0.1, acceleration=-9.81),
        plant=Plant(position=0.002, velocity=0.05),
        reference=Reference(position=0.01, velocity=-0.05, acceleration=0.4),
    ),
}


def worth(motion: Motion, scenario: Scenario, sensor: Curve, gain: float) -> tuple[float, float]:
    """Allowed errors of l and l' of a computed motion.

    The slope that the integrator uses is met to 1e-13, which moves M l' by 1e-13 |D_p| times the rise of ln xi at
    most; some fifty steps leave four roundings of the largest speed each. Both act on l for as long as the motion
    lasts, and l itself is rounded as the difference of the positions that it is.
    """
    rise = sensor.log_output(np.clip(motion.distance, 0, None)).max() - sensor.log_output(scenario.distance)
    speed = np.abs(motion.relative_velocity).max() + np.abs(motion.velocity).max()
    velocity = 1e-13 * abs(gain) / scenario.admittance.mass * rise + 200 * EPS * speed
    return velocity * motion.time[-1] + 4 * EPS * np.abs(motion.position).max(), velocity


@pytest.mark.slow(keep=4)
@pytest.mark.equation(
    "L(4)", "L(7)", "L(9)", "L(14)", by="the printed equations in x, integrated by mpmath's Taylor method in 25 digits"
)
@pytest.mark.parametrize("gain", [-0.8, -0.05])
@pytest.mark.parametrize("curve", LETTER_CURVES)
@pytest.mark.parametrize("case", SCENARIOS)
def test_the_plant_moves_as_the_printed_equation_says(case: str, curve: str, gain: float) -> None:
    """L(4) for the inverse power, L(7) and L(14) for the exponential curves, with the obstacle of L(9)."""
    scenario, sensor = SCENARIOS[case], LETTER_CURVES[curve]
    printed = plant_motion(scenario, right_side(sensor, gain))
    for method in ("auto", "integration"):
        motion = solve_motion(scenario, sensor, gain, method=method, samples=9)
        assert motion.result.reached
        states = [printed(t) for t in motion.time]
        obstacle = [uniformly_accelerated(scenario.obstacle, exact(t)) for t in motion.time]
        tolerance, fast = worth(motion, scenario, sensor, gain)
        assert np.abs(differences(motion.position, [x for x, _ in states])).max() <= tolerance
        assert np.abs(differences(motion.velocity, [v for _, v in states])).max() <= fast
        distances = [o[0] - x for o, (x, _) in zip(obstacle, states, strict=True)]
        speeds = [o[1] - v for o, (_, v) in zip(obstacle, states, strict=True)]
        assert np.abs(differences(motion.distance, distances)).max() <= tolerance
        assert np.abs(differences(motion.relative_velocity, speeds)).max() <= fast


@pytest.mark.slow(keep=2)
@pytest.mark.equation("L(8)", by="the printed equation in l, integrated by mpmath's Taylor method in 25 digits")
@pytest.mark.parametrize("method", ["closed-form", "integration"])
@pytest.mark.parametrize("case", SCENARIOS)
def test_the_distance_of_a_constant_slope_obeys_its_printed_equation(case: str, method: str) -> None:
    scenario, sensor, gain = SCENARIOS[case], ExponentialFirstOrder(scale=1.25, rate=-63.46), -0.6
    m, d, k = (exact(getattr(scenario.admittance, name)) for name in ("mass", "damping", "stiffness"))
    c1_dp = exact(sensor.rate) * exact(gain)

    def acceleration(t: mpf, ell: mpf, dl: mpf) -> mpf:
        obstacle, reference = (uniformly_accelerated(b, t) for b in (scenario.obstacle, scenario.reference))
        xo, vo, ao = (o - r for o, r in zip(obstacle, reference, strict=True))
        return (m * ao + d * vo + k * xo - (d + c1_dp) * dl - k * ell) / m

    printed = distance_motion(scenario, acceleration)
    motion = solve_motion(scenario, sensor, gain, method=method, samples=9)
    tolerance, fast = worth(motion, scenario, sensor, gain)
    assert np.abs(differences(motion.distance, [printed(t)[0] for t in motion.time])).max() <= tolerance
    assert np.abs(differences(motion.relative_velocity, [printed(t)[1] for t in motion.time])).max() <= fast


@pytest.mark.slow(keep=1)
@pytest.mark.equation("L(15)", by="the printed equation in l, integrated by mpmath's Taylor method in 25 digits")
@pytest.mark.parametrize("curvature", [474.0, -300.0, 0.0])
@pytest.mark.parametrize("case", ["of section IV-B", "of section V-B"])
def test_the_distance_of_a_linear_slope_obeys_its_printed_equation(case: str, curvature: float) -> None:
    """During the whole motion from any start; the uniform motion is only one solution."""
    scenario, gain = SCENARIOS[case], -0.7
    sensor = ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=curvature)
    m, d, k = (exact(getattr(scenario.admittance, name)) for name in ("mass", "damping", "stiffness"))
    b2, c2, dp = exact(curvature), exact(sensor.rate), exact(gain)
    vo, xoi = exact(scenario.obstacle.velocity), exact(scenario.obstacle.position)

    def acceleration(t: mpf, ell: mpf, dl: mpf) -> mpf:
        return (k * vo * t + d * vo + k * xoi - d * dl - k * ell - 2 * b2 * dp * dl * ell - c2 * dp * dl) / m

    printed = distance_motion(scenario, acceleration)
    motion = solve_motion(scenario, sensor, gain, samples=9)
    tolerance, fast = worth(motion, scenario, sensor, gain)
    assert np.abs(differences(motion.distance, [printed(t)[0] for t in motion.time])).max() <= tolerance
    assert np.abs(differences(motion.relative_velocity, [printed(t)[1] for t in motion.time])).max() <= fast


SINGULAR: dict[str, tuple[Admittance, Curve, float]] = {
    "critical damping: D_a + c_1 D_p = 2 sqrt(M_a K_a)": (
        Admittance(mass=1.0, damping=2.0, stiffness=25.0),
        ExponentialFirstOrder(scale=1.0, rate=-64.0),
        -0.125,
    ),
    "K_a = 0": (
        Admittance(mass=1.0, damping=10.0, stiffness=0.0),
        ExponentialFirstOrder(scale=1.0, rate=-61.0),
        -0.5,
    ),
    "K_a -> 0": (
        Admittance(mass=1.0, damping=10.0, stiffness=1e-12),
        ExponentialFirstOrder(scale=1.0, rate=-61.0),
        -0.5,
    ),
    "K_a = D_a = 0": (
        Admittance(mass=1.0, damping=0.0, stiffness=0.0),
        ExponentialSecondOrder(scale=1.0, rate=-74.0, curvature=474.0),
        -0.1,
    ),
    "D_p = 0": (
        Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ExponentialSecondOrder(scale=1.0, rate=-74.0, curvature=474.0),
        0.0,
    ),
    "D_p -> 0": (
        Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ExponentialSecondOrder(scale=1.0, rate=-74.0, curvature=474.0),
        -1e-12,
    ),
    "b_2 -> 0": (
        Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ExponentialSecondOrder(scale=1.0, rate=-61.0, curvature=1e-12),
        -0.8,
    ),
}


@pytest.mark.slow(keep=5)
@pytest.mark.equation(
    "L(7)", "L(14)", by="the printed equations in x, integrated by mpmath's Taylor method in 25 digits"
)
@pytest.mark.parametrize("acceleration", [0.0, -2.0])
@pytest.mark.parametrize("name", SINGULAR)
def test_where_a_printed_solution_divides_by_zero_the_motion_still_obeys_its_equation(
    name: str, acceleration: float
) -> None:
    admittance, sensor, gain = SINGULAR[name]
    obstacle = Obstacle(position=0.0422, velocity=-0.3, acceleration=acceleration)
    scenario = Scenario(admittance=admittance, obstacle=obstacle, plant=Plant(velocity=0.02))
    printed = plant_motion(scenario, right_side(sensor, gain))
    motion = solve_motion(scenario, sensor, gain, samples=9)
    assert motion.result.reached
    tolerance, fast = worth(motion, scenario, sensor, gain)
    assert np.abs(differences(motion.position, [printed(t)[0] for t in motion.time])).max() <= tolerance
    assert np.abs(differences(motion.velocity, [printed(t)[1] for t in motion.time])).max() <= fast


@pytest.mark.equation("L(9)", by="exact rational arithmetic")
@pytest.mark.parametrize(
    ("method", "case", "curve"),
    [
        ("closed-form", "falling, with a reference that moves", "exponential-1"),
        ("integration", "falling, with a reference that moves", "inverse-power"),
        ("uniform-motion", "of section IV-B", "exponential-2"),
    ],
)
def test_plant_and_distance_add_up_to_the_obstacle(method: str, case: str, curve: str) -> None:
    """x~ + l is the obstacle relative to the reference, L(9), and x + l the obstacle in absolute coordinates."""
    scenario = SCENARIOS[case]
    motion = solve_motion(scenario, LETTER_CURVES[curve], -0.8, method=method, samples=50)
    absolute, reference = (
        [Fraction(float(getattr(body, name))) for name in ("position", "velocity", "acceleration")]
        for body in (scenario.obstacle, scenario.reference)
    )
    relative = [o - r for o, r in zip(absolute, reference, strict=True)]
    for (p, v, a), plant in ((relative, motion.displacement), (absolute, motion.position)):
        for t, x, distance in zip(motion.time, plant, motion.distance, strict=True):
            moment = Fraction(float(t))
            expected = a * moment**2 / 2 + v * moment + p
            # either side of each of two subtractions is made of three terms of at most 0.4 m here
            assert abs(float(Fraction(float(x)) + Fraction(float(distance)) - expected)) <= 8 * EPS * 0.4


@pytest.mark.slow
@pytest.mark.parametrize("curve", LETTER_CURVES)
def test_ten_more_digits_do_not_move_the_reference(curve: str) -> None:
    scenario, force = SCENARIOS["of section IV-B"], right_side(LETTER_CURVES[curve], -0.8)
    coarse, fine = plant_motion(scenario, force)(0.2), plant_motion(scenario, force, digits=35)(0.2)
    assert max(abs(float(a - b)) for a, b in zip(coarse, fine, strict=True)) < 1e-20
