"""What a result says of itself: one description in blocks, which each medium turns into its own text.

A result is described once, as a `Page`. The text of a terminal is made of its headline, its warnings and the blocks
that are marked as brief; a notebook shows the headline and the first brief table; a report has all of it, with its
pictures.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, ClassVar, Final, TypeAlias

from .units import format_quantity
from .values import Value
from .vocabulary import QUANTITIES

LINK: Final = re.compile(r"\[([^\[\]]+)\]\(#([a-z0-9-]+)\)")
"""How a text names a place of the page: `[words](#anchor)`."""


@dataclass(frozen=True, slots=True)
class Measured(Value):
    """A number that a medium writes with its unit.

    Args:
        value: in SI; None or NaN where there is none.
        unit: its SI unit.
        digits: significant digits.
        beside: text that follows it, such as an interval.
    """

    value: float | None
    unit: str = ""
    digits: int = 4
    beside: str = ""


@dataclass(frozen=True, slots=True)
class Named(Value):
    """A quantity in words, with its symbol where a medium can show it."""

    words: str
    symbol: str = ""


Cell: TypeAlias = str | Measured | Named


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows(Value):
    """Rows of cells; the first cell of a row names it.

    Args:
        rows: the rows, each with as many cells.
        head: what the columns are; empty where the rows speak for themselves.
        note: what a reader must know of it, below.
        wraps: whether cells hold sentences, which may be broken into lines.
        brief: whether it is part of the short text.
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
    """Sentences; text between backticks is code. A `quiet` one explains, and is set smaller.

    In every text, `[words](#anchor)` leads to a section or a download of the page where a medium can.
    """

    text: str
    quiet: bool = False
    brief: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing(Value):
    """Sentences, one below the other."""

    items: tuple[str, ...]
    brief: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture(Value):
    """A figure, drawn by whoever shows it.

    Args:
        figure: its name among the figures of `pretouch.report.plots`, or any name of one that is drawn already.
        of: what it is drawn from, or the figure of Matplotlib itself.
        name: what it shows, for who cannot see it.
        caption: how it is read.
    """

    figure: str
    of: Any
    name: str
    caption: str
    brief: ClassVar[bool] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Code(Value):
    """Text that is copied: a file or a part of one; under a title it can be folded away."""

    text: str
    title: str = ""
    brief: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Download(Value):
    """A file that a page holds and a reader can save.

    Args:
        name: of the file.
        text: what is in it.
        kind: its media type.
        anchor: what links lead to, and where a program finds it.
    """

    name: str
    text: str
    kind: str = "text/plain"
    anchor: str = ""
    brief: ClassVar[bool] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter(Value):
    """Blocks under a title; one that holds a brief block is part of the short text with just those.

    Args:
        title: the title.
        blocks: what stands below it; None among them is left out.
        titled: whether the short text shows the title, too.
        anchor: what links lead to; empty where none does.
    """

    title: str
    blocks: tuple[Any, ...]
    titled: bool = False
    anchor: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", tuple(block for block in self.blocks if block is not None))

    @property
    def brief(self) -> bool:
        """Whether anything of it is part of the short text."""
        return any(block.brief for block in self.blocks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Later(Value):
    """A section, or a table, that takes its time to work out: made by who shows it, never part of the short text.

    Args:
        make: returns it; None where there is nothing to show.
    """

    make: Callable[[], Chapter | Rows | None]
    brief: ClassVar[bool] = False


Block: TypeAlias = Chapter | Rows | Paragraph | Listing | Picture | Code | Download | Later


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Value):
    """Everything that a result says.

    Args:
        kind: what it is, such as `Gain design`.
        headline: the answer in a sentence or two.
        status: how it ended, in words.
        good: whether that is what was asked for.
        key_figures: the few numbers that matter most, with their names.
        open: what must be known before anything else: where no data support the answer.
        warnings: sentences to be read before relying on it.
        blocks: the rest; None among them is left out.
        source: name of what it was computed from, for the title.
    """

    kind: str
    headline: str
    status: str = ""
    good: bool = True
    key_figures: tuple[tuple[str, Cell], ...] = ()
    open: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    blocks: tuple[Any, ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", tuple(block for block in self.blocks if block is not None))

    def with_blocks(self, *blocks: Block | None) -> Page:
        """Return the page with blocks at its end."""
        return replace(self, blocks=(*self.blocks, *blocks))


def named(name: str, *, magnitude: bool = False) -> Named:
    """Return a quantity of the vocabulary as a cell, as a magnitude where only that is meant."""
    q = QUANTITIES[name]
    return Named(q.words, f"|{q.symbol}|" if magnitude and "|" not in q.symbol else q.symbol)


def tables_of(blocks: Iterable[Block]) -> Iterator[Rows]:
    """Yield all tables of blocks, those of their sections included."""
    for block in blocks:
        if isinstance(block, Rows):
            yield block
        elif isinstance(block, Chapter):
            yield from tables_of(block.blocks)


def aligned(table: Sequence[Sequence[str]], *, left: bool = False) -> list[str]:
    """Align rows in columns, the first to the left and the others to the right.

    Args:
        table: the rows, each with as many cells.
        left: whether the others stand to the left, too.

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


def page_as_text(page: Page) -> str:
    """Write a page as text.

    Args:
        page: the page.

    Returns:
        Lines, without an end of line after the last.
    """
    parts = ["\n".join([page.headline, *page.open])]
    if page.warnings:
        parts.append("\n".join(f"warning: {_bare(text)}" for text in page.warnings))
    return "\n\n".join([*parts, *_parts(page.blocks)])


def _parts(blocks: Iterable[Block]) -> Iterator[str]:
    """Yield the brief blocks; what follows a title stands right below it."""
    for block in blocks:
        if not block.brief:
            continue
        if isinstance(block, Chapter):
            inner = "\n\n".join(_parts(block.blocks))
            yield f"{block.title[0].lower()}{block.title[1:]}\n{inner}" if block.titled else inner
        elif isinstance(block, Rows):
            rows = [block.head, *block.rows] if block.head else list(block.rows)
            yield "\n".join(aligned([[cell_as_text(cell) for cell in row] for row in rows], left=block.wraps))
        elif isinstance(block, Listing):
            yield "\n".join(f"  {_bare(item)}" for item in block.items)
        elif isinstance(block, Paragraph | Code):
            yield _bare(block.text) if isinstance(block, Paragraph) else block.text


def _bare(text: str) -> str:
    """Leave out what only a page can show: marks of code, and where links lead."""
    return LINK.sub(r"\1", text).replace("`", "")


def cell_as_text(cell: Cell) -> str:
    """Write a cell; a hyphen stands for a number that is not there."""
    if isinstance(cell, Named):
        return cell.words
    if not isinstance(cell, Measured):
        return _bare(cell)
    if cell.value is None or math.isnan(cell.value):
        return "-"
    return format_quantity(cell.value, cell.unit, cell.digits) + cell.beside


class Described:
    """A result that has a page: its text, and what a notebook shows of it.

    A class names the function that describes it by text, so that no result imports its description.
    """

    __slots__ = ()

    page: ClassVar[str]
    """Module and function, such as `pretouch.design.page:gain_page`."""

    def __str__(self) -> str:
        return page_as_text(page_of(self))

    def _repr_html_(self) -> str | None:
        excerpt: Callable[[Page], str] = import_module("pretouch.report.blocks_html").page_as_excerpt
        return excerpt(page_of(self))


def page_of(result: Described) -> Page:
    """Describe a result.

    Args:
        result: a result whose class names its description.

    Returns:
        Its page.
    """
    module, _, name = result.page.partition(":")
    page: Page = getattr(import_module(module), name)(result)
    return page
