"""The smallest law that the loop can run, written without pretouch.control: L(2) by differences, L(1) exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm


class Answer(NamedTuple):
    position: float
    velocity: float
    acceleration: float
    virtual_force: float
    log_level: float
    status: int


def bare_step(parameters: Any, state: Any, sample: Any) -> Any:
    """One step: the force of a new difference acts for one period of the sensor."""
    gain, period, hold, a, b, c, d, e, f = parameters
    x, v, last, force, left, seen = state
    if sample.fresh and sample.reading > 0.0:
        log = math.log(sample.reading)
        if seen > 0.0:
            force, left = gain * (log - last) / hold, hold
        last, seen = log, 1.0
    acting = force if left > 0.5 * period else 0.0
    left -= period
    x_next, v_next = a * x + b * v + e * acting, c * x + d * v + f * acting
    x_d = sample.reference_position + period * (
        sample.reference_velocity + 0.5 * period * sample.reference_acceleration
    )
    v_d = sample.reference_velocity + period * sample.reference_acceleration
    answer = Answer(x_next + x_d, v_next + v_d, (v_next - v) / period + sample.reference_acceleration, acting, last, 1)
    return (x_next, v_next, last, force, left, seen), answer


@lru_cache(maxsize=64)
def exact_step(mass: float, damping: float, stiffness: float, period: float) -> Any:
    """The motion over one period from position, velocity and a constant force."""
    block = np.zeros((3, 3))
    block[0, 1] = 1.0
    block[1] = -stiffness / mass, -damping / mass, 1 / mass
    return expm(block * period)


@dataclass(frozen=True)
class BareLaw:
    """The letter's law and nothing else; `hold` is the period of the sensor."""

    gain: float
    period: float
    mass: float = 1.0
    damping: float = 10.0
    stiffness: float = 25.0
    hold: float | None = None

    @property
    def continuous(self) -> str:
        return "virtual-damper"

    @property
    def step(self) -> Any:
        return bare_step

    def parameters(self) -> tuple[float, ...]:
        m = exact_step(self.mass, self.damping, self.stiffness, self.period)
        numbers = (self.gain, self.period, self.hold or self.period, *m[:2, :2].ravel(), m[0, 2], m[1, 2])
        return tuple(map(float, numbers))

    def start(self, *, position: float, velocity: float) -> tuple[float, ...]:
        return (position, velocity, 0.0, 0.0, 0.0, 0.0)


def grows(result: Any) -> float:
    """By how much the oscillation of a run grows from its middle third to its last: ln of the ratio."""
    trace = result.trace()
    v, n = np.abs(trace.virtual_velocity), len(trace.time)
    return math.log(max(v[2 * n // 3 :].max(), 1e-300) / max(v[n // 3 : 2 * n // 3].max(), 1e-300))


def simulated_limit(run: Any, guess: float, halvings: int = 10) -> float:
    """Bisect for the damping between decay and growth; `run` gives the growth for a damping."""
    low, high = 0.5 * guess, 2.0 * guess
    for _ in range(halvings):
        middle = math.sqrt(low * high)
        if run(middle) > 0:
            high = middle
        else:
            low = middle
    return math.sqrt(low * high)
