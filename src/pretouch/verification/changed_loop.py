"""Change settings of a sampled loop: other rates, filters and hardware that may help."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final, NamedTuple

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity
from pretouch.control import Controller
from pretouch.simulation import (
    ClosedLoop,
    ImpedancePlant,
    PositionPlant,
    SensorChain,
)

_BELOW_HALF: Final = 0.45  # share of the rate: highest cutoff of a low-pass; a slower sensor needs a lower cutoff
_FASTER: Final = 2.0
_ROOM: Final = 2.0  # largest_rate, or largest_force, as a multiple of the largest value in an approach
_DEVIATIONS: Final = 6.0 * 2**0.5  # six standard deviations of the difference of two readings, in those of one reading
_SHORT_MEDIAN: Final = 3  # window of a median filter that removes single spikes, in readings
_LOW: Final = 0.2  # share of the rate: a cutoff that averages some readings
_LOWER: Final = 0.5  # share of the floor, if the object starts where the controller does not detect it
NOISES: Final = ("noise", "relative_noise", "distance_noise")
_FREE: Final = frozenset(
    {"median", "low-pass", "add-median", "add-low-pass", "controller-rate", "offset", "largest-rate", "floor"}
)


def rounded_up(value: float, digits: int = 2) -> float:
    """Round a positive number up to some significant digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{math.ceil(value / step - 1e-9) * step:.{digits + 1}g}")


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


_PARTS_OF_LAW: Final = ("conditioning", "limits")
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
    loop: ClosedLoop,
    quickest: float,
    noise: float,
    wanted: float | None = None,
    start: float = math.inf,
    *,
    most: float = math.inf,
    gain: float | None = None,
) -> list[ChangedLoop]:
    """Return several loops, each with one change.

    Every changed value is the one that its sentence prints. |d ln xi / dt| is at most `quickest` [1/s]; `noise` is that
    of ln xi. `wanted` is the sensor rate for a gain margin of 2 [Hz]; None if the margin is reached, or no rate is
    enough. `start` is the sensor output at the start of the encounter. `most` is the largest rate of the sensor
    [Hz]. `gain` is the verified gain; None if there is none.
    """
    candidates: list[ChangedLoop] = []
    rate = as_printed(_FASTER * loop.chain.rate, 6) if wanted is None else rounded_up(wanted)
    rate = max(min(rate, most), loop.chain.rate)
    faster: list[_Made] = [("sensor-rate", "", partial(loop_at, loop, rate))] if rate > loop.chain.rate else []
    changes: list[_Made] = [*faster, *_of_chain(loop), *_of_robot(loop)]
    changes += [*_of_controller(loop, quickest, noise, start), *_of_force_limit(loop, quickest, gain)]
    for name, sentence, make in changes:
        try:
            changed = make()
        except InvalidInputError:  # a change that does not fit the other parts of the loop is not proposed
            continue
        candidates.append(ChangedLoop(name, sentence or rate_in_words(loop, changed), changed))
    return candidates


def with_settings(loop: ClosedLoop, **changes: dict[str, Any]) -> ClosedLoop:
    """Return a copy of the loop with changed settings of `chain`, `plant`, `conditioning` or `limits`."""
    parts: dict[str, Any] = {"chain": loop.chain, "plant": loop.plant}
    parts_changed = {name: replace(part, **changes[name]) for name, part in parts.items() if name in changes}
    law: Any = loop.law
    if own := {name: replace(getattr(law, name), **changes[name]) for name in _PARTS_OF_LAW if name in changes}:
        parts_changed["law"] = replace(law, **own)
    return replace(loop, **parts_changed)


def rate_in_words(loop: ClosedLoop, after: ClosedLoop) -> str:
    """Return a sentence that recommends the sensor rate of another loop."""
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


def _of_force_limit(loop: ClosedLoop, quickest: float, gain: float | None) -> Iterator[_Made]:
    """Yield a larger limit of the virtual force, if the gain needs more in the fastest approach."""
    law, own = loop.law, loop.continuous
    if not isinstance(law, Controller) or own is None or law.limits.force is None or not gain:
        return
    force = abs(float(own.damping(gain, quickest, -1.0)))  # by L(2) with g |l'| = quickest; NaN if it is unknown
    if force > law.limits.force:
        raised = rounded_up(_ROOM * force)
        new, present = (format_quantity(each, "N") for each in (raised, law.limits.force))
        text = f"Raise largest_force of the controller from {present} to {new}, if the robot allows it."
        yield "largest-force", text, partial(with_settings, loop, limits={"force": raised})


def _of_controller(loop: ClosedLoop, quickest: float, noise: float, start: float) -> Iterator[_Made]:
    law = loop.law
    if not isinstance(law, Controller):
        return
    c, noisy = law.conditioning, any(getattr(loop.chain, name) > 0 for name in NOISES)
    if c.median_window > 1:
        text = f"Remove the {c.median_window}-sample median filter."
        yield "median", text, partial(with_settings, loop, conditioning={"median_window": 1})
    if c.moving_average > 1:
        text = f"Remove the moving average over {c.moving_average} readings."
        yield "moving-average", text, partial(with_settings, loop, conditioning={"moving_average": 1})
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
