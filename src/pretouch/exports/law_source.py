"""Read the C source of the control law.

The fields of its C structures are read from the header.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

from pretouch._core.errors import BrokenCoreError

HEADER: Final = "pretouch_law.h"
SOURCE: Final = "pretouch_law.c"

_STRUCTURE: Final = re.compile(r"typedef struct \{(?P<body>.*?)\} (?P<name>\w+);", re.DOTALL)
_FIELD: Final = re.compile(r"(?P<type>\w+) (?P<names>[^;]+);[ \t]*(?:/\*(?P<comment>[^*]*)\*/)?")


class Field(NamedTuple):
    """One field of a C structure.

    Args:
        type: C type of the field, such as `pretouch_real`.
        name: name of the field.
        comment: what the C header says about the field; empty if it says nothing.
    """

    type: str
    name: str
    comment: str


@cache
def law_text(name: str) -> str:
    """Return the C source or header of the control law.

    The text is exactly the one that pretouch compiles.

    Args:
        name: `pretouch_law.h` or `pretouch_law.c`.

    Returns:
        The text of the file.

    Raises:
        BrokenCoreError: the file is missing from this installation.
    """
    installed, tree = Path(__file__).with_name("law") / name, Path(__file__).parents[3] / "native/law" / name
    for path in (installed, tree):
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise BrokenCoreError(
        f"{name}: the C source of the control law is missing from this installation; reinstall pretouch"
    )


@cache
def structures() -> dict[str, tuple[Field, ...]]:
    """Return the fields of the control law's C structures."""
    return {match["name"]: tuple(_fields(match["body"])) for match in _STRUCTURE.finditer(law_text(HEADER))}


def _fields(body: str) -> list[Field]:
    parts = []
    for match in _FIELD.finditer(body):
        comment = " ".join((match["comment"] or "").split())
        for declared in match["names"].split(","):
            name = declared.strip().partition("[")[0]
            parts.append(Field(match["type"], name, comment))
    return parts
