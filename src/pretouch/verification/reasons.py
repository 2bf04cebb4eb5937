"""Decide whether a gain passes the verification, and list the reasons."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.units import format_quantity
from pretouch.control import Controller, Status
from pretouch.designs import GainDesign
from pretouch.designs.robust.required import least_probability, runs_to_show
from pretouch.uncertainty.ensemble import share_in_words

from .appraisal import ROOM, USUAL_MARGIN
from .changed_loop import rounded_up
from .effect import LOST, OFTEN, Effect, VerdictStatus, chase_in_words, higher_in_words
from .result import LimitCheck, Verdict

_USED_UP: Final = 0.97  # share of the allowed excursion that counts as all of it
_MOST_SHARE: Final = 0.5  # share of the runs
_ROUNDING: Final = 1e-9  # relative rounding error of a speed or force
_SHOWN: Final = 5e-3  # relative; a smaller difference does not show in three digits
_CAUTIONS: Final = (0.7, 0.5)  # confidence levels of the share of runs from which a number of runs is computed
_MOST_RUNS: Final = 20_000  # more runs are not advised; another gain or loop is then better


def judged(v: Verdict) -> Verdict:
    """Return a verdict with its status and its reasons.

    The most serious reason comes first. There are none if the status is `holds`.
    """
    missed, narrow = list(_failures(v)), list(_narrow_reasons(v))
    status = VerdictStatus.HOLDS_NARROWLY if narrow else VerdictStatus.HOLDS
    return replace(v, status=VerdictStatus.DOES_NOT_HOLD if missed else status, reasons=(*missed, *narrow))


def no_gain_with_margin(design: GainDesign, rate: float) -> str:
    """Return a message that no gain has the required margin.

    The text includes the sensor rate that would be needed.
    """
    task, free = design.problem.task, design.without_margin
    optimum = design.number.equals(0.0 if free is None else free.gain)
    if math.isinf(rate):
        needed = "No sensor rate gives it this margin, because latency, filters or robot are too slow"
    else:
        needed = f"This gain has the required margin at a sensor rate of {rounded_up(rate):g} Hz or more"
        if rate > task.largest_sensor_rate:
            needed += f", but the {task.sensor_part.name} reaches at most {task.largest_sensor_rate:g} Hz"
    return (
        f"at a sensor rate of {task.loop.chain.rate:g} Hz, no gain with a gain margin of "
        f"{task.stability_margin:g} meets every limit. Without the required margin, the optimum would be {optimum}. "
        f"{needed}"
    )


def _failures(v: Verdict) -> Iterator[str]:
    """Yield the reasons why a gain fails, most serious first."""
    stability, reached, calibration = v.stability, v.reached, v.calibration_check
    yield from chase_in_words(v.law.number, v.gain)
    if stability is not None and stability.margin < 1:
        if stability.strongest == 0:
            yield "the loop is unstable with any gain, however weak"
        else:
            strongest = format_quantity(stability.strongest, v.law.number.unit)
            place = format_quantity(stability.critical_distance, "m")
            yield (
                f"the sampled loop is unstable with this gain, because the strongest stable gain is {strongest} at a "
                f"distance of {place}"
            )
    if reached is not None and reached.missing:
        when = f", but only near or after the horizon of {v.loop.horizon:g} s" if reached.late else ""
        yield f"{reached.missing} of {v.runs} runs end without contact, although contact was predicted{when}"
    cause = _used_up(v) + _force_limited(v)
    yield from (f"{cause}{reason}" for reason in _harm_reasons(v))
    if v.at_rest is not None and v.at_rest.reaches_object:
        place = format_quantity(v.at_rest.distance, "m", 3)
        yield f"{v.at_rest.text[0].lower()}{v.at_rest.text[1:]}, as far as an object at {place}"
    yield from (_limit_missed(check, v.runs) for check in v.limits if not check.is_met)
    if v.approach is not None:
        yield from (f"{v.approach.place}: {_limit_missed(check, v.runs)}" for check in v.approach.missed)
        if v.approach.is_harder:
            yield f"{v.approach.place}, contact is harder than without mitigation"
    if calibration is not None and not calibration.is_good_enough:
        yield calibration.reason


def _harm_reasons(v: Verdict) -> Iterator[str]:
    """Yield the reasons why a gain does not soften the contact."""
    effect, quiet = v.effect, v.noiseless_effect
    if effect is not None and effect.is_harder:
        yield f"contact is harder than without mitigation{_harder(effect)}"
    elif quiet is not None and quiet.is_harder:
        text = "even in simulations without sensor noise, contact is harder than without mitigation"
        yield text + _harder(quiet)
    elif effect is not None and effect.is_absent:
        speed, free = (format_quantity(value, "m/s") for value in (effect.speed, effect.unmitigated))
        yield (
            f"the gain has no effect: the average contact speed is {speed} with the gain, and {free} without mitigation"
        )
    elif effect is not None and effect.lost > LOST:
        yield f"most of the predicted mitigation is lost on the simulated loop: {_speeds(effect)}"
    predicted, free_end = v.predicted, v.design.no_mitigation
    if predicted is None or not predicted.reached.all():
        return
    own, before = abs(float(predicted.end.relative_velocity)), 0.0
    if free_end.reached.all():
        before = abs(float(free_end.end.relative_velocity))
    if own > before * (1 + _ROUNDING):
        yield (
            "contact is predicted to be harder than without mitigation: the predicted contact speed is "
            f"{format_quantity(own, 'm/s')} instead of "
            f"{format_quantity(before, 'm/s') if before else 'no contact'}"
        )


def _used_up(v: Verdict) -> str:
    """Return a clause that the robot uses up its allowed excursion before contact in most runs; otherwise empty."""
    law = v.loop.law
    limit = law.limits.excursion if isinstance(law, Controller) else None
    if limit is None or v.mitigated is None:
        return ""
    limited = (np.asarray(v.mitigated.flags).astype(np.int64) & int(Status.MOTION_LIMITED)) != 0
    used = limited & (np.asarray(v.mitigated.largest_excursion) >= _USED_UP * limit) & v.mitigated.touched
    share = float(used.mean())
    if share <= _MOST_SHARE:
        return ""
    return (
        f"the allowed excursion of {format_quantity(limit, 'm')} is used up before contact in "
        f"{share_in_words(share)} of {v.runs} runs; "
    )


def _force_limited(v: Verdict) -> str:
    """Return a clause that the virtual force reaches its limit before contact in most runs; otherwise empty."""
    law = v.loop.law
    limit = law.limits.force if isinstance(law, Controller) else None
    if limit is None or v.mitigated is None:
        return ""
    share = float((np.asarray(v.mitigated.largest_virtual_force) >= limit * (1 - _ROUNDING)).mean())
    if share <= _MOST_SHARE:
        return ""
    return (
        f"the virtual force reaches its limit of {format_quantity(limit, 'N')} (largest_force) in "
        f"{share_in_words(share)} of {v.runs} runs; "
    )


def _speeds(effect: Effect) -> str:
    """Return the simulated, predicted and unmitigated contact speed as text."""
    reached, predicted, free = (
        format_quantity(x or 0.0, "m/s", 3) for x in (effect.reached, effect.predicted, effect.unmitigated)
    )
    return f"the mean contact speed is {reached} (predicted speed: {predicted}; without mitigation: {free})"


def _harder(effect: Effect) -> str:
    """Say how much harder the gain makes contact."""
    if effect.difference <= 0:
        return f" in {effect.harder_count} of {effect.runs} runs"
    speed, free = (format_quantity(value, "m/s") for value in (effect.speed, effect.unmitigated))
    error = f" +- {effect.standard_error:.1g}" if effect.standard_error > 0 else ""
    return f": {speed} on average instead of {free} (+{effect.difference:.2g}{error} m/s)"


def _limit_missed(check: LimitCheck, runs: int) -> str:
    """Say in how many runs a limit is exceeded, and the allowed share."""
    limit = format_quantity(check.limit, check.unit)
    absent = "" if check.value is not None else " or no contact"
    share, allowed = (share_in_words(1 - x) for x in (check.held, check.required.probability))
    allowed = "none" if check.required.probability == 1 else allowed
    return f"{check.label} above {limit}{absent} in {share} of {runs} runs ({allowed} allowed)"


def _narrow_reasons(v: Verdict) -> Iterator[str]:
    """Yield the reasons why a gain passes only narrowly."""
    stability, reached, required = v.stability, v.reached, v.design.problem.task.stability_margin
    yield from _harder_than_promised(v)
    if stability is None:
        yield "the stability of the loop is not known"
    elif stability.margin >= 1 and misses_required_margin(v):
        yield (
            f"the gain margin is only {stability.margin:.3g}, and a margin of {required:g} is required "
            "(stability_margin)"
        )
    elif 1 <= stability.margin < USUAL_MARGIN:
        yield f"the gain margin is only {stability.margin:.3g}, and 2 or more is usual"
    for check in (check for check in v.limits if check.is_met):
        p = check.required.probability
        if _is_unshown(check):
            needed = _runs_to_show(check, v)
            low, confidence = share_in_words(check.low), f"{100 * v.confidence:g} % confidence"
            sentences = [
                f"the limit {check.statement} is met in {share_in_words(check.held)} of {v.runs} runs",
                f"This does not demonstrate the required probability of {100 * p:g} %",
                f"The runs demonstrate only a probability of {low} ({confidence})",
            ]
            if needed is not None:
                sentences.append(f"To demonstrate the required probability, simulate about {needed} runs")
            yield ". ".join(sentences)
        # The gain itself is chosen, not drawn at random, so a gain exactly at its limit is no reason.
        elif check.name != "gain" and check.margin is not None and check.margin < ROOM * check.limit:
            yield f"{check.statement} is met with a margin of only {format_quantity(check.margin, check.unit)}"
    report = v.design.problem.task.calibration
    if report is not None and report.verdict != "usable":
        yield f"the calibration is {report.verdict}"
    if reached is None or reached.predicted:
        return
    if reached.simulated:
        share = share_in_words(reached.simulated)
        yield f"no contact is predicted with this gain, but contact occurs in {share} of the runs"
    elif v.unmitigated is None or not v.unmitigated.touched.any():
        yield "no contact occurs even without mitigation, so these encounters do not show what the gain does"


def _is_unshown(check: LimitCheck) -> bool:
    """Return True if the runs do not demonstrate a met limit.

    No bound can reach 1; a requirement of 1 applies only to the simulated runs.
    """
    return check.is_met and check.low < check.required.probability < 1


def _runs_to_show(check: LimitCheck, v: Verdict) -> int | None:
    """Return how many runs are likely to demonstrate a limit."""
    return likely_runs(round(check.held * v.runs), v.runs, check.required.probability, v.confidence)


def likely_runs(held: int, count: int, probability: float, confidence: float) -> int | None:
    """Return how many runs are likely to demonstrate a probability.

    The share of the simulated runs may be too good by chance, so a lower bound of it is used, if the runs allow it.

    Args:
        held: number of simulated runs that meet the limit.
        count: number of simulated runs.
        probability: the required probability.
        confidence: confidence level of its lower bound.

    Returns:
        The number of runs, rounded up; None if too many are needed.
    """
    for share in (*(least_probability(held, count, caution) for caution in _CAUTIONS), held / count):
        needed = runs_to_show(share, probability, confidence)
        if needed is not None and needed <= _MOST_RUNS:
            return int(rounded_up(needed))
    return None


def misses_required_margin(v: Verdict) -> bool:
    """Return True if the gain margin is visibly smaller than the required one."""
    required = v.design.problem.task.stability_margin
    return required is not None and v.stability is not None and v.stability.margin < required * (1 - _SHOWN)


def lacks_only_runs(v: Verdict) -> bool:
    """Return True if the only reservation is that the runs are too few to demonstrate a limit."""
    unshown = [check for check in v.limits if _is_unshown(check)]
    return bool(unshown) and len(unshown) == len(v.reasons)


def runs_advised(v: Verdict) -> int | None:
    """Return the number of runs that are likely to demonstrate every limit.

    None if more runs alone do not help.
    """
    needed = [_runs_to_show(check, v) for check in v.limits if _is_unshown(check)]
    if not lacks_only_runs(v) or None in needed:
        return None
    return max(v.runs, *(count for count in needed if count is not None))


def _harder_than_promised(v: Verdict) -> Iterator[str]:
    """Yield the reasons why contact is harder than expected, or than with a faster sensor."""
    effect, sensor, allowed = v.effect, v.sensor_speed, 100 * v.speed_tolerance
    if effect is not None and effect.excess is not None and v.speed_tolerance < effect.excess and effect.lost <= LOST:
        yield (
            f"{_force_limited(v)}the contact speed is {higher_in_words(effect.excess, 'predicted')}, more than "
            f"the tolerance of {allowed:.3g} %: {_speeds(effect)}"
        )
    if sensor is not None and not sensor.is_fast_enough:
        yield f"the sensor is too slow: {sensor.excess_in_words}"
    if effect is None or effect.is_harder or effect.is_absent:
        return
    if not effect.is_softer:
        yield (
            f"contact is not significantly softer than without mitigation: over {effect.runs} runs, the "
            f"contact speeds differ by {effect.difference:.2g} m/s on average (standard error: "
            f"{effect.standard_error:.1g} m/s)"
        )
    if effect.harder_count > OFTEN * effect.runs:
        share = share_in_words(effect.harder_count / effect.runs)
        yield f"in {share} of the runs, contact is harder than without mitigation"
