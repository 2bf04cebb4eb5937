"""Summarize the page of a result for a terminal: the answer, the numbers that matter, limits, warnings, next step."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from typing import Final

from pretouch._core.blocks import Page, cell_as_text, plain_text

WIDTH: Final = 100
"""Columns of a terminal."""

_FIGURES: Final = 4  # numbers that are printed, of those of a report


def summary_of(page: Page, *, lines: int, opening: Sequence[str] = (), ending: Sequence[str] = ()) -> str:
    """Return a page as a short text of at most 100 columns.

    Args:
        page: the page.
        lines: how many lines there may be; warnings that do not fit are counted instead of printed.
        opening: sentences before the headline, such as that readings contradict the answer.
        ending: lines at the end, such as where the report is.

    Returns:
        The text.
    """
    top = [line for text in (*opening, page.headline, *page.open) for line in _wrapped(text)]
    body = [*_figures(page), *(line for text in page.limits for line in _wrapped(text, first="  ", indent="    "))]
    close = [*(_wrapped(f"Next: {page.next_step}") if page.next_step else []), *ending]
    gaps = [""] if body else []
    room = lines - len(top) - len(body) - len(gaps) - len(close) - (1 if close else 0)
    warnings = list(_warnings(page.warnings, room))
    blocks = [top, body, [*warnings, *close]]
    return "\n".join(line for i, block in enumerate(filter(None, blocks)) for line in (["", *block] if i else block))


def _figures(page: Page) -> Iterator[str]:
    """Yield one line for each of the first key figures: its name, its value, and what it is compared with."""
    rows = []
    for name, cell in page.key_figures[:_FIGURES]:
        label, _, comparison = name.partition("; ")
        rows.append((label, cell_as_text(cell), comparison.replace("; ", ", ")))
    width = max((len(label) for label, *_ in rows), default=0)
    for label, value, comparison in rows:
        line = f"  {label:<{width}}  {value}" + (f"  ({comparison})" if comparison else "")
        yield line if len(line) <= WIDTH else textwrap.shorten(line[2:], WIDTH - 2, placeholder=" ...").rjust(0)


def _warnings(texts: Sequence[str], room: int) -> Iterator[str]:
    """Yield warnings, shortened to their first sentence, as far as there is room; then how many are left."""
    shown = [_wrapped(_first_sentence(plain_text(text)), first="Warning: ", indent="  ") for text in texts]
    for i, lines in enumerate(shown):
        rest = len(shown) - i
        if len(lines) + (rest > 1) > room:
            yield f"{'Also' if i else 'There are'} {rest} {'more ' if i else ''}warning{'s' if rest > 1 else ''}: use --verbose."
            return
        yield from lines
        room -= len(lines)


def _first_sentence(text: str) -> str:
    """Return the first sentence of a text; a period within a number or an abbreviation does not end it."""
    return re.split(r"(?<=[a-z)%\d][.!?])\s+(?=[A-Z])", text, maxsplit=1)[0]


def _wrapped(text: str, *, first: str = "", indent: str = "") -> list[str]:
    return textwrap.wrap(
        plain_text(text), WIDTH, initial_indent=first, subsequent_indent=indent, break_on_hyphens=False
    ) or [""]
