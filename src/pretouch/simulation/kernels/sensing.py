"""The sensor chain: from the distance at an instant to the number that the controller is handed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .noise import mix, normal, uniform

__all__ = ["DRAWS", "draw_misfit", "exposed_to", "instant_of", "log_output", "raw_reading", "start_of"]

DRAWS = 8  # numbers that a reading may draw
_PHASE = 7  # the draw of the first reading that is for the phase of the run
_MISFIT = np.uint64(1 << 63)  # the draw of a run that its misfit comes from, beyond those of all readings
_WAVES = 8  # cosines that a misfit is made of
_INNER = 0.1127016653792583  # first node of Gauss's rule with three on [0, 1]


def log_output(table: Any, low: float, step: float, distance: float) -> float:
    """Return ln xi from its values and slopes at equal distances; beyond the ends that of the end."""
    place = (distance - low) / step
    if place <= 0.0:
        return float(table[0, 0])
    if place >= table.shape[0] - 1:
        return float(table[table.shape[0] - 1, 0])
    i = min(int(place), table.shape[0] - 2)
    s = place - i
    rise = table[i + 1, 0] - table[i, 0]
    first, last = table[i, 1], table[i + 1, 1]
    return float(table[i, 0] + s * (first + s * (3.0 * rise - 2.0 * first - last + s * (first + last - 2.0 * rise))))


def draw_misfit(chain: Any, key: Any) -> Any:
    """Draw the error that the curve has in a run, as cosines of distance: amplitude, wave number [1/m], phase of each.

    Wave numbers of the normal distribution and phases of the uniform one make a random function with the covariance
    misfit^2 exp(-d^2 / (2 misfit_length^2)) (A. Rahimi, B. Recht, NIPS 2007).
    """
    misfit, length = chain[18], chain[19]
    waves = np.zeros((_WAVES if misfit > 0.0 else 0, 3))
    own = mix(key, _MISFIT)
    for j in range(waves.shape[0]):
        waves[j, 0] = misfit * math.sqrt(2.0 / _WAVES)
        waves[j, 1] = normal(own, 3 * j) / length
        waves[j, 2] = 2.0 * math.pi * uniform(own, 3 * j + 2)
    return waves


def misfit_at(waves: Any, distance: float) -> float:
    """Return by how much the ln xi of a run exceeds that of the curve."""
    total = 0.0
    for j in range(waves.shape[0]):
        total += waves[j, 0] * math.cos(waves[j, 1] * distance + waves[j, 2])
    return total


def start_of(chain: Any, key: Any, k: int) -> float:
    """Return when the k-th exposure starts [s]."""
    rate, jitter = chain[0], chain[4]
    phase = uniform(key, _PHASE) / rate if chain[17] else chain[1]
    shift = jitter * normal(key, DRAWS * k + 2) if jitter > 0.0 else 0.0
    return max(phase + k / rate + shift, 0.0)


def instant_of(chain: Any, start: float, node: int) -> float:
    """Return the instant [s] at which an exposure that began at `start` is looked at for the node-th time."""
    part = _INNER if node == 0 else 0.5 if node == 1 else 1.0 - _INNER
    return start + chain[2] * part


def exposed_to(ranging: Any, distance: float, table: Any, low: float, step: float, high: float, waves: Any) -> float:
    """Return what an exposure averages: the output xi, or the distance of a part that reports one."""
    if ranging:
        return distance
    if distance > high:
        return 0.0
    return math.exp(log_output(table, low, step, distance) + misfit_at(waves, max(distance, low)))


def raw_reading(
    chain: Any, key: Any, k: int, mean: float, time: float, table: Any, low: float, step: float, waves: Any
) -> float:
    """Return the k-th reading from its mean over the exposure; NaN where it drops out."""
    noise, relative, offset, drift = chain[5], chain[6], chain[7], chain[8]
    lowest, highest, resolution, dropout = chain[9], chain[10], chain[11], chain[12]
    ranging, distance_noise, distance_step, high = chain[13], chain[14], chain[15], chain[16]
    if dropout > 0.0 and uniform(key, DRAWS * k + 4) < dropout:
        return math.nan
    if ranging:
        distance = mean + distance_noise * normal(key, DRAWS * k + 5)
        if distance_step > 0.0:
            distance = distance_step * np.floor(distance / distance_step + 0.5)
        mean = exposed_to(False, distance, table, low, step, high, waves)
    value = mean + offset + drift * time
    if noise > 0.0 or relative > 0.0:
        value += math.sqrt(noise * noise + relative * relative * mean * mean) * normal(key, DRAWS * k)
    value = min(max(value, lowest), highest)
    if resolution > 0.0:
        value = resolution * np.floor(value / resolution + 0.5)
    return float(value)
