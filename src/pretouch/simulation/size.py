"""What is refused of a simulation before it begins: numbers without sense, too many steps of a run, too many runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import nonnegative, positive
from pretouch._core.units import format_quantity

from .native_loop import CONTACT_COLUMNS, CONTACT_NUMBERS, RESULT_COLUMNS, TOUCHES, Loop, contact_step
from .plant import COEFFICIENTS, checked_numbers, plant_step

__all__ = ["FOLLOW", "HORIZON", "MOST_RUNS", "check_loop", "refuse_too_many_runs", "runs_of", "whole"]

HORIZON: Final = 10.0
"""How long runs wait for contact where nothing else is said [s]."""

FOLLOW: Final = 0.2
"""How long runs go on after the first contact where nothing else is said [s]."""

MOST_RUNS: Final = 1_000_000
"""How many runs of a simulation are kept at once: about 2 GB."""

_MOST_STEPS: Final = 20_000_000  # of one run, of any kind: some seconds
_MOST_BUFFERED: Final = 1_000_000  # readings that wait to be delivered


def check_loop(loop: Loop) -> Loop:
    """Return a loop with its numbers checked; refuse what makes no sense, and runs that may be endless."""
    checked_numbers(loop.plant, loop.plant.coefficients(), COEFFICIENTS)
    if loop.contact is not None:
        checked_numbers(loop.contact, loop.contact.numbers(), CONTACT_NUMBERS)
        if loop.plant.coefficients()[0] == 0:
            raise InvalidInputError(
                "contact: an ideal plant has no mass, so no force follows from its contact; choose an ImpedancePlant "
                "or a PositionPlant"
            )
    checked = replace(
        loop,
        horizon=positive(loop.horizon, "horizon", "s"),
        follow=nonnegative(loop.follow, "follow", "s") if loop.contact is not None else 0.0,
        seed=whole(loop.seed, "seed", 0, 2**64 - 1),
    )
    _refuse_endless_runs(checked)
    return checked


def refuse_too_many_runs(count: int) -> None:
    """Refuse more runs than are kept at once, before anything is allocated for them."""
    if count > MOST_RUNS:
        size = 8 * count * (len(RESULT_COLUMNS) + TOUCHES * len(CONTACT_COLUMNS))
        raise InvalidInputError(
            f"runs: found {count:,}, which would take {size / 1e9:,.0f} GB, expected at most {MOST_RUNS:,}; for more, "
            "go on with another seed"
        )


def _refuse_endless_runs(loop: Loop) -> None:
    """Refuse a loop of which a single run may take more steps, or readings, than there is time and memory for."""
    period, chain = loop.laws[0].period, loop.chain
    _refuse(loop.horizon, period, "loop horizon", f"a controller with a period of {_time(period)}")
    _refuse(loop.horizon, 1 / chain.rate, "loop horizon", f"a sensor with {chain.rate:g} readings per second")
    step = plant_step(loop.plant, period)
    _refuse(loop.horizon, step, "loop horizon", f"a robot followed in steps of {_time(step)}")
    if loop.contact is not None:
        numbers, mass = loop.contact.numbers(), loop.plant.coefficients()[0]
        fastest = max(1.0, float(np.max(np.abs(loop.scenario.relative_velocity))))
        step = contact_step(numbers, 1 / mass + numbers[4], fastest)
        _refuse(loop.follow, period, "loop follow", f"a controller with a period of {_time(period)}")
        _refuse(loop.follow, step, "loop follow", f"a contact followed in steps of {_time(step)}")
    waiting = chain.exposure + chain.delay + 16 * chain.jitter + period
    if waiting * chain.rate > _MOST_BUFFERED:
        raise InvalidInputError(
            f"chain delay: found up to {waiting * chain.rate:.3g} readings on their way (delay, exposure and jitter "
            f"at {chain.rate:g} readings per second), expected at most {_MOST_BUFFERED:,}"
        )


def _refuse(span: float, step: float, name: str, what: str) -> None:
    if not span / step <= _MOST_STEPS:
        raise InvalidInputError(
            f"{name}: found {_time(span)}, which is {span / step:.3g} steps of {what}, expected at most "
            f"{_MOST_STEPS:,} of them, {_time(_MOST_STEPS * step)}; a run ends soon after its contact: wait for "
            "that no longer than it may take"
        )


def _time(seconds: float) -> str:
    return format_quantity(seconds, "s") if seconds >= 1e-9 else f"{seconds:g} s"


def whole(value: Any, name: str, least: int, most: int) -> int:
    """Return a whole number, or refuse what is none or out of range."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise InvalidInputError(f"{name}: found {value!r}, expected a whole number from {least} to {most}")
    return int(value)


def runs_of(value: Any) -> int:
    """Return a number of runs, or refuse what is none or too large."""
    refuse_too_many_runs(runs := whole(value, "runs", 1, 2**63))
    return runs
