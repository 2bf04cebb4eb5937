"""Is the loop stable? How far it is from oscillating, which rate the gain asks for, and loops with one change."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.control import Controller
from pretouch.motion import Admittance
from pretouch.sensors import SensorModel
from pretouch.simulation import (
    ClosedLoop,
    GainLimit,
    ImpedancePlant,
    LoopTiming,
    PositionPlant,
    SensorChain,
    gain_limit,
    lowest_rate,
    timing_of,
)

_BELOW_HALF: Final = 0.45  # of the rate: the highest cutoff of a low-pass whose sensor becomes too slow for its own
_FASTER: Final = 2.0
_ROOM: Final = 2.0  # times the fastest change of ln xi that an approach makes
_DEVIATIONS: Final = 6.0 * 2**0.5  # of the difference of two readings
_SHORT_MEDIAN: Final = 3  # readings: it takes out single spikes
_LOW: Final = 0.2  # of the rate: a cutoff that averages some readings
NOISES: Final = ("noise", "relative_noise", "distance_noise")


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityCheck(Value):
    """How far the loop is from oscillating, linearized at each distance that the encounter passes.

    Args:
        limit: the strongest stable gain at each distance.
        margin: how many times the gain can grow until the loop is unstable; below 1 it is.
        rate: readings per second of the loop [Hz].
        lowest_rate: the rate of the sensor from which on the gain is stable at every rate and at every phase between
            sensor and controller [Hz]; infinite where none is high enough. A controller that would be slower steps as
            often as the sensor reads. It can be above `rate` with a margin above 1: then rates or phases between are
            unstable.
        lowest_rate_with_margin: the rate from which on the gain could double [Hz]; infinite where none is high enough.
        has_unknown_phase: whether the wait of a reading for the controller differs from run to run; limit and margin
            are then those of the worst wait.
    """

    limit: GainLimit
    margin: float
    rate: float
    lowest_rate: float
    lowest_rate_with_margin: float
    has_unknown_phase: bool = False

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
        """Whether the loop is stable, and which rates that asks for, in two sentences."""
        if math.isinf(self.margin) and math.isfinite(self.strongest):
            n = self.limit.law.number
            strongest = n.text(self.strongest)
            return f"Without a {n.name} nothing can oscillate; {strongest} would be the strongest stable one."
        if math.isinf(self.margin):
            return "No gain makes this loop unstable."
        if self.strongest == 0:
            return (
                f"No gain is stable on this loop, however weak: its own oscillation at {self.frequency:.3g} Hz is "
                "undamped or grows, and the virtual force comes too late to damp it."
            )
        stable = "unstable" if self.margin < 1 else "stable, but only just" if self.margin < 2 else "stable"
        frequency = "" if math.isnan(self.frequency) else f" at {self.frequency:.3g} Hz"
        return (
            f"The loop is {stable}: it begins to oscillate{frequency} from "
            f"{self.limit.law.number.equals(self.strongest)} on, {self.margin:.3g} times the gain, first at a distance "
            f"of {format_quantity(self.critical_distance, 'm')}{self._phase}. {self._rates}."
        )

    @property
    def _phase(self) -> str:
        return " and at the worst phase between sensor and controller" if self.has_unknown_phase else ""

    @property
    def _rates(self) -> str:
        if math.isinf(self.lowest_rate):
            return "No rate of the sensor is high enough for this gain to be stable: delay, filters or robot forbid it"
        text = f"For stability this gain needs {self.lowest_rate:.3g} readings a second"
        if self.margin >= 1 and self.lowest_rate > self.rate:
            text += " (below that it is stable at some rates or phases, as here, and unstable at others)"
        if math.isinf(self.lowest_rate_with_margin):
            return text + "; no rate is high enough for a margin of 2"
        return text + f", and {self.lowest_rate_with_margin:.3g} for a margin of 2"

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


Passed: TypeAlias = tuple[FloatArray, FloatArray | None]
"""Distances that an encounter passes [m]; with l' there [m/s] where the damping of the law follows it."""


def limit_of(loop: ClosedLoop, sensor: SensorModel, passed: Passed) -> GainLimit | None:
    """Return the strongest gains that are stable where an encounter passes; None where damping or timing is unknown."""
    law, own = loop.law, loop.continuous
    if not isinstance(law, Controller) or own is None or np.isnan(own.damping(1.0, -1.0, -1.0)):
        return None
    known: dict[str, Any] = {"distance": passed[0], "relative_velocity": passed[1], "plant": loop.plant, "law": own}
    return gain_limit(sensor, _own(law), timing_of(loop.chain, law), **known)


