"""Judge whether a calibration recording has enough readings.

The slope of the sensor curve must be known accurately enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.errors import PretouchError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.calibration import Calibration, CalibrationReport, fit
from pretouch.calibration.averaging import average
from pretouch.calibration.result import uncertainty_in_words
from pretouch.designs import Task, design_gain
from pretouch.designs.gain import designed_number
from pretouch.uncertainty import reservations_of
from pretouch.verification.calibration_check import check_calibration

from .record_missing import MissingDistances, missing_distances
from .record_settling import robust_spread

_FEWEST: Final = 4  # distances from which curves are fitted
_ENDS: Final = "Distances at the ends of the range are missing."
_FLOOR: Final = 3.0  # standard deviations of the noise above the offset, as in a fit


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordGoal(Value):
    """Requirements for a calibration recording.

    Args:
        accuracy: largest allowed relative uncertainty of the slope g (95 %).
        nearest: smallest distance that is needed [m].
        farthest: largest distance that is needed [m]; None for a twentieth of the largest signal.
        limit: largest distance that can be set [m].
        load: reads the scenario with the recorded readings as calibration; None without a scenario.
    """

    accuracy: float = 0.05
    nearest: float = 0.0
    farthest: float | None = None
    limit: float = math.inf
    load: Callable[[], Task] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgment(Value):
    """Judgment on whether a calibration recording is sufficient.

    Args:
        is_enough: whether the slope g is known well enough.
        reason: why, or what is missing, in one sentence.
        missing: the distances that are missing.
        uncertainty: largest relative uncertainty of g (95 %); None before a fit.
        report: the fit; None with too few distances.
    """

    is_enough: bool
    reason: str
    missing: MissingDistances
    uncertainty: float | None = None
    report: CalibrationReport | None = None


def judge_recording(calibration: Calibration | None, goal: RecordGoal, *, final: bool = True) -> Judgment:
    """Judge whether a calibration determines the sensor slope accurately enough.

    The slope is g = d ln xi / dl.

    Args:
        calibration: the readings so far; None without any.
        goal: what the recording must achieve.
        final: whether to fit curves in any case; otherwise only if the distances reach far enough.

    Returns:
        The judgment: enough if the verdict of the fit is `usable`, the uncertainty of g is within the goal, the
        distances cover the needed range, and the scenario, if there is one, accepts the calibration.
    """
    if calibration is None:
        missing = missing_distances(
            np.empty(0), np.empty(0), 0.0, nearest=goal.nearest, farthest=goal.farthest, limit=goal.limit
        )
        return Judgment(is_enough=False, reason="No distance is recorded yet.", missing=missing)
    count = len(calibration.distinct_distances)
    if count < _FEWEST:
        reason = f"The number of recorded distances is {count}, but a fit needs at least {_FEWEST} distances."
        return Judgment(is_enough=False, reason=reason, missing=_missing(calibration, None, goal))
    if not final and len(calibration.no_object):  # with an unknown offset, a fit must find out what the signal is
        missing = _missing(calibration, None, goal)
        if missing.ends:
            return Judgment(is_enough=False, reason=_ENDS, missing=missing)
    report = fit(calibration)
    missing = _missing(calibration, report, goal)
    slope = None if report.slope is None else report.slope.largest
    reason = _objection(report, slope, missing, goal)
    if not reason and goal.load is not None:
        reason = _objection_of_scenario(goal.load)
    done = "" if slope is None else f"The slope g has an uncertainty of {uncertainty_in_words(slope)} (95 % confidence)"
    good = f"{done}{', which is good enough for the scenario' if goal.load is not None else ''}."
    return Judgment(is_enough=not reason, reason=reason or good, missing=missing, uncertainty=slope, report=report)


def _missing(calibration: Calibration, report: CalibrationReport | None, goal: RecordGoal) -> MissingDistances:
    """Return the distances at which a calibration needs more readings."""
    curve = average(calibration)
    empty: FloatArray = calibration.no_object
    offset = 0.0
    if report is not None and report.offset is not None:
        offset = report.offset.value
    elif len(empty):
        offset = float(np.median(empty))
    if report is not None and report.noise is not None:
        noise = report.noise.output
    else:
        noise = robust_spread(empty) if len(empty) else 0.0
    signals = curve.output - offset
    floor = max(_FLOOR * noise, 1e-12 * float(np.abs(curve.output).max()), 1e-300)
    return missing_distances(
        curve.distance, signals, floor, nearest=goal.nearest, farthest=goal.farthest, limit=goal.limit
    )


def _objection(report: CalibrationReport, slope: float | None, missing: MissingDistances, goal: RecordGoal) -> str:
    """Return a reason why the fit of the sensor curve is insufficient. The text is empty if the fit is good enough."""
    if report.verdict != "usable":
        return report.reasons[0]
    if slope is None or report.slope is None:
        return "The uncertainty of the slope g is unknown: record more distances."
    if slope > goal.accuracy:
        place = format_quantity(report.slope.worst_at, "m", 3)
        return (
            f"The slope g has an uncertainty of {uncertainty_in_words(slope)} (95 % confidence), but at most "
            f"{100 * goal.accuracy:g} % is allowed: record more readings at distances around {place}."
        )
    if missing.ends:
        return _ENDS
    return ""


def _objection_of_scenario(load: Callable[[], Task]) -> str:
    """Return why a calibration is insufficient for a scenario; empty if it is good enough."""
    try:
        task = load()
        report = task.calibration
        design = design_gain(task.replace(evaluate=None))
        gain = task.gain
        if gain is None:
            gain = design.gain if task.drag_effect is None else designed_number(task)
    except PretouchError as error:
        return str(error).splitlines()[0]
    if gain is None or report is None:  # no gain meets the limits, so more readings do not help
        return ""
    if task.loop is not None:
        check = check_calibration(task, report, float(gain))
        return "" if check is None or check.is_good_enough else check.text
    return reservations_of(report, design).headline or ""
