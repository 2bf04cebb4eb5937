"""Is my sensor fast enough? How far the loop is from oscillating, and which rate the gain asks for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.control import Controller
from pretouch.motion import Admittance
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, GainLimit, LoopTiming, SensorChain, gain_limit, lowest_rate, timing_of

__all__ = [
    "StabilityCheck",
    "acts_as_damper",
    "chain_at",
    "check_stability",
    "controller_at",
    "limit_of",
    "loop_at",
    "no_stability_in_words",
    "stability_margin",
    "told_period",
]

_PROBE: Final = 1e-3  # change of ln xi: small beside any limit of the force, large beside rounding
_WAIT: Final = 0.5  # s before and after the change, for ramps and filters to settle
_READINGS: Final = 40
_ALIKE: Final = 1e-3  # of the impulse: what is left of a low-pass after the wait is less
_BELOW_HALF: Final = 0.45  # of the rate: the highest cutoff of a low-pass whose sensor becomes too slow for its own


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityCheck(Value):
    """How far the loop is from oscillating, linearized at each distance that the encounter passes.

    Args:
        limit: the strongest stable gain at each distance.
        margin: how many times the gain can grow until the loop is unstable; below 1 it is.
        rate: readings per second of the loop [Hz].
        lowest_rate: the rate of the sensor from which on the gain is stable at every rate [Hz]; infinite where none is
            high enough. It can be above `rate` with a margin above 1: then rates between the two are unstable.
        lowest_rate_with_margin: the rate from which on the gain could double [Hz]; infinite where none is high enough.
    """

    limit: GainLimit
    margin: float
    rate: float
    lowest_rate: float
    lowest_rate_with_margin: float

    @property
    def strongest(self) -> float:
        """The strongest gain that is stable at every distance [N s]."""
        return self.limit.strongest

    @property
    def critical_distance(self) -> float:
        """The distance that allows the least [m]."""
        return self.limit.critical_distance

    @property
    def frequency(self) -> float:
        """At which the loop oscillates at its limit [Hz]; NaN where there is none."""
        return self.limit.damping.frequency

    @property
    def text(self) -> str:
        """Whether the sensor is fast enough, in one or two sentences."""
        if math.isinf(self.margin) and math.isfinite(self.strongest):
            strongest = format_quantity(self.strongest, "N*s")
            return f"Without a gain nothing can oscillate; {strongest} would be the strongest stable one."
        if math.isinf(self.margin):
            return "No gain makes this loop unstable: the sensor is fast enough."
        if self.strongest == 0:
            return (
                f"No gain is stable on this loop, however weak: its own oscillation at {self.frequency:.3g} Hz is "
                "undamped or grows, and the virtual force comes too late to damp it."
            )
        enough = (
            "not fast enough" if self.margin < 1 else "fast enough, but only just" if self.margin < 2 else "fast enough"
        )
        text = f"The sensor is {enough}: it reads {self.rate:.6g} times a second, and {self._rates}."
        frequency = "" if math.isnan(self.frequency) else f" at {self.frequency:.3g} Hz"
        return text + (
            f" The loop begins to oscillate{frequency} from D_p = {format_quantity(self.strongest, 'N*s')} on, "
            f"{self.margin:.3g} times the gain, first at a distance of {format_quantity(self.critical_distance, 'm')}."
        )

    @property
    def _rates(self) -> str:
        if math.isinf(self.lowest_rate):
            return "no rate is high enough for this gain: delay, filters or robot forbid it"
        text = f"this gain needs {self.lowest_rate:.3g} at the limit"
        if self.margin >= 1 and self.lowest_rate > self.rate:
            text += " (below that it is stable at some rates, as at this one, and unstable at others)"
        if math.isinf(self.lowest_rate_with_margin):
            return text + "; no rate is high enough for a margin of 2"
        return text + f", {self.lowest_rate_with_margin:.3g} for a margin of 2"

    def to_dict(self) -> dict[str, Any]:
        """Return the check as one JSON object, in SI."""
        own = (
            "margin",
            "strongest",
            "critical_distance",
            "frequency",
            "rate",
            "lowest_rate",
            "lowest_rate_with_margin",
        )
        return {**{name: getattr(self, name) for name in own}, "distance": self.limit.distance, "gain": self.limit.gain}


def acts_as_damper(loop: ClosedLoop) -> bool:
    """Return whether the impulse of a law is its gain times the change of ln xi, on which the stability limit rests.

    It is tried out: a reading that stands still, rises once by a thousandth and stands still again tells the whole
    impulse. Of a law
    that is no `Controller` nothing is known.
    """
    law = loop.law.with_gain(-1e-3)
    if not isinstance(law, Controller):
        return False
    c = law.conditioning
    highest = 16 * c.floor if c.saturation is None else c.saturation - c.offset
    level = math.sqrt(c.floor * highest)
    every = max(round(told_period(law) / law.period), 1)
    steps = math.ceil(max(_WAIT / law.period, _READINGS * every) / every) * every
    run, impulse = law.begin(), 0.0
    for k in range(2 * steps):
        reading = c.offset + level * (1.0 if k < steps else math.exp(_PROBE))
        impulse += law.period * run.step(reading, fresh=k % every == 0).virtual_force
    return abs(impulse / (-1e-3 * _PROBE) - 1) < _ALIKE


def limit_of(loop: ClosedLoop, sensor: SensorModel, distance: FloatArray) -> GainLimit | None:
    """Return the strongest gains that are stable at distances [m] that an encounter passes.

    The law has been found to act as a damper; None where it is no controller.
    """
    law = loop.law
    if not isinstance(law, Controller):
        return None
    timing = timing_of(loop.chain, law)
    return gain_limit(sensor, _own(law), timing, distance=distance, plant=loop.plant)


def stability_margin(limit: GainLimit | None, gain: float) -> float | None:
    """Return how many times a gain [N s] can grow until the loop is unstable; infinite where none is too strong.

    None where no limit is known, or the gain does not mitigate.
    """
    if limit is None or gain > 0:
        return None
    return math.inf if gain == 0 or math.isinf(limit.strongest) else abs(limit.strongest / gain)


def check_stability(
    loop: ClosedLoop, sensor: SensorModel, distance: FloatArray, gain: float, limit: GainLimit | None
) -> StabilityCheck | None:
    """Return how far a loop is from oscillating with a gain [N s] at the distances [m] that the encounter passes.

    None where no limit of the gain is known, or the gain does not mitigate.
    """
    law, margin = loop.law, stability_margin(limit, gain)
    if limit is None or margin is None or not isinstance(law, Controller):
        return None
    told = told_period(law) * loop.chain.rate

    def timing_at(rate: float) -> LoopTiming:
        return timing_of(chain_at(loop.chain, rate), controller_at(law, told / rate))

    def least(factor: float) -> float:
        if gain == 0:
            return 0.0
        return lowest_rate(
            sensor, _own(law), gain, distance=distance, timing_at=timing_at, plant=loop.plant, margin=factor
        )

    return StabilityCheck(
        limit=limit,
        margin=margin,
        rate=loop.chain.rate,
        lowest_rate=least(1.0),
        lowest_rate_with_margin=least(2.0),
    )


def _own(law: Controller) -> Admittance:
    a = law.admittance
    return Admittance(mass=a.mass, damping=a.damping, stiffness=a.stiffness)


def no_stability_in_words(gain: float, damper: bool) -> str:
    """Return why nothing is said of stability with a gain [N s]: of the law or, where that is a damper, of the gain."""
    if damper:
        return f"Nothing is said of stability: D_p = {format_quantity(gain, 'N*s')} does not mitigate."
    return (
        "How far the loop is from oscillating is not known: the limit is that of an impulse of D_p times the change of "
        "ln xi, which this law does not make."
    )


def chain_at(chain: SensorChain, rate: float) -> SensorChain:
    """Return a sensor read at another rate [Hz]; its exposure stays, but where a period is too short for it.

    Exposure and jitter are cut to what the new period allows: continuous in the exposure.
    """
    period = 1 / rate
    return replace(chain, rate=rate, exposure=min(chain.exposure, period), jitter=min(chain.jitter, period / 4))


def told_period(controller: Controller) -> float:
    """Return the time between two readings that a controller was told [s]."""
    told = controller.conditioning.sensor_period
    return controller.period if told is None else told


def controller_at(controller: Controller, sensor_period: float, period: float | None = None) -> Controller:
    """Return a controller that is told of another time between two readings [s], never less than its own period [s].

    Its own period may be another, too. A cutoff that such a sensor is too slow for is lowered to 0.45 of its rate.
    """
    own = controller.period if period is None else period
    told, c = max(sensor_period, own), controller.conditioning
    conditioning = replace(
        c,
        sensor_period=told,
        timeout=None if c.timeout is None else max(c.timeout, told),
        cutoff=None if c.cutoff is None else min(c.cutoff, _BELOW_HALF / told),
    )
    return replace(controller, period=own, conditioning=conditioning)


def loop_at(loop: ClosedLoop, rate: float) -> ClosedLoop:
    """Return a loop whose sensor is read at another rate [Hz]; a controller that would be slower than that follows."""
    chain, law = chain_at(loop.chain, rate), loop.law
    if isinstance(law, Controller):
        sensor_period = told_period(law) * loop.chain.rate / rate
        law = controller_at(law, sensor_period, min(law.period, sensor_period))
    return replace(loop, chain=chain, law=law)
