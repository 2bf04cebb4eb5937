"""Is my sensor fast enough? How far the loop is from oscillating, and which rate the gain asks for."""

from __future__ import annotations

import math
from typing import Final

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch.control import Controller
from pretouch.motion import Admittance
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, GainLimit, LoopTiming, gain_limit, lowest_rate, timing_of

from .parts import StabilityCheck
from .timing import chain_at, controller_at, told_period

__all__ = [
    "acts_as_damper",
    "check_stability",
    "limit_of",
    "no_stability_in_words",
    "stability_in_words",
    "stability_margin",
]

_PROBE: Final = 1e-3  # change of ln xi: small beside any limit of the force, large beside rounding
_WAIT: Final = 0.5  # s before and after the change, for ramps and filters to settle
_READINGS: Final = 40
_ALIKE: Final = 1e-3  # of the impulse: what is left of a low-pass after the wait is less


def acts_as_damper(loop: ClosedLoop) -> bool:
    """Try out whether the impulse of a law is its gain times the change of ln xi, on which the stability limit rests.

    A reading that stands still, rises once by a thousandth and stands still again tells the whole impulse.

    Args:
        loop: the loop, whose law is stepped.

    Returns:
        Whether it is, for a controller with a conditioning; False for another law.
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
    """Find the strongest gain that is stable on a loop.

    Args:
        loop: the loop, whose law has been found to act as a damper.
        sensor: the sensor curve.
        distance: those that the encounter passes [m].

    Returns:
        The limits; None where the law is no controller.
    """
    law = loop.law
    if not isinstance(law, Controller):
        return None
    timing = timing_of(loop.chain, law)
    return gain_limit(sensor, _own(law), timing, distance=distance, plant=loop.plant)


def stability_margin(limit: GainLimit | None, gain: float) -> float | None:
    """Return how many times a gain can grow until the loop is unstable; None where no limit is known or none applies.

    Args:
        limit: the limit.
        gain: D_p [N s].

    Returns:
        The margin; infinite where no gain is too strong.
    """
    if limit is None or gain > 0:
        return None
    return math.inf if gain == 0 or math.isinf(limit.strongest) else abs(limit.strongest / gain)


def check_stability(
    loop: ClosedLoop, sensor: SensorModel, distance: FloatArray, gain: float, limit: GainLimit | None
) -> StabilityCheck | None:
    """Tell how far a loop is from oscillating.

    Args:
        loop: the loop.
        sensor: the sensor curve.
        distance: those that the encounter passes [m].
        gain: D_p [N s].
        limit: the strongest stable gains; None where they are not known.

    Returns:
        The check; None where no limit is known, or the gain does not mitigate.
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


def stability_in_words(check: StabilityCheck) -> str:
    """Say whether the sensor is fast enough.

    Args:
        check: the margin to instability and the rates.

    Returns:
        One or two sentences.
    """
    if math.isinf(check.margin) and math.isfinite(check.strongest):
        strongest = format_quantity(check.strongest, "N*s")
        return f"Without a gain nothing can oscillate; {strongest} would be the strongest stable one."
    if math.isinf(check.margin):
        return "No gain makes this loop unstable: the sensor is fast enough."
    if check.strongest == 0:
        return (
            f"No gain is stable on this loop, however weak: its own oscillation at {check.frequency:.3g} Hz is "
            "undamped or grows, and the virtual force comes too late to damp it."
        )
    enough = (
        "not fast enough" if check.margin < 1 else "fast enough, but only just" if check.margin < 2 else "fast enough"
    )
    text = f"The sensor is {enough}: it reads {check.rate:.6g} times a second, and {_rates(check)}."
    frequency = "" if math.isnan(check.frequency) else f" at {check.frequency:.3g} Hz"
    return text + (
        f" The loop begins to oscillate{frequency} from D_p = {format_quantity(check.strongest, 'N*s')} on, "
        f"{check.margin:.3g} times the gain, first at a distance of {format_quantity(check.critical_distance, 'm')}."
    )


def _rates(check: StabilityCheck) -> str:
    if math.isinf(check.lowest_rate):
        return "no rate is high enough for this gain: delay, filters or robot forbid it"
    text = f"this gain needs {check.lowest_rate:.3g} at the limit"
    if check.margin >= 1 and check.lowest_rate > check.rate:
        text += " (below that it is stable at some rates, as at this one, and unstable at others)"
    if math.isinf(check.lowest_rate_with_margin):
        return text + "; no rate is high enough for a margin of 2"
    return text + f", {check.lowest_rate_with_margin:.3g} for a margin of 2"


def no_stability_in_words(gain: float, damper: bool) -> str:
    """Say why nothing is said of stability.

    Args:
        gain: D_p [N s].
        damper: whether the law acts as a damper.

    Returns:
        A sentence.
    """
    if not damper:
        return (
            "How far the loop is from oscillating is not known: the limit is that of an impulse of D_p times the "
            "change of ln xi, which this law does not make."
        )
    return f"Nothing is said of stability: D_p = {format_quantity(gain, 'N*s')} does not mitigate."
