"""Remove the frames of tables: rules, bars and brackets, as in Markdown, LaTeX, wikis and source code."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Final

from .cells import is_number
from .formed_lines import COLUMN, LOOKED_AT, MOST, FormedLines, share

_RULE: Final = re.compile(
    r"[\s|+:¦]*(?:[-=_*~+]{3,}[\s|+:¦]*)+|\s*\\(?:hline|toprule|midrule|bottomrule|begin|end)\b.*"
    r"|\s*\{\|.*|\s*\|[-}].{0,60}|\s*\(\d+ rows?\)\s*"
    r"|.{0,200}[=:]\s*[\[{(]+\s*|\s*[\[{(]+\s*|\s*[\]})]+\s*[;,]?\s*"
)
"""Lines without cells: rules, the first and the last line of a table, and the count of its rows."""
_MACRO: Final = re.compile(r"\\[A-Za-z]+|[{}$]")
_OPENING: Final = "|!([{"
_CLOSING: Final = "|)]}"
_BARS: Final = ("|", "¦", ":")


def without_frames(numbers: Sequence[int], texts: list[str]) -> FormedLines:
    """Remove rules, bars, and brackets around rows.

    Args:
        numbers: the numbers of the lines.
        texts: the lines.

    Returns:
        The rows, with tabs in place of bars. Other lines stay as they are.
    """
    first = texts[:LOOKED_AT]
    if any(map(_is_rule, first)):
        kept = [(i, text) for i, text in zip(numbers, texts, strict=True) if not _is_rule(text)]
        if not kept:
            return FormedLines(numbers, texts, ())
        numbers, texts = [i for i, _ in kept], [text for _, text in kept]
    if any(map(_is_framed, first)) and share(map(_is_framed, texts)) >= MOST:
        return _without_brackets(numbers, texts)
    mark = _bar(texts[:LOOKED_AT])
    if mark:
        count = texts[0].count(mark)
        texts = [
            COLUMN.join(cell.strip() for cell in text.split(mark)) if text.count(mark) == count else text
            for text in texts
        ]
    return FormedLines(numbers, texts, ())


def _is_rule(text: str) -> bool:
    return bool(_RULE.fullmatch(text)) and len(text) < 4096


def _is_framed(text: str) -> bool:
    stripped = text.strip()
    if stripped[:1] == "{" and ":" in stripped:  # an object of JSON
        return False
    return (
        (stripped[:1] in _OPENING and stripped.rstrip(",;")[-1:] in _CLOSING)
        or stripped.endswith("\\\\")
        or (stripped[:2] == "! " or (stripped[:2] == "| " and "||" in stripped))
    )


def _without_brackets(numbers: Sequence[int], texts: list[str]) -> FormedLines:
    kept = [(i, text.strip()) for i, text in zip(numbers, texts, strict=True)]
    kept = [(i, text) for i, text in kept if text.strip("()[]{}|!, ")]
    rows = []
    for _, text in kept:
        if text.startswith("! ") or "||" in text:
            rows.append(COLUMN.join(cell.strip() for cell in re.split(r"!!|\|\|", text.strip("|! "))))
        elif text.startswith("|") or text.endswith("\\\\"):
            mark = "|" if text.startswith("|") else "&"
            inner = text.removesuffix("\\\\").strip().strip("|")
            inner = _MACRO.sub("", inner) if mark == "&" else inner
            rows.append(COLUMN.join(cell.strip() for cell in inner.split(mark)))
        else:
            rows.append(text.rstrip(",;").strip("()[]{}"))
    return FormedLines([i for i, _ in kept], rows, ())


def _bar(texts: Sequence[str]) -> str:
    """Return the bar or colon that separates the cells of a table without a frame; empty if there is none.

    Each line has equally many, and other delimiters do not separate anything.
    """
    for mark in _BARS:
        counts = Counter(text.count(mark) for text in texts)
        (count, often) = counts.most_common(1)[0] if counts else (0, 0)
        if not count or often < MOST * len(texts) or texts[0].count(mark) != count:
            continue
        rows = [[cell.strip() for cell in text.split(mark)] for text in texts[1:] if text.count(mark) == count]
        filled = [row for row in rows if sum(map(is_number, row)) >= 2 or (mark != ":" and any(map(is_number, row)))]
        names = texts[0].split(mark)
        if len(filled) >= MOST * len(rows) > 0 and (mark != ":" or not any(is_number(n.strip()) for n in names)):
            return mark
    return ""
