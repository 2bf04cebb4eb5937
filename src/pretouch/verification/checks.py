"""Predicted beside simulated: each quantity, each limit, and which runs came to a contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.design import ImpactModel, quantity_of
from pretouch.design.robust import Required
from pretouch.design.robust.validation import least_probability
from pretouch.motion import ContactResult
from pretouch.simulation import ClosedLoop, SimulationResult

from .parts import Comparison, LimitCheck, Reached, Spread
from .problem import Outcomes
from .simulated import source_of

__all__ = ["check_limits", "check_reached", "compare_quantities", "spread_of"]

_COMPARED: Final = ("relative_velocity", "time", "largest_excursion", "largest_virtual_force", "largest_speed")
_SAME: Final = 1e-9  # of a force: the peak of a contact is then that of its impact


def compare_quantities(
    mitigated: SimulationResult,
    unmitigated: SimulationResult,
    predicted: ContactResult,
    predicted_unmitigated: ContactResult,
    *,
    loop: ClosedLoop,
    impact: ImpactModel | None,
) -> tuple[Comparison, ...]:
    """Put predicted and simulated magnitudes side by side, with and without mitigation.

    Args:
        mitigated: the runs.
        unmitigated: the same with D_p = 0.
        predicted: the nominal encounter in continuous time.
        predicted_unmitigated: the same with D_p = 0.
        loop: what the runs ran on.
        impact: the impact that is predicted with.

    Returns:
        The comparisons.
    """
    both, foreseen = (mitigated, unmitigated), (predicted, predicted_unmitigated)

    def row(name: str, values: Sequence[float | None]) -> Comparison:
        simulated = [spread_of(np.abs(np.asarray(getattr(r, name))), r.touched) for r in both]
        return Comparison(
            name=name,
            label=words_for(name),
            unit=unit_of(name),
            predicted=values[0],
            predicted_unmitigated=values[1],
            simulated=simulated[0],
            unmitigated=simulated[1],
        )

    names = [*_COMPARED, *(["impact_force"] if loop.contact is not None else [])]
    rows = [row(name, [_magnitude(name, r, impact) for r in foreseen]) for name in names]
    if loop.contact is not None and any(np.any(r.peak_force > (1 + _SAME) * r.impact_force) for r in both):
        rows.append(row("peak_force", (None, None)))
    return tuple(rows)


def spread_of(values: FloatArray, counted: BoolArray) -> Spread | None:
    """Summarize a quantity over runs.

    Args:
        values: of every run.
        counted: which of them count.

    Returns:
        The spread; None where none counts.
    """
    some = values[counted]
    if not len(some):
        return None
    low, median, high = (float(q) for q in np.quantile(some, [0.05, 0.5, 0.95]))
    error = float(np.std(some, ddof=1)) / math.sqrt(len(some)) if len(some) > 1 else math.nan
    return Spread(
        mean=float(some.mean()),
        standard_error=error,
        low=low,
        median=median,
        high=high,
        worst=float(some.max()),
        runs=len(some),
    )


def check_limits(
    limits: tuple[Required, ...],
    outcomes: Outcomes,
    predicted: ContactResult,
    gain: float,
    *,
    loop: ClosedLoop,
    impact: ImpactModel | None,
    confidence: float,
) -> tuple[LimitCheck, ...]:
    """Tell of each limit how often it holds.

    Args:
        limits: the limits.
        outcomes: the runs.
        predicted: the nominal encounter in continuous time.
        gain: D_p [N s].
        loop: what the runs ran on.
        impact: the impact that is predicted with.
        confidence: of the lower bounds.

    Returns:
        The checks.
    """
    found = []
    for required, ratio in zip(limits, outcomes.ratios, strict=True):
        constraint = required.constraint
        count = int((ratio <= 1 + 1e-12).sum())
        reached = float(required.share(ratio)) * constraint.limit
        value = reached if math.isfinite(reached) else None
        foreseen = abs(gain) if constraint.quantity == "gain" else _magnitude(constraint.quantity, predicted, impact)
        found.append(
            LimitCheck(
                required=required,
                predicted=foreseen,
                held=count / len(ratio),
                low=least_probability(count, len(ratio), confidence),
                value=value,
                margin=None if value is None else constraint.limit - value,
                source=source_of(constraint.quantity, loop),
            )
        )
    return tuple(found)


def check_reached(result: SimulationResult, predicted: BoolArray, confidence: float) -> Reached:
    """Tell which runs came to a contact.

    Args:
        result: the runs.
        predicted: which do in continuous time.
        confidence: of the lower bound.

    Returns:
        Shares and counts.
    """
    expected, came = int(predicted.sum()), int(result.touched[predicted].sum())
    return Reached(
        predicted=float(predicted.mean()),
        simulated=float(result.touched.mean()),
        missing=expected - came,
        low=least_probability(came, expected, confidence) if expected else None,
    )


def _magnitude(name: str, result: ContactResult, impact: ImpactModel | None) -> float | None:
    if not result.reached.all():
        return None
    value: Any = quantity_of(name, result.end, impact)
    return abs(float(value)) if math.isfinite(float(value)) else None
