"""What could be changed: the loop with one thing made better, and what to do for it, in one sentence with numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity
from pretouch.control import Controller
from pretouch.simulation import ClosedLoop, ImpedancePlant, PositionPlant

from .stability import controller_at, loop_at, told_period

__all__ = ["Approach", "Candidate", "candidates_of"]

_FASTER: Final = 2.0
_ROOM: Final = 2.0  # times the fastest change of ln xi that an approach makes
_DEVIATIONS: Final = 6.0 * 2**0.5  # of the difference of two readings
_SHORT_MEDIAN: Final = 3  # readings: it takes out single spikes
_LOW: Final = 0.2  # of the rate: a cutoff that averages some readings
_NOISES: Final = ("noise", "relative_noise", "distance_noise")


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A loop that differs in one thing.

    Args:
        name: short name of the change.
        sentence: what to do, with numbers.
        loop: the changed loop.
    """

    name: str
    sentence: str
    loop: ClosedLoop


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """What changes are measured by: how fast readings change, how noisy they are, and which rate the gain asks for.

    Args:
        steepest: largest |g| that the encounter passes [1/m].
        fastest: fastest approach [m/s].
        noise: standard deviation of ln xi from reading to reading, where it is largest.
        wanted_rate: of the sensor, for a margin of 2 to instability [Hz]; None where it has that, or none is enough.
    """

    steepest: float
    fastest: float
    noise: float
    wanted_rate: float | None = None


_Made = tuple[str, str, Callable[[], ClosedLoop]]


def candidates_of(loop: ClosedLoop, approach: Approach) -> list[Candidate]:
    """Collect what could be changed of a loop.

    Args:
        loop: the loop.
        approach: what changes are measured by.

    Returns:
        The changes that mean something for it.
    """
    wanted = approach.wanted_rate
    rate = _FASTER * loop.chain.rate if wanted is None else _rounded_up(wanted)
    found = []
    for name, sentence, make in (
        ("sensor-rate", "", partial(loop_at, loop, rate)),
        *_of_chain(loop),
        *_of_robot(loop),
        *(_of_controller(loop, loop.law, approach) if isinstance(loop.law, Controller) else ()),
    ):
        try:
            changed = make()
        except InvalidInputError:  # the parts of this loop do not go together with it: nothing to be proposed
            continue
        found.append(Candidate(name=name, sentence=sentence or _rate_in_words(loop, changed), loop=changed))
    return found


def _rounded_up(rate: float) -> float:
    """Round a rate up to two digits: one that is sensible, and not below what is needed."""
    step = 10.0 ** (math.floor(math.log10(rate)) - 1)
    return float(f"{math.ceil(rate / step - 1e-9) * step:.3g}")


def _rate_in_words(loop: ClosedLoop, after: ClosedLoop) -> str:
    text = f"Read the sensor {_hertz(after.chain.rate)} instead of {loop.chain.rate:.6g}"
    if after.chain.exposure < loop.chain.exposure:
        text += f", with an exposure of {format_quantity(after.chain.exposure, 's')}"
    if after.law.period < loop.law.period:
        text += f", and step the controller {_hertz(1 / after.law.period)}"
    return f"{text}."


def _of_chain(loop: ClosedLoop) -> Iterator[_Made]:
    chain = loop.chain
    if chain.delay > 0:
        text = f"Hand over readings without the delay of {format_quantity(chain.delay, 's')} after their exposure."
        yield "delay", text, partial(_with_chain, loop, delay=0.0)
    if _is_noisy(loop):
        half = {name: getattr(chain, name) / 2 for name in _NOISES}
        parts = [f"{half['noise']:.3g} in the unit of xi instead of {chain.noise:.3g}"] if chain.noise else []
        if chain.relative_noise:
            parts.append(f"{100 * half['relative_noise']:.3g} % of xi instead of {100 * chain.relative_noise:.3g} %")
        if chain.distance_noise:
            noises = (half["distance_noise"], chain.distance_noise)
            parts.append(" instead of ".join(format_quantity(noise, "m") for noise in noises))
        text = f"Halve the noise of the sensor to a standard deviation of {' and '.join(parts)}."
        yield "noise", text, partial(_with_chain, loop, **half)
    if chain.misfit > 0:
        half_misfit = chain.misfit / 2
        text = (
            f"Calibrate anew, so that the sensor lies off its curve by {100 * half_misfit:.3g} % of xi instead of "
            f"{100 * chain.misfit:.3g} %: at more distances, set more exactly; or sink it to where its curve fits "
            "better."
        )
        yield "calibration", text, partial(_with_chain, loop, misfit=half_misfit)


