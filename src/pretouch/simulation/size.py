"""How much a simulation asks for, estimated before it begins: steps of a run, and the memory of many runs."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity

from .asked import Loop
from .layout import CONTACT_COLUMNS, RESULT_COLUMNS
from .native_loop import contact_step

__all__ = ["MOST_RUNS", "TOUCHES", "refuse_endless_runs", "refuse_too_many_runs", "rows_until"]

TOUCHES: Final = 32
"""How many contacts of one run are told apart."""

MOST_RUNS: Final = 1_000_000
"""How many runs of a simulation are kept at once: about 2 GB."""

_MOST_STEPS: Final = 20_000_000  # of one run, of any kind: some seconds
_MOST_BUFFERED: Final = 1_000_000  # readings that wait to be delivered


def refuse_too_many_runs(count: int) -> None:
    """Refuse more runs than are kept at once, before anything is allocated for them.

    Args:
        count: how many.

    Raises:
        InvalidInputError: there are more than MOST_RUNS.
    """
    if count > MOST_RUNS:
        size = 8 * count * (len(RESULT_COLUMNS) + TOUCHES * len(CONTACT_COLUMNS))
        raise InvalidInputError(
            f"runs: found {count:,}, which would take {size / 1e9:,.0f} GB, expected at most {MOST_RUNS:,}; for more, "
            "go on with another seed"
        )


def refuse_endless_runs(loop: Loop, plant_step: float) -> None:
    """Refuse a loop of which a single run may take more steps, or readings, than there is time and memory for.

    Args:
        loop: the loop.
        plant_step: what is integrated of the plant at once [s].

    Raises:
        InvalidInputError: it may; the message says what would fit.
    """
    period, chain = loop.laws[0].period, loop.chain
    _refuse(loop.horizon, period, "loop horizon", f"a controller with a period of {_time(period)}")
    _refuse(loop.horizon, 1 / chain.rate, "loop horizon", f"a sensor with {chain.rate:g} readings per second")
    _refuse(loop.horizon, plant_step, "loop horizon", f"a robot followed in steps of {_time(plant_step)}")
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


def rows_until(end: float, period: float) -> int:
    """Return how many rows a trace has of a run that ends at a time.

    Args:
        end: when it ended [s].
        period: of the controller [s].

    Returns:
        The number of rows.
    """
    return math.ceil(end / period) + 1
