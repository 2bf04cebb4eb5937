"""Build the report on an exported control law."""

from __future__ import annotations

from collections.abc import Iterator

from pretouch._core.blocks import Cell, Page, PageSection, PageTable
from pretouch._core.warning_codes import caution
from pretouch.verification.page import verdict_page

from .law_design import UNKNOWN
from .result import Export


def _warnings(export: Export) -> Iterator[str]:
    """Yield warnings about missing limits and about the verification."""
    if export.is_written and export.verdict is None:
        for text in export.attraction:
            yield caution("PT316", f"{text}.")
        if export.is_idle:
            yield caution("PT316", "The number of the law is 0, so the law never moves the robot.")
        yield caution(
            "PT316",
            f"The exported law is not verified: run pretouch verify before you use it. Unknown are {UNKNOWN}.",
        )
    if export.is_written and not export.is_limited:
        yield caution(
            "PT416",
            "The law limits neither force nor motion, so a faulty sensor can move the robot as far as its drive "
            "allows: set largest_force and largest_excursion in [controller].",
        )
    yield from export.warnings if export.verdict is None else verdict_page(export.verdict).warnings


def export_page(export: Export) -> Page:
    """Create the report on the export of a control law."""
    rows: list[tuple[str, Cell]] = [(path.name, str(path)) for path in export.files]
    return Page(
        kind=f"Export as {export.kind}",
        headline=export.headline,
        status="exported" if export.is_written else "not exported",
        good=export.is_written,
        warnings=tuple(_warnings(export)),
        next_step=export.next_step,
        blocks=(PageSection(title="Files", blocks=(PageTable(rows=tuple(rows)),), opened=True),) if rows else (),
    )
