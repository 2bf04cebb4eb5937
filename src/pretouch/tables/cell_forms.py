"""Bring the numbers in table cells into one form, such as `2.5` for `2,5`, `2.5 mm`, `2.5 ± 0.1` and `1'250`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from decimal import Decimal
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.errors import CalibrationDataError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import parse_unit

from .cells import is_missing, is_no_object, is_number, quoted
from .names import split_title
from .number_forms import from_fraction, from_thousands, in_decimal, is_hexadecimal, with_exponent
from .unit_words import dimension, unit_in_words

_FIRST: Final = 50  # cells that are tried first
_SMALL: Final = 100.0  # counts below which all with three decimals are rarely means
_SPREAD: Final = re.compile(r"(.*?\S)\s*(?:±|\+/-|\+-)\s*[\d.,]+(.*)")
_WITH_UNIT: Final = re.compile(
    r"([-+\N{MINUS SIGN}]?[\d.,' \u00a0\u202f\N{RIGHT SINGLE QUOTATION MARK}]*\d\.?)\s*([^\d\s.,].*|\")"
)
_SPACED: Final = re.compile(r"[-+]?\d{1,3}(?:[' \u00a0\u202f\N{RIGHT SINGLE QUOTATION MARK}]\d{3})+(?:[.,]\d+)?")
_GROUPS: Final = {
    mark: re.compile(rf"[-+]?\d{{1,3}}(?:\{mark}\d{{3}}){{2,}}(?:\{other}\d+)?|[-+]?\d{{1,3}}\{mark}\d{{3}}\{other}\d+")
    for mark, other in ((",", "."), (".", ","))
}
"""Numbers whose mark certainly separates thousands, as in `1.234,5` and `1,234,567`."""
_ONE_COMMA: Final = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_AMBIGUOUS: Final = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")


class PlainColumns(NamedTuple):
    """The columns of a table after all numbers were brought into one form.

    `decimal_mark` is that of the file; the cells have it only where it is a comma that no other form hides.
    """

    header: tuple[str, ...]
    columns: tuple[Sequence[str], ...]
    floats: tuple[FloatArray | None, ...]
    decimal_mark: str
    notes: tuple[str, ...]


def plain_columns(
    file: str, header: tuple[str, ...], columns: tuple[Sequence[str], ...], lines: Sequence[int], delimiter: str
) -> PlainColumns:
    """Bring the numbers of a table into one form.

    Units in the cells move to the header. Thousands separators, uncertainties behind ± and hexadecimal digits are read.

    Returns:
        The columns. A column with anything else stays as it is.
    """
    titles, changed, notes, comma = list(header), list(columns), [], False
    floats = [_floats(cells) for cells in columns]
    others = [cells for cells, numbers in zip(columns, floats, strict=True) if numbers is None]
    has_commas = delimiter != "," and any(map(_has_certain_comma, others))
    for i, cells in enumerate(columns):
        if floats[i] is not None:
            if has_commas and _has_thousands(cells):
                changed[i] = tuple(cell.replace(".", "") for cell in cells)
                floats[i] = _floats(changed[i])
                notes.append(
                    f"The points in the column {titles[i]!r} separate thousands, because commas mark decimals."
                )
                continue
            is_counted = split_title(titles[i])[1] == "counts"
            _refuse_two_readings(file, cells, lines, ".", delimiter, is_counted=is_counted)
            continue
        distinct = {cell: cell for cell in set(cells)}
        if all(map(_is_plain, distinct)):
            continue
        forms = {cell: with_exponent(form) for cell, form in _without_spreads(distinct).items()}
        forms, notes_on_forms = _without_fractions(forms, titles[i])
        forms, unit = _without_units(forms, split_title(titles[i])[1])
        forms = _without_groups(forms)
        if not all(_is_plain(form) for form in forms.values()):
            continue
        own = split_title(titles[i])[1]
        if unit is not None and own not in {None, unit}:
            continue  # the cells and the header contradict each other
        comma |= any("," in cell for cell in forms.values())
        if unit is not None and own is None:
            titles[i] = f"{titles[i]} [{unit}]".strip()
            notes.append(f"The unit of the column {titles[i]!r} is in its cells.")
        if any("±" in cell or "+-" in cell or "+/-" in cell for cell in distinct):
            notes.append(f"The uncertainties in the column {titles[i]!r} are not used.")
        notes += notes_on_forms
        changed[i] = tuple(forms[cell] for cell in cells)
        floats[i] = _floats(changed[i])
    others = [cells for cells, numbers in zip(changed, floats, strict=True) if numbers is None]
    commas = [cells for cells in others if any("," in cell for cell in set(cells))]
    if commas:
        comma |= any(map(_has_decimal_comma, commas))
        for cells in commas:
            _refuse_two_readings(file, cells, lines, ",", delimiter)
    return PlainColumns(tuple(titles), tuple(changed), tuple(floats), "," if comma else ".", tuple(notes))


def plain_cell(cell: str) -> str:
    """Return the number in one cell without its uncertainty and its unit, and without separators of thousands.

    Examples:
        >>> plain_cell("2.5 ± 0.1 mm"), plain_cell("1'250"), plain_cell("0x1F"), plain_cell("9.6k")
        ('2.5', '1250', '31', '9600')
    """
    forms, _ = _without_units(_without_spreads({cell: from_thousands(cell) or cell.strip()}))
    return _without_groups(forms)[cell]


def _floats(cells: Sequence[str]) -> FloatArray | None:
    """Return the cells as numbers, if all are numbers with a decimal point; this is quick."""
    try:
        np.array(cells[:_FIRST]).astype(np.float64)
        numbers = np.fromiter(map(float, cells), np.float64, len(cells))
    except ValueError:
        return None
    return None if "_" in "".join(cells) else numbers


def _is_plain(cell: str) -> bool:
    return is_number(cell) or is_missing(cell) or is_no_object(cell)


def _has_decimal_comma(cells: Sequence[str]) -> bool:
    return any(_ONE_COMMA.fullmatch(cell) for cell in set(cells))


def _has_certain_comma(cells: Sequence[str]) -> bool:
    """Return True if a comma certainly marks decimals, as in `0,5`, and not thousands, as it may in `1,234`."""
    return any(_ONE_COMMA.fullmatch(cell) and not _AMBIGUOUS.fullmatch(cell) for cell in set(cells))


def _has_thousands(cells: Sequence[str]) -> bool:
    """Return True if every number with a point has three digits behind it, so that it may separate thousands."""
    marked = {cell for cell in cells if "." in cell}
    return bool(marked) and all(_AMBIGUOUS.fullmatch(cell.replace(".", ",")) for cell in marked)


def _without_spreads(forms: dict[str, str]) -> dict[str, str]:
    return {cell: "".join(m.groups()) if (m := _SPREAD.fullmatch(form)) else form for cell, form in forms.items()}


def _without_fractions(forms: dict[str, str], title: str) -> tuple[dict[str, str], list[str]]:
    """Read numbers such as `1 1/4` and `9.60k`, if all cells of a column are such numbers or others.

    Returns:
        The cells, and a note on the first of these numbers.
    """
    for read in (from_fraction, from_thousands):
        found = {cell: number for cell, form in forms.items() if (number := read(form)) is not None}
        if found:
            cell = min(found)
            note = f"Numbers such as {quoted(cell)} in the column {title!r} are read as {found[cell]}."
            return {**forms, **found}, [note]
    return forms, []


def _without_units(forms: dict[str, str], wanted: str | None = None) -> tuple[dict[str, str], str | None]:
    """Remove the unit from every cell.

    Cells with another unit of the same dimension are converted to the wanted unit, or else to the most frequent one.

    Returns:
        The cells without units, and the unit; None if there is none.
    """
    numbers, units = dict(forms), dict[str, str]()
    for cell, form in forms.items():
        match = None if _is_plain(form) or is_hexadecimal(form) else _WITH_UNIT.fullmatch(form)
        unit = unit_in_words(match[2].strip()) if match else None
        if match and unit:
            numbers[cell], units[cell] = match[1], unit
    if not units or len({parse_unit(unit).exponents for unit in units.values()}) > 1:
        return forms, None
    common = Counter(units.values()).most_common(1)[0][0]
    target = wanted if wanted and dimension(wanted) == parse_unit(common).exponents else common
    size = Decimal(repr(parse_unit(target).factor))
    for cell, unit in units.items():
        if unit != target:
            try:
                value = Decimal(numbers[cell].replace(",", "."))
            except ArithmeticError:
                return forms, None
            numbers[cell] = f"{value * Decimal(repr(parse_unit(unit).factor)) / size:f}"
    return numbers, target


def _without_groups(forms: dict[str, str]) -> dict[str, str]:
    """Remove separators of thousands, and read hexadecimal numbers."""
    texts = list(forms.values())
    grouped = next((mark for mark, pattern in _GROUPS.items() if any(map(pattern.fullmatch, texts))), "")
    found = {}
    for cell, form in forms.items():
        if is_hexadecimal(form):
            found[cell] = in_decimal(form)
        elif _SPACED.fullmatch(form):
            found[cell] = re.sub(r"[^\d.,+-]", "", form)
        elif grouped and (_GROUPS[grouped].fullmatch(form) or re.fullmatch(r"[-+]?[\d.,]+", form)):
            found[cell] = form.replace(grouped, "").replace("," if grouped == "." else ".", ".")
        else:
            found[cell] = form
    return found


def _refuse_two_readings(
    file: str, cells: Sequence[str], lines: Sequence[int], mark: str, delimiter: str, *, is_counted: bool = False
) -> None:
    """Check that the mark in `1,234` cannot both separate thousands and mark decimals, unless other cells tell which.

    If the cells are counts of a converter, all of them may have a mark: counts such as 9.600 are rarely means.

    Raises:
        CalibrationDataError: the numbers can be read in two ways.
    """
    if mark == "." and not _is_mixed(cells) and not (is_counted and _are_small_counts(cells)):
        return
    distinct = set(cells)
    marked = [cell for cell in distinct if mark in cell]
    unclear = [cell for cell in marked if _AMBIGUOUS.fullmatch(cell.replace(mark, ","))]
    whole = [cell for cell in distinct if re.fullmatch(r"[-+]?\d+", cell)]
    enough = is_counted or (len(whole) > 1 and len(unclear) > 1 if mark == "." else bool(whole) or delimiter == ",")
    if not unclear or len(unclear) < len(marked) or not enough:
        return
    cell = min(unclear, key=cells.index)
    line = lines[cells.index(cell)]
    thousands, decimals = cell.replace(mark, ""), cell.replace(mark, ".")
    raise CalibrationDataError(
        f"{file}, line {line}: {quoted(cell)} may be the number {thousands} or {decimals}. If it is {thousands}, write "
        f"the numbers without a separator of thousands; if it is {decimals}, write {decimals}0, with a fourth decimal, "
        "in each row",
        problem=f"{file}, line {line}: found numbers that can be read in two ways",
    )


def _is_mixed(cells: Sequence[str]) -> bool:
    """Return True if all numbers with a decimal point have three decimals, and others have no point."""
    return 0 < "".join(cells).count(".") < len(cells) and _has_thousands(cells)


def _are_small_counts(cells: Sequence[str]) -> bool:
    """Return True if all numbers have three decimals and are below 100, as counts of 16 bits in thousands are."""
    return all("." in cell for cell in cells) and _has_thousands(cells) and max(map(float, cells)) < _SMALL
