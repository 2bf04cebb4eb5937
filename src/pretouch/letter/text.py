"""What a letter report says on a terminal."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator

from .comparison import Comparison, Verdict
from .result import Finding, LetterReport, Reproduction
from .wording import WORDS, evidence, failed, ours

__all__ = ["report_text"]

WIDTH = 110


def report_text(report: LetterReport) -> str:
    """Lay out a letter report for a terminal.

    Args:
        report: what was reproduced.

    Returns:
        A line for each reproduction, the findings, every number that disagrees, and a closing line.

    Examples:
        >>> print(report_text(LetterReport()))
        nothing was reproduced
    """
    if not report.reproductions:
        return "nothing was reproduced"
    total = sum(report.counts.values())
    lines = [f"The letter computed again: {total} printed numbers beside ours", "", *_overview(report)]
    if report.findings:
        lines += ["", "what was found:"]
        lines += [line for finding in report.findings for line in _finding(finding)]
    found = [(r, c) for r in report.reproductions for c in r.comparisons if c.verdict is Verdict.DISAGREES]
    if found:
        lines += ["", "printed numbers that disagree with ours:"]
        lines += [line for pair in found for line in _disagreement(*pair)]
    return "\n".join([*lines, "", *_closing(report)])


def _overview(report: LetterReport) -> list[str]:
    """Align a row for each reproduction and one for all: titles to the left, counts to the right, zeros left out."""
    heads = list(WORDS.values())
    first = max(len(r.id) for r in report.reproductions)
    room = WIDTH - first - sum(len(head) + 2 for head in heads) - 2
    rows = [
        (r.id, textwrap.shorten(r.title, room, placeholder=" ..."), Counter(c.verdict for c in r.comparisons))
        for r in report.reproductions
    ]
    rows.append(("all", "", Counter(report.counts)))
    second = max(len(title) for _, title, _ in rows)
    lines = [f"{'':{first}}  {'':{second}}  {'  '.join(heads)}"]
    for name, title, counts in rows:
        cells = "  ".join(f"{counts[verdict] or '':>{len(head)}}" for verdict, head in WORDS.items())
        lines.append(f"{name:<{first}}  {title:<{second}}  {cells}".rstrip())
    return lines


def _finding(finding: Finding) -> Iterator[str]:
    state = "holds" if finding.holds else "DOES NOT HOLD"
    yield from _wrapped(f"{finding.id:>3}. ", f"{finding.title.rstrip('. ')}: {state}")
    if not finding.holds:
        steps = [step for step in finding.evidence if failed(step)] or finding.evidence
        for step in steps:
            yield from _wrapped("       ", f"{step.name}: {evidence(step)}")


def _disagreement(reproduction: Reproduction, comparison: Comparison) -> Iterator[str]:
    unit = comparison.unit.replace("*", " ")
    yield from _wrapped("  ", f"{reproduction.id}, {comparison.name} ({comparison.place})")
    numbers = f"printed {comparison.printed} {unit}".rstrip() + f", ours {ours(comparison)} {unit}".rstrip()
    yield from _wrapped("      ", f"{numbers}: {comparison.reason or 'NO REASON KNOWN'}")


def _closing(report: LetterReport) -> list[str]:
    if report.holds:
        return ["Reproduced: every finding holds, and every number that disagrees has its reason."]
    findings = [f"finding {f.id}" for f in report.findings if not f.holds]
    numbers = [f"{c.name} ({r.id})" for r in report.reproductions for c in r.comparisons if c.unexplained]
    return list(_wrapped("", f"NOT REPRODUCED: {'; '.join([*findings, *numbers])}"))


def _wrapped(start: str, text: str) -> list[str]:
    """Break a text into lines that continue under where it starts."""
    return textwrap.wrap(
        text, WIDTH, initial_indent=start, subsequent_indent=" " * len(start), break_on_hyphens=False
    ) or [start.rstrip()]
