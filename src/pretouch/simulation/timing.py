"""When the loop samples, when its force acts and for how long: all that its stability depends on beside the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pretouch._core.declared import check_declared, quantity
from pretouch._core.errors import InvalidInputError
from pretouch.control import Controller
from pretouch.control.parts import design_low_pass

from .chain import SensorChain

__all__ = ["LoopTiming", "timing_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """The timing of a sampled loop: a reading per period, and a force that follows it after a delay.

    Args:
        rate: readings per second 1/T > 0 [Hz].
        delay: from the middle of an exposure until its force begins to act, tau >= 0 [s]: half of the exposure,
            processing, transfer, and waiting for the controller's next step. A median over N readings adds
            (N - 1) / 2 periods.
        hold: for how long the force of one difference acts [s]; one period where not given. The impulse
            D_p (ln xi_k - ln xi_k-1) is the same for any: a force that acts for a shorter time is larger.
        exposure: over which time a reading averages [s], at most one period.
        sections: second-order sections of a digital filter that runs at `rate`, as SciPy gives them, one tuple of six
            numbers each; none by default.

    Examples:
        >>> LoopTiming(rate=100.0, delay=0.005).period
        0.01
    """

    rate: float = quantity("Hz", sign="positive")
    delay: float = quantity("s", 0.0, sign="nonnegative")
    hold: float | None = quantity("s", None, sign="positive")
    exposure: float = quantity("s", 0.0, sign="nonnegative")
    sections: Any = ()

    def __post_init__(self) -> None:
        check_declared(self)
        object.__setattr__(self, "sections", _sections(self.sections))
        if self.exposure > self.period * (1 + 1e-9):
            raise InvalidInputError(
                f"exposure: found {self.exposure:g} s, longer than the period of {self.period:g} s at {self.rate:g} Hz"
            )
        if self.delay < self.exposure / 2 * (1 - 1e-9):
            raise InvalidInputError(
                f"delay: found {self.delay:g} s, less than half of the exposure of {self.exposure:g} s: it counts from "
                "the middle of the exposure"
            )

    @property
    def period(self) -> float:
        """The time between two readings T [s]."""
        return 1.0 / self.rate

    @property
    def holding(self) -> float:
        """For how long the force of one difference acts [s]."""
        return self.period if self.hold is None else self.hold


def timing_of(chain: SensorChain, controller: Controller) -> LoopTiming:
    """Tell when a loop of this chain and this controller samples and acts.

    A reading that is ready waits for the next step of the controller; the force of a difference acts for the sensor
    period that the controller was told. A median over N readings counts as a delay of (N - 1) / 2 periods, which it is
    for every signal that only rises.

    Args:
        chain: the sensor chain; its jitter, noise and dropouts are left out.
        controller: the controller; its limits and what its law does beside the gain are left out.

    Returns:
        The timing, with the Butterworth filter of the controller.

    Examples:
        >>> from pretouch.control import Conditioning, VirtualAdmittance, VirtualDamper
        >>> controller = Controller(
        ...     period=1e-3,
        ...     conditioning=Conditioning(sensor_period=0.01, floor=1e-3, median_window=3),
        ...     law=VirtualDamper(gain=-0.7),
        ...     admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ... )
        >>> timing = timing_of(SensorChain(rate=100.0, exposure=0.002, delay=0.0015), controller)
        >>> round(timing.delay, 6)  # 1 ms of exposure, 1.5 ms, 0.5 ms until the next step, one period of 10 ms
        0.013
    """
    conditioning, period = controller.conditioning, controller.period
    ready = chain.phase + chain.exposure + chain.delay
    ratio = chain.period / period
    together = ratio > 0.5 and abs(ratio - round(ratio)) < 1e-6 and not chain.random_phase
    # where the two clocks have no common beat, a reading waits for half a step on average
    waiting = math.ceil(ready / period - 1e-9) * period - ready if together else period / 2
    median = (conditioning.median_window - 1) / 2 * chain.period
    designed = design_low_pass(conditioning.low_pass_order, conditioning.cutoff, chain.rate)
    hold = period if conditioning.sensor_period is None else conditioning.sensor_period
    return LoopTiming(
        rate=chain.rate,
        delay=chain.latency + max(waiting, 0.0) + median,
        hold=hold,
        exposure=chain.exposure,
        sections=[(s.b0, s.b1, s.b2, 1.0, s.a1, s.a2) for s in designed],
    )


def _sections(given: Any) -> tuple[tuple[float, ...], ...]:
    rows = tuple(tuple(map(float, row)) for row in given)
    for row in rows:
        if len(row) != 6 or not all(map(math.isfinite, row)) or row[3] == 0:
            raise InvalidInputError(f"sections: found the row {row}, expected b0, b1, b2, a0, a1, a2 with a0 not 0")
    return tuple(tuple(v / row[3] for v in row) for row in rows)
