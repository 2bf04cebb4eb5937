"""The letter's tables and figures as one self-contained HTML page, with every number in it."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from pretouch._core.files import write_text
from pretouch._core.json_text import as_json
from pretouch._core.units import pretty_unit
from pretouch.report.html import picture, render_page

from .comparison import Comparison, Verdict
from .result import Finding, LetterReport, Reproduction
from .wording import SHAPES, WORDS, difference, evidence, ours, over_inputs

__all__ = ["letter_report_html", "write_letter_report"]

CITATION: Final = "Optimization of Preemptive Impact Mitigation Without Prior Collision Testing"
Row = tuple[str, ...]

_LONG = 9  # rows from which a table is broken in two
_WIDE = 6.0  # inches from which a figure takes the whole width, with its code below it
_LEGEND: Final = {
    Verdict.AGREES: "ours lies within half a unit in the last printed place.",
    Verdict.WITHIN_INPUTS: "the printed number lies in the range of ours over inputs that round to the printed ones.",
    Verdict.DISAGREES: "neither of these; what explains it stands below the table.",
    Verdict.MEASURED: "the letter measured it on hardware; nothing says that the model must give the same.",
}


def letter_report_html(report: LetterReport) -> str:
    """Write a letter report as one self-contained HTML page.

    Args:
        report: what was reproduced, all of it or a part.

    Returns:
        The page, signed as pretouch's own.

    Examples:
        >>> "The letter, computed again" in letter_report_html(LetterReport())
        True
    """
    text = as_json(report.to_dict(), indent=None)
    findings = [(f, r) for r in report.reproductions for f in r.findings]
    return render_page(
        "letter.html.j2",
        citation=CITATION,
        holds=report.holds,
        tiles=[{"shape": SHAPES[v], "count": n, "meaning": v.meaning} for v, n in report.counts.items()],
        failures=list(_failures(report)),
        findings=[_finding(f, r) for f, r in sorted(findings, key=lambda pair: pair[0].id)],
        parts=[_part(r) for r in report.reproductions],
        legend=[{"shape": SHAPES[v], "word": WORDS[v], "text": text} for v, text in _LEGEND.items()],
        shapes={"good": SHAPES[Verdict.AGREES], "bad": SHAPES[Verdict.DISAGREES]},
        data=_embedded(text),
        data_uri=f"data:application/json,{quote(text, safe=',:')}",
        data_size=f"{max(1, round(len(text) / 1000))} kB",
    )


def write_letter_report(report: LetterReport, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a letter report to a file.

    Args:
        report: what was reproduced, all of it or a part.
        path: where the page goes.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    return write_text(path, letter_report_html(report), overwrite=overwrite)


def _embedded(text: str) -> Any:
    """Mark JSON for a script element, which ends at the first "</" that it holds."""
    from markupsafe import Markup  # noqa: PLC0415

    return Markup(text.replace("<", "\\u003c"))  # noqa: S704 - nothing in it can end the element


def _anchor(kind: str, name: object) -> str:
    """Make an identifier from a name; the kind keeps those of the parts apart from the page's own."""
    return f"{kind}-{re.sub(r'[^a-z0-9]+', '-', str(name).lower()).strip('-')}"


def _failures(report: LetterReport) -> Iterator[dict[str, str]]:
    """Yield what does not come out, with the place on the page where it stands."""
    for finding in report.findings:
        if not finding.holds:
            yield {"anchor": _anchor("finding", finding.id), "name": f"finding {finding.id}: {finding.title}"}
    for part in report.reproductions:
        for comparison in part.comparisons:
            if comparison.unexplained:
                yield {"anchor": _anchor("part", part.id), "name": f"{part.title}: {comparison.name}"}


def _finding(finding: Finding, part: Reproduction) -> dict[str, Any]:
    return {
        "anchor": _anchor("finding", finding.id),
        "id": finding.id,
        "title": finding.title.rstrip(". "),
        "place": finding.place,
        "statement": finding.statement,
        "evidence": [(step.name, _unbroken(evidence(step))) for step in finding.evidence],
        "holds": finding.holds,
        "part": {"anchor": _anchor("part", part.id), "title": part.title},
    }


def _columns(rows: list[Row]) -> list[list[Row]]:
    """Break a long table into two that stand side by side where there is room."""
    half = (len(rows) + 1) // 2
    return [column for column in ([rows] if len(rows) < _LONG else [rows[:half], rows[half:]]) if column]


def _unbroken(text: str) -> str:
    """Keep a number and its unit on one line; a sentence may break."""
    return text.replace(" ", "\u00a0") if len(text) < 24 else text


def _part(part: Reproduction) -> dict[str, Any]:
    """Collect the text and the picture of one reproduction."""
    places = {c.place for c in part.comparisons}
    return {
        "anchor": _anchor("part", part.id),
        "title": part.title,
        "place": part.place,
        "summary": part.summary,
        "marks": _marks(part),
        "findings": [_finding(f, part) for f in part.findings],
        "parameters": _columns(
            [
                (p.name.replace("_", " "), p.symbol, _unbroken(f"{p.printed} {pretty_unit(p.unit)}".strip()), p.place)
                for p in part.parameters
            ]
        ),
        "comparisons": [_comparison(c) for c in part.comparisons],
        "places": len(places) > 1,
        "place_of_all": next(iter(places)) if len(places) == 1 else "",
        "ranges": any(over_inputs(c) for c in part.comparisons),
        "reasons": list(_reasons(part)),
        "unexplained": [c.name for c in part.comparisons if c.unexplained],
        "tables": part.tables,
        "narrow": part.figure.get_size_inches()[0] < _WIDE,
        "figure": picture(part.figure, _anchor("figure", part.id)),
        "caption": part.caption,
        "code": part.code,
    }


def _marks(part: Reproduction) -> str:
    """Write the verdicts of a part as shapes with counts."""
    counts = Counter(c.verdict for c in part.comparisons)
    return "  ".join(f"{SHAPES[v]} {counts[v]}" for v in Verdict if counts[v])


def _comparison(comparison: Comparison) -> dict[str, Any]:
    return {
        "name": comparison.name,
        "place": comparison.place,
        "unit": pretty_unit(comparison.unit),
        "printed": comparison.printed,
        "ours": ours(comparison),
        "difference": difference(comparison),
        "range": over_inputs(comparison) or "\u2013",
        "shape": SHAPES[comparison.verdict],
        "word": WORDS[comparison.verdict],
        "alarm": comparison.verdict is Verdict.DISAGREES,
    }


def _reasons(part: Reproduction) -> Iterator[tuple[str, str]]:
    """Yield each reason once, with the names of all numbers that it explains."""
    names: dict[str, list[str]] = {}
    for comparison in part.comparisons:
        if comparison.reason:
            names.setdefault(comparison.reason, []).append(comparison.name)
    for reason, explained in names.items():
        everything = len(explained) == len(part.comparisons) > 1
        yield "all of them" if everything else "; ".join(explained), reason
