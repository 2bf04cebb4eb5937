"""Recognize dates that a spreadsheet made of numbers, such as `01. Feb` of 1.2."""

from __future__ import annotations

import re
from typing import Final

_MONTHS: Final = (
    "jan january januar janv janvier ene enero gen gennaio januari jänner",
    "feb february februar févr fév février febrero febbraio februari",
    "mar march mrz mär märz mars marzo mrt maart",
    "apr april avr avril abr abril aprile",
    "may mai mayo mag maggio mei",
    "jun june juni juin junio giu giugno",
    "jul july juli juil juillet julio lug luglio",
    "aug august août ago agosto augustus",
    "sep sept september septembre septiembre set settembre",
    "oct october okt oktober octobre octubre ott ottobre",
    "nov november novembre noviembre",
    "dec december dez dezember déc décembre dic diciembre dicembre",
)
_MONTH_OF: Final = {name: i for i, names in enumerate(_MONTHS, start=1) for name in names.split()}
_DAY_FIRST: Final = re.compile(r"(\d{1,2})[. /-]+([^\W\d_]{3,10})\.?(?:[. /-]+\d{2,4})?")
_MONTH_FIRST: Final = re.compile(r"([^\W\d_]{3,10})\.?[. /-]+(\d{1,4})")
_PARTS_OF_AN_INCH: Final = frozenset({2, 4, 8, 16})
_IN_FULL: Final = re.compile(r"\d{4}-(\d\d)-(\d\d)(?:[t ]00:00(?::00)?)?")


def number_of_date(cell: str) -> str | None:
    """Return the number from which a spreadsheet probably made a date; None if a cell is no date.

    A day may also be the lower number of a fraction.

    Examples:
        >>> number_of_date("01. Feb"), number_of_date("3-May"), number_of_date("Mai 50"), number_of_date("12.5")
        ('1.2', '3.5', '5.50', None)
        >>> number_of_date("2024-02-01T00:00:00"), number_of_date("8-Mar")
        ('1.2', '8.3 or 3/8')
    """
    text = cell.strip().casefold()
    match = _DAY_FIRST.fullmatch(text)
    if match is not None and match[2] in _MONTH_OF:
        return _of_day(int(match[1]), _MONTH_OF[match[2]])
    match = _MONTH_FIRST.fullmatch(text)
    if match is not None and match[1] in _MONTH_OF:
        return f"{_MONTH_OF[match[1]]}.{match[2]}"
    match = _IN_FULL.fullmatch(text)
    return _of_day(int(match[2]), int(match[1])) if match is not None else None


def _of_day(day: int, month: int) -> str:
    fraction = f" or {month}/{day}" if day in _PARTS_OF_AN_INCH and month < day else ""
    return f"{day}.{month}{fraction}"
