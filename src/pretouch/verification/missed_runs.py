"""Name the uncertain input that distinguishes the runs that miss a limit."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.units import format_quantity
from pretouch.motion.scenario import input_units

from .appraisal import Draws

_CLEAR: Final = 0.8  # probability that an input is larger (or smaller) in a missed run than in another one
_MOST: Final = 0.9  # share of all runs that have a value in the range of the runs that miss the limit
_SPEED: Final = "obstacle.velocity"


def missed_in_words(draws: Draws, missed: BoolArray) -> str:
    """Return a sentence on the runs that miss a limit.

    Args:
        draws: the encounters.
        missed: the runs that miss a limit.

    Returns:
        A sentence without its end; empty if no uncertain input distinguishes these runs.
    """
    if draws.ensemble is None or not missed.any() or missed.all():
        return ""
    values = {name: np.abs(v) if name == _SPEED else v for name, v in draws.ensemble.values.items()}
    clearest = max(values, key=lambda name: _clearness(values[name], missed), default="")
    if not clearest or _clearness(values[clearest], missed) < _CLEAR:
        return ""
    every, ends = values[clearest], np.sort(values[clearest][missed])[[0, -1]]
    if np.mean((every >= ends[0]) & (every <= ends[1])) > _MOST:
        return ""  # single runs with any value miss the limit, so the ranges say nothing
    unit = input_units(draws.task.sensor).get(clearest, "")
    these, all_runs = (
        " to ".join(format_quantity(float(end), unit, 3) for end in (v.min(), v.max()))
        for v in (values[clearest][missed], values[clearest])
    )
    runs = f"approach at {these}" if clearest == _SPEED else f"have {clearest} from {these}"
    return f"the runs that miss a limit {runs} (all runs: {all_runs}): check this spread of {clearest} in [uncertainty]"


def _clearness(values: FloatArray, missed: BoolArray) -> float:
    """Return how well an input distinguishes the missed runs: 1 if perfectly, 1/2 if not at all.

    It is the probability that the input is larger in a missed run than in another one, or smaller.
    """
    low, high = (np.sort(values[which]) for which in (~missed, missed))
    below = np.searchsorted(low, high, "left") + np.searchsorted(low, high, "right")
    larger = float(below.mean()) / (2 * len(low))
    return max(larger, 1 - larger)
