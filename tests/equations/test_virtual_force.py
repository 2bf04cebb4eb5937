"""The virtual force L(2), computed only from the output by xi'/xi, and the resulting motion of L(1)."""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from printed_letter import LETTER_CURVES, exact, plant_motion, right_side, uniformly_accelerated, xi
from scipy.integrate import solve_ivp

from pretouch.motion import Admittance, Motion, Obstacle, Plant, Reference, Scenario, solve_motion
from pretouch.sensors import MittagLeffler, SensorModel

GAIN = -0.7
EPS = np.finfo(float).eps
OUTPUTS: dict[str, Callable[[complex], complex]] = {
    "inverse-power": lambda ell: 1.30e-5 / (ell + 0.0419) ** 3.32,
    "exponential-1": lambda ell: 0.458 * np.exp(-61.0 * ell),
    "exponential-2": lambda ell: 0.480 * np.exp(474.0 * ell**2 - 74.0 * ell),
}


@pytest.fixture(scope="module")
def accelerated() -> Scenario:
    return Scenario(
        admittance=Admittance(mass=1.3, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-0.3, acceleration=-1.5),
        plant=Plant(position=0.002, velocity=0.05),
        reference=Reference(position=0.01, velocity=-0.05, acceleration=0.4),
    )


@pytest.mark.equation("L(2)", by="numerical differentiation of the printed xi(l(t)) over time in 25 digits")
@pytest.mark.parametrize("curve", LETTER_CURVES)
def test_the_force_is_the_gain_times_the_rate_of_the_output_over_the_output(accelerated: Scenario, curve: str) -> None:
    sensor = LETTER_CURVES[curve]
    motion = solve_motion(accelerated, sensor, GAIN, samples=8)
    plant = plant_motion(accelerated, right_side(sensor, GAIN))

    def output(t: mpmath.mpf) -> mpmath.mpf:
        return xi(sensor, uniformly_accelerated(accelerated.obstacle, t)[0] - plant(t)[0])

    for t, force in zip(motion.time[1:-1], motion.virtual_force[1:-1], strict=True):
        with mpmath.workdps(25):
            # a central difference over 1e-7 s in 25 digits: (1e-7 x 100 / s)^2 / 6 of truncation, 1e-18 of rounding
            rate = mpmath.diff(output, exact(t), h=mpmath.mpf("1e-7")) / output(exact(t))
            error = float(exact(force) - exact(GAIN) * rate)
        assert abs(error) <= 1e-10 * abs(force)


@pytest.mark.equation("L(2)", by="differences of the sampled output over the sampled time")
@pytest.mark.parametrize("curve", [*LETTER_CURVES, "mittag-leffler"])
@pytest.mark.parametrize("method", ["auto", "integration"])
def test_the_force_of_a_motion_is_seen_in_the_output_along_it(accelerated: Scenario, curve: str, method: str) -> None:
    """As on a robot, the force comes from samples of xi, without the slope of the curve."""
    sensor: SensorModel = LETTER_CURVES.get(curve) or MittagLeffler(scale=1.0, rate=-80.0, order=0.8)
    motion = solve_motion(accelerated, sensor, GAIN, method=method, samples=401)
    output = sensor.output(np.clip(motion.distance, 0.0, None))
    step = motion.time[1]
    weights = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / step
    rate = np.correlate(output, weights, mode="valid") / output[4:-4]
    # eighth order: (step x fastest rate)^8 / 630 of that rate, where motion and output change with 100 / s at most;
    # rounding: nine terms of an output with a few roundings in its exponent, over a step
    rounding = 9 * 10 * EPS / step
    tolerance = abs(GAIN) * (100.0 * (100 * step) ** 8 / 630 + rounding)
    assert np.abs(motion.virtual_force[4:-4] - GAIN * rate).max() <= tolerance
    assert tolerance < 1e-6 * np.abs(motion.virtual_force).max()


@pytest.mark.equation("L(1)", by="the two sides put together from a motion and the complex-step derivative of xi")
@pytest.mark.parametrize("curve", OUTPUTS)
@pytest.mark.parametrize("method", ["auto", "integration"])
def test_the_admittance_turns_the_force_into_the_motion(accelerated: Scenario, curve: str, method: str) -> None:
    motion = solve_motion(accelerated, LETTER_CURVES[curve], GAIN, method=method, samples=400)
    t = motion.time
    inertia = 1.3 * (motion.acceleration - 0.4)
    damping = 10.0 * (motion.velocity - (-0.05 + 0.4 * t))
    spring = 25.0 * (motion.position - (0.01 - 0.05 * t + 0.2 * t**2))
    force = GAIN * _log_slope(OUTPUTS[curve], motion.distance) * motion.relative_velocity
    # x'' loses a factor of order / step = 20 / 5 ms to x' on the way from the series of l, whose end is at 1e-16 of l'
    largest = np.max([np.abs(part).max() for part in (inertia, damping, spring, force)])
    assert np.abs(inertia + damping + spring - force).max() <= 1e-12 * largest
    _check_derivatives(motion)


def _check_derivatives(motion: Motion) -> None:
    """x' and x'' are the derivatives of x, by the trapezoidal rule with end correction between samples.

    Its next term is h^5 / 720 times the fourth derivative of x', which is at most 100^4 / s^4 of the largest x' here.
    """
    h, v, a = motion.time[1], motion.velocity, motion.acceleration
    predicted = h * (v[1:] + v[:-1]) / 2 - h**2 * (a[1:] - a[:-1]) / 12
    tolerance = h**5 / 720 * 100.0**4 * np.abs(v).max() + 4 * EPS * np.abs(motion.position).max()
    assert np.abs(np.diff(motion.position) - predicted).max() <= tolerance
    assert tolerance < 1e-10


def _log_slope(output: Callable, distance: np.ndarray) -> np.ndarray:
    """(d xi / dl) / xi by the complex step, which has no cancellation and is accurate to rounding."""
    return np.asarray(np.imag(output(distance + 1e-30j)) / 1e-30 / np.real(output(distance)))


@pytest.mark.equation("L(1)", "L(2)", by="SciPy's DOP853 on xi alone, differentiated by the complex step")
@pytest.mark.parametrize("curve", OUTPUTS)
@pytest.mark.parametrize("gain", [-0.1, -0.7, -2.0])
def test_the_motion_follows_from_the_output_alone(accelerated: Scenario, curve: str, gain: float) -> None:
    def slope(t: float, y: np.ndarray) -> list[float]:
        x, v = y
        distance = 0.0422 - 0.3 * t - 0.75 * t**2 - x
        rate = _log_slope(OUTPUTS[curve], distance) * (-0.3 - 1.5 * t - v)
        reference, its_speed = 0.01 - 0.05 * t + 0.2 * t**2, -0.05 + 0.4 * t
        return [v, 0.4 + (gain * rate - 10.0 * (v - its_speed) - 25.0 * (x - reference)) / 1.3]

    found = solve_motion(accelerated, LETTER_CURVES[curve], gain, samples=2).result.contact
    runs = [
        solve_ivp(slope, (0.0, found.time), (0.002, 0.05), method="DOP853", rtol=r, atol=r / 100).y[:, -1]
        for r in (1e-9, 1e-12)
    ]
    # what a thousand times looser tolerance changes is at least a hundred times the error of the tighter one
    tolerance = np.maximum(np.abs(runs[0] - runs[1]) / 100, 1e-13)
    assert (np.abs([found.position, found.velocity] - runs[1]) <= tolerance).all()
    assert (tolerance < 1e-10).all()
