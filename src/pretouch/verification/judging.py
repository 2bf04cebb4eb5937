"""The word for it: holds, holds narrowly, does not hold; and why, one clause each, with numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pretouch._core.units import format_quantity
from pretouch.design import Task
from pretouch.uncertainty.describing import share_in_words

from .appraisal import Effect
from .calibration_check import CalibrationCheck
from .checks import LimitCheck, Reached, VerdictStatus
from .stability import StabilityCheck

__all__ = ["judge"]

_MARGIN: Final = 2.0  # of the gain to instability: the usual 6 dB
_ROOM: Final = 0.03  # of a limit


def judge(
    task: Task,
    *,
    reached: Reached,
    effect: Effect | None,
    limits: tuple[LimitCheck, ...],
    stability: StabilityCheck | None,
    calibration: CalibrationCheck | None,
) -> tuple[VerdictStatus, tuple[str, ...]]:
    """Return the status and the reasons why it is not `holds`, those for the graver status first.

    None stands for what is not known: an effect that cannot be compared, a margin to instability, what becomes of the
    gain on other sensors that the readings allow.
    """
    missed = [
        *_missed(task.runs, reached, effect, stability),
        *(_limit_missed(check, task.runs) for check in limits if not check.is_met),
        *([calibration.reason] if calibration is not None and not calibration.is_good_enough else []),
    ]
    narrow = list(_narrow(reached, limits, stability, task.confidence))
    if missed:
        return VerdictStatus.DOES_NOT_HOLD, (*missed, *narrow)
    return VerdictStatus.HOLDS_NARROWLY if narrow else VerdictStatus.HOLDS, tuple(narrow)


def _missed(runs: int, reached: Reached, effect: Effect | None, stability: StabilityCheck | None) -> Iterator[str]:
    if stability is not None and stability.margin < 1:
        if stability.strongest == 0:
            yield "the loop is unstable with any gain, however weak"
        else:
            strongest = format_quantity(stability.strongest, "N*s")
            place = format_quantity(stability.critical_distance, "m")
            yield f"the loop is unstable: {strongest} is the strongest stable gain, at a distance of {place}"
    if reached.missing:
        yield f"{reached.missing} of {runs} runs end without the contact that is predicted"
    if effect is not None and effect.is_harder:
        speed, free = (format_quantity(value, "m/s") for value in (effect.speed, effect.unmitigated))
        error = f" +- {effect.standard_error:.1g}" if effect.standard_error > 0 else ""
        yield (
            f"contact is harder than without mitigation: {speed} on average instead of {free} "
            f"(+{effect.difference:.2g}{error} m/s)"
        )


def _limit_missed(check: LimitCheck, runs: int) -> str:
    """Say that a limit is missed, how often and by how much."""
    p = check.required.probability
    required = "always" if p == 1 else f"in {100 * p:g} %"
    text = f"{check.statement} holds in {round(check.held * runs)} of {runs} runs, and must {required}"
    if check.value is not None:
        worst = "the worst run reaches" if p == 1 else f"{100 * p:g} % of the runs stay within"
        text += f" ({worst} {format_quantity(check.value, check.unit)})"
    return text


def _narrow(
    reached: Reached, limits: tuple[LimitCheck, ...], stability: StabilityCheck | None, confidence: float
) -> Iterator[str]:
    """Say what is near, or not shown."""
    if stability is None:
        yield "how far the loop is from instability is not known"
    elif 1 <= stability.margin < _MARGIN:
        yield f"a gain {stability.margin:.3g} times as strong makes the loop unstable, where a margin of 2 is usual"
    for check in (check for check in limits if check.is_met):
        p = check.required.probability
        if check.low < p < 1:  # no bound can reach 1, which is asked of the runs alone
            yield (
                f"{check.statement} holds in {share_in_words(check.held)} of the runs, which shows at least "
                f"{share_in_words(check.low)} at {100 * confidence:g} % confidence, where {100 * p:g} % are required"
            )
        # the gain is chosen, and on its limit as good as within
        elif check.name != "gain" and check.margin is not None and check.margin < _ROOM * check.limit:
            yield f"{check.statement} has no more than {format_quantity(check.margin, check.unit)} of room"
    if not reached.predicted:
        share = share_in_words(reached.simulated)
        yield f"no contact is predicted with this gain, and {share} of the runs come to one"
