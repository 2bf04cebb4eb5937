"""Whether a gain holds by all that was found, and every reason why it does not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pretouch._core.units import format_quantity
from pretouch.uncertainty.ensemble import share_in_words

from .appraisal import ROOM, USUAL_MARGIN
from .effect import OFTEN, Effect, VerdictStatus, chase_in_words
from .encounter_parts import percent
from .result import LimitCheck, Verdict

_ROUNDING: Final = 1e-9  # of a speed


def judge(v: Verdict) -> tuple[VerdictStatus, tuple[str, ...]]:
    """Return the status and the reasons why it is not `holds`, the graver first."""
    missed, narrow = list(_missed(v)), list(_narrow(v))
    if missed:
        return VerdictStatus.DOES_NOT_HOLD, (*missed, *narrow)
    return VerdictStatus.HOLDS_NARROWLY if narrow else VerdictStatus.HOLDS, tuple(narrow)


def _missed(v: Verdict) -> Iterator[str]:
    """Say what is missed, worst first."""
    stability, reached, calibration = v.stability, v.reached, v.calibration_check
    yield from chase_in_words(v.law.number, v.gain)
    if stability is not None and stability.margin < 1:
        if stability.strongest == 0:
            yield "the loop is unstable with any gain, however weak"
        else:
            strongest = format_quantity(stability.strongest, v.law.number.unit)
            place = format_quantity(stability.critical_distance, "m")
            yield f"the loop is unstable: {strongest} is the strongest stable gain, at a distance of {place}"
    if reached is not None and reached.missing:
        yield f"{reached.missing} of {v.runs} runs end without the contact that is predicted"
    yield from _harmful(v)
    yield from (_limit_missed(check, v.runs) for check in v.limits if not check.is_met)
    if calibration is not None and not calibration.is_good_enough:
        yield calibration.reason


def _harmful(v: Verdict) -> Iterator[str]:
    """Say that contact is no softer with the gain than without, in the runs, without noise, or as predicted."""
    effect, quiet = v.effect, v.noiseless_effect
    if effect is not None and effect.is_harder:
        yield f"contact is harder than without mitigation{_harder(effect)}"
    elif quiet is not None and quiet.is_harder:
        yield f"contact is harder than without mitigation even without noise{_harder(quiet)}"
    elif effect is not None and effect.is_absent:
        speed, free = (format_quantity(value, "m/s") for value in (effect.speed, effect.unmitigated))
        yield f"the gain has no effect: contact is at {speed} on average, and at {free} without mitigation"
    predicted, free_end = v.predicted, v.design.no_mitigation
    if predicted is None or not predicted.reached.all():
        return
    own, before = abs(float(predicted.end.relative_velocity)), 0.0
    if free_end.reached.all():
        before = abs(float(free_end.end.relative_velocity))
    if own > before * (1 + _ROUNDING):
        yield (
            f"contact is predicted to be harder than without mitigation: {format_quantity(own, 'm/s')} instead of "
            f"{format_quantity(before, 'm/s') if before else 'no contact'}"
        )


def _harder(effect: Effect) -> str:
    """Say by how much contact is harder on average, or in how many runs."""
    if effect.difference <= 0:
        return f" in {effect.harder} of {effect.runs} runs"
    speed, free = (format_quantity(value, "m/s") for value in (effect.speed, effect.unmitigated))
    error = f" +- {effect.standard_error:.1g}" if effect.standard_error > 0 else ""
    return f": {speed} on average instead of {free} (+{effect.difference:.2g}{error} m/s)"


def _limit_missed(check: LimitCheck, runs: int) -> str:
    """Say that a limit is missed, how often and by how much."""
    p = check.required.probability
    required = "always" if p == 1 else f"in {100 * p:g} %"
    text = f"{check.statement} holds in {round(check.held * runs)} of {runs} runs, and must {required}"
    if check.value is not None:
        worst = "the worst run reaches" if p == 1 else f"{100 * p:g} % of the runs stay within"
        text += f" ({worst} {format_quantity(check.value, check.unit)})"
    return text


def _narrow(v: Verdict) -> Iterator[str]:
    """Say what is near, or not shown."""
    stability, reached = v.stability, v.reached
    yield from _harder_than_promised(v)
    if stability is None:
        yield "how far the loop is from instability is not known"
    elif 1 <= stability.margin < USUAL_MARGIN:
        yield f"a gain {stability.margin:.3g} times as strong makes the loop unstable, where a margin of 2 is usual"
    for check in (check for check in v.limits if check.is_met):
        p = check.required.probability
        if check.low < p < 1:  # no bound can reach 1, which is asked of the runs alone
            yield (
                f"{check.statement} holds in {share_in_words(check.held)} of the runs, which shows at least "
                f"{share_in_words(check.low)} at {100 * v.confidence:g} % confidence, where {100 * p:g} % are required"
            )
        # the gain is chosen, and on its limit as good as within
        elif check.name != "gain" and check.margin is not None and check.margin < ROOM * check.limit:
            yield f"{check.statement} has no more than {format_quantity(check.margin, check.unit)} of room"
    if reached is not None and not reached.predicted:
        share = share_in_words(reached.simulated)
        yield f"no contact is predicted with this gain, and {share} of the runs come to one"


def _harder_than_promised(v: Verdict) -> Iterator[str]:
    """Say that contact is harder than predicted, or than with a faster sensor, or not shown to be any softer."""
    effect, sensor, allowed = v.effect, v.sensor_speed, 100 * v.speed_tolerance
    if effect is not None and effect.excess is not None and effect.excess > v.speed_tolerance:
        reached, predicted = (format_quantity(x or 0.0, "m/s") for x in (effect.reached, effect.predicted))
        yield (
            f"contact is {percent(effect.excess)} harder than predicted, {reached} on average instead of "
            f"{predicted} ({allowed:.3g} % are allowed)"
        )
    if sensor is not None and not sensor.is_fast_enough:
        yield (
            f"the sensor is too slow: in 95 % of the runs contact is {sensor.harder_in_words} than with an infinitely "
            f"fast one ({allowed:.3g} % are allowed)"
        )
    if effect is None or effect.is_harder or effect.is_absent:
        return
    if not effect.is_softer:
        yield (
            f"that contact is softer than without mitigation is not shown: {effect.difference:.2g} +- "
            f"{effect.standard_error:.1g} m/s over {effect.runs} runs"
        )
    if effect.harder > OFTEN * effect.runs:
        share = share_in_words(effect.harder / effect.runs)
        yield f"in {share} of the runs contact is harder than without mitigation"
