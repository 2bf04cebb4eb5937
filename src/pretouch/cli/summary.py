"""Summarize a result for the terminal: main answer, important numbers, warnings and next step."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from typing import Final

from pretouch._core.blocks import Page, cell_as_text, plain_text
from pretouch._core.warning_codes import split_code

WIDTH: Final = 100
"""Columns of a terminal."""

_FIGURES: Final = 4  # key figures that are printed


def summary_of(page: Page, *, lines: int, opening: Sequence[str] = (), ending: Sequence[str] = ()) -> str:
    """Summarize a report page for the terminal.

    Lines have at most 100 columns.

    Args:
        page: the page.
        lines: the largest number of lines. Warnings, findings and reservations that do not fit are counted instead of
            printed, and key figures that do not fit are left out. The next step is always printed.
        opening: sentences before the headline, such as that readings contradict the answer.
        ending: lines at the end, such as the verdict on the calibration.

    Returns:
        The text.
    """
    top = [line for text in (*opening, page.headline) for line in wrapped(text)]
    step = wrapped(f"Next: {page.next_step}.", indent="  ") if page.next_step else []
    step += [f"  {line}" for line in page.next_lines]
    room = lines - len(top) - len(ending) - len(step) - 2  # one empty line before and after the figures
    reservations = [wrapped(text) for text in page.reservations]
    top += _fitting(reservations, room - 1, len(reservations))
    room = lines - len(top) - len(ending) - len(step) - 2
    figures = _figures(page)[: max(room - 1, 0)]
    room -= len(figures)
    findings = [wrapped(text, first="  - ", indent="    ") for text in page.findings]
    warnings = [warning_lines(text) for text in page.warnings]
    shown = _fitting([*findings, *warnings], room, len(findings))
    return "\n\n".join("\n".join(block) for block in (top, [*figures, *shown], [*step, *ending]) if block)


def warning_lines(text: str) -> list[str]:
    """Return the first sentence of a warning as lines.

    The warning code stands in front.
    """
    code, rest = split_code(text)
    return wrapped(_first_sentence(rest), first=f"Warning {code}: " if code else "Warning: ", indent="  ")


def _figures(page: Page) -> list[str]:
    """Return the lines of the four most important numbers of a report. A long comparison has a line of its own."""
    rows = []
    for name, cell in page.key_figures[:_FIGURES]:
        label, _, comparison = name.partition("; ")
        rows.append((label, cell_as_text(cell), comparison.replace("; ", ", ")))
    width = max((len(label) for label, *_ in rows), default=0)
    lines = []
    for label, value, more in rows:
        line = f"  {label:<{width}}  {value}"
        full = f"{line}  ({more})" if more else line
        lines += [full] if len(full) <= WIDTH else [line, *wrapped(f"({more})", first=" " * 4, indent=" " * 5)]
    return lines


def _fitting(paragraphs: Sequence[Sequence[str]], room: int, findings: int) -> list[str]:
    """Return the paragraphs that fit into the available lines. The last line gives the number of omitted paragraphs."""
    lines: list[str] = []
    for i, paragraph in enumerate(paragraphs):
        rest = len(paragraphs) - i - 1
        if len(lines) + len(paragraph) + (rest > 0) > room:
            hidden = len(paragraphs) - max(i, findings)
            kind = f"{hidden} warning{'s' if hidden != 1 else ''}" if hidden else f"{rest + 1} more"
            return [*lines, f"  ... and {kind}: see --verbose"] if room > len(lines) else lines
        lines += paragraph
    return lines


def _first_sentence(text: str) -> str:
    """Return the first sentence of a text. Periods inside numbers and abbreviations are ignored."""
    return re.split(r"(?<=[\w)%][.!?])\s+(?=[A-Z])", text, maxsplit=1)[0]


def wrapped(text: str, *, first: str = "", indent: str = "") -> list[str]:
    """Return a text broken into lines for the terminal.

    A number and its unit stay together, and so do a key and its quoted value.
    """
    together = r"(?<=\d) (?=[^\W\d]|%)|(?<=\bN) (?=s\b)|(?<=\w) (?== \")|(?<==) (?=\")"
    kept = re.sub(together, "\u00a0", plain_text(text))
    lines = textwrap.wrap(kept, WIDTH, initial_indent=first, subsequent_indent=indent, break_on_hyphens=False)
    return [line.replace("\u00a0", " ") for line in lines]
