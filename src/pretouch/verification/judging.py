"""The word for it: holds, holds narrowly, does not hold, and why."""

from __future__ import annotations

from typing import Final

from .parts import LimitCheck, Reached, StabilityCheck, VerdictStatus
from .reasons import (
    chance_missing,
    contact_missing,
    limit_missed,
    little_room,
    loop_unstable,
    margin_small,
    not_proved,
    not_simulated,
    stability_unknown,
)

__all__ = ["judge"]

_MARGIN: Final = 2.0  # of the gain to instability: the usual 6 dB
_ROOM: Final = 0.03  # of a limit


def judge(
    reached: Reached, limits: tuple[LimitCheck, ...], stability: StabilityCheck | None, runs: int, confidence: float
) -> tuple[VerdictStatus, tuple[str, ...]]:
    """Find the status and the reasons why it is not `holds`.

    Args:
        reached: which runs came to a contact.
        limits: the limits.
        stability: the margin to instability; None where it is not known.
        runs: how many runs.
        confidence: of the bounds.

    Returns:
        The status, and the reasons, those for the graver status first.
    """
    missed = [] if stability is None or stability.margin >= 1 else [loop_unstable(stability)]
    missed += [contact_missing(reached, runs)] if reached.missing else []
    missed += [limit_missed(check, runs) for check in limits if check.held is not None and not check.is_met]
    narrow: list[str] = []
    if stability is None:
        narrow.append(stability_unknown())
    elif 1 <= stability.margin < _MARGIN:
        narrow.append(margin_small(stability))
    for check in limits:
        if check.held is None:
            narrow.append(not_simulated(check))
        elif check.is_met and not _is_proved(check):
            narrow.append(not_proved(check, confidence))
        elif check.is_met and _is_near(check):
            narrow.append(little_room(check))
    if not reached.predicted:
        narrow.append(chance_missing(reached))
    status = VerdictStatus.HOLDS
    if missed or narrow:
        status = VerdictStatus.DOES_NOT_HOLD if missed else VerdictStatus.HOLDS_NARROWLY
    return status, (*missed, *narrow)


def _is_proved(check: LimitCheck) -> bool:
    """Tell whether the bound reaches a required probability; none can reach 1, which is asked of the runs alone."""
    p = check.required.probability
    return p == 1 or (check.low is not None and check.low >= p)


def _is_near(check: LimitCheck) -> bool:
    if check.name == "gain" or check.margin is None:  # the gain is chosen, and on its limit as good as within
        return False
    return check.margin < _ROOM * check.limit