def stability_margin(limit: GainLimit | None, gain: float) -> float | None:
    """Return how many times a gain can grow until the loop is unstable; None where that is not known."""
    if limit is None or limit.law.number.sign * gain < 0:  # which does not mitigate
        return None
    return math.inf if gain == 0 or math.isinf(limit.strongest) else abs(limit.strongest / gain)


def check_stability(
    loop: ClosedLoop, sensor: SensorModel, passed: Passed, gain: float, limit: GainLimit | None
) -> StabilityCheck | None:
    """Return how far a loop is from oscillating with a gain where an encounter passes; None where it is not known."""
    law, margin = loop.law, stability_margin(limit, gain)
    if limit is None or margin is None or not isinstance(law, Controller):
        return None

    def timing_at(rate: float) -> LoopTiming:
        found: Any = loop_at(loop, rate)
        return timing_of(found.chain, found.law, worst_ratio=True)

    known: dict[str, Any] = {"distance": passed[0], "relative_velocity": passed[1], "law": limit.law}
    known |= {"timing_at": timing_at, "plant": loop.plant}
    least = [lowest_rate(sensor, _own(law), gain, margin=factor, **known) if gain else 0.0 for factor in (1.0, 2.0)]
    return StabilityCheck(
        limit=limit,
        margin=margin,
        rate=loop.chain.rate,
        lowest_rate=least[0],
        lowest_rate_with_margin=least[1],
        has_unknown_phase=timing_of(loop.chain, law).delay_range > 0,
    )


def _own(law: Controller) -> Admittance:
    a = law.admittance
    return Admittance(mass=a.mass, damping=a.damping, stiffness=a.stiffness)


def chain_at(chain: SensorChain, rate: float) -> SensorChain:
    """Return a sensor read at another rate [Hz]; exposure and jitter are cut to what the new period allows."""
    period = 1 / rate
    return replace(chain, rate=rate, exposure=min(chain.exposure, period), jitter=min(chain.jitter, period / 4))


def told_period(controller: Controller) -> float:
    """Return the time between two readings that a controller was told [s]."""
    told = controller.conditioning.sensor_period
    return controller.period if told is None else told


def controller_at(controller: Controller, sensor_period: float, period: float | None = None) -> Controller:
    """Return a controller that is told of another time between readings [s], at least its period, which may change."""
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


class Candidate(NamedTuple):
    """A loop that differs in one thing."""

    name: str  # short name of the change
    sentence: str  # what to do, with numbers
    loop: ClosedLoop  # the changed one


_Made = tuple[str, str, Callable[[], ClosedLoop]]


def candidates_of(loop: ClosedLoop, quickest: float, noise: float, wanted: float | None = None) -> list[Candidate]:
    """Collect what could be changed of a loop; ln xi changes by `quickest` [1/s] at most and deviates by `noise`."""
    # wanted: rate of the sensor for a margin of 2 to instability [Hz]; None where it has that, or none is enough
    rate, found = wanted, []
    if rate is None:
        rate = _FASTER * loop.chain.rate
    else:  # rounded up to two digits: one that is sensible, and not below what is needed
        step = 10.0 ** (math.floor(math.log10(rate)) - 1)
        rate = float(f"{math.ceil(rate / step - 1e-9) * step:.3g}")
    made: list[_Made] = [("sensor-rate", "", partial(loop_at, loop, rate)), *_of_chain(loop), *_of_robot(loop)]
    for name, sentence, make in (*made, *_of_controller(loop, quickest, noise)):
        try:
            changed = make()
        except InvalidInputError:  # the parts of this loop do not go together with it: nothing to be proposed
            continue
        found.append(Candidate(name, sentence or _rate_in_words(loop, changed), changed))
    return found


def _with(loop: ClosedLoop, **changes: dict[str, Any]) -> ClosedLoop:
    """Return a loop with other fields of its chain, its plant or the conditioning of its controller."""
    parts: dict[str, Any] = {"chain": loop.chain, "plant": loop.plant}
    found = {name: replace(part, **changes[name]) for name, part in parts.items() if name in changes}
    if "conditioning" in changes:
        law: Any = loop.law
        found["law"] = replace(law, conditioning=replace(law.conditioning, **changes["conditioning"]))
    return replace(loop, **found)


def _rate_in_words(loop: ClosedLoop, after: ClosedLoop) -> str:
    text = f"Read the sensor {after.chain.rate:.6g} times a second instead of {loop.chain.rate:.6g}"
    if after.chain.exposure < loop.chain.exposure:
        text += f", with an exposure of {format_quantity(after.chain.exposure, 's')}"
    if after.law.period < loop.law.period:
        text += f", and step the controller {1 / after.law.period:.6g} times a second"
    return f"{text}."


