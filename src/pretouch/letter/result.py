"""What a reproduction comes to: numbers beside ours, what the program found, tables, a figure and its program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pretouch._core.values import Value

from .comparison import Comparison, Parameter, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DataTable", "Evidence", "Finding", "LetterReport", "Reproduction"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence(Value):
    """One step of the derivation of a finding.

    Args:
        name: what was computed.
        value: a number, a text, or whether a condition holds.
        unit: the unit of a number; empty for a pure one.
    """

    name: str
    value: float | str | bool
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Finding(Value):
    """What the program derived about the letter's text, beside single numbers.

    Args:
        id: the number of the point, 1 to 7 as they were first listed, and from 8 on what this program found itself.
        title: what is found, in a sentence.
        place: where in the letter.
        statement: the finding with its reason.
        evidence: the computed steps that it rests on.
        holds: whether every step came out so.
    """

    id: int
    title: str
    place: str
    statement: str
    evidence: tuple[Evidence, ...]
    holds: bool

    def to_dict(self) -> dict[str, Any]:
        """Return the finding in plain values."""
        return _fields(self, "id", "title", "place", "statement", "holds") | {
            "evidence": [_fields(e, "name", "value", "unit") for e in self.evidence]
        }

    def __repr__(self) -> str:
        return f"<Finding {self.id}: {self.title}{'' if self.holds else ': DOES NOT HOLD'}>"


@dataclass(frozen=True, slots=True, kw_only=True)
class DataTable(Value):
    """A table of numbers to read.

    Args:
        title: what it shows.
        head: column heads, with units.
        rows: its cells, as many per row as there are heads.
        note: what a reader should know.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Reproduction(Value):
    """One table, figure or section of the letter, computed again.

    Args:
        id: its name on the command line: "table-2".
        title: what it shows.
        place: where in the letter it stands.
        summary: what was done and what came out, in a few sentences.
        parameters: its inputs.
        comparisons: its numbers beside ours.
        findings: what was derived beyond single numbers.
        tables: numbers to read that the letter does not print.
        caption: what the figure shows.
        code: the program that makes the figure.
        figure: the figure that this program made.
        numbers: every number, for other programs: text to numbers, text, lists and mappings of these, all SI.
    """

    id: str
    title: str
    place: str
    summary: str
    parameters: tuple[Parameter, ...]
    comparisons: tuple[Comparison, ...]
    caption: str
    code: str
    figure: Figure = field(compare=False)
    numbers: Mapping[str, Any]
    findings: tuple[Finding, ...] = ()
    tables: tuple[DataTable, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every difference is explained and every finding came out."""
        return all(f.holds for f in self.findings) and not any(c.unexplained for c in self.comparisons)

    def __repr__(self) -> str:
        state = "holds" if self.holds else "DOES NOT HOLD"
        return f"<Reproduction {self.id}: {len(self.comparisons)} numbers, {len(self.findings)} findings, {state}>"

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the figure, in plain values."""
        return {
            "title": self.title,
            "place": self.place,
            "holds": self.holds,
            "parameters": [_fields(p, "name", "symbol", "value", "unit", "place") for p in self.parameters],
            "comparisons": [
                _fields(c, "name", "printed", "value", "unit", "difference", "low", "high", "place", "reason")
                | {"verdict": c.verdict.value}
                for c in self.comparisons
            ],
            "findings": [f.to_dict() for f in self.findings],
            "numbers": dict(self.numbers),
        }


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LetterReport(Value):
    """What `reproduce` returns.

    Args:
        reproductions: one for each table, figure and section asked for, in the order of the letter.
    """

    reproductions: tuple[Reproduction, ...] = field(default=())

    @property
    def holds(self) -> bool:
        """Whether this installation gives what the letter's equations give: all differences explained."""
        return all(r.holds for r in self.reproductions)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, in the order of their numbers."""
        return tuple(sorted((f for r in self.reproductions for f in r.findings), key=lambda f: f.id))

    @property
    def counts(self) -> dict[Verdict, int]:
        """How many printed numbers met each verdict."""
        found = Counter(c.verdict for r in self.reproductions for c in r.comparisons)
        return {verdict: found[verdict] for verdict in Verdict}

    def to_dict(self) -> dict[str, Any]:
        """Return every number, in plain values."""
        return {
            "holds": self.holds,
            "counts": {verdict.value: count for verdict, count in self.counts.items()},
            "findings": [f.to_dict() for f in self.findings],
            "reproductions": {r.id: r.to_dict() for r in self.reproductions},
        }

    def __repr__(self) -> str:
        names = ", ".join(r.id for r in self.reproductions)
        return f"<LetterReport {names}: {'holds' if self.holds else 'DOES NOT HOLD'}>"

    def __str__(self) -> str:
        """Return the text for a terminal."""
        from .text import report_text  # noqa: PLC0415 - text is laid out when it is asked for

        return report_text(self)


def _fields(thing: object, *names: str) -> dict[str, Any]:
    return {name: getattr(thing, name) for name in names}
