"""Check the stability of a sampled loop.

The module also finds the sensor rate that a gain needs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
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

_BELOW_HALF: Final = 0.45  # share of the rate: highest cutoff of a low-pass; a slower sensor needs a lower cutoff
_FASTER: Final = 2.0
_ROOM: Final = 2.0  # largest_rate as a multiple of the fastest change of ln xi in an approach
_DEVIATIONS: Final = 6.0 * 2**0.5  # six standard deviations of the difference of two readings, in those of one reading
_SHORT_MEDIAN: Final = 3  # window of a median filter that removes single spikes, in readings
_LOW: Final = 0.2  # share of the rate: a cutoff that averages some readings
_LOWER: Final = 0.5  # share of the floor, if the object starts where the controller does not detect it
NOISES: Final = ("noise", "relative_noise", "distance_noise")
_FREE: Final = frozenset(
    {"median", "low-pass", "add-median", "add-low-pass", "controller-rate", "offset", "largest-rate", "floor"}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityCheck(Value):
    """Stability of the sampled loop with a given gain.

    The loop is linearized at each distance of the encounter.

    Args:
        limit: the strongest stable gain at each distance.
        margin: gain margin, the factor by which the gain can grow until the loop is unstable; below 1 it is unstable.
        rate: readings per second of the loop [Hz].
        lowest_rate: sensor rate [Hz] above which the gain is stable at every rate and at every phase between sensor
            and controller; infinite if none is high enough. A controller that is slower than the sensor is run at the
            rate of the sensor. `lowest_rate` can exceed `rate` although the margin is above 1. In this case, some
            phases, or some rates between `rate` and `lowest_rate`, are unstable.
        lowest_rate_for_margin_2: the sensor rate above which the gain margin is at least 2 [Hz]; infinite if none is
            high enough.
        has_unknown_phase: whether the time from a reading to the controller step that uses it differs between runs;
            limit and margin are then those of the worst case.
    """

    limit: GainLimit
    margin: float
    rate: float
    lowest_rate: float
    lowest_rate_for_margin_2: float
    has_unknown_phase: bool

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


Passed: TypeAlias = tuple[FloatArray, FloatArray | None]
"""Distances that an encounter passes [m], with l' at each distance [m/s] if the damping of the law depends on l'."""


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
    loop: ClosedLoop,
    sensor: SensorModel,
    passed: Passed,
    gain: float,
    limit: GainLimit | None,
    *,
    has_rates: bool = True,
) -> StabilityCheck | None:
    """Check whether the sampled loop is stable with a gain.

    Without `has_rates`, the lowest sensor rates are not computed; they are then NaN.

    Returns:
        The check at all distances of the encounter; None if the stability is unknown.
    """
    law, margin = loop.law, stability_margin(limit, gain)
    if limit is None or margin is None or not isinstance(law, Controller):
        return None

    rates = rates_for_margins(loop, sensor, passed, gain, (1.0, 2.0)) if has_rates else (math.nan, math.nan)
    stable, with_margin_2 = map(float, rates)
    return StabilityCheck(
        limit=limit,
        margin=margin,
        rate=loop.chain.rate,
        lowest_rate=stable,
        lowest_rate_for_margin_2=with_margin_2,
        has_unknown_phase=timing_of(loop.chain, law).delay_range > 0,
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


def rounded_up(value: float, digits: int = 2) -> float:
    """Round a positive number up to some significant digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{math.ceil(value / step - 1e-9) * step:.{digits + 1}g}")


def _virtual_admittance(law: Controller) -> Admittance:
    a = law.admittance
    return Admittance(mass=a.mass, damping=a.damping, stiffness=a.stiffness)


def chain_at(chain: SensorChain, rate: float) -> SensorChain:
    """Return the sensor chain with another sensor rate [Hz].

    Exposure and jitter are reduced to fit the new period.
    """
    period = 1 / rate
    return replace(chain, rate=rate, exposure=min(chain.exposure, period), jitter=min(chain.jitter, period / 4))


def told_period(controller: Controller) -> float:
    """Return the sensor period [s] from the controller settings.

    The default is the controller period.
    """
    sensor_period = controller.conditioning.sensor_period
    return controller.period if sensor_period is None else sensor_period


def controller_at(controller: Controller, sensor_period: float, period: float | None = None) -> Controller:
    """Return the controller with another sensor period [s].

    If `period` is given, the controller period [s] changes, too. The sensor period in its settings is at least the
    controller period.
    """
    new_period = controller.period if period is None else period
    configured, c = max(sensor_period, new_period), controller.conditioning
    conditioning = replace(
        c,
        sensor_period=configured,
        timeout=None if c.timeout is None else max(c.timeout, configured),
        cutoff=None if c.cutoff is None else min(c.cutoff, _BELOW_HALF / configured),
    )
    return replace(controller, period=new_period, conditioning=conditioning)


