"""Hold the lines of a file as rows of a table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

COLUMN: Final = "\t"
"""What separates the cells of rows that are made from other forms of lines."""
MOST: Final = 0.8
"""Share of the lines of a file that must have a form, so that the file is read in this form."""
LOOKED_AT: Final = 200
"""Number of lines from which the form is told."""


class FormedLines(NamedTuple):
    """Lines of a file as rows of a table, with the line number of each.

    `notes` say how the lines were understood, `lost` which lines are not read.
    """

    numbers: Sequence[int]
    texts: list[str]
    notes: tuple[str, ...]
    lost: tuple[str, ...] = ()


def share(matches: Iterable[object]) -> float:
    """Return the share of values that are true."""
    marks = [bool(each) for each in matches]
    return sum(marks) / len(marks) if marks else 0.0
