"""Rows of text in aligned columns, for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["aligned"]


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
