"""What could be changed: the loop with one thing made better, and what to do for it, with numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch.control import Conditioning, Controller
from pretouch.simulation import ClosedLoop, ImpedancePlant, PositionPlant

from .change_wording import change_sentence
from .timing import controller_at, loop_at, told_period

__all__ = ["Candidate", "candidates_of"]

_FASTER: Final = 2.0
_ROOM: Final = 2.0  # times the fastest change of ln xi that an approach makes
_DEVIATIONS: Final = 6.0 * 2**0.5  # of the difference of two readings
_SHORT_MEDIAN: Final = 3  # readings: it takes out single spikes
_LOW: Final = 0.2  # of the rate: a cutoff that averages some readings


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


def candidates_of(loop: ClosedLoop, *, steepest: float, fastest: float, noise: float) -> list[Candidate]:
    """Collect what could be changed of a loop.

    Args:
        loop: the loop.
        steepest: largest |g| that the encounter passes [1/m].
        fastest: fastest approach [m/s].
        noise: standard deviation of ln xi from reading to reading, where it is largest.

    Returns:
        The changes that mean something for it.
    """
    makers: tuple[Callable[[ClosedLoop], ClosedLoop | None], ...] = (
        *(_faster_sensor, _prompt, _quiet, _without_median, _without_low_pass, _with_median, _with_low_pass),
        *(_faster_law, _faster_robot, _stiffer_robot, _exact_offset),
    )
    names = (
        *("sensor-rate", "delay", "noise", "median", "low-pass", "add-median", "add-low-pass"),
        *("controller-rate", "robot-bandwidth", "robot-stiffness", "offset"),
    )
    # a reading is refused only where approach and noise together could not have made it
    rate = _ROOM * fastest * steepest + _DEVIATIONS * noise * loop.chain.rate
    found = list(_made(loop, zip(names, makers, strict=True)))
    found += _made(loop, [("largest-rate", lambda one: _checked_rate(one, rate))])
    return found


def _made(loop: ClosedLoop, makers: Any) -> Iterator[Candidate]:
    for name, make in makers:
        try:
            changed = make(loop)
        except InvalidInputError:  # the parts of this loop do not go together with it: nothing to be proposed
            continue
        if changed is not None:
            yield Candidate(name=name, sentence=change_sentence(name, loop, changed), loop=changed)


def _faster_sensor(loop: ClosedLoop) -> ClosedLoop:
    return loop_at(loop, _FASTER * loop.chain.rate)


def _prompt(loop: ClosedLoop) -> ClosedLoop | None:
    return replace(loop, chain=replace(loop.chain, delay=0.0)) if loop.chain.delay > 0 else None


def _quiet(loop: ClosedLoop) -> ClosedLoop | None:
    chain = loop.chain
    if not _is_noisy(loop):
        return None
    half = {name: getattr(chain, name) / 2 for name in ("noise", "relative_noise", "distance_noise")}
    return replace(loop, chain=replace(chain, **half))


def _conditioned(loop: ClosedLoop, **changes: Any) -> ClosedLoop | None:
    law = loop.law
    if not isinstance(law, Controller):
        return None
    conditioning: Conditioning = replace(law.conditioning, **changes)
    return replace(loop, law=replace(law, conditioning=conditioning))


def _without_median(loop: ClosedLoop) -> ClosedLoop | None:
    law = loop.law
    if not isinstance(law, Controller) or law.conditioning.median_window == 1:
        return None
    return _conditioned(loop, median_window=1)


def _without_low_pass(loop: ClosedLoop) -> ClosedLoop | None:
    law = loop.law
    if not isinstance(law, Controller) or law.conditioning.low_pass_order == 0:
        return None
    return _conditioned(loop, low_pass_order=0, cutoff=None)


def _with_median(loop: ClosedLoop) -> ClosedLoop | None:
    law = loop.law
    if not isinstance(law, Controller) or law.conditioning.median_window > 1 or not _is_noisy(loop):
        return None
    return _conditioned(loop, median_window=_SHORT_MEDIAN)


def _with_low_pass(loop: ClosedLoop) -> ClosedLoop | None:
    law = loop.law
    if not isinstance(law, Controller) or law.conditioning.low_pass_order > 0 or not _is_noisy(loop):
        return None
    return _conditioned(loop, low_pass_order=2, cutoff=_LOW / told_period(law))


def _is_noisy(loop: ClosedLoop) -> bool:
    chain = loop.chain
    return chain.noise + chain.relative_noise + chain.distance_noise > 0


def _faster_law(loop: ClosedLoop) -> ClosedLoop | None:
    law = loop.law
    if not isinstance(law, Controller):
        return None
    return replace(loop, law=controller_at(law, told_period(law), law.period / _FASTER))


def _faster_robot(loop: ClosedLoop) -> ClosedLoop | None:
    plant = loop.plant
    if isinstance(plant, PositionPlant) or (isinstance(plant, ImpedancePlant) and plant.bandwidth < float("inf")):
        return replace(loop, plant=replace(plant, bandwidth=_FASTER * plant.bandwidth))
    return None


def _stiffer_robot(loop: ClosedLoop) -> ClosedLoop | None:
    plant = loop.plant
    if not isinstance(plant, ImpedancePlant):
        return None
    stiffer = replace(plant, stiffness=2 * plant.stiffness, damping=2**0.5 * plant.damping)
    return replace(loop, plant=stiffer)


def _exact_offset(loop: ClosedLoop) -> ClosedLoop | None:
    law, chain = loop.law, loop.chain
    if not isinstance(law, Controller):
        return None
    pedestal = chain.offset + chain.crosstalk
    if pedestal == law.conditioning.offset and chain.drift == 0:
        return None
    still = replace(loop, chain=replace(chain, drift=0.0))
    return _conditioned(still, offset=pedestal)


def _checked_rate(loop: ClosedLoop, rate: float) -> ClosedLoop | None:
    law = loop.law
    if not isinstance(law, Controller) or law.conditioning.largest_rate is not None or not rate > 0:
        return None
    return _conditioned(loop, largest_rate=rate)
