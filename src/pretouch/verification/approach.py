"""Repeat the simulated runs from the distance at which the controller detects the object.

An encounter may start nearer than that. An object that comes from farther away is then met by another motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.designs import Task
from pretouch.motion import ContactResult
from pretouch.simulation.detection import DetectionRange, moved_on, time_at

from .appraisal import LoopProblem
from .checks import check_limits
from .result import ApproachCheck


def check_approach(
    problem: LoopProblem, detection: DetectionRange | None, predicted: ContactResult, gain: float
) -> ApproachCheck | None:
    """Repeat the runs from the detection distance, if it lies clearly beyond the start of the encounter.

    Returns:
        The result; None if the runs begin there anyway, or if the sensor curve does not reach farther.
    """
    draws = problem.draws
    task: Task = draws.task
    if detection is None or not detection.is_early or detection.moved is None:
        return None
    begins = detection.start if task.loop.start_distance is None else float(np.max(task.loop.start_distance))
    if not detection.distance > begins or not task.start_warnings(gain):
        return None
    times = _earlier(time_at(draws.scenarios, detection.distance))
    farther = replace(draws, scenarios=moved_on(draws.scenarios, times), ensemble=None)
    loop = replace(task.loop, horizon=task.loop.horizon + float(-times.min()), start_distance=None)
    outcomes = replace(problem, draws=farther).appraise(loop, gain)
    return ApproachCheck(
        start=detection.start,
        distance=detection.distance,
        cures=detection.cures,
        limits=check_limits(task, outcomes, predicted, gain),
        is_harder=outcomes.effect is not None and outcomes.effect.is_harder,
    )


def _earlier(times: FloatArray) -> FloatArray:
    """Return the times before the start [s]; 0 for an object that does not approach or starts farther away."""
    return np.asarray(np.where(np.isnan(times), 0.0, np.minimum(times, 0.0)))
