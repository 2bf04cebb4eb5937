"""What fresh, independent samples say of a gain."""

from __future__ import annotations

import numpy as np

from pretouch._core.numbers import FloatArray

from .measures import Required
from .problem import RobustProblem
from .result import LimitOutcome, LossOfNominal, Validation

__all__ = ["least_probability", "validate"]


def validate(problem: RobustProblem, gain: float, nominal: float | None, *, confidence: float) -> Validation:
    """Appraise a gain on samples that its design has not seen.

    Args:
        problem: the problem, with fresh and independent encounters.
        gain: D_p [N s].
        nominal: another gain to be appraised beside it [N s]; None for none.
        confidence: of the intervals.

    Returns:
        The measure with its interval, and every constraint.
    """
    objective, ratios = problem.values(gain)
    value, low, high = problem.measure.estimate(objective, confidence)
    beside, loss = None, None
    if nominal is not None:
        other = problem.values(nominal)[0]
        beside = float(problem.measure.of(other))
        with np.errstate(invalid="ignore"):  # without contact in both
            change, error = problem.measure.difference(objective, other)
        if np.isfinite(change) and value > 0:
            loss = LossOfNominal(relative=change / value, standard_error=error / value)
    return Validation(
        samples=len(objective),
        confidence=confidence,
        value=value,
        low=low,
        high=high,
        nominal=beside,
        loss=loss,
        limits=tuple(_limit(r, ratio, confidence) for r, ratio in zip(problem.limits, ratios, strict=True)),
        reached=float(np.isfinite(objective).mean()),
    )


def least_probability(held: int, count: int, confidence: float) -> float:
    """Return the one-sided lower bound of a probability after so many successes (Clopper and Pearson, 1934).

    Args:
        held: successes.
        count: trials.
        confidence: of the bound.

    Returns:
        The bound.

    Examples:
        >>> round(least_probability(300, 300, 0.95), 4)
        0.9901
    """
    from scipy.special import betaincinv  # noqa: PLC0415 - SciPy, only when something is validated

    return 0.0 if held == 0 else float(betaincinv(held, count - held + 1, 1 - confidence))


def _limit(required: Required, ratio: FloatArray, confidence: float) -> LimitOutcome:
    held = int((ratio <= 1 + 1e-12).sum())
    return LimitOutcome(
        required=required,
        held=held / len(ratio),
        low=least_probability(held, len(ratio), confidence),
        magnitude=float(required.share(ratio)) * required.constraint.limit,
    )
