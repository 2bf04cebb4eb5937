"""The virtual admittance of L(1), discretized exactly for a force that is constant over each period."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pretouch._core.declared import ONE_ROBOT, check_declared, quantity

from .structures import AdmittanceNumbers

__all__ = ["VirtualAdmittance", "discretize"]

_SERIES_RADIUS = 1.5
_TERMS = 26  # 1.5^26 / 28! is far below rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualAdmittance:
    """Virtual mass, damping and stiffness M_a, D_a, K_a of L(1).

    Args:
        mass: M_a > 0 [kg].
        damping: D_a >= 0 [N s/m].
        stiffness: K_a >= 0 [N/m].

    Examples:
        >>> VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
        VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
    """

    mass: float = quantity("kg", sign="positive")
    damping: float = quantity("N*s/m", sign="nonnegative")
    stiffness: float = quantity("N/m", sign="nonnegative")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)


def discretize(admittance: VirtualAdmittance, period: float) -> AdmittanceNumbers:
    """Integrate L(1) over one period under a constant force, exactly.

    With the roots z_1, z_2 of the free motion, times the period, all six numbers follow from the divided differences
    G_0 = exp[z_1, z_2] and G_1 = exp[0, z_1, z_2]: entire functions, so that nothing special happens at critical
    damping, without stiffness or without damping.

    Args:
        admittance: M_a, D_a, K_a.
        period: T > 0 [s].

    Returns:
        Transition matrix and input vector.

    Examples:
        >>> free = VirtualAdmittance(mass=2.0, damping=0.0, stiffness=0.0)
        >>> round(discretize(free, 0.1).position_from_force, 6)  # T^2 / (2 M)
        0.0025
    """
    m, t = admittance.mass, period
    p, q = -admittance.damping / m * t, admittance.stiffness / m * t * t
    g0, g1 = _differences(p, q)
    return AdmittanceNumbers(
        position_from_position=1.0 - q * g1,
        position_from_velocity=t * g0,
        velocity_from_position=-q / t * g0,
        velocity_from_velocity=1.0 + p * g0 - q * g1,
        position_from_force=t * t / m * g1,
        velocity_from_force=t / m * g0,
    )


def _differences(p: float, q: float) -> tuple[float, float]:
    """Return exp[z1, z2] and exp[0, z1, z2] for z1 + z2 = p <= 0 and z1 z2 = q >= 0."""
    d = p * p / 4 - q
    magnitude = -p / 2 + math.sqrt(d) if d > 0 else math.sqrt(q)
    if magnitude < _SERIES_RADIUS:
        g0 = g1 = before = 0.0
        symmetric = weight = 1.0
        for k in range(_TERMS):
            weight /= k + 1
            g0 += symmetric * weight
            g1 += symmetric * weight / (k + 2)
            symmetric, before = p * symmetric - q * before, symmetric
        return g0, g1
    if d > 0:
        far = -magnitude
        near = q / far
        g0 = -math.exp(near) * math.expm1(far - near) / (near - far)
        return g0, (g0 - (math.expm1(near) / near if near < 0 else 1.0)) / far
    angle = math.sqrt(-d)
    sinc = math.sin(angle) / angle if angle > 0 else 1.0
    decay = math.exp(p / 2)
    return decay * sinc, (1.0 - decay * (math.cos(angle) - p / 2 * sinc)) / q