def loop_at(loop: ClosedLoop, rate: float) -> ClosedLoop:
    """Return the loop with another sensor rate [Hz].

    The controller is at least as fast as the sensor.
    """
    chain, law = chain_at(loop.chain, rate), loop.law
    if isinstance(law, Controller):
        sensor_period = told_period(law) * loop.chain.rate / rate
        law = controller_at(law, sensor_period, min(law.period, sensor_period))
    return replace(loop, chain=chain, law=law)


class ChangedLoop(NamedTuple):
    """A sampled loop with one changed property."""

    name: str  # short name of the change
    sentence: str  # what to do, with numbers
    loop: ClosedLoop  # the loop with the change

    @property
    def is_free(self) -> bool:
        """True if the change is a setting of the controller, which needs no other hardware."""
        return self.name in _FREE


_Made = tuple[str, str, Callable[[], ClosedLoop]]


def plausible_rate(loop: ClosedLoop, quickest: float, noise: float) -> float:
    """Return the largest plausible rate of change of the log output [1/s].

    The controller rejects readings that imply a larger rate. It rejects a reading only if neither the fastest approach
    nor noise can explain the reading.

    Args:
        loop: the loop.
        quickest: the largest |d ln xi / dt| of an approach [1/s].
        noise: standard deviation of the noise of ln xi.
    """
    return _ROOM * quickest + _DEVIATIONS * noise * loop.chain.rate


def as_printed(value: float, digits: int = 4) -> float:
    """Round a value to the digits with which it is printed, so that a recommended value is the tried one."""
    return float(f"{value:.{digits}g}")


def candidates_of(
    loop: ClosedLoop, quickest: float, noise: float, wanted: float | None = None, start: float = math.inf
) -> list[ChangedLoop]:
    """Return several loops, each with one change.

    Every changed value is the one that its sentence prints. |d ln xi / dt| is at most `quickest` [1/s]; `noise` is that
    of ln xi. `wanted` is the sensor rate for a gain margin of 2 [Hz]; None if the margin is reached, or no rate is
    enough. `start` is the sensor output at the start of the encounter.
    """
    candidates: list[ChangedLoop] = []
    rate = as_printed(_FASTER * loop.chain.rate, 6) if wanted is None else rounded_up(wanted)
    changes: list[_Made] = [("sensor-rate", "", partial(loop_at, loop, rate)), *_of_chain(loop), *_of_robot(loop)]
    for name, sentence, make in (*changes, *_of_controller(loop, quickest, noise, start)):
        try:
            changed = make()
        except InvalidInputError:  # a change that does not fit the other parts of the loop is not proposed
            continue
        candidates.append(ChangedLoop(name, sentence or _rate_in_words(loop, changed), changed))
    return candidates


def with_settings(loop: ClosedLoop, **changes: dict[str, Any]) -> ClosedLoop:
    """Return a copy of the loop with changed settings of `chain`, `plant` or `conditioning`."""
    parts: dict[str, Any] = {"chain": loop.chain, "plant": loop.plant}
    parts_changed = {name: replace(part, **changes[name]) for name, part in parts.items() if name in changes}
    if "conditioning" in changes:
        law: Any = loop.law
        parts_changed["law"] = replace(law, conditioning=replace(law.conditioning, **changes["conditioning"]))
    return replace(loop, **parts_changed)


def _rate_in_words(loop: ClosedLoop, after: ClosedLoop) -> str:
    text = f"Read the sensor at {after.chain.rate:.6g} Hz instead of {loop.chain.rate:.6g} Hz"
    if after.chain.exposure < loop.chain.exposure:
        text += f", with an exposure of {format_quantity(after.chain.exposure, 's')}"
    if after.law.period < loop.law.period:
        text += f", and run the controller at {1 / after.law.period:.6g} Hz"
    return f"{text}."


def _of_chain(loop: ClosedLoop) -> Iterator[_Made]:
    chain = loop.chain
    if chain.delay > 0:
        text = f"Remove the sensor latency of {format_quantity(chain.delay, 's')}."
        yield "delay", text, partial(with_settings, loop, chain={"delay": 0.0})
    if any(getattr(chain, name) > 0 for name in NOISES):
        half = {name: as_printed(getattr(chain, name) / 2, 3) for name in NOISES}
        parts = [f"{half['noise']:.3g} (unit of the readings) instead of {chain.noise:.3g}"] if chain.noise else []
        if chain.relative_noise:
            parts.append(f"{100 * half['relative_noise']:.3g} % of xi instead of {100 * chain.relative_noise:.3g} %")
        if chain.distance_noise:
            noises = (half["distance_noise"], chain.distance_noise)
            parts.append(" instead of ".join(format_quantity(noise, "m") for noise in noises))
        text = f"Halve the sensor noise to a standard deviation of {' and '.join(parts)}."
        yield "noise", text, partial(with_settings, loop, chain=half)
    if chain.misfit > 0:
        half_misfit = as_printed(chain.misfit / 2, 3)
        text = (
            "Calibrate again to reduce the error of the sensor curve (misfit) from "
            f"{100 * chain.misfit:.3g} % to {100 * half_misfit:.3g} % of the signal. Record more distances, set the "
            "distances more exactly, or mount the sensor farther behind the contact surface."
        )
        yield "calibration", text, partial(with_settings, loop, chain={"misfit": half_misfit})


