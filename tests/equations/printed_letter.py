"""The letter's equations as printed, in mpmath. Only parameters are taken from the program.

Motions are integrated by mpmath's Taylor method with numerical derivatives in 25 digits, so what differs from them is
the program's own error.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
from mpmath import mpf

from pretouch.motion import Obstacle, Reference, Scenario
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower

DIGITS = 25
LETTER_CURVES = {
    "inverse-power": InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "exponential-1": ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "exponential-2": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
}
Curve = InversePower | ExponentialFirstOrder | ExponentialSecondOrder
Force = Callable[[mpf, mpf], mpf]
Motion = Callable[[float], tuple[mpf, mpf]]


def exact(value: float) -> mpf:
    """Convert a double to mpmath exactly."""
    return mpf(float(value))


def xi(sensor: Curve, ell: mpf) -> mpf:
    """The output curves: inverse power L(3), exponentials L(5) and L(6)."""
    if isinstance(sensor, InversePower):
        return exact(sensor.scale) / (ell + exact(sensor.distance_offset)) ** exact(sensor.exponent)
    if isinstance(sensor, ExponentialFirstOrder):
        return exact(sensor.scale) * mpmath.exp(exact(sensor.rate) * ell)
    return exact(sensor.scale) * mpmath.exp(exact(sensor.curvature) * ell**2 + exact(sensor.rate) * ell)


def right_side(sensor: Curve, gain: float) -> Force:
    """The right-hand sides of the equations of motion L(4), L(7) and L(14), as functions of l and l'."""
    dp = exact(gain)
    if isinstance(sensor, InversePower):
        n, l0 = exact(sensor.exponent), exact(sensor.distance_offset)
        return lambda ell, dl: -n * dp * dl / (ell + l0)
    if isinstance(sensor, ExponentialFirstOrder):
        c1 = exact(sensor.rate)
        return lambda _, dl: c1 * dp * dl
    b2, c2 = exact(sensor.curvature), exact(sensor.rate)
    return lambda ell, dl: dp * (2 * b2 * ell + c2) * dl


def uniformly_accelerated(body: Obstacle | Reference, t: mpf) -> tuple[mpf, mpf, mpf]:
    """Position, velocity and acceleration of the obstacle, L(9)."""
    p, v, a = exact(body.position), exact(body.velocity), exact(body.acceleration)
    return a * t**2 / 2 + v * t + p, a * t + v, a


def plant_motion(scenario: Scenario, force: Force, digits: int = DIGITS) -> Motion:
    """Integrate M_a (x'' - x_d'') + D_a (x' - x_d') + K_a (x - x_d) = F for x and x' in absolute coordinates."""
    m, d, k = (exact(getattr(scenario.admittance, name)) for name in ("mass", "damping", "stiffness"))

    def slope(t: mpf, y: list[mpf]) -> list[mpf]:
        xo, vo, _ = uniformly_accelerated(scenario.obstacle, t)
        xd, vd, ad = uniformly_accelerated(scenario.reference, t)
        x, v = y
        return [v, ad + (force(xo - x, vo - v) - d * (v - vd) - k * (x - xd)) / m]

    return _integrate(slope, exact(scenario.plant.position), exact(scenario.plant.velocity), digits)


def distance_motion(scenario: Scenario, acceleration: Callable[[mpf, mpf, mpf], mpf]) -> Motion:
    """Integrate l'' = acceleration(t, l, l') for l and l'."""
    start = exact(scenario.obstacle.position) - exact(scenario.plant.position)
    speed = exact(scenario.obstacle.velocity) - exact(scenario.plant.velocity)
    return _integrate(lambda t, y: [y[1], acceleration(t, y[0], y[1])], start, speed, DIGITS)


def _integrate(slope: Callable, position: mpf, velocity: mpf, digits: int) -> Motion:
    with mpmath.workdps(digits):
        solution = mpmath.odefun(slope, 0, [position, velocity])

    def at(t: float) -> tuple[mpf, mpf]:
        with mpmath.workdps(digits):
            return tuple(solution(exact(t)))  # type: ignore[return-value]

    return at


def differences(values: np.ndarray, printed: list[mpf]) -> np.ndarray:
    """Return the difference of program and letter, computed in extended precision."""
    with mpmath.workdps(DIGITS):
        return np.array([float(exact(value) - other) for value, other in zip(values, printed, strict=True)])
