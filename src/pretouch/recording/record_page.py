"""Build the report on a recorded calibration."""

from __future__ import annotations

from pretouch._core.blocks import Cell, Page, PageSection, PageTable
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution
from pretouch.calibration.result import uncertainty_in_words

from .record_session import RecordedCalibration


def recording_page(recording: RecordedCalibration) -> Page:
    """Create the report page on a calibration recording."""
    judgment = recording.judgment
    figures: list[tuple[str, Cell]] = []
    if judgment.report is not None and judgment.report.best is not None:
        slope = judgment.report.best.middle_slope
        figures.append(("slope g in the middle", f"{slope.value:.4g} 1/m"))
    if judgment.uncertainty is not None:
        figures.append(("largest uncertainty of g; 95 %", uncertainty_in_words(judgment.uncertainty)))
    missing = ", ".join(format_quantity(d, "m") for d in judgment.missing.all)
    if missing and not judgment.is_enough:
        figures.append(("missing distances", missing))
    resume = "continue with --resume" if not judgment.is_enough else ""
    rows: tuple[tuple[Cell, ...], ...] = (("readings that count", recording.path), ("all readings", recording.raw))
    return Page(
        kind="RecordedCalibration",
        headline=recording.headline,
        status="enough" if judgment.is_enough else "not enough",
        good=judgment.is_enough,
        key_figures=tuple(figures),
        warnings=tuple(caution("PT602", note) for note in recording.notes),
        next_step=resume or f"pretouch fit {recording.path}",
        blocks=(PageSection(title="Files", blocks=(PageTable(rows=rows, brief=True),), opened=True),),
    )
