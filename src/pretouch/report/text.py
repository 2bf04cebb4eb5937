"""Format a report page as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pretouch._core.blocks import (
    Block,
    Code,
    LazyBlock,
    Listing,
    Page,
    PageSection,
    PageTable,
    Paragraph,
    aligned,
    cell_as_text,
    plain_text,
)
from pretouch._core.warning_codes import split_code


def page_as_text(page: Page) -> str:
    """Format a report as plain text for a terminal.

    Args:
        page: the page.

    Returns:
        The text, without a line end after the last line.
    """
    parts = ["\n".join([page.headline, *page.reservations])]
    if page.warnings:
        parts.append("\n".join(f"{_label(text)}: {plain_text(split_code(text)[1])}" for text in page.warnings))
    return "\n\n".join([*parts, *_parts(page.blocks)])


def _label(text: str) -> str:
    """Return the label in front of a warning, such as `warning PT101`."""
    return f"warning {split_code(text)[0]}".strip()


def _parts(blocks: Iterable[Block]) -> Iterator[str]:
    """Yield the plain text of report blocks that the terminal shows."""
    for block in blocks:
        if not block.brief:
            continue
        if isinstance(block, LazyBlock):
            made = block.make()
            yield from () if made is None else _parts((made,))
        elif isinstance(block, PageSection):
            inner = "\n\n".join(_parts(block.blocks))
            yield f"{block.title[0].lower()}{block.title[1:]}\n{inner}" if block.titled else inner
        elif isinstance(block, PageTable):
            rows = [block.head, *block.rows] if block.head else list(block.rows)
            yield "\n".join(aligned([[cell_as_text(cell) for cell in row] for row in rows], left=block.wraps))
        elif isinstance(block, Listing):
            yield "\n".join(f"  {plain_text(item)}" for item in block.items)
        elif isinstance(block, Paragraph | Code):
            yield plain_text(block.text) if isinstance(block, Paragraph) else block.text
