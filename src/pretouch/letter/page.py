"""Build the report that compares published values of the letter with recomputed ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pretouch._core.blocks import Cell, Code, Download, Listing, Page, PageSection, PageTable, Paragraph, Picture
from pretouch._core.files import as_json
from pretouch._core.units import pretty_unit
from pretouch._core.warning_codes import caution
from pretouch.motion.page_sections import method_section

from .experiment import Finding, LetterReport, Reproduction
from .printed import Agreement, Printed

_TITLE: Final = "Reproduction of the letter"
_ALL_HOLD: Final = "Reproduced: every finding holds, and every disagreement is explained."
_ORIGIN: Final = (
    "Findings 1 to 7 were known before this program was written, and the program derives them. The findings from 8 on "
    "were made with this program: some contradict the letter, some confirm or complete it."
)
_INPUTS: Final = "The inputs are the printed numbers of the letter, with their printed digits. The verdicts:"
_METHOD: Final = "Motions and gains are computed from the equations of the letter, cited as L(n)."
_SCOPE: Final = "This page compares a publication with its own equations. It does not describe any machine."
_DATA: Final = (
    "Inputs, comparisons and findings of this page and all numbers of the figures in SI, as one JSON object in the "
    "element `numbers`. Numbers that are not finite are null. `pretouch reproduce --json` prints the same object."
)


def letter_page(report: LetterReport) -> Page:
    """Create the report on the published letter.

    It shows how well computed values agree with the letter.

    Args:
        report: the reproductions.

    Returns:
        Its page.
    """
    parts, findings = report.reproductions, report.findings
    home = {f.id: r for r in parts for f in r.findings}
    disagreements = [(r, c) for r in parts for c in r.comparisons if c.agreement is Agreement.DISAGREES]
    links = tuple(f"[{f.id}. {_title(f)}](#finding-{f.id}): {_state(f)}" for f in findings)
    opening = Paragraph(text=_ORIGIN, quiet=True)
    rules = Listing(items=tuple(f"{a.shape} {a.words}: {a.meaning}" for a in Agreement))
    legend = (Paragraph(text=_INPUTS), rules, Paragraph(text=_SCOPE, quiet=True))
    data = as_json(report.to_dict(), indent=None)
    numbers = Download(name="letter-numbers.json", text=data, kind="application/json", anchor="numbers")
    chapters = (Listing(items=links, brief=True), opening, *(_finding(f, home[f.id]) for f in findings))
    listing = Listing(items=tuple(_disagreement(*pair) for pair in disagreements), brief=True)
    return Page(
        kind=_TITLE,
        headline=f"{sum(report.counts.values())} printed numbers of the letter compared. {_closing(report)}",
        status="reproduced" if report.holds else "not reproduced",
        good=report.holds,
        key_figures=tuple((a.meaning, f"{a.shape} {count}") for a, count in report.counts.items()),
        warnings=tuple(_failures(report)),
        blocks=(
            _overview(report) if parts else None,
            PageSection(title="Findings", anchor="findings", titled=True, blocks=chapters, opened=True)
            if findings
            else None,
            PageSection(title="Printed numbers that disagree", titled=True, blocks=(listing,))
            if disagreements
            else None,
            *map(_part, parts),
            PageSection(title="All numbers", anchor="all-numbers", blocks=(numbers, Paragraph(text=_DATA))),
            method_section(_METHOD, others=legend),
        ),
    )


def _overview(report: LetterReport) -> PageTable:
    """Count the published values for each degree of agreement. The table has one row for each part of the letter."""
    rows: list[tuple[Cell, ...]] = [
        (f"[{r.id}: {r.title}](#part-{r.id})", *(str(r.counts[a] or "") for a in Agreement))
        for r in report.reproductions
    ]
    total = ("all", *(str(count or "") for count in report.counts.values()))
    return PageTable(head=("", *(a.words for a in Agreement)), rows=(*rows, total), brief=True)


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
    """Yield a warning for each unexplained difference from the letter, and each finding that does not hold."""
    for f in report.findings:
        if not f.holds:
            steps = "; ".join(f"{step.name}: {step}" for step in f.failed)
            yield caution("PT901", f"Does not hold: [finding {f.id}: {_title(f)}](#finding-{f.id}) ({steps})")
    for r in report.reproductions:
        for c in r.comparisons:
            if c.unexplained:
                yield caution("PT902", f"Unexplained disagreement: [{r.title}: {c.name}](#part-{r.id})")


def _disagreement(part: Reproduction, c: Printed) -> str:
    unit = f" {c.unit.replace('*', ' ')}".rstrip()
    numbers = f"printed {c.printed}{unit}, computed {c.ours}{unit}"
    return f"[{part.id}](#part-{part.id}), {c.name} ({c.place}): {numbers}: {c.reason or 'NO REASON KNOWN'}"


def _finding(finding: Finding, part: Reproduction) -> PageSection:
    state = Agreement.AGREES if finding.holds else Agreement.DISAGREES
    origin = f"{state.shape} {_state(finding)}. {finding.place}; computed with [{part.title}](#part-{part.id})."
    steps = PageTable(rows=tuple((step.name, str(step)) for step in finding.evidence), wraps=True)
    blocks = (Paragraph(text=finding.statement), Paragraph(text=origin, quiet=True), steps)
    return PageSection(title=f"{finding.id}. {_title(finding)}", anchor=f"finding-{finding.id}", blocks=blocks)


def _part(part: Reproduction) -> PageSection:
    links = "; ".join(f"[{f.id}. {_title(f)}](#finding-{f.id})" for f in part.findings)
    inputs = PageTable(
        head=("input", "symbol", "value", "place"),
        rows=tuple(
            (p.name.replace("_", " "), p.symbol, f"{p.printed} {pretty_unit(p.unit)}".strip(), p.place)
            for p in part.parameters
        ),
    )
    picture = Picture(figure=part.id, of=part.figure, name=part.title, caption=part.caption)
    blocks = (
        Paragraph(text=part.summary),
        Paragraph(text=f"Findings: {links}", quiet=True) if links else None,
        PageSection(title="Inputs, as printed in the letter", blocks=(inputs,)) if part.parameters else None,
        PageSection(title="Printed and computed numbers", blocks=tuple(_comparison_blocks(part)))
        if part.comparisons
        else None,
        *part.tables,
        picture,
        Code(text=part.code, title="Complete program of this figure"),
    )
    return PageSection(title=f"{part.place}: {part.title}", anchor=f"part-{part.id}", blocks=blocks)


def _comparison_blocks(part: Reproduction) -> Iterator[PageTable | Listing | Paragraph]:
    """Yield a table of published and computed numbers. Then yield the reason for each difference."""
    head = ("number", "place", "printed", "computed", "difference", "range over input rounding", "verdict")
    rows = [
        (
            *(f"{c.name} [{pretty_unit(c.unit)}]" if c.unit else c.name, c.place, c.printed, c.ours, c.off_by),
            *(c.span or "\u2013", f"{c.agreement.shape} {c.agreement.words}"),
        )
        for c in part.comparisons
    ]
    shown = [i for i in range(len(head)) if i != 5 or any(c.over_inputs for c in part.comparisons)]
    yield PageTable(head=tuple(head[i] for i in shown), rows=tuple(tuple(row[i] for i in shown) for row in rows))
    names: dict[str, list[str]] = {}
    for c in part.comparisons:
        if c.reason or c.unexplained:
            names.setdefault(c.reason or "NO REASON KNOWN", []).append(c.name)
    if names:
        yield Paragraph(text="Reasons of the differences:", quiet=True)
        everything = len(part.comparisons) if len(part.comparisons) > 1 else 0
        reasons = ((reason, "all numbers" if len(of) == everything else "; ".join(of)) for reason, of in names.items())
        yield Listing(items=tuple(f"{of}: {reason}" for reason, of in reasons))