def _of_robot(loop: ClosedLoop) -> Iterator[_Made]:
    plant = loop.plant
    if isinstance(plant, PositionPlant | ImpedancePlant) and plant.bandwidth < math.inf:
        raised = as_printed(_FASTER * plant.bandwidth)
        new, present = (format_quantity(bandwidth, "Hz") for bandwidth in (raised, plant.bandwidth))
        text = f"Raise the bandwidth of the robot's controller from {present} to {new}."
        yield "robot-bandwidth", text, partial(with_settings, loop, plant={"bandwidth": raised})
    if isinstance(plant, ImpedancePlant):
        stiffness, damping = as_printed(2 * plant.stiffness), as_printed(2**0.5 * plant.damping)
        text = (
            "Raise the stiffness of the robot's impedance controller from "
            f"{format_quantity(plant.stiffness, 'N/m')} to {format_quantity(stiffness, 'N/m')}, and its damping "
            f"to {format_quantity(damping, 'N*s/m')}."
        )
        yield "robot-stiffness", text, partial(with_settings, loop, plant={"stiffness": stiffness, "damping": damping})


def _of_controller(loop: ClosedLoop, quickest: float, noise: float, start: float) -> Iterator[_Made]:
    law = loop.law
    if not isinstance(law, Controller):
        return
    c, noisy = law.conditioning, any(getattr(loop.chain, name) > 0 for name in NOISES)
    if c.median_window > 1:
        text = f"Remove the {c.median_window}-sample median filter."
        yield "median", text, partial(with_settings, loop, conditioning={"median_window": 1})
    if c.low_pass_order and c.cutoff is not None:
        text = f"Remove the low-pass filter of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}."
        yield "low-pass", text, partial(with_settings, loop, conditioning={"low_pass_order": 0, "cutoff": None})
    if c.median_window == 1 and noisy:
        text = f"Add a {_SHORT_MEDIAN}-sample median filter."
        yield "add-median", text, partial(with_settings, loop, conditioning={"median_window": _SHORT_MEDIAN})
    if not c.low_pass_order and noisy:
        cutoff = as_printed(_LOW / told_period(law))
        text = f"Add a low-pass filter of order 2 at {format_quantity(cutoff, 'Hz')}."
        yield "add-low-pass", text, partial(with_settings, loop, conditioning={"low_pass_order": 2, "cutoff": cutoff})
    period = 1 / as_printed(_FASTER / law.period, 6)
    text = f"Run the controller at {1 / period:.6g} Hz instead of {1 / law.period:.6g} Hz."
    yield "controller-rate", text, lambda: replace(loop, law=controller_at(law, told_period(law), period))
    if start < c.floor:
        lower = as_printed(max(_LOWER * c.floor, _DEVIATIONS * loop.chain.noise), 3)
        text = f"Lower the floor of the controller (its detection threshold) from {c.floor:.4g} to {lower:.3g}."
        if lower < c.floor:
            yield "floor", text, partial(with_settings, loop, conditioning={"floor": lower})
    pedestal, configured = loop.chain.offset + loop.chain.crosstalk, c.offset
    if pedestal != configured:
        pedestal = as_printed(pedestal)
    if pedestal != configured or loop.chain.drift:
        exact = f"{pedestal:.4g}" if pedestal == configured else f"{pedestal:.4g} instead of {configured:.4g}"
        text = f"Subtract the exact offset of the sensor: {exact} (unit of the readings)"
        text += ", and track its drift." if loop.chain.drift else "."
        yield "offset", text, partial(with_settings, loop, chain={"drift": 0.0}, conditioning={"offset": pedestal})
    rate = as_printed(plausible_rate(loop, quickest, noise))
    if c.largest_rate is None and rate > 0:
        text = (
            f"Set the controller's largest_rate to {format_quantity(rate, '1/s')}. This value is twice the "
            "largest rate |d ln xi / dt| of the sensor signal xi in an approach"
        )
        text += f"{', plus noise' if noisy else ''}."
        yield "largest-rate", text, partial(with_settings, loop, conditioning={"largest_rate": rate})
