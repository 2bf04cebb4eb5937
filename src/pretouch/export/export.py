"""Verify a control law, write the files of an export, and describe the result."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pretouch._core.blocks import Cell, Described, Page, PageSection, PageTable, page_of
from pretouch._core.files import plain, refuse_input
from pretouch._core.values import Value
from pretouch.design import Task
from pretouch.verification import Verdict

from .folder import check_free, write_folder
from .law_design import law_design


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Export(Described, Value):
    """Result of an export: the files that were written, or the verdict for which nothing was written.

    Args:
        kind: name of the format, such as "C".
        folder: the folder.
        files: paths of the files; empty if nothing was written.
        law: the law and its number in words.
        verdict: the verdict; None if the gain was not verified.
    """

    kind: str
    folder: Path
    files: tuple[Path, ...]
    law: str
    verdict: Verdict | None

    page: ClassVar[str] = "pretouch.export.export:export_page"

    @property
    def is_written(self) -> bool:
        """True if the files were written."""
        return bool(self.files)

    @property
    def headline(self) -> str:
        """What was written, or why nothing was written, in one sentence."""
        if not self.is_written:
            assert self.verdict is not None  # noqa: S101 - only a verdict prevents an export
            return f"Nothing was exported, because the verdict is negative. {self.verdict.headline}"
        verified = "not verified" if self.verdict is None else self.verdict.status.value.replace("-", " ")
        return f"Exported to {self.folder} as {self.kind}: {self.law} ({verified})."

    @property
    def next_step(self) -> str:
        """What the user should do next."""
        if not self.is_written:
            return "run pretouch verify for the reasons; --unverified exports the law in spite of them"
        return f"read {self.folder / 'README.md'}, and run its test on the target"

    def to_dict(self) -> dict[str, Any]:
        """Return the result as one JSON object."""
        fields: dict[str, Any] = plain(
            {
                "status": "exported" if self.is_written else "not-exported",
                "headline": self.headline,
                "kind": self.kind,
                "folder": str(self.folder),
                "files": [str(path) for path in self.files],
                "law": self.law,
                "verdict": None if self.verdict is None else self.verdict.status,
            }
        )
        return fields

    def __repr__(self) -> str:
        return f"<Export: {len(self.files)} files in {self.folder}>"


def export_files(
    task: Task,
    folder: str | os.PathLike[str],
    make: Callable[[Any], Mapping[str, str | bytes]],
    *,
    kind: str,
    verify: bool,
    date: str | None,
    overwrite: bool,
) -> Export:
    """Verify a task, make the files of an export, and write them unless the verdict is negative.

    Args:
        task: the task.
        folder: the new folder.
        make: returns the content of each file from a `LawDesign`.
        kind: what is exported, for the result.
        verify: whether to verify the gain first.
        date: date of the verification.
        overwrite: whether an unchanged earlier export may be replaced.

    Returns:
        The result.
    """
    refuse_input(folder, getattr(task.source, "inputs", ()))
    check_free(folder, overwrite=overwrite)  # before the verification, which takes seconds
    design = law_design(task, verify=verify, date=date)
    files: tuple[Path, ...] = ()
    if design.is_supported or not verify:
        content = {name: text.encode() if isinstance(text, str) else text for name, text in make(design).items()}
        files = write_folder(folder, content, overwrite=overwrite)
    return Export(kind=kind, folder=Path(folder), files=files, law=design.law_text, verdict=design.verdict)


def export_page(export: Export) -> Page:
    """Create the report on an export."""
    rows: list[tuple[str, Cell]] = [(path.name, str(path)) for path in export.files]
    return Page(
        kind=f"Export as {export.kind}",
        headline=export.headline,
        status="exported" if export.is_written else "not exported",
        good=export.is_written,
        warnings=() if export.verdict is None else page_of(export.verdict).warnings,
        next_step=export.next_step,
        blocks=(PageSection(title="Files", blocks=(PageTable(rows=tuple(rows)),)),) if rows else (),
    )
