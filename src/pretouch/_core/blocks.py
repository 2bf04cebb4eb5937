"""What a result says of itself: one description in blocks, which each medium turns into its own text.

A result is described once, as a `Page`. The text of a terminal is made of its headline, its warnings and the blocks
that are marked as brief; a notebook shows the headline and the first brief table; a report has all of it, with its
pictures.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, ClassVar, TypeAlias

from .values import Value
from .vocabulary import QUANTITIES

__all__ = [
    "Block",
    "Cell",
    "Code",
    "Described",
    "Listing",
    "Measured",
    "Named",
    "Page",
    "Paragraph",
    "Picture",
    "Section",
    "Table",
    "named",
    "page_of",
    "tables_of",
]


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
class Table(Value):
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
    """Sentences; text between backticks is code. A `quiet` one explains, and is set smaller."""

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
        figure: its name among the figures of `pretouch.report.plots`.
        of: what it is drawn from.
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
    """Text that is copied: a file or a part of one."""

    text: str
    brief: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Section(Value):
    """Blocks under a title; one that holds a brief block is part of the short text with just those.

    Args:
        title: the title.
        blocks: what stands below it; None among them is left out.
        titled: whether the short text shows the title, too.
    """

    title: str
    blocks: tuple[Any, ...]
    titled: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", tuple(block for block in self.blocks if block is not None))

    @property
    def brief(self) -> bool:
        """Whether anything of it is part of the short text."""
        return any(block.brief for block in self.blocks)


Block: TypeAlias = Section | Table | Paragraph | Listing | Picture | Code


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


class Described:
    """A result that has a page: its text, and what a notebook shows of it.

    A class names the function that describes it by text, so that no result imports its description.
    """

    __slots__ = ()

    page: ClassVar[str]
    """Module and function, such as `pretouch.design.page:gain_page`."""

    def __str__(self) -> str:
        from .block_text import page_as_text  # noqa: PLC0415 - only for who reads it

        return page_as_text(page_of(self))

    def _repr_html_(self) -> str | None:
        from .block_html import page_as_excerpt  # noqa: PLC0415

        return page_as_excerpt(page_of(self))


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


def named(name: str, *, magnitude: bool = False) -> Named:
    """Return a quantity of the vocabulary as a cell, as a magnitude where only that is meant."""
    q = QUANTITIES[name]
    return Named(q.words, f"|{q.symbol}|" if magnitude and "|" not in q.symbol else q.symbol)


def tables_of(blocks: Iterable[Block]) -> Iterator[Table]:
    """Yield all tables of blocks, those of their sections included."""
    for block in blocks:
        if isinstance(block, Table):
            yield block
        elif isinstance(block, Section):
            yield from tables_of(block.blocks)
