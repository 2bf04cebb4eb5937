"""Families of control laws that are compared with the drag. For theta = 0, each family starts near the drag.

A scaled drag multiplies the impulse of the sampled drag by exp(theta . features). The features differ by what they use:

- **rate**: only the rate s' of s = ln xi, with F = -phi s'^2 (s'/r)^(theta_1 + theta_2 ln(s'/r)). A power of s' has
  theta_2 = 0.
- **rise**: only the rise of s since the first reading.
- **memory**: s', the rise of s and the time t since the first reading. With an object of constant speed, s' t over the
  rise shows how much the robot has already slowed the approach.
- **level**: the absolute level, with F = -phi (xi/xi_d)^q s'^2 and xi_d the calibrated signal at START.

Reflectance multiplies xi, so it changes level but not rate, rise and memory.

`Ranging` estimates the distance, from its own retreat, with the Kalman filter of examples/self_ranging.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .loop import MASS, NUMBERS, PHI, SENSOR, START, Array, Memory, Seen, T

Features = Callable[[Seen], tuple[Array, ...]]

TYPICAL_RATE = 10.0  # r [1/s]
TYPICAL_RISE = 2.0
_DETECTED = np.log(SENSOR.scale * (START + SENSOR.distance_offset) ** -SENSOR.exponent)
_LARGEST = 4.0  # of the logarithm of a factor


def _log_rate(seen: Seen) -> Array:
    return np.log(np.maximum(seen.rate, 1e-3) / TYPICAL_RATE)


def constant(_: Seen) -> tuple[Array, ...]:
    """Return no features: the drag."""
    return ()


def rate(seen: Seen) -> tuple[Array, ...]:
    """Return functions of s'."""
    a = _log_rate(seen)
    return a, a**2 / 2


def rise(seen: Seen) -> tuple[Array, ...]:
    """Return functions of the rise since the first reading."""
    z = seen.total / TYPICAL_RISE
    return z, z**2, z**3


def memory(seen: Seen) -> tuple[Array, ...]:
    """Return functions of s', of the rise and of the time since the first reading."""
    a, z = _log_rate(seen), seen.total / TYPICAL_RISE
    slowing = np.log(np.maximum(seen.rate * seen.time, 1e-3) / np.maximum(seen.total, 1e-2)).clip(-2, 2)
    return z, z**2, z**3, slowing, slowing**2, slowing * z, a, a * z


def level(seen: Seen) -> tuple[Array, ...]:
    """Return the logarithm of the level."""
    return (np.log(seen.reading) - _DETECTED,)


@dataclass(frozen=True)
class ScaledDrag:
    """The sampled drag times exp(theta_0 + theta_1 feature_1 + ...), without memory of its own."""

    features: Features

    def start(self, lanes: int) -> Memory:  # noqa: ARG002
        """Return an empty memory."""
        return ()

    def step(self, theta: Array, memory: Memory, seen: Seen) -> tuple[Array, Memory]:
        """Return the impulse [N s]."""
        exponent = theta[0] + sum(a * b for a, b in zip(theta[1:], self.features(seen), strict=True))
        return PHI * np.exp(np.clip(exponent, -2 * _LARGEST, _LARGEST)) * seen.rate * seen.rise, memory


_THETA = SENSOR.scale ** (-1 / SENSOR.exponent)  # dy/dl of y = xi^(-1/n) at the calibrated reflectance
_SPREAD = 0.45  # expected standard deviation of ln reflectance


def estimate(memory: Memory, seen: Seen, sway: Array) -> Memory:
    """Update the Kalman filter of y, of the rate of y by the object, and of dy/dl, with their covariances."""
    n, relative = SENSOR.exponent, NUMBERS.variance / seen.reading**2 + NUMBERS.relative_variance
    y = seen.reading ** (-1 / n)
    variance, zero = (y / n) ** 2 * relative, 0 * y
    if seen.number == 0:
        return y, zero, zero + _THETA, variance, zero, zero, zero + _THETA**2, zero, zero + (_THETA * _SPREAD / n) ** 2
    mean, by_object, slope, v00, v01, v02, v11, v12, v22 = memory
    g, push = seen.retreat, (sway * slope * T) ** 2
    mean = mean + T * by_object + g * slope
    v00 = v00 + 2 * T * v01 + 2 * g * v02 + T**2 * v11 + 2 * T * g * v12 + g**2 * v22 + push * T**2 / 4
    v01 = v01 + T * v11 + g * v12 + push * T / 2
    v02 = v02 + T * v12 + g * v22
    v11 = v11 + push
    k0, k1, k2 = (v / (v00 + variance) for v in (v00, v01, v02))
    error = y - mean
    means = mean + k0 * error, by_object + k1 * error, slope + k2 * error
    return *means, v00 - k0 * v00, v01 - k0 * v01, v02 - k0 * v02, v11 - k1 * v01, v12 - k1 * v02, v22 - k2 * v02


@dataclass(frozen=True)
class Ranging:
    """A constant deceleration over the estimated distance, as a drag that never falls below a floor.

    The numbers are: logarithm of a factor of the force, desired contact speed over approach speed, logarithm of the
    largest drag over PHI, and logarithm of the expected acceleration of the object [m/s^2].

    Args:
        floor: smallest drag over PHI.
    """

    floor: float

    def start(self, lanes: int) -> Memory:
        """Return nine rows: three means and six covariances."""
        return tuple(np.zeros((9, lanes)))

    def step(self, theta: Array, memory: Memory, seen: Seen) -> tuple[Array, Memory]:
        """Return the impulse [N s] and the next estimate."""
        factor, share, largest, sway = theta
        memory = estimate(memory, seen, np.exp(sway))
        y, by_object, slope = memory[:3]
        slope = np.clip(slope, 0.6 * _THETA, 1.6 * _THETA)
        distance = np.maximum(y / slope - SENSOR.distance_offset, 1e-3)
        approach = -by_object / slope
        closing = approach - seen.velocity
        force = np.exp(factor) * MASS * np.maximum(closing**2 - (share * approach) ** 2, 0.0) / (2 * distance)
        drag = force / np.maximum(seen.rate, 1e-3) ** 2
        limits = PHI * self.floor, PHI * np.maximum(np.exp(np.clip(largest, -_LARGEST, _LARGEST)), self.floor)
        return np.clip(drag, *limits) * seen.rate * seen.rise, memory
