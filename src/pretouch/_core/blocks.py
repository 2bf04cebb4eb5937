"""Describe a report independently of its output medium.

A result is described once, as a `Page`. The terminal shows the headline, the warnings and the blocks that are marked as
brief. A notebook shows the headline, the warnings and the first brief table. A report shows everything, with figures.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, TypeAlias

from .units import format_quantity
from .values import Value
from .vocabulary import QUANTITIES, Entry

LINK: Final = re.compile(r"\[([^\[\]]+)\]\(#([a-z0-9-]+)\)")
"""A link inside a page: `[words](#anchor)`."""


@dataclass(frozen=True, slots=True)
class Measured(Value):
    """A number with its unit, shown as one cell of a table.

    Args:
        value: the number in SI; None or NaN if there is none.
        unit: its SI unit.
        digits: number of significant digits.
        suffix: text that follows the number, such as a confidence interval.
    """

    value: float | None
    unit: str = ""
    digits: int = 4
    suffix: str = ""


@dataclass(frozen=True, slots=True)
class Named(Value):
    """A table cell with the name and symbol of a quantity."""

    words: str
    symbol: str = ""


Cell: TypeAlias = str | Measured | Named


@dataclass(frozen=True, slots=True, kw_only=True)
class PageTable(Value):
    """A table in a report.

    The first cell of each row is the name of the row.

    Args:
        rows: the rows, all with the same number of cells.
        head: titles of the columns; empty for none.
        note: a remark below the table.
        wraps: whether cells hold sentences, which may be broken into lines.
        brief: whether terminal output contains the table.
    """

    rows: tuple[tuple[Cell, ...], ...]
    head: tuple[Cell, ...] = ()
    note: str = ""
    wraps: bool = False
    brief: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", tuple(map(tuple, self.rows)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Paragraph(Value):
    """A paragraph in a report; text between backticks is shown as code.

    A `quiet` paragraph is an explanation in smaller type. In every text, `[words](#anchor)` is a link to a section or a
    download of the page, in media that have links.
    """

    text: str
    quiet: bool = False
    brief: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing(Value):
    """A list of sentences in a report."""

    items: tuple[str, ...]
    brief: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture(Value):
    """A figure in a report, drawn when the report is shown.

    Args:
        figure: name of a function of `pretouch.report.plots`; any name if `of` is a Matplotlib figure.
        of: the result that the figure shows, or a Matplotlib figure.
        name: text for readers who cannot see the figure.
        caption: how to read the figure.
    """

    figure: str
    of: Any
    name: str
    caption: str
    brief: ClassVar[bool] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Film(Picture):
    """A figure that an HTML report shows together with an animation.

    Its function in `pretouch.report.plots` draws the figure without the animation, for media that show a single figure.
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class Code(Value):
    """A text in a report for readers to copy.

    If it has a title, readers can collapse it.
    """

    text: str
    title: str = ""
    brief: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Download(Value):
    """A file embedded in a report for download.

    Args:
        name: name of the file.
        text: its content.
        kind: its media type.
        anchor: id of the element, for links and for programs that read the page.
    """

    name: str
    text: str
    kind: str = "text/plain"
    anchor: str = ""
    brief: ClassVar[bool] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSection(Value):
    """A titled section of a report.

    The terminal shows only the parts that are marked as brief.

    Args:
        title: the title.
        blocks: the blocks of the section; None is skipped.
        titled: whether terminal output shows the title as well.
        anchor: id for links; empty for none.
        opened: whether a report shows the section open, because it explains the answer.
    """

    title: str
    blocks: tuple[Any, ...]
    titled: bool = False
    anchor: str = ""
    opened: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", tuple(block for block in self.blocks if block is not None))

    @property
    def brief(self) -> bool:
        """Whether the terminal shows any part of this report section."""
        return any(block.brief for block in self.blocks)


