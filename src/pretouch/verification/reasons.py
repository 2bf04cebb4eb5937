"""Why a gain does not hold, or holds narrowly: one clause each, with numbers."""

from __future__ import annotations

from pretouch._core.units import format_quantity
from pretouch.design.robust.wording import share_in_words

from .parts import LimitCheck, Reached, StabilityCheck

__all__ = [
    "chance_missing",
    "contact_missing",
    "limit_missed",
    "little_room",
    "loop_unstable",
    "margin_small",
    "not_proved",
    "not_simulated",
    "stability_unknown",
]


def loop_unstable(stability: StabilityCheck) -> str:
    """Say that the gain is too strong for the loop."""
    return (
        f"the loop is unstable: {format_quantity(stability.strongest, 'N*s')} is the strongest stable gain, at a "
        f"distance of {format_quantity(stability.critical_distance, 'm')}"
    )


def contact_missing(reached: Reached, runs: int) -> str:
    """Say that runs ended without contact."""
    return f"{reached.missing} of {runs} runs end without the contact that is predicted"


def limit_missed(check: LimitCheck, runs: int) -> str:
    """Say that a limit is missed, how often and by how much."""
    p = check.required.probability
    asked = "always" if p == 1 else f"in {100 * p:g} %"
    text = f"{_limited(check)} holds in {round((check.held or 0.0) * runs)} of {runs} runs, and must {asked}"
    if check.value is not None:
        worst = "the worst run reaches" if p == 1 else f"{100 * p:g} % of the runs stay within"
        text += f" ({worst} {format_quantity(check.value, check.unit)})"
    return text


def margin_small(stability: StabilityCheck) -> str:
    """Say that the loop is near its limit of stability."""
    return f"a gain {stability.margin:.3g} times as strong makes the loop unstable, where a margin of 2 is usual"


def stability_unknown() -> str:
    """Say that nothing is known of the stability."""
    return "how far the loop is from instability is not known"


def not_simulated(check: LimitCheck) -> str:
    """Say that a limit could not be checked."""
    return f"{_limited(check)} is not simulated, so that nothing is known of it"


def not_proved(check: LimitCheck, confidence: float) -> str:
    """Say that too few runs show what is required."""
    return (
        f"{_limited(check)} holds in {share_in_words(check.held or 0.0)} of the runs, which shows at least "
        f"{share_in_words(check.low or 0.0)} at {100 * confidence:g} % confidence, where "
        f"{100 * check.required.probability:g} % are required"
    )


def little_room(check: LimitCheck) -> str:
    """Say that a limit is all but used up."""
    return f"{_limited(check)} has no more than {format_quantity(check.margin or 0.0, check.unit)} of room"


def chance_missing(reached: Reached) -> str:
    """Say that no contact is predicted at all."""
    share = share_in_words(reached.simulated)
    return f"no contact is predicted with this gain, and {share} of the runs come to one"


def _limited(check: LimitCheck) -> str:
    return f"{check.name} <= {format_quantity(check.limit, check.unit)}"
