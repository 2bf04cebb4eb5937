"""Read what the code of a warning, such as PT406, means.

The page docs/warnings/PT406.md is the only place with these words. The wheel contains a copy of the pages.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from .errors import BrokenCoreError

_CODED: Final = re.compile(r"(PT\d{3}): ")
_PAGE: Final = re.compile(
    r"# PT\d{3}: (?P<title>[^\n]+)\n\n"
    r"## What it means\n\n(?P<meaning>.+)\n\n"
    r"## Why it matters\n\n(?P<why>.+)\n\n"
    r"## What to do\n\n(?P<remedy>.+)\n\n"
    r"## Example\n\n```text\nPT\d{3}: (?P<example>[^\n]+)\n```\n\n"
    r"\[All warnings\]\(README\.md\)\n",
    re.DOTALL,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class WarningCode:
    """The explanation of one kind of warning.

    Args:
        code: code of the warning, such as PT101.
        title: what the warning is about, in a few words.
        meaning: what the warning means.
        why: why the warning matters.
        remedy: what to do.
        example: example of the text of such a warning.
    """

    code: str
    title: str
    meaning: str
    why: str
    remedy: str
    example: str


def caution(code: str, text: str) -> str:
    """Return the text of a warning with its code in front.

    Args:
        code: the code; docs/warnings/ has a page for it.
        text: what is wrong, with value and unit.

    Returns:
        Code and text, such as `PT301: the optimal gain lies on its bound -10 N s`.
    """
    return f"{code}: {text}"


def split_code(text: str) -> tuple[str, str]:
    """Split a warning into its code and its text.

    Returns:
        The code, such as PT101, and the text; the code is empty if the warning has none.
    """
    match = _CODED.match(text)
    return (match[1], text[match.end() :]) if match else ("", text)


def with_context(context: str, text: str) -> str:
    """Return a warning with a context, such as a sensor name.

    The context, such as the name of a sensor site, follows the warning code.
    """
    code, rest = split_code(text)
    return f"{code}: {context}: {rest}" if code else f"{context}: {rest}"


def codes_in(texts: Iterable[str]) -> tuple[str, ...]:
    """Return the warning codes that occur in several texts.

    Each code occurs once. The codes are in ascending order.
    """
    return tuple(sorted({code for text in texts for code in _CODED.findall(text)} & set(warning_codes())))


def page_of_code(code: str) -> str:
    """Return the documentation page of a warning code.

    The path is relative to the source tree.
    """
    return f"docs/warnings/{code}.md"


def warning_codes() -> tuple[str, ...]:
    """Return the codes of all warnings, in ascending order."""
    return tuple(sorted(path.stem for path in _pages().glob("PT*.md")))


@cache
def explanation(code: str) -> WarningCode:
    """Return what a warning code means, from its page."""
    page = (_pages() / f"{code}.md").read_text(encoding="utf-8")
    parts = _PAGE.fullmatch(page)
    if parts is None:
        raise BrokenCoreError(f"{code}.md: the page of this warning is damaged; reinstall pretouch")
    return WarningCode(code=code, **{name: " ".join(text.split()) for name, text in parts.groupdict().items()})


@cache
def _pages() -> Path:
    """Return the folder with the pages: that of the wheel, or that of the source tree."""
    installed, tree = Path(__file__).with_name("warnings"), Path(__file__).parents[3] / "docs/warnings"
    for folder in (installed, tree):
        if folder.is_dir():
            return folder
    raise BrokenCoreError("warnings: the pages of the warnings are missing from this installation; reinstall pretouch")
