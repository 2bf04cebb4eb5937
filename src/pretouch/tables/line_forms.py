"""Bring lines of text that are no rows of a table yet, such as `10:12:33.000 -> 27`, into rows."""

from __future__ import annotations

from collections.abc import Sequence

from .cells import is_number, is_row
from .dialect import cells_of, delimiter_of_row
from .distance_blocks import may_have_blocks, of_blocks, title_cells
from .formed_lines import COLUMN, LOOKED_AT, MOST, FormedLines, share
from .frames import without_frames
from .labeled_records import of_labels
from .labels import labeled_cells
from .line_prefixes import TIME_OF_LINE, without_stamp
from .names import is_length, is_named, split_title
from .oscilloscopes import of_oscilloscope
from .source_code import of_arrays, of_vectors
from .yaml_documents import of_documents, of_stamped_messages

_MOST_STACKED = 8  # headers that stand on a line each


def form_lines(file: str, numbers: Sequence[int], texts: list[str]) -> FormedLines:
    """Bring the lines of a file into rows of a table.

    Times in front of the lines become a column. Labels become the header. Brackets around rows, and the frames of
    tables in Markdown and LaTeX are removed. Other lines stay as they are.

    Args:
        file: name of the file, for messages.
        numbers: the numbers of the lines.
        texts: the lines.

    Returns:
        The lines, with notes on what was changed.
    """
    for form in (of_arrays, of_oscilloscope, of_documents, of_stamped_messages, of_vectors):
        formed = form(numbers, texts)
        if formed is not None:
            return formed
    numbers, texts, *_ = without_frames(numbers, texts)
    given, plain = numbers, texts
    titles = [text for text in texts[:LOOKED_AT] if title_cells(text)]
    first = [text for text in texts[:LOOKED_AT] if text not in titles]
    notes: tuple[str, ...] = ()
    if share(without_stamp(text)[0] for text in first) >= MOST:
        numbers, texts = _with_times(numbers, texts)
        notes = ("The times in front of the lines are read as a column.",)
        first = [text for text in texts[:LOOKED_AT] if text.rpartition(COLUMN)[2] not in titles]
    if share(labeled_cells(text.rpartition(COLUMN)[2]) for text in first) >= MOST:
        labeled = of_labels(file, numbers, texts)
        if labeled is not None:
            return labeled._replace(notes=(*notes, *labeled.notes))
    if titles or may_have_blocks(first):
        blocks = of_blocks(file, given, [without_stamp(text)[1] for text in plain])
        if blocks is not None:
            return blocks
    return _with_stacked_header(numbers, texts) or FormedLines(numbers, texts, notes)


def _with_times(numbers: Sequence[int], texts: list[str]) -> tuple[Sequence[int], list[str]]:
    """Make the times in front of the lines a column; a line without one belongs to the header or has no time."""
    rows = []
    parts = [without_stamp(text) for text in texts]
    rests = (rest for stamp, rest in parts if stamp or not title_cells(rest))
    several = next((rest for rest in rests if len(cells_of(rest, delimiter_of_row(rest))) > 1), "")
    mark = COLUMN if labeled_cells(several) or not several else delimiter_of_row(several)
    for stamp, rest in parts:
        is_reading = is_row(cells_of(rest, mark)) or is_number(rest.strip()) or labeled_cells(rest) is not None
        rows.append(f"{stamp if is_reading else TIME_OF_LINE}{mark}{rest}")
    head = rows[0].startswith(TIME_OF_LINE)
    if not head and not labeled_cells(parts[0][1]):
        width = len(cells_of(parts[0][1], mark))
        rows.insert(0, mark.join([TIME_OF_LINE, *(f"column {i + 2}" for i in range(width))]))
        numbers = [numbers[0], *numbers]
    return numbers, rows


def _with_stacked_header(numbers: Sequence[int], texts: list[str]) -> FormedLines | None:
    """Join headers that stand on a line each above the rows, as in text that was copied from a PDF, or return None."""
    for count in range(2, min(len(texts) - 1, _MOST_STACKED) + 1):
        mark = delimiter_of_row(texts[count])
        row = cells_of(texts[count], mark)
        if not all(map(is_number, row)):
            continue
        titles = [split_title(text) for text in texts[:count]]
        names_one = any(is_length(unit) for _, unit in titles)
        if len(row) != count or not names_one or not all(unit or is_named(name, "output") for name, unit in titles):
            return None
        rows = [COLUMN.join(cells_of(text, mark)) for text in texts[count:]]
        header = COLUMN.join(text.strip() for text in texts[:count])
        note = f"The headers of the columns are lines {numbers[0]} to {numbers[count - 1]}."
        return FormedLines([numbers[0], *numbers[count:]], [header, *rows], (note,))
    return None
