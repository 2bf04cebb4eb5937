"""Say what to do next after a verification, the most urgent step first."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.warning_codes import split_code
from pretouch.designs import DesignStatus, Task
from pretouch.designs.gain import designed_number
from pretouch.designs.page_sentences import step_without_gain
from pretouch.motion.page_sections import approach_step, mitigating_step

from .appraisal import USUAL_MARGIN
from .changed_loop import rounded_up, with_settings
from .reasons import runs_advised
from .result import Advice, Verdict
from .run_warnings import detection_step
from .settings import settings_between

_IDEAL: Final = ". This is enough for the ideal design; the sampled loop may need more"
_ENOUGH: Final = ". This rate gives the optimal gain its gain margin; the limits in simulated runs may need more"
_LATER: Final = 1.3  # factor on the latest predicted contact


def next_step(task: Task, verdict: Verdict, search: Callable[[], Advice | None] | None = None) -> Advice | None:
    """Return the first step that applies.

    Args:
        task: the verified task.
        verdict: its verdict.
        search: searches for another gain or loop; None if no change is wanted.

    Returns:
        The step; None if the verdict holds and nothing improves it.
    """
    return next((step for step in _steps(task, verdict, search) if step is not None and step.sentence), None)


def _steps(task: Task, v: Verdict, search: Callable[[], Advice | None] | None) -> Iterator[Advice | None]:
    """Yield steps, most urgent first. Some may be None, or have no sentence."""
    if not (v.reached is not None and v.reached.simulated):
        yield Advice(kind="approach", sentence=approach_step(v.scenario))
    if v.gain is None:
        if search is not None:
            yield search()
        yield Advice(kind="design", sentence=_step_without_gain(v))
        return
    yield from _before_gain(task, v)
    if search is not None and _is_searchable(v):
        yield search()
    yield from _without_search(v, v.gain)


def _before_gain(task: Task, v: Verdict) -> Iterator[Advice | None]:
    """Yield what to mend before another gain is sought."""
    if v.mitigated is not None and np.isnan(v.mitigated.detection_time).all():
        yield Advice(kind="detection", sentence=detection_step(v.loop))
    yield _start_at_detection(task, v)
    if v.calibration_check is not None and not v.calibration_check.is_good_enough:
        yield Advice(kind="calibration", sentence=v.calibration_check.remedy)
    yield _longer_horizon(task, v)
    yield _more_runs(task, v)


def _is_searchable(v: Verdict) -> bool:
    """Return True if another gain or loop can be compared by the contacts that it leads to.

    With an unstable gain, the motion at rest says nothing about the noise.
    """
    is_stable = v.stability is None or v.stability.margin > 1
    if is_stable and v.at_rest is not None and v.at_rest.reaches_object and v.at_rest.quiet_floor is None:
        return False  # no floor keeps the noise away
    return v.reached is not None and bool(v.reached.predicted or v.reached.simulated)


def _without_search(v: Verdict, gain: float) -> Iterator[Advice]:
    """Yield what helps if no other gain and no change of the loop was found."""
    report = v.design.problem.task.calibration
    if v.law.number.sign * gain < 0:
        yield Advice(kind="gain", sentence=mitigating_step(v.law.number, gain))
    if v.stability is not None and v.stability.margin < 1 and math.isfinite(v.stability.strongest):
        weaker = v.law.number.equals(v.stability.strongest / USUAL_MARGIN)
        yield Advice(kind="gain", sentence=f"use a weaker gain: {weaker} has a gain margin of {USUAL_MARGIN:g}")
    if v.at_rest is not None and v.at_rest.reaches_object:
        yield Advice(kind="floor", sentence=v.at_rest.remedy(v.loop.law))
    if v.sensor_speed is not None and not v.sensor_speed.is_fast_enough:
        task, rate = v.design.problem.task, v.loop.chain.rate
        text = f"read the sensor much faster than at {rate:g} Hz"
        if rate >= task.largest_sensor_rate:
            text = f"use a much faster sensor than the {task.sensor_part.name}"
        yield Advice(kind="sensor", sentence=text)
    if v.reasons and report is not None and report.reasons and report.verdict != "usable":
        first = split_code(report.reasons[0])[1].removesuffix(".")
        yield Advice(kind="calibration", sentence=f"improve the calibration: {first}")
    if v.changes and v.reasons:
        yield Advice(kind="none", sentence="none of the tried changes helps; see the report for the causes")


def _step_without_gain(v: Verdict) -> str:
    """Recommend what to change if no gain meets the requirements."""
    if v.needed_rate is None:
        design = v.design
        contact = design.status is not DesignStatus.NO_CONTACT
        step = step_without_gain(
            design.problem.task, contact=contact, relaxations=design.relaxations, design=designed_number
        )
        return f"{step}{_IDEAL if design.relaxations else ''}"
    if math.isinf(v.needed_rate):
        return "shorten latency and filters, or relax a limit: no sensor rate results in the required gain margin"
    task = v.design.problem.task
    if v.needed_rate > task.largest_sensor_rate:
        return (
            f"use a faster sensor than the {task.sensor_part.name}, which reaches at most "
            f"{task.largest_sensor_rate:g} Hz, shorten latency and filters, or relax one of the limits: with a gain "
            f"margin of {task.stability_margin:g}, the best gain needs {rounded_up(v.needed_rate):g} Hz"
        )
    return (
        f"read the sensor at {rounded_up(v.needed_rate):g} Hz instead of {v.loop.chain.rate:g} Hz, or relax one of "
        f"the limits{_ENOUGH}"
    )


def _start_at_detection(task: Task, v: Verdict) -> Advice | None:
    """Return the advice to start where the controller detects the object; None if this is no reason.

    The gain must be designed again for this start, so that no gain for the present start is searched.
    """
    if v.approach is None or v.approach.is_met:
        return None
    detection = task.loop.detection(task.scenario, task.sensor)
    uncertain = {"obstacle.position", "obstacle.velocity"} & set(task.uncertainty)
    plain = Advice(kind="start", sentence=f"{v.approach.cures}, and design again")
    if detection is None or detection.moved is None:
        return plain
    changed, sentence = task.replace(scenario=detection.moved), plain.sentence
    # beyond the curve, the distance is unknown; another position would need another distribution, too
    fixed = detection.is_beyond_curve or "obstacle.position" in uncertain
    if fixed and detection.floor_at_start is None:
        return plain
    if detection.floor_at_start is not None and (fixed or designed_number(changed.replace(gain=None)) is None):
        floor = float(f"{detection.floor_at_start:.3g}")
        changed = task.replace(loop=with_settings(task.loop, conditioning={"floor": floor}))
        if "obstacle.position" in uncertain:
            sentence = f"set floor = {floor:g} in [controller], and design again"
    settings = settings_between(task, changed)
    return plain if uncertain & set(settings) else Advice(kind="start", sentence=sentence, settings=settings)


def _longer_horizon(task: Task, v: Verdict) -> Advice | None:
    """Return the advice to wait longer for the slowest encounters."""
    if v.reached is None or not v.reached.late:
        return None
    horizon = rounded_up(_LATER * max(v.reached.latest, v.loop.horizon))
    longer = task.replace(loop=replace(task.loop, horizon=horizon))
    text = f"set a longer horizon of the loop: {horizon:g} s instead of {v.loop.horizon:g} s"
    return Advice(kind="horizon", sentence=text, settings=settings_between(task, longer))


def _more_runs(task: Task, v: Verdict) -> Advice | None:
    """Return the advice to simulate more runs, if the verdict lacks nothing else."""
    runs = runs_advised(v)
    if runs is None:
        return None
    more = task.replace(verify=replace(task.verify, runs=runs))
    return Advice(kind="runs", sentence=f"simulate {runs} runs", settings=settings_between(task, more))
