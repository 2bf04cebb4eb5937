"""The verdict in one sentence, and whether the sensor is fast enough, in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pretouch._core.units import format_quantity

from .parts import Comparison, StabilityCheck, VerdictStatus
from .proposals import Change, Loss

if TYPE_CHECKING:
    from .result import Verdict

__all__ = [
    "best_gain_in_words",
    "change_in_words",
    "full_stop",
    "headline",
    "lacks_in_words",
    "no_stability_in_words",
    "rate_in_words",
    "stability_in_words",
]

_MARGIN: Final = 2.0  # to instability: the usual 6 dB

_HOLDS = {
    VerdictStatus.HOLDS: "holds on this loop",
    VerdictStatus.HOLDS_NARROWLY: "holds narrowly on this loop",
    VerdictStatus.DOES_NOT_HOLD: "does not hold on this loop",
}


def headline(verdict: Verdict) -> str:
    """Return the verdict in one sentence."""
    if verdict.gain is None:
        return f"There is no gain to verify: {full_stop(verdict.design.headline)}"
    text = f"D_p = {format_quantity(verdict.gain, 'N*s')} {_HOLDS[verdict.status]}"
    if verdict.reasons:
        text += f": {verdict.reasons[0]}"
        others = len(verdict.reasons) - 1
        text += f" ({others} more reason{'s' if others > 1 else ''} below)" if others else ""
    parts = [text]
    speed = verdict.comparison("relative_velocity")
    if speed is not None and speed.simulated is not None:
        parts.append(_speed(speed))
    if verdict.status is VerdictStatus.HOLDS:
        if verdict.limits:
            parts.append(f"every limit held as often as it must in {verdict.runs} runs")
        if verdict.stability is not None and math.isfinite(verdict.stability.margin):
            parts.append(f"the gain could be {verdict.stability.margin:.3g} times as strong before the loop oscillates")
    return "; ".join(parts) + "."


def _speed(speed: Comparison) -> str:
    s = speed.simulated
    if s is None:
        return ""
    text = f"contact at {format_quantity(s.mean, 'm/s')}"
    beside = []
    if s.high - s.low > 1e-3 * s.mean:
        beside.append(f"{format_quantity(s.low, 'm/s')} to {format_quantity(s.high, 'm/s')} in 90 % of the runs")
    if speed.predicted is not None:
        beside.append(f"{format_quantity(speed.predicted, 'm/s')} predicted")
    text += f" ({', '.join(beside)})" if beside else ""
    if speed.unmitigated is not None:
        text += f" instead of {format_quantity(speed.unmitigated.mean, 'm/s')} without mitigation"
    return text


def full_stop(text: str) -> str:
    """End a sentence, if it is not yet."""
    return text if text.endswith(".") else f"{text}."


def stability_in_words(check: StabilityCheck) -> str:
    """Say whether the sensor is fast enough.

    Args:
        check: the margin to instability and the rates.

    Returns:
        One or two sentences.
    """
    if math.isinf(check.margin) and math.isfinite(check.strongest):
        strongest = format_quantity(check.strongest, "N*s")
        return f"Without a gain nothing can oscillate; {strongest} would be the strongest stable one."
    if math.isinf(check.margin):
        return "No gain makes this loop unstable: the sensor is fast enough."
    if check.strongest == 0:
        return (
            f"No gain is stable on this loop, however weak: its own oscillation at {check.frequency:.3g} Hz is "
            "undamped or grows, and the virtual force comes too late to damp it."
        )
    enough = (
        "not fast enough" if check.margin < 1 else "fast enough, but only just" if check.margin < 2 else "fast enough"
    )
    text = f"The sensor is {enough}: it reads {check.rate:.6g} times a second, and {_rates(check)}."
    frequency = "" if math.isnan(check.frequency) else f" at {check.frequency:.3g} Hz"
    return text + (
        f" The loop begins to oscillate{frequency} from D_p = {format_quantity(check.strongest, 'N*s')} on, "
        f"{check.margin:.3g} times the gain, first at a distance of {format_quantity(check.critical_distance, 'm')}."
    )


def _rates(check: StabilityCheck) -> str:
    if math.isinf(check.lowest_rate):
        return "no rate is high enough for this gain: delay, filters or robot forbid it"
    text = f"this gain needs {check.lowest_rate:.3g} at the limit"
    if check.margin >= 1 and check.lowest_rate > check.rate:
        text += " (below that it is stable at some rates, as at this one, and unstable at others)"
    if math.isinf(check.lowest_rate_with_margin):
        return text + "; no rate is high enough for a margin of 2"
    return text + f", {check.lowest_rate_with_margin:.3g} for a margin of 2"


def no_stability_in_words(gain: float, damper: bool) -> str:
    """Say why nothing is said of stability.

    Args:
        gain: D_p [N s].
        damper: whether the law acts as a damper.

    Returns:
        A sentence.
    """
    if not damper:
        return (
            "How far the loop is from oscillating is not known: the limit is that of an impulse of D_p times the "
            "change of ln xi, which this law does not make."
        )
    return f"Nothing is said of stability: D_p = {format_quantity(gain, 'N*s')} does not mitigate."


def change_in_words(verdict: Verdict) -> str:
    """Say which one change would help most.

    Args:
        verdict: the verdict.

    Returns:
        A sentence; empty where no change was tried.
    """
    best, rate = verdict.best_change, rate_in_words(verdict)
    if best is None:
        text = "None of the changes that were tried helps by more than chance and 1 % of the objective."
        return f"{text} {rate}".strip() if verdict.changes else ""
    effects = []
    start = "" if best.standing >= 1 else "no single change is enough; the most helpful: "
    if best.held is not None:
        effects.append(f"what was missed then holds in {100 * best.held:.4g} % of the runs")
    if verdict.effect is not None and verdict.effect.is_harder and best.standing >= 1:
        effects.append("contact is then no harder than without mitigation")
    if verdict.stability is not None and verdict.stability.margin < 1 and best.margin is not None:
        effects.append(f"the margin to instability becomes {best.margin:.3g}")
    if best.improvement is not None:
        word = "falls" if best.improvement >= 0 else "grows"
        effects.append(f"the objective {word} by {100 * abs(best.improvement):.3g} %")
    text = start + best.sentence.removesuffix(".") + (f": {', '.join(effects)}." if effects else ".")
    return f"{text} {rate}".strip()


def rate_in_words(verdict: Verdict) -> str:
    """Say which rate of the sensor the verified gain asks for, where no change that was tried is enough.

    Args:
        verdict: the verdict.

    Returns:
        A sentence; empty where the margin is 2, or a change is enough.
    """
    check = verdict.stability
    if check is None or check.margin >= _MARGIN or _is_enough(verdict.best_change):
        return ""
    gain = f"With D_p = {format_quantity(verdict.gain or 0.0, 'N*s')}"
    if math.isfinite(check.lowest_rate_with_margin):
        return (
            f"{gain} the sensor would have to be read {check.lowest_rate_with_margin:.3g} times a second for a margin "
            "of 2 to instability."
        )
    text = f"{gain} no rate of the sensor is high enough for a margin of 2 to instability"
    if math.isfinite(check.lowest_rate):
        text += f", {check.lowest_rate:.3g} times a second at the limit"
    return f"{text}: delay, filters or robot forbid it."


def _is_enough(change: Change | None) -> bool:
    return change is not None and change.standing >= 1 and (change.margin is None or change.margin >= _MARGIN)


def best_gain_in_words(loss: Loss) -> str:
    """Say among which gains the best one on the loop was sought.

    Args:
        loss: what the verified gain costs beside it.

    Returns:
        A phrase, such as `best gain on this loop with a margin of 2 to instability`.
    """
    if loss.sought_margin is None:
        return "best gain on this loop"
    if loss.sought_margin >= _MARGIN:
        return f"best gain on this loop with a margin of {loss.sought_margin:g} to instability"
    return "best stable gain on this loop, where none within the bounds has a margin of 2 to instability"


def lacks_in_words(verdict: Verdict) -> str:
    """Say what the verified gain lacks that the best one on the loop has, where it seems to be better.

    Args:
        verdict: the verdict.

    Returns:
        Words that go on from `better`; empty where it lacks nothing: a search over fewer runs cannot tell more.
    """
    if not all(check.is_met for check in verdict.limits):
        return ", and misses a limit"
    if verdict.effect is not None and verdict.effect.is_harder:
        return ", and makes contact harder than without mitigation"
    check, loss = verdict.stability, verdict.loss
    if check is not None and loss is not None and check.margin < (loss.sought_margin or 0.0):
        return f", with a margin of only {check.margin:.3g} to instability"
    return ""
