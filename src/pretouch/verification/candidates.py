"""What could be changed: the loop with one thing made better, and what to do for it, in one sentence with numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity
from pretouch.control import Conditioning, Controller
from pretouch.simulation import ClosedLoop, ImpedancePlant, PositionPlant

from .timing import controller_at, loop_at, told_period

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


def candidates_of(loop: ClosedLoop, approach: Approach) -> list[Candidate]:
    """Collect what could be changed of a loop.

    Args:
        loop: the loop.
        approach: what changes are measured by.

    Returns:
        The changes that mean something for it.
    """
    makers: list[Callable[[], Candidate | None]] = [
        lambda: _of_rate(loop, approach.wanted_rate),
        *(lambda: _prompt(loop), lambda: _quiet(loop), lambda: _calibrated(loop)),
        *(lambda: _faster_robot(loop), lambda: _stiffer_robot(loop)),
    ]
    if isinstance(law := loop.law, Controller):
        makers += [
            *(lambda: _without_median(loop, law), lambda: _without_low_pass(loop, law)),
            *(lambda: _with_median(loop, law), lambda: _with_low_pass(loop, law)),
            *(lambda: _faster_law(loop, law), lambda: _exact_offset(loop, law)),
            lambda: _checked_rate(loop, law, approach),
        ]
    found = []
    for make in makers:
        try:
            found.append(make())
        except InvalidInputError:  # the parts of this loop do not go together with it: nothing to be proposed
            continue
    return [one for one in found if one is not None]


def _of_rate(loop: ClosedLoop, wanted: float | None) -> Candidate:
    rate = _FASTER * loop.chain.rate if wanted is None else _rounded_up(wanted)
    after = loop_at(loop, rate)
    text = f"Read the sensor {_hertz(rate)} instead of {loop.chain.rate:.6g}"
    if after.chain.exposure < loop.chain.exposure:
        text += f", with an exposure of {format_quantity(after.chain.exposure, 's')}"
    if after.law.period < loop.law.period:
        text += f", and step the controller {_hertz(1 / after.law.period)}"
    return Candidate(name="sensor-rate", sentence=f"{text}.", loop=after)


def _rounded_up(rate: float) -> float:
    """Round a rate up to two digits: one that is sensible, and not below what is needed."""
    step = 10.0 ** (math.floor(math.log10(rate)) - 1)
    return float(f"{math.ceil(rate / step - 1e-9) * step:.3g}")


def _prompt(loop: ClosedLoop) -> Candidate | None:
    chain = loop.chain
    if not chain.delay > 0:
        return None
    text = f"Hand over readings without the delay of {format_quantity(chain.delay, 's')} after their exposure."
    return Candidate(name="delay", sentence=text, loop=replace(loop, chain=replace(chain, delay=0.0)))


def _quiet(loop: ClosedLoop) -> Candidate | None:
    if not _is_noisy(loop):
        return None
    chain, parts = loop.chain, []
    half: dict[str, Any] = {name: getattr(chain, name) / 2 for name in _NOISES}
    if chain.noise:
        parts.append(f"{half['noise']:.3g} in the unit of xi instead of {chain.noise:.3g}")
    if chain.relative_noise:
        parts.append(f"{100 * half['relative_noise']:.3g} % of xi instead of {100 * chain.relative_noise:.3g} %")
    if chain.distance_noise:
        noises = (half["distance_noise"], chain.distance_noise)
        parts.append(" instead of ".join(format_quantity(noise, "m") for noise in noises))
    text = f"Halve the noise of the sensor to a standard deviation of {' and '.join(parts)}."
    return Candidate(name="noise", sentence=text, loop=replace(loop, chain=replace(chain, **half)))


def _calibrated(loop: ClosedLoop) -> Candidate | None:
    chain = loop.chain
    if not chain.misfit > 0:
        return None
    half = replace(chain, misfit=chain.misfit / 2)
    text = (
        f"Calibrate anew, so that the sensor lies off its curve by {100 * half.misfit:.3g} % of xi instead of "
        f"{100 * chain.misfit:.3g} %: at more distances, set more exactly; or sink it to where its curve fits better."
    )
    return Candidate(name="calibration", sentence=text, loop=replace(loop, chain=half))


def _faster_robot(loop: ClosedLoop) -> Candidate | None:
    plant = loop.plant
    if not isinstance(plant, PositionPlant | ImpedancePlant) or plant.bandwidth == math.inf:
        return None
    faster = replace(plant, bandwidth=_FASTER * plant.bandwidth)
    new, old = (format_quantity(one.bandwidth, "Hz") for one in (faster, plant))
    text = f"Give the robot's own control a bandwidth of {new} instead of {old}."
    return Candidate(name="robot-bandwidth", sentence=text, loop=replace(loop, plant=faster))


def _stiffer_robot(loop: ClosedLoop) -> Candidate | None:
    plant = loop.plant
    if not isinstance(plant, ImpedancePlant):
        return None
    stiffer = replace(plant, stiffness=2 * plant.stiffness, damping=2**0.5 * plant.damping)
    text = (
        f"Raise the stiffness of the robot's impedance controller to {format_quantity(stiffer.stiffness, 'N/m')} from "
        f"{format_quantity(plant.stiffness, 'N/m')}, and its damping to {format_quantity(stiffer.damping, 'N*s/m')}."
    )
    return Candidate(name="robot-stiffness", sentence=text, loop=replace(loop, plant=stiffer))


def _without_median(loop: ClosedLoop, law: Controller) -> Candidate | None:
    window = law.conditioning.median_window
    if window == 1:
        return None
    text = f"Leave out the median over {window} readings."
    return Candidate(name="median", sentence=text, loop=_conditioned(loop, law, median_window=1))


def _without_low_pass(loop: ClosedLoop, law: Controller) -> Candidate | None:
    c = law.conditioning
    if not c.low_pass_order or c.cutoff is None:
        return None
    text = f"Leave out the low-pass of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}."
    return Candidate(name="low-pass", sentence=text, loop=_conditioned(loop, law, low_pass_order=0, cutoff=None))


def _with_median(loop: ClosedLoop, law: Controller) -> Candidate | None:
    if law.conditioning.median_window > 1 or not _is_noisy(loop):
        return None
    text = f"Take the running median over {_SHORT_MEDIAN} readings."
    return Candidate(name="add-median", sentence=text, loop=_conditioned(loop, law, median_window=_SHORT_MEDIAN))


def _with_low_pass(loop: ClosedLoop, law: Controller) -> Candidate | None:
    if law.conditioning.low_pass_order > 0 or not _is_noisy(loop):
        return None
    cutoff = _LOW / told_period(law)
    text = f"Filter readings by a low-pass of order 2 at {format_quantity(cutoff, 'Hz')}."
    filtered = _conditioned(loop, law, low_pass_order=2, cutoff=cutoff)
    return Candidate(name="add-low-pass", sentence=text, loop=filtered)


def _faster_law(loop: ClosedLoop, law: Controller) -> Candidate:
    period = law.period / _FASTER
    text = f"Step the controller {_hertz(1 / period)} instead of {1 / law.period:.6g}."
    faster = replace(loop, law=controller_at(law, told_period(law), period))
    return Candidate(name="controller-rate", sentence=text, loop=faster)


def _exact_offset(loop: ClosedLoop, law: Controller) -> Candidate | None:
    chain, own = loop.chain, law.conditioning.offset
    pedestal = chain.offset + chain.crosstalk
    if pedestal == own and chain.drift == 0:
        return None
    text = f"Subtract the offset exactly, {pedestal:.4g} in the unit of xi"
    text += f" instead of {own:.4g}" if pedestal != own else ""
    text += ", and follow its drift." if chain.drift else "."
    still = replace(loop, chain=replace(chain, drift=0.0))
    return Candidate(name="offset", sentence=text, loop=_conditioned(still, law, offset=pedestal))


def _checked_rate(loop: ClosedLoop, law: Controller, approach: Approach) -> Candidate | None:
    # a reading is refused only where approach and noise together could not have made it
    rate = _ROOM * approach.fastest * approach.steepest + _DEVIATIONS * approach.noise * loop.chain.rate
    if law.conditioning.largest_rate is not None or not rate > 0:
        return None
    noise = " and what noise adds" if _is_noisy(loop) else ""
    text = f"Set largest_rate to {format_quantity(rate, '1/s')}: twice what the fastest approach makes of ln xi{noise}."
    return Candidate(name="largest-rate", sentence=text, loop=_conditioned(loop, law, largest_rate=rate))


def _conditioned(loop: ClosedLoop, law: Controller, **changes: Any) -> ClosedLoop:
    conditioning: Conditioning = replace(law.conditioning, **changes)
    return replace(loop, law=replace(law, conditioning=conditioning))


def _is_noisy(loop: ClosedLoop) -> bool:
    return any(getattr(loop.chain, name) > 0 for name in _NOISES)


def _hertz(rate: float) -> str:
    return f"{rate:.6g} times a second"