@dataclass(frozen=True, slots=True, kw_only=True)
class LazyBlock(Value):
    """A part of a report that is computed when the report is written.

    The computation of such a part, for example a figure, takes long.

    Args:
        make: returns the block; None if there is nothing to show.
        brief: whether the terminal shows the block, if it is brief itself.
    """

    make: Callable[[], PageSection | PageTable | Picture | None]
    brief: bool = False


Block: TypeAlias = PageSection | PageTable | Paragraph | Listing | Picture | Code | Download | LazyBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Value):
    """The content of a report for any output medium.

    Args:
        kind: kind of the result, such as `Gain design`.
        headline: the answer in one or two sentences.
        status: how the computation ended, in words.
        good: whether the answer is a positive one.
        key_figures: the most important numbers, with their names.
        reservations: sentences about results that no data support, shown next to the headline.
        warnings: sentences to read before relying on the answer.
        findings: short sentences on limits and reasons, for the terminal.
        next_step: what to do next, in one sentence, for the terminal.
        next_lines: lines of a file to copy, which belong to the next step.
        lead: name of the figure that a report shows first, below the answer.
        blocks: all further blocks; None is skipped.
        source: name of the input file, for the title.
    """

    kind: str
    headline: str
    status: str = ""
    good: bool = True
    key_figures: tuple[tuple[str, Cell], ...] = ()
    reservations: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    next_step: str = ""
    next_lines: tuple[str, ...] = ()
    lead: str = ""
    blocks: tuple[Any, ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", tuple(block for block in self.blocks if block is not None))

    def with_blocks(self, *blocks: Block | None) -> Page:
        """Return a copy of this report with additional blocks.

        The blocks, such as tables, figures or paragraphs, are added at the end.
        """
        return replace(self, blocks=(*self.blocks, *blocks))


def named(name: str, *, magnitude: bool = False) -> Named:
    """Return a table cell with the name and symbol of a quantity.

    `magnitude` puts bars around the symbol, as in |v|.
    """
    return named_entry(QUANTITIES[name], magnitude=magnitude)


def named_entry(q: Entry, *, magnitude: bool = False) -> Named:
    """Return a table cell with the name and symbol of a quantity.

    `magnitude` puts bars around the symbol, as in |v|.
    """
    with_bars = magnitude and q.is_magnitude and q.symbol and "|" not in q.symbol
    return Named(q.words, f"|{q.symbol}|" if with_bars else q.symbol)


def tables_of(blocks: Iterable[Block]) -> Iterator[PageTable]:
    """Yield all tables in a list of report blocks.

    Tables inside sections are included.
    """
    for block in blocks:
        if isinstance(block, PageTable):
            yield block
        elif isinstance(block, PageSection):
            yield from tables_of(block.blocks)


def aligned(table: Sequence[Sequence[str]], *, left: bool = False) -> list[str]:
    """Format the rows of a table as text lines with aligned columns.

    The first column is aligned to the left, the others to the right.

    Args:
        table: the rows, all with the same number of cells.
        left: whether to align all columns to the left.

    Returns:
        The lines.

    Examples:
        >>> aligned([("", "value"), ("speed", "0.3 m/s")])
        ['         value', 'speed  0.3 m/s']
    """
    width = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join(
            cell.ljust(w) if left or i == 0 else cell.rjust(w)
            for i, (cell, w) in enumerate(zip(row, width, strict=True))
        ).rstrip()
        for row in table
    ]


def plain_text(text: str) -> str:
    """Remove backticks and link targets from a text."""
    return LINK.sub(r"\1", text).replace("`", "")


def cell_as_text(cell: Cell) -> str:
    """Return a table cell as plain text.

    A missing number becomes a hyphen.
    """
    if isinstance(cell, Named):
        return cell.words
    if not isinstance(cell, Measured):
        return plain_text(cell)
    if cell.value is None or math.isnan(cell.value):
        return "-"
    return format_quantity(cell.value, cell.unit, cell.digits) + cell.suffix