def _of_robot(loop: ClosedLoop) -> Iterator[_Made]:
    plant = loop.plant
    if isinstance(plant, PositionPlant | ImpedancePlant) and plant.bandwidth < math.inf:
        new, own = (format_quantity(bandwidth, "Hz") for bandwidth in (_FASTER * plant.bandwidth, plant.bandwidth))
        text = f"Give the robot's own control a bandwidth of {new} instead of {own}."
        yield "robot-bandwidth", text, partial(_with_plant, loop, bandwidth=_FASTER * plant.bandwidth)
    if isinstance(plant, ImpedancePlant):
        stiffness, damping = 2 * plant.stiffness, 2**0.5 * plant.damping
        text = (
            f"Raise the stiffness of the robot's impedance controller to {format_quantity(stiffness, 'N/m')} from "
            f"{format_quantity(plant.stiffness, 'N/m')}, and its damping to {format_quantity(damping, 'N*s/m')}."
        )
        yield "robot-stiffness", text, partial(_with_plant, loop, stiffness=stiffness, damping=damping)


def _of_controller(loop: ClosedLoop, law: Controller, approach: Approach) -> Iterator[_Made]:
    c, noisy = law.conditioning, _is_noisy(loop)
    if c.median_window > 1:
        text = f"Leave out the median over {c.median_window} readings."
        yield "median", text, partial(_conditioned, loop, law, median_window=1)
    if c.low_pass_order and c.cutoff is not None:
        text = f"Leave out the low-pass of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}."
        yield "low-pass", text, partial(_conditioned, loop, law, low_pass_order=0, cutoff=None)
    if c.median_window == 1 and noisy:
        text = f"Take the running median over {_SHORT_MEDIAN} readings."
        yield "add-median", text, partial(_conditioned, loop, law, median_window=_SHORT_MEDIAN)
    if not c.low_pass_order and noisy:
        cutoff = _LOW / told_period(law)
        text = f"Filter readings by a low-pass of order 2 at {format_quantity(cutoff, 'Hz')}."
        yield "add-low-pass", text, partial(_conditioned, loop, law, low_pass_order=2, cutoff=cutoff)
    period = law.period / _FASTER
    text = f"Step the controller {_hertz(1 / period)} instead of {1 / law.period:.6g}."
    yield "controller-rate", text, lambda: replace(loop, law=controller_at(law, told_period(law), period))
    yield from _of_offset(loop, law)
    # a reading is refused only where approach and noise together could not have made it
    rate = _ROOM * approach.fastest * approach.steepest + _DEVIATIONS * approach.noise * loop.chain.rate
    if c.largest_rate is None and rate > 0:
        text = f"Set largest_rate to {format_quantity(rate, '1/s')}: twice what the fastest approach makes of ln xi"
        text += f"{' and what noise adds' if noisy else ''}."
        yield "largest-rate", text, partial(_conditioned, loop, law, largest_rate=rate)


def _of_offset(loop: ClosedLoop, law: Controller) -> Iterator[_Made]:
    chain, own = loop.chain, law.conditioning.offset
    pedestal = chain.offset + chain.crosstalk
    if pedestal != own or chain.drift:
        text = f"Subtract the offset exactly, {pedestal:.4g} in the unit of xi"
        text += f" instead of {own:.4g}" if pedestal != own else ""
        text += ", and follow its drift." if chain.drift else "."
        yield "offset", text, lambda: _conditioned(_with_chain(loop, drift=0.0), law, offset=pedestal)


def _with_chain(loop: ClosedLoop, **changes: Any) -> ClosedLoop:
    return replace(loop, chain=replace(loop.chain, **changes))


def _with_plant(loop: ClosedLoop, **changes: Any) -> ClosedLoop:
    plant: Any = loop.plant
    return replace(loop, plant=replace(plant, **changes))


def _conditioned(loop: ClosedLoop, law: Controller, **changes: Any) -> ClosedLoop:
    return replace(loop, law=replace(law, conditioning=replace(law.conditioning, **changes)))


def _is_noisy(loop: ClosedLoop) -> bool:
    return any(getattr(loop.chain, name) > 0 for name in _NOISES)


def _hertz(rate: float) -> str:
    return f"{rate:.6g} times a second"
