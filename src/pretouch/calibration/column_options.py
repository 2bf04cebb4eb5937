"""Options that select the columns of a table, by header or number, and give their units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pretouch._core.errors import CalibrationDataError

from .headers import TextTable, is_length, listed, shortened, split_title

_SHOWN = 20  # headers that a message lists
_KEYS = ("distance", "output")
_HERE = "in a scenario file and in Python"


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """One column, the `distance` or the `output`, as somebody names it: by its number from 1, its name, or its unit.

    The number is None where the column is given by its header, or only its unit is; the unit where the header tells.
    Nothing is known of a column that is left open.
    """

    key: str
    text: str = ""
    number: int | None = None
    name: str = ""
    unit: str | None = None

    @property
    def names_a_column(self) -> bool:
        """Whether a column is meant, and not only its unit said."""
        return self.number is not None or bool(self.name)

    def index(self, table: TextTable) -> int | None:
        """Find the column in a table; None where only its unit was said."""
        return _find(table, self.number, (self.text, self.name), f"columns: found {self.text!r} for the {self.key}")

    def unit_beside(self, title: str) -> str | None:
        """Return the unit of the column, which may be said or stand in its header, but not differ between them."""
        found = split_title(title)[1]
        if self.unit is None or self.text == title:
            return found
        if found is not None and found != self.unit:
            raise CalibrationDataError(
                f"columns: found the unit {self.unit!r} for the {self.key}, whose header {title!r} says {found!r}: "
                "leave one of them out"
            )
        return self.unit


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnChoice:
    """What was said about the columns of distances and outputs."""

    distance: Chosen = Chosen(key="distance")
    output: Chosen = Chosen(key="output")

    @property
    def names_a_column(self) -> bool:
        """Whether a column of distances or outputs was named, which only a long table has."""
        return self.distance.names_a_column or self.output.names_a_column

    @property
    def has_a_number(self) -> bool:
        """Whether a column was given by its number, which needs no header."""
        return self.distance.number is not None or self.output.number is not None

    @property
    def declares_distances(self) -> bool:
        """Whether only the unit of distances was said."""
        return self.distance.unit is not None and not self.distance.names_a_column

    def names_one_of(self, header: Sequence[str]) -> bool:
        """Tell whether a line holds a header that was given by name."""
        titles = {title.casefold() for title in header} | {split_title(title)[0].casefold() for title in header}
        return any(c.name and {c.text.casefold(), c.name.casefold()} & titles for c in (self.distance, self.output))


def read_choice(columns: Mapping[str, object] | None) -> ColumnChoice:
    """Read what somebody says about the `distance` and the `output` column, as `read_calibration` takes it."""
    found = {}
    for key, value in (columns or {}).items():
        if key not in _KEYS:
            raise CalibrationDataError(f"columns: found {key!r}, expected only 'distance' and 'output'")
        if isinstance(value, bool) or not isinstance(value, (str, int)) or not str(value).strip():
            raise CalibrationDataError(
                f"columns: found {value!r} for the {key}, expected the header of a column or its number, such as "
                f'{key}=1, or its unit, such as {key}="[{"mm" if key == "distance" else "V"}]"'
            )
        text = str(value).strip()
        match = re.fullmatch(r"(.*?)\s*\[([^\[\]]*)\]", text)
        name, unit = (match[1], match[2].strip()) if match else (text, None)
        if key == "distance" and unit is not None and not is_length(unit):
            raise CalibrationDataError(
                f"columns: found the unit {unit!r} for the distance, expected a length such as mm"
            )
        number = int(name) if re.fullmatch(r"\d{1,6}", name) else None
        found[key] = Chosen(key=key, text=text, number=number, name="" if number is not None else name, unit=unit)
    return ColumnChoice(**found)


def chosen_labels(table: TextTable, labels: Sequence[str | int]) -> tuple[int, ...]:
    """Find the columns that are named as labels, by headers or numbers from 1; in the order of the file."""
    found = set()
    for label in [labels] if isinstance(labels, str) else labels:
        text = str(label).strip()
        number = int(text) if re.fullmatch(r"\d{1,6}", text) and text not in table.header else None
        found.add(_find(table, number, (text, text), f"labels: found {text!r}"))
    return tuple(sorted(i for i in found if i is not None))


def remedy(columns: str) -> str:
    """Say what to type: on the command line, and where else it stands."""
    return f'--columns "{columns}" ({_HERE}: columns)'


def _find(table: TextTable, number: int | None, names: tuple[str, str], found: str) -> int | None:
    """Find a column by its number, its whole header, or the name in it, the stricter first."""
    if number is not None:
        if not 1 <= number <= len(table.header):
            raise CalibrationDataError(f"{found}, expected a number from 1 to {len(table.header)}")
        return number - 1
    text, name = names
    if not name:
        return None
    plain = [split_title(title)[0] for title in table.header]
    for wanted, among in (
        (text, list(table.header)),
        (name, plain),
        (name.casefold(), [title.casefold() for title in plain]),
    ):
        at = [i for i, title in enumerate(among) if title == wanted]
        if len(at) > 1:
            raise CalibrationDataError(
                f"{found}, which columns {' and '.join(str(i + 1) for i in at[:2])} of {table.file} are called: give "
                "the number of the one that is meant"
            )
        if at:
            return at[0]
    known = [shortened(title) for title in table.header]
    raise CalibrationDataError(f"{found}, expected one of {listed(known, _SHOWN)}")