def _of_chain(loop: ClosedLoop) -> Iterator[_Made]:
    chain = loop.chain
    if chain.delay > 0:
        text = f"Hand over readings without the delay of {format_quantity(chain.delay, 's')} after their exposure."
        yield "delay", text, partial(_with, loop, chain={"delay": 0.0})
    if any(getattr(chain, name) > 0 for name in NOISES):
        half = {name: getattr(chain, name) / 2 for name in NOISES}
        parts = [f"{half['noise']:.3g} in the unit of xi instead of {chain.noise:.3g}"] if chain.noise else []
        if chain.relative_noise:
            parts.append(f"{100 * half['relative_noise']:.3g} % of xi instead of {100 * chain.relative_noise:.3g} %")
        if chain.distance_noise:
            noises = (half["distance_noise"], chain.distance_noise)
            parts.append(" instead of ".join(format_quantity(noise, "m") for noise in noises))
        text = f"Halve the noise of the sensor to a standard deviation of {' and '.join(parts)}."
        yield "noise", text, partial(_with, loop, chain=half)
    if chain.misfit > 0:
        text = (
            f"Calibrate anew, so that the sensor lies off its curve by {50 * chain.misfit:.3g} % of xi instead of "
            f"{100 * chain.misfit:.3g} %: at more distances, set more exactly; or sink it to where its curve fits "
            "better."
        )
        yield "calibration", text, partial(_with, loop, chain={"misfit": chain.misfit / 2})


def _of_robot(loop: ClosedLoop) -> Iterator[_Made]:
    plant = loop.plant
    if isinstance(plant, PositionPlant | ImpedancePlant) and plant.bandwidth < math.inf:
        new, own = (format_quantity(bandwidth, "Hz") for bandwidth in (_FASTER * plant.bandwidth, plant.bandwidth))
        text = f"Give the robot's own control a bandwidth of {new} instead of {own}."
        yield "robot-bandwidth", text, partial(_with, loop, plant={"bandwidth": _FASTER * plant.bandwidth})
    if isinstance(plant, ImpedancePlant):
        stiffness, damping = 2 * plant.stiffness, 2**0.5 * plant.damping
        text = (
            f"Raise the stiffness of the robot's impedance controller to {format_quantity(stiffness, 'N/m')} from "
            f"{format_quantity(plant.stiffness, 'N/m')}, and its damping to {format_quantity(damping, 'N*s/m')}."
        )
        yield "robot-stiffness", text, partial(_with, loop, plant={"stiffness": stiffness, "damping": damping})


def _of_controller(loop: ClosedLoop, quickest: float, noise: float) -> Iterator[_Made]:
    law = loop.law
    if not isinstance(law, Controller):
        return
    c, noisy = law.conditioning, any(getattr(loop.chain, name) > 0 for name in NOISES)
    if c.median_window > 1:
        text = f"Leave out the median over {c.median_window} readings."
        yield "median", text, partial(_with, loop, conditioning={"median_window": 1})
    if c.low_pass_order and c.cutoff is not None:
        text = f"Leave out the low-pass of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}."
        yield "low-pass", text, partial(_with, loop, conditioning={"low_pass_order": 0, "cutoff": None})
    if c.median_window == 1 and noisy:
        text = f"Take the running median over {_SHORT_MEDIAN} readings."
        yield "add-median", text, partial(_with, loop, conditioning={"median_window": _SHORT_MEDIAN})
    if not c.low_pass_order and noisy:
        cutoff = _LOW / told_period(law)
        text = f"Filter readings by a low-pass of order 2 at {format_quantity(cutoff, 'Hz')}."
        yield "add-low-pass", text, partial(_with, loop, conditioning={"low_pass_order": 2, "cutoff": cutoff})
    period = law.period / _FASTER
    text = f"Step the controller {1 / period:.6g} times a second instead of {1 / law.period:.6g}."
    yield "controller-rate", text, lambda: replace(loop, law=controller_at(law, told_period(law), period))
    pedestal, own = loop.chain.offset + loop.chain.crosstalk, c.offset
    if pedestal != own or loop.chain.drift:
        text = f"Subtract the offset exactly, {pedestal:.4g} in the unit of xi"
        text += f" instead of {own:.4g}" if pedestal != own else ""
        text += ", and follow its drift." if loop.chain.drift else "."
        yield "offset", text, partial(_with, loop, chain={"drift": 0.0}, conditioning={"offset": pedestal})
    # a reading is refused only where approach and noise together could not have made it
    rate = _ROOM * quickest + _DEVIATIONS * noise * loop.chain.rate
    if c.largest_rate is None and rate > 0:
        text = f"Set largest_rate to {format_quantity(rate, '1/s')}: twice what the fastest approach makes of ln xi"
        text += f"{' and what noise adds' if noisy else ''}."
        yield "largest-rate", text, partial(_with, loop, conditioning={"largest_rate": rate})
