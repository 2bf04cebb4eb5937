"""Read the CSV files of two families of oscilloscopes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from .cells import is_number
from .formed_lines import LOOKED_AT, FormedLines

_COLUMNS: Final = 5  # of a file with settings, times and values


def of_oscilloscope(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Return the rows of two formats of oscilloscopes, or None.

    One has its settings in the first three columns of the first rows; the other counts the samples, and gives the start
    and the increment of the time in its second row.
    """
    cells = [[cell.strip() for cell in text.split(",")] for text in texts[:LOOKED_AT]]
    if cells and cells[0][0] == "Record Length" and len(cells[0]) >= _COLUMNS:
        settings = {row[0]: row[1] for row in cells if len(row) >= _COLUMNS and row[0]}
        header = f"time [{settings.get('Horizontal Units') or 's'}],output [{settings.get('Vertical Units') or 'V'}]"
        rows = [",".join(text.split(",")[3:5]) for text in texts]
        return FormedLines([numbers[0], *numbers], [header, *rows], ("The file is one of an oscilloscope.",))
    if len(cells) > 1 and cells[0][0] == "X" and {"Start", "Increment"} <= set(cells[0]):
        channels = [name for name in cells[0][1:] if name and name not in {"Start", "Increment"}]
        ends = [cell for cell in cells[1][1 + len(channels) :] if is_number(cell)]
        if len(ends) != len(("start", "increment")) or not all(
            text.partition(",")[0].strip().isdigit() for text in texts[2:]
        ):
            return None
        units, (start, step) = cells[1][1 : 1 + len(channels)], map(float, ends)
        titles = [f"{name} [{unit}]" for name, unit in zip(channels, units, strict=True)]
        rows = [",".join(["time [s]", *titles])]
        for text in texts[2:]:
            first, *rest = text.split(",")
            rows.append(",".join([f"{start + step * float(first):.12g}", *rest[: len(channels)]]))
        return FormedLines([numbers[0], *numbers[2:]], rows, ("The file is one of an oscilloscope.",))
    return None
