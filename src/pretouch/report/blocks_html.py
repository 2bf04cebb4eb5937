"""Convert the blocks of a report, such as tables, to HTML."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from html import escape
from typing import Final
from urllib.parse import quote

from pretouch._core.blocks import (
    LINK,
    Block,
    Cell,
    Code,
    Download,
    Film,
    LazyBlock,
    Listing,
    Measured,
    Named,
    Page,
    PageSection,
    PageTable,
    Paragraph,
    Picture,
    tables_of,
)
from pretouch._core.units import format_quantity, pretty_unit
from pretouch._core.warning_codes import codes_in, explanation, page_of_code

from .style import minus_signs

_PAGE_LINK: Final = re.compile(r"\[([^\]]+)\]\([^)#]+\)")
"""A link to another page of the documentation, which a report does not have."""

_CODE: Final = re.compile(r"(`[^`]+`)")
_QUOTED: Final = re.compile(r'("[^"]*"|--[a-z-]+[ =]-[^ ]*)')
_SUBSCRIPT: Final = re.compile(r"(?:(?<=\b[A-Za-z])|(?<=\bd[A-Z])|(?<=[\u2032\u2033]))_([a-z0-9]{1,3})(?![\w.(])")
_INDEX: Final = {"a": "\u2090", "p": "\u209a"}
_SENTENCES: Final = ' class="text"'
_MOST_COLUMNS: Final = 5  # of a table that fits into the page
_LONGEST_LINE: Final = 40  # letters of the longest cell that stays in one line

QUIET: Final = ' class="note"'


def page_as_excerpt(page: Page, draw: Callable[[Picture], str]) -> str:
    """Return a short HTML version of a report page for notebooks.

    It contains the headline, the warnings, the main plot and one short table.

    Args:
        page: the page.
        draw: draws a figure, as an element.

    Returns:
        The elements.
    """
    lead, _ = _without_lead(page.blocks, page.lead)
    figure = "" if lead is None else draw(lead)
    table = next((table for table in tables_of(page.blocks) if table.brief), None)
    warnings = "".join(f"<p>Warning {_inline(text)}</p>" for text in page.warnings)
    excerpt = f"<p><b>{typeset(page.headline)}</b></p>{warnings}{figure}{'' if table is None else _table(table)}"
    return re.sub(r'<a href="#[^"]*">(.*?)</a>', r"\1", excerpt)


def page_as_html(page: Page, draw: Callable[[Picture], str]) -> str:
    """Return a report page as HTML.

    Result, key numbers, plot and warnings come first, then collapsible sections, of which those that explain the result
    are open. A link to a section opens it.

    Args:
        page: the page.
        draw: draws a figure, as an SVG element.

    Returns:
        The elements of the body.
    """
    computed = (block.make() if isinstance(block, LazyBlock) else block for block in page.blocks)
    listed = (_without_items(block, page.findings) for block in computed)
    lead, blocks = _without_lead((block for block in listed if block is not None), page.lead)
    sections = [block for block in blocks if isinstance(block, PageSection)]
    opened = [block for section in sections if section.opened for block in section.blocks if isinstance(block, Listing)]
    listed_below = {item for block in opened for item in block.items}
    top = replace(page, findings=tuple(text for text in page.findings if text not in listed_below))
    parts = [page_top(top, "" if lead is None else "\n".join(blocks_as_html((lead,), draw)))]
    parts += blocks_as_html((block for block in blocks if not isinstance(block, PageSection)), draw)
    for number, section in enumerate(sections, 1):
        anchor, title = section.anchor or f"section-{number}", _inline(section.title)
        parts.append(f"<details{' open' if section.opened else ''}>\n<summary><h2>{title}</h2></summary>")
        # a link opens the section because its target is inside
        parts += [f'<div id="{anchor}">', *blocks_as_html(section.blocks, draw, 3), "</div>", "</details>"]
    return "\n".join(parts)


def _without_items(block: Block | None, shown: tuple[str, ...]) -> Block | None:
    """Return a list without the items that the top of the page already shows; None if no other item remains."""
    if not isinstance(block, Listing):
        return block
    items = tuple(item for item in block.items if item not in shown)
    return replace(block, items=items) if items else None


def lead_picture(page: Page) -> Picture | None:
    """Return the main plot of a report page.

    Without a main plot, the first plot is returned; without plots, None.
    """
    return _without_lead(page.blocks, page.lead)[0] or next(_pictures(page.blocks), None)


def _pictures(blocks: Iterable[Block]) -> Iterator[Picture]:
    """Yield all plots of a report page and its sections."""
    for block in blocks:
        if isinstance(block, Picture):
            yield block
        elif isinstance(block, PageSection):
            yield from _pictures(block.blocks)


def _without_lead(blocks: Iterable[Block], name: str) -> tuple[Picture | None, list[Block]]:
    """Separate one plot from all other blocks; sections that it leaves empty are removed."""
    lead: Picture | None = None
    others: list[Block] = []
    for block in blocks:
        if lead is None and isinstance(block, Picture) and block.figure == name:
            lead = block
        elif lead is None and isinstance(block, PageSection):
            lead, inner = _without_lead(block.blocks, name)
            if lead is None or inner:
                others.append(replace(block, blocks=tuple(inner)))
        else:
            others.append(block)
    return lead, others


def page_top(page: Page, figure: str = "") -> str:
    """Return the top part of a report page as HTML.

    It contains status, result, key numbers, plot and warnings.
    """
    parts = [f'<p class="state{"" if page.good else " bad"}">{escape(page.status)}</p>'] if page.status else []
    parts += [f'<p class="warning">{_with_links(text)}</p>' for text in page.reservations]
    parts.append(f'<p class="answer">{typeset(page.headline)}</p>')
    if page.key_figures:
        tiles = (f"<li><b>{cell_as_html(cell)}</b><span>{typeset(name)}</span></li>" for name, cell in page.key_figures)
        parts.append("\n".join(['<ul class="tiles">', *tiles, "</ul>"]))
    if figure:
        parts.append(figure)
    if page.findings:
        parts.append("\n".join(["<ul>", *(f"<li>{_inline(text)}</li>" for text in page.findings), "</ul>"]))
    parts += [f'<p class="warning">{_with_links(text)}</p>' for text in page.warnings]
    if page.next_step:
        parts.append(f'<p class="next"><b>Next:</b> {_inline(page.next_step)}.</p>')
    if page.next_lines:
        lines = "\n".join(page.next_lines)
        parts.append(f"<pre>{escape(lines)}</pre>")
    return "\n".join(parts)


def explained(page: Page) -> Page:
    """Return a report page with explanations of its warning codes.

    An additional section explains the codes, such as PT201.
    """
    codes = codes_in((*page.reservations, *page.warnings))
    if not codes:
        return page
    return page.with_blocks(PageSection(title="What the warnings mean", blocks=tuple(map(_explanation, codes))))


def _explanation(code: str) -> PageSection:
    """Return the report section that explains one warning code."""
    entry = explanation(code)
    rows = (
        ("meaning", entry.meaning),
        ("why it matters", entry.why),
        ("what to do", _PAGE_LINK.sub(r"\1", entry.remedy)),
    )
    table = PageTable(rows=rows, note=f"Page: `{page_of_code(code)}`.", wraps=True)
    return PageSection(title=f"{code}: {entry.title}", blocks=(table,), anchor=code.lower())


def _with_links(text: str) -> str:
    """Return a warning as HTML with linked warning codes."""
    return re.sub(r"\b(PT\d{3}): ", lambda m: f'<a href="#{m[1].lower()}">{m[1]}:</a> ', _inline(text))


def blocks_as_html(blocks: Iterable[Block], draw: Callable[[Picture], str], level: int = 2) -> Iterator[str]:
    """Yield the blocks of a report page as HTML elements.

    Args:
        blocks: the blocks.
        draw: draws a figure, as an SVG element.
        level: heading level of sections, 2 to 4.

    Yields:
        The elements, from top to bottom.
    """
    for block in blocks:
        if isinstance(block, PageSection):
            yield f"<h{level}{_id(block.anchor)}>{_inline(block.title)}</h{level}>"
            yield from blocks_as_html(block.blocks, draw, min(level + 1, 4))
        elif isinstance(block, PageTable):
            if block.rows:
                wide = max(map(len, block.rows)) > _MOST_COLUMNS
                reached = ' tabindex="0" role="group" aria-label="Wide table"' if wide else ""  # by the keyboard
                yield f'<div class="scroll"{reached}>{_table(block)}</div>'
            if block.note:
                yield f"<p{QUIET}>{_inline(block.note)}</p>"
        elif isinstance(block, Paragraph):
            yield f"<p{QUIET if block.quiet else ''}>{_inline(block.text)}</p>"
        elif isinstance(block, Listing):
            yield "\n".join(["<ul>", *(f"<li>{_inline(item)}</li>" for item in block.items), "</ul>"])
        elif isinstance(block, LazyBlock):
            computed = block.make()
            yield from blocks_as_html(() if computed is None else (computed,), draw, level)
        elif isinstance(block, Code):
            code = f"<pre>\n{escape(block.text)}</pre>"  # browsers drop the line end right after the tag
            folds = f"<details open>\n<summary>{_inline(block.title)}</summary>\n{code}\n</details>"
            yield folds if block.title else code
        elif isinstance(block, Download):
            address, size = f"data:{block.kind},{quote(block.text, safe=',:')}", max(1, round(len(block.text) / 1000))
            name = escape(block.name)
            yield f'<p><a{_id(block.anchor)} download="{name}" href="{address}">{name}</a> ({size} kB)</p>'
        else:
            name = escape(minus_signs(block.name))
            role = "group" if isinstance(block, Film) else "img"
            yield f'<figure>\n<div class="scroll" role="{role}" aria-label="{name}">{draw(block)}</div>'
            yield f"<figcaption>{_inline(block.caption)}</figcaption>\n</figure>"


def _table(table: PageTable) -> str:
    kind = _SENTENCES if table.wraps else ""
    titles = [cell_as_html(c) for c in table.head]
    kinds = [[kind or _long_text(cell) for cell in row] for row in table.rows]
    head = "".join(f'<th scope="col">{title}</th>' for title in titles)
    labels = [f' data-label="{_without_tags(title)}"' if title else "" for title in titles]
    rows = (
        "".join(
            f'<th scope="row">{cell_as_html(c)}</th>'
            if i == 0
            else f"<td{kinds[k][i]}{labels[i] if i < len(labels) else ''}>{cell_as_html(c)}</td>"
            for i, c in enumerate(row)
        )
        for k, row in enumerate(table.rows)
    )
    top = f"<thead><tr>{head}</tr></thead>\n" if head else ""
    return "\n".join([f"<table>\n{top}<tbody>", *(f"<tr>{row}</tr>" for row in rows), "</tbody></table>"])


def _without_tags(html: str) -> str:
    """Return the text of a title for an attribute, which has no tags but may have the index letters of the figures."""
    return re.sub("<sub>(.*?)</sub>", lambda m: _INDEX.get(m[1], f"_{m[1]}"), re.sub(r"<(?!/?sub>)[^>]*>", "", html))


def _long_text(cell: Cell) -> str:
    """Return the class of a cell whose text may be broken into lines; empty for numbers and short texts."""
    return _SENTENCES if isinstance(cell, str) and len(cell) > _LONGEST_LINE else ""


def cell_as_html(cell: Cell) -> str:
    """Return a table cell as HTML.

    A missing number is shown as a dash.
    """
    if isinstance(cell, Named):
        return typeset(f"{cell.words} {cell.symbol}".strip())
    if not isinstance(cell, Measured):
        return "\u2013" if cell == "-" else _inline(cell)
    value = cell.value
    if value is None or math.isnan(value):
        return "\u2013"
    if math.isinf(value):
        return "\u221e" if value > 0 else "\u2212\u221e"
    return typeset(pretty_unit(format_quantity(value, cell.unit, cell.digits)) + cell.suffix)


def _id(anchor: str) -> str:
    return f' id="{escape(anchor)}"' if anchor else ""


def _inline(text: str) -> str:
    """Convert a sentence with backticks and links to HTML."""
    parts = (
        f"<code>{escape(part[1:-1])}</code>" if i % 2 else typeset(part) for i, part in enumerate(_CODE.split(text))
    )
    return LINK.sub(r'<a href="#\2">\1</a>', "".join(parts))


def typeset(text: str) -> str:
    """Convert plain text to HTML with the minus signs, subscripts and relations that the figures have.

    Args:
        text: the text. Quoted numbers in it stay as they are, because users copy them.

    Returns:
        The HTML.

    Examples:
        >>> typeset("gain D_p <= 0.5 N s") == "gain D<sub>p</sub> \u2264 0.5 N s"
        True
        >>> typeset('use --gain "-0.5 N*s"')
        'use --gain &quot;-0.5 N*s&quot;'
    """
    parts = (part if i % 2 else minus_signs(part) for i, part in enumerate(_QUOTED.split(text)))
    plain = "".join(parts).replace("<=", "\u2264").replace(">=", "\u2265").replace("-\u221e", "\u2212\u221e")
    return "".join(
        f"<sub>{escape(part)}</sub>" if i % 2 else escape(part) for i, part in enumerate(_SUBSCRIPT.split(plain))
    )
