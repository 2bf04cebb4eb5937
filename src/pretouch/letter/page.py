"""What a letter report says: how many numbers agree, what was found, and every number beside ours."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pretouch._core.blocks import Cell, Chapter, Code, Download, Listing, Page, Paragraph, Picture, Rows
from pretouch._core.files import as_json
from pretouch._core.units import pretty_unit
from pretouch.motion.page_sections import method_section

from .experiment import Finding, LetterReport, Reproduction
from .printed import Agreement, Printed

_TITLE: Final = "The letter, computed again"
_ALL_HOLD: Final = "Reproduced: every finding holds, and every number that disagrees has its reason."
_FOUND: Final = (
    "Points 1 to 7 were known when this program was written, and it derives each of them. From 8 on it found them "
    "itself: some disagree with the letter, some confirm or complete it."
)
_INPUTS: Final = "The inputs are those that the letter prints, taken at their printed digits. The verdicts:"
_METHOD: Final = "Motions and gains come from the equations of the letter, cited as L(n)."
_SCOPE: Final = "This page compares a publication with its own equations. It says nothing about a machine."
_DATA: Final = (
    "Inputs, comparisons and findings as on this page, and every number behind the figures in SI, as one JSON object: "
    "the address of the element `numbers` holds it. What is not finite is null; `pretouch reproduce --json` prints it."
)


def letter_page(report: LetterReport) -> Page:
    """Describe what was reproduced, all of it or a part.

    Args:
        report: the reproductions.

    Returns:
        Its page.
    """
    parts, findings = report.reproductions, report.findings
    home = {f.id: r for r in parts for f in r.findings}
    off = [(r, c) for r in parts for c in r.comparisons if c.agreement is Agreement.DISAGREES]
    said = tuple(f"[{f.id}. {_title(f)}](#finding-{f.id}): {_state(f)}" for f in findings)
    opening = Paragraph(text=_FOUND, quiet=True)
    rules = Listing(items=tuple(f"{a.shape} {a.words}: {a.meaning}" for a in Agreement))
    legend = (Paragraph(text=_INPUTS), rules, Paragraph(text=_SCOPE, quiet=True))
    data = as_json(report.to_dict(), indent=None)
    numbers = Download(name="letter-numbers.json", text=data, kind="application/json", anchor="numbers")
    found = (Listing(items=said, brief=True), opening, *(_finding(f, home[f.id]) for f in findings))
    listed = Listing(items=tuple(_disagreement(*pair) for pair in off), brief=True)
    return Page(
        kind=_TITLE,
        headline=f"{sum(report.counts.values())} printed numbers of the letter beside ours. {_closing(report)}",
        status="reproduced" if report.holds else "not reproduced",
        good=report.holds,
        key_figures=tuple((a.meaning, f"{a.shape} {count}") for a, count in report.counts.items()),
        warnings=tuple(_failures(report)),
        blocks=(
            _overview(report) if parts else None,
            Chapter(title="What was found", anchor="findings", titled=True, blocks=found) if findings else None,
            Chapter(title="Printed numbers that disagree with ours", titled=True, blocks=(listed,)) if off else None,
            *map(_part, parts),
            Chapter(title="All numbers", anchor="all-numbers", blocks=(numbers, Paragraph(text=_DATA))),
            method_section(_METHOD, others=legend),
        ),
    )


def _overview(report: LetterReport) -> Rows:
    """Count the verdicts of each part, and lead to it; zeros are left out."""
    rows: list[tuple[Cell, ...]] = [
        (f"[{r.id}: {r.title}](#part-{r.id})", *(str(r.counts[a] or "") for a in Agreement))
        for r in report.reproductions
    ]
    total = ("all", *(str(count or "") for count in report.counts.values()))
    return Rows(head=("", *(a.words for a in Agreement)), rows=(*rows, total), brief=True)


def _title(finding: Finding) -> str:
    return finding.title.rstrip(". ")


def _state(finding: Finding) -> str:
    return "holds" if finding.holds else "DOES NOT HOLD"


def _closing(report: LetterReport) -> str:
    if report.holds:
        return _ALL_HOLD if report.reproductions else "Nothing was reproduced."
    numbers = (f"{c.name} ({r.id})" for r in report.reproductions for c in r.comparisons if c.unexplained)
    return f"NOT REPRODUCED: {'; '.join([*(f'finding {f.id}' for f in report.findings if not f.holds), *numbers])}."


def _failures(report: LetterReport) -> Iterator[str]:
    """Yield what does not come out, and where it stands."""
    for f in report.findings:
        if not f.holds:
            steps = "; ".join(f"{step.name}: {step}" for step in f.failed)
            yield f"Does not come out here: [finding {f.id}: {_title(f)}](#finding-{f.id}) ({steps})"
    for r in report.reproductions:
        for c in r.comparisons:
            if c.unexplained:
                yield f"Does not come out here: [{r.title}: {c.name}](#part-{r.id}) disagrees, and no reason is known"


def _disagreement(part: Reproduction, c: Printed) -> str:
    unit = f" {c.unit.replace('*', ' ')}".rstrip()
    numbers = f"printed {c.printed}{unit}, ours {c.ours}{unit}"
    return f"[{part.id}](#part-{part.id}), {c.name} ({c.place}): {numbers}: {c.reason or 'NO REASON KNOWN'}"


def _finding(finding: Finding, part: Reproduction) -> Chapter:
    state = Agreement.AGREES if finding.holds else Agreement.DISAGREES
    origin = f"{state.shape} {_state(finding)}. {finding.place}; computed with [{part.title}](#part-{part.id})."
    steps = Rows(rows=tuple((step.name, str(step)) for step in finding.evidence), wraps=True)
    blocks = (Paragraph(text=finding.statement), Paragraph(text=origin, quiet=True), steps)
    return Chapter(title=f"{finding.id}. {_title(finding)}", anchor=f"finding-{finding.id}", blocks=blocks)


def _part(part: Reproduction) -> Chapter:
    links = "; ".join(f"[{f.id}. {_title(f)}](#finding-{f.id})" for f in part.findings)
    inputs = Rows(
        head=("input", "symbol", "value", "place"),
        rows=tuple(
            (p.name.replace("_", " "), p.symbol, f"{p.printed} {pretty_unit(p.unit)}".strip(), p.place)
            for p in part.parameters
        ),
    )
    picture = Picture(figure=part.id, of=part.figure, name=part.title, caption=part.caption)
    blocks = (
        Paragraph(text=part.summary),
        Paragraph(text=f"Findings from it: {links}", quiet=True) if links else None,
        Chapter(title="Inputs, as the letter gives them", blocks=(inputs,)) if part.parameters else None,
        Chapter(title="Printed numbers beside ours", blocks=tuple(_compared(part))) if part.comparisons else None,
        *part.tables,
        picture,
        Code(text=part.code, title="The code that makes this figure, as one program"),
    )
    return Chapter(title=f"{part.place}: {part.title}", anchor=f"part-{part.id}", blocks=blocks)


def _compared(part: Reproduction) -> Iterator[Rows | Listing | Paragraph]:
    """Yield the numbers beside ours, and each reason once, with the names of all numbers that it explains."""
    head = ("number", "place", "printed", "ours", "difference", "ours over the rounding of the inputs", "verdict")
    rows = [
        (
            *(f"{c.name} [{pretty_unit(c.unit)}]" if c.unit else c.name, c.place, c.printed, c.ours, c.off_by),
            *(c.span or "\u2013", f"{c.agreement.shape} {c.agreement.words}"),
        )
        for c in part.comparisons
    ]
    shown = [i for i in range(len(head)) if i != 5 or any(c.over_inputs for c in part.comparisons)]
    yield Rows(head=tuple(head[i] for i in shown), rows=tuple(tuple(row[i] for i in shown) for row in rows))
    names: dict[str, list[str]] = {}
    for c in part.comparisons:
        if c.reason or c.unexplained:
            names.setdefault(c.reason or "NO REASON KNOWN", []).append(c.name)
    if names:
        yield Paragraph(text="Why they differ:", quiet=True)
        everything = len(part.comparisons) if len(part.comparisons) > 1 else 0
        said = ((reason, "all of them" if len(of) == everything else "; ".join(of)) for reason, of in names.items())
        yield Listing(items=tuple(f"{of}: {reason}" for reason, of in said))
