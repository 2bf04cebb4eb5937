"""Check the stability of a sampled loop.

The module also finds the sensor rate that a gain needs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.control import Controller
from pretouch.motion import Admittance
from pretouch.sensors import SensorModel
from pretouch.simulation import (
    ClosedLoop,
    GainLimit,
    LoopTiming,
    gain_limit,
    lowest_rate,
    timing_of,
)

from .changed_loop import loop_at

Passed: TypeAlias = tuple[FloatArray, FloatArray | None]
"""Distances that an encounter passes [m], with l' at each distance [m/s] if the damping of the law depends on l'."""


@dataclass(frozen=True, kw_only=True)
class StabilityCheck(Value):
    """Stability of the sampled loop with a given gain.

    The loop is linearized at each distance of the encounter. The lowest sensor rates are computed when they are read.

    Args:
        limit: the strongest stable gain at each distance.
        margin: gain margin, the factor by which the gain can grow until the loop is unstable; below 1 it is unstable.
        gain: the gain of the law, such as D_p [N s].
        has_unknown_phase: whether the time from a reading to the controller step that uses it differs between runs;
            limit and margin are then those of the worst case.
        loop: the sampled loop.
        sensor: the sensor curve.
        passed: the distances that the encounter passes.
    """

    limit: GainLimit
    margin: float
    gain: float
    has_unknown_phase: bool
    loop: ClosedLoop = field(repr=False)
    sensor: SensorModel = field(repr=False)
    passed: Passed = field(repr=False)

    @property
    def rate(self) -> float:
        """Readings per second of the loop [Hz]."""
        return self.loop.chain.rate

    @property
    def lowest_rate(self) -> float:
        """Sensor rate [Hz] above which the gain is stable at every rate and phase.

        The phase is that between sensor and controller. The rate is infinite if none is high enough. A controller that
        is slower than the sensor is run at the rate of the sensor. `lowest_rate` can exceed `rate` although the margin
        is above 1. In this case, some phases, or some rates between `rate` and `lowest_rate`, are unstable.
        """
        return self._lowest_rates[0]

    @property
    def lowest_rate_for_margin_2(self) -> float:
        """Sensor rate [Hz] above which the gain margin is at least 2.

        It is infinite if none is high enough.
        """
        return self._lowest_rates[1]

    @cached_property
    def _lowest_rates(self) -> tuple[float, float]:
        stable, with_margin_2 = rates_for_margins(self.loop, self.sensor, self.passed, self.gain, (1.0, 2.0))
        return float(stable), float(with_margin_2)

    @property
    def strongest(self) -> float:
        """The strongest stable gain, such as D_p [N s].

        With this gain, the loop is stable at every distance.
        """
        return self.limit.strongest

    @property
    def critical_distance(self) -> float:
        """The distance at which the loop becomes unstable first [m].

        It becomes unstable there as the gain is made stronger.
        """
        return self.limit.critical_distance

    @property
    def frequency(self) -> float:
        """Oscillation frequency at the stability limit [Hz].

        NaN if there is no oscillation.
        """
        return self.limit.damping.frequency

    @property
    def text(self) -> str:
        """Sentences on stability and on the required sensor rate."""
        if math.isinf(self.margin) and math.isfinite(self.strongest):
            n = self.limit.law.number
            strongest = n.text(self.strongest)
            return (
                f"A {n.name} of 0 cannot make the sampled loop oscillate. The strongest stable {n.name} is {strongest}."
            )
        if math.isinf(self.margin):
            return "No gain makes this loop unstable."
        if self.strongest == 0:
            return (
                f"No gain is stable on the simulated loop, however weak. The loop oscillates at {self.frequency:.3g} "
                "Hz even without a virtual force. The virtual force acts too late to damp this oscillation."
            )
        stable = "unstable" if self.margin < 1 else "stable, but close to its limit," if self.margin < 2 else "stable"
        phase = ", at the worst phase between sensor and controller" if self.has_unknown_phase else ""
        frequency = "" if math.isnan(self.frequency) else f" at {self.frequency:.3g} Hz"
        number, place = self.limit.law.number, format_quantity(self.critical_distance, "m")
        sentences = (
            f"The loop is {stable} with a gain margin of {self.margin:.3g}{phase}.",
            f"Any {number.name} stronger than {number.text(self.strongest)} makes the loop oscillate{frequency}.",
            f"Oscillation starts at a distance of {place}.",
            f"{self._rates}.",
        )
        return " ".join(sentences)

    @property
    def _rates(self) -> str:
        if math.isinf(self.lowest_rate):
            return "No sensor rate makes this gain stable: latency, filters or robot are too slow"
        text = f"This gain is stable at every sensor rate above {self.lowest_rate:.3g} Hz"
        if self.margin >= 1 and self.lowest_rate > self.rate:
            text += " (at lower rates, as here, stability depends on the exact rate and phase)"
        if math.isinf(self.lowest_rate_for_margin_2):
            return text + "; no rate results in a gain margin of 2"
        return text + f", with a gain margin of 2 from {self.lowest_rate_for_margin_2:.3g} Hz"

    def to_dict(self) -> dict[str, Any]:
        """Return the stability check as one JSON object in SI units."""
        own = (
            "margin",
            "strongest",
            "critical_distance",
            "frequency",
            "rate",
            "lowest_rate",
            "lowest_rate_for_margin_2",
        )
        return {**{name: getattr(self, name) for name in own}, "distance": self.limit.distance, "gain": self.limit.gain}


def limit_of(loop: ClosedLoop, sensor: SensorModel, passed: Passed) -> GainLimit | None:
    """Return the strongest stable gain at each distance.

    The distances are those of an encounter. None if the gain cannot be computed.
    """
    law, own = loop.law, loop.continuous
    if not isinstance(law, Controller) or own is None or np.isnan(own.damping(1.0, -1.0, -1.0)):
        return None
    encounter: dict[str, Any] = {"distance": passed[0], "relative_velocity": passed[1], "plant": loop.plant, "law": own}
    return gain_limit(sensor, _virtual_admittance(law), timing_of(loop.chain, law), **encounter)


def stability_margin(limit: GainLimit | None, gain: float) -> float | None:
    """Return the stability margin of a gain.

    The gain may grow by this factor before the loop is unstable. None if the factor is unknown, or if the gain does not
    mitigate.
    """
    if limit is None or limit.law.number.sign * gain < 0:  # a gain of the wrong sign does not mitigate
        return None
    return math.inf if gain == 0 or math.isinf(limit.strongest) else abs(limit.strongest / gain)


def check_stability(
    loop: ClosedLoop, sensor: SensorModel, passed: Passed, gain: float, limit: GainLimit | None
) -> StabilityCheck | None:
    """Check whether the sampled loop is stable with a gain.

    Returns:
        The check at all distances of the encounter; None if the stability is unknown.
    """
    law, margin = loop.law, stability_margin(limit, gain)
    if limit is None or margin is None or not isinstance(law, Controller):
        return None
    return StabilityCheck(
        limit=limit,
        margin=margin,
        gain=gain,
        has_unknown_phase=timing_of(loop.chain, law).delay_range > 0,
        loop=loop,
        sensor=sensor,
        passed=passed,
    )


def rates_for_margins(
    loop: ClosedLoop, sensor: SensorModel, passed: Passed, gain: float, margins: Sequence[float]
) -> list[float]:
    """Return the sensor rate [Hz] needed for each gain margin.

    The gain has the margin at every higher rate. The rate is infinite if no rate suffices.
    """
    law: Any = loop.law
    if not gain:
        return [0.0] * len(margins)

    def timing_at(rate: float) -> LoopTiming:
        changed: Any = loop_at(loop, rate)
        return timing_of(changed.chain, changed.law, worst_ratio=True)

    encounter: dict[str, Any] = {"distance": passed[0], "relative_velocity": passed[1], "law": loop.continuous}
    encounter |= {"timing_at": timing_at, "plant": loop.plant}
    return list(lowest_rate(sensor, _virtual_admittance(law), gain, margin=margins, **encounter))


def _virtual_admittance(law: Controller) -> Admittance:
    a = law.admittance
    return Admittance(mass=a.mass, damping=a.damping, stiffness=a.stiffness)
