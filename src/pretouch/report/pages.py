"""Select the function that makes the page of a result.

This is the only table of results and their pages. The pages of a folder are imported when one of its results is shown.
"""

# ruff: noqa: PLC0415 - a short text of a design must not wait for the import of verification or robots

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

from pretouch._core.blocks import Page
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError

Rows: TypeAlias = dict[type[Described], Callable[[Any], Page]]


def _motion() -> Rows:
    from pretouch.motion.contact import ContactResult, Motion
    from pretouch.motion.page import contact_page, motion_page, scenario_page
    from pretouch.motion.scenario import Scenario

    return {Scenario: scenario_page, ContactResult: contact_page, Motion: motion_page}


def _calibration() -> Rows:
    from pretouch.calibration.page import calibration_page, fit_page
    from pretouch.calibration.result import CalibrationReport, SensorFit

    return {SensorFit: fit_page, CalibrationReport: calibration_page}


def _design() -> Rows:
    from pretouch.designs.admittance_page import admittance_page
    from pretouch.designs.admittance_result import AdmittanceDesign
    from pretouch.designs.gain import GainDesign
    from pretouch.designs.page import gain_page, task_page
    from pretouch.designs.task import Task

    return {Task: task_page, GainDesign: gain_page, AdmittanceDesign: admittance_page}


def _design_drag() -> Rows:
    from pretouch.designs.drag.page import drag_page
    from pretouch.designs.drag.result import DragDesign

    return {DragDesign: drag_page}


def _design_front() -> Rows:
    from pretouch.designs.front.page import front_page
    from pretouch.designs.front.result import ParetoFront

    return {ParetoFront: front_page}


def _design_robust() -> Rows:
    from pretouch.designs.robust.page import robust_page
    from pretouch.designs.robust.result import RobustDesign

    return {RobustDesign: robust_page}


def _verification() -> Rows:
    from pretouch.verification.candidates import CandidateComparison
    from pretouch.verification.candidates_page import candidates_page
    from pretouch.verification.encounter import SimulatedEncounter
    from pretouch.verification.encounter_page import encounter_page
    from pretouch.verification.page import verdict_page
    from pretouch.verification.result import Verdict

    return {SimulatedEncounter: encounter_page, Verdict: verdict_page, CandidateComparison: candidates_page}


def _robots() -> Rows:
    from pretouch.robots.page import projection_page, table_page
    from pretouch.robots.projection import Projection
    from pretouch.robots.result import RobotSimulation
    from pretouch.robots.simulation_page import robot_page
    from pretouch.robots.table import ProjectionTable

    return {Projection: projection_page, ProjectionTable: table_page, RobotSimulation: robot_page}


def _recording() -> Rows:
    from pretouch.recording.calibration_recheck import Recheck
    from pretouch.recording.recheck_page import recheck_page
    from pretouch.recording.record_page import recording_page
    from pretouch.recording.record_session import RecordedCalibration
    from pretouch.recording.replay_page import replay_page
    from pretouch.recording.result import Replay

    return {RecordedCalibration: recording_page, Recheck: recheck_page, Replay: replay_page}


def _export() -> Rows:
    from pretouch.exports.page import export_page
    from pretouch.exports.result import Export

    return {Export: export_page}


def _letter() -> Rows:
    from pretouch.letter.experiment import LetterReport
    from pretouch.letter.page import letter_page

    return {LetterReport: letter_page}


PAGES: Final[dict[str, Callable[[], Rows]]] = {
    "motion": _motion,
    "calibration": _calibration,
    "designs": _design,
    "designs.drag": _design_drag,
    "designs.front": _design_front,
    "designs.robust": _design_robust,
    "verification": _verification,
    "robots": _robots,
    "recording": _recording,
    "exports": _export,
    "letter": _letter,
}
"""The pages of the results that are defined in each folder."""


def page_of(result: Described) -> Page:
    """Create the report page that describes a result.

    Args:
        result: a result of a verb, or a task, scenario or motion.

    Returns:
        The page.

    Raises:
        InvalidInputError: no page describes objects of this class.
    """
    for kind in type(result).__mro__:  # a subclass has the page of its base class
        folder = kind.__module__.partition(".")[2].rpartition(".")[0]
        make = PAGES[folder]().get(kind) if folder in PAGES else None
        if make is not None:
            return make(result)
    raise InvalidInputError(
        f"result: found {result!r}, which no report page describes; pass a result of pretouch", value=result
    )
