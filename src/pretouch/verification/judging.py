"""The word for it: holds, holds narrowly, does not hold; and why, one clause each, with numbers."""

from __future__ import annotations

from typing import Final

from pretouch._core.units import format_quantity
from pretouch.uncertainty.describing import share_in_words

from .calibration_check import CalibrationCheck
from .parts import Effect, LimitCheck, Reached, StabilityCheck, VerdictStatus

__all__ = ["judge"]

_MARGIN: Final = 2.0  # of the gain to instability: the usual 6 dB
_ROOM: Final = 0.03  # of a limit


def judge(
    reached: Reached,
    effect: Effect | None,
    limits: tuple[LimitCheck, ...],
    stability: StabilityCheck | None,
    calibration: CalibrationCheck | None = None,
    *,
    runs: int,
    confidence: float,
) -> tuple[VerdictStatus, tuple[str, ...]]:
    """Find the status and the reasons why it is not `holds`.

    Args:
        reached: which runs came to a contact.
        effect: on the speed at contact, beside no mitigation; None where it cannot be compared.
        limits: the limits.
        stability: the margin to instability; None where it is not known.
        calibration: what becomes of the gain on other sensors that its readings allow; None where that is not known.
        runs: how many runs.
        confidence: of the bounds.

    Returns:
        The status, and the reasons, those for the graver status first.
    """
    missed = [] if stability is None or stability.margin >= 1 else [_loop_unstable(stability)]
    missed += [_contact_missing(reached, runs)] if reached.missing else []
    missed += [_contact_harder(effect)] if effect is not None and effect.is_harder else []
    missed += [_limit_missed(check, runs) for check in limits if not check.is_met]
    missed += [calibration.reason] if calibration is not None and not calibration.is_good_enough else []
    narrow: list[str] = []
    if stability is None:
        narrow.append(_stability_unknown())
    elif 1 <= stability.margin < _MARGIN:
        narrow.append(_margin_small(stability))
    for check in limits:
        if check.is_met and not _is_proved(check):
            narrow.append(_not_proved(check, confidence))
        elif check.is_met and _is_near(check):
            narrow.append(_little_room(check))
    if not reached.predicted:
        narrow.append(_chance_missing(reached))
    status = VerdictStatus.HOLDS
    if missed or narrow:
        status = VerdictStatus.DOES_NOT_HOLD if missed else VerdictStatus.HOLDS_NARROWLY
    return status, (*missed, *narrow)


def _is_proved(check: LimitCheck) -> bool:
    """Tell whether the bound reaches a required probability; none can reach 1, which is asked of the runs alone."""
    p = check.required.probability
    return p == 1 or check.low >= p


def _is_near(check: LimitCheck) -> bool:
    if check.name == "gain" or check.margin is None:  # the gain is chosen, and on its limit as good as within
        return False
    return check.margin < _ROOM * check.limit


def _loop_unstable(stability: StabilityCheck) -> str:
    """Say that the gain is too strong for the loop."""
    if stability.strongest == 0:
        return "the loop is unstable with any gain, however weak"
    return (
        f"the loop is unstable: {format_quantity(stability.strongest, 'N*s')} is the strongest stable gain, at a "
        f"distance of {format_quantity(stability.critical_distance, 'm')}"
    )


def _contact_missing(reached: Reached, runs: int) -> str:
    """Say that runs ended without contact."""
    return f"{reached.missing} of {runs} runs end without the contact that is predicted"


def _contact_harder(effect: Effect) -> str:
    """Say that contact is harder than without mitigation, and by how much."""
    speed, free = (format_quantity(value, "m/s") for value in (effect.speed, effect.unmitigated))
    error = f" +- {effect.standard_error:.1g}" if effect.standard_error > 0 else ""
    return (
        f"contact is harder than without mitigation: {speed} on average instead of {free} "
        f"(+{effect.difference:.2g}{error} m/s)"
    )


def _limit_missed(check: LimitCheck, runs: int) -> str:
    """Say that a limit is missed, how often and by how much."""
    p = check.required.probability
    asked = "always" if p == 1 else f"in {100 * p:g} %"
    text = f"{check.statement} holds in {round(check.held * runs)} of {runs} runs, and must {asked}"
    if check.value is not None:
        worst = "the worst run reaches" if p == 1 else f"{100 * p:g} % of the runs stay within"
        text += f" ({worst} {format_quantity(check.value, check.unit)})"
    return text


def _margin_small(stability: StabilityCheck) -> str:
    """Say that the loop is near its limit of stability."""
    return f"a gain {stability.margin:.3g} times as strong makes the loop unstable, where a margin of 2 is usual"


def _stability_unknown() -> str:
    """Say that nothing is known of the stability."""
    return "how far the loop is from instability is not known"


def _not_proved(check: LimitCheck, confidence: float) -> str:
    """Say that too few runs show what is required."""
    return (
        f"{check.statement} holds in {share_in_words(check.held)} of the runs, which shows at least "
        f"{share_in_words(check.low)} at {100 * confidence:g} % confidence, where "
        f"{100 * check.required.probability:g} % are required"
    )


def _little_room(check: LimitCheck) -> str:
    """Say that a limit is all but used up."""
    return f"{check.statement} has no more than {format_quantity(check.margin or 0.0, check.unit)} of room"


def _chance_missing(reached: Reached) -> str:
    """Say that no contact is predicted at all."""
    share = share_in_words(reached.simulated)
    return f"no contact is predicted with this gain, and {share} of the runs come to one"
