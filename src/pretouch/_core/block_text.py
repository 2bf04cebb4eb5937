"""A page as text for a terminal: its headline, its warnings and its brief blocks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from .blocks import LINK, Block, Cell, Chapter, Code, Listing, Measured, Named, Page, Paragraph, Rows
from .text_table import aligned
from .units import format_quantity

__all__ = ["cell_as_text", "page_as_text"]


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
