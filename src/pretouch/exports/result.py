"""Define the result of exporting a control law."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pretouch._core.display import Described
from pretouch._core.files import plain
from pretouch._core.values import Value
from pretouch.verification import Verdict
from pretouch.verification.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Export(Described, Value):
    """Result of exporting a control law.

    A negative verdict prevents the export, and the result has no files.

    Args:
        kind: name of the format, such as "C".
        folder: the folder.
        files: paths of the files; empty if nothing was written.
        law: the law and its number in words.
        verdict: the verdict; None if the gain was not verified.
        is_limited: whether the law limits force, speed, acceleration or excursion.
        is_idle: whether the gain or drag is 0, so that the law has no effect.
        attraction: sentences on a law that pulls the robot toward the object; empty for a mitigating law.
        warnings: warnings about the scenario.
    """

    kind: str
    folder: Path
    files: tuple[Path, ...]
    law: str
    verdict: Verdict | None
    is_limited: bool = True
    is_idle: bool = False
    attraction: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def is_written(self) -> bool:
        """True if the export wrote its files."""
        return bool(self.files)

    @property
    def headline(self) -> str:
        """Summary of the export or of the failed verification."""
        if not self.is_written:
            assert self.verdict is not None  # noqa: S101 - only a verdict prevents an export
            return f"Nothing was exported, because the gain failed its verification. {self.verdict.headline}"
        verified = "not verified"
        if self.verdict is not None:
            reason = f": {self.verdict.reasons[0]}" if self.verdict.reasons else ""
            verified = f"{self.verdict.status.value.replace('-', ' ')}{reason}"
        return f"Exported to {self.folder} as {self.kind}: {self.law} ({verified})."

    @property
    def next_step(self) -> str:
        """Advice on what the user should do after the export."""
        if not self.is_written and self.attraction:
            return "change the sign of the gain"
        if not self.is_written:
            gain = _as_option(self.verdict)
            return f"run pretouch verify with the same file{gain}: it says why, and searches for a remedy"
        if self.verdict is None:
            return "run pretouch verify with the same file and gain, and export the law again without --unverified"
        return f"read {self.folder / 'README.md'}, and run its test on the target"

    def to_dict(self) -> dict[str, Any]:
        """Return the result of the export as one JSON object."""
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


def _as_option(verdict: Verdict | None) -> str:
    """Return the verified gain as an option of a command."""
    if verdict is None or verdict.gain is None:
        return ""
    return f' and --gain "{setting(verdict.gain, verdict.law.number.unit)}"'
