"""Parse options that select the columns of a calibration table.

The options can also give the units of these columns.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pretouch._core.errors import CalibrationDataError

from .cells import TextTable, join_first, quoted
from .names import is_length, split_title
from .unit_words import unit_in_words

_SHOWN = 20  # headers that a message lists
_KEYS = ("distance", "output")


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnOption:
    """User option for one column of a calibration table.

    The option selects the distance or output column, or gives the unit of this column. A column is selected by its
    number counted from 1, or by its header. The number is None if the option has a header, or only a unit. The unit is
    None if the option has no unit.
    """

    key: str
    text: str = ""
    number: int | None = None
    name: str = ""
    unit: str | None = None

    @property
    def names_a_column(self) -> bool:
        """Whether this option selects a column by number or header."""
        return self.number is not None or bool(self.name)

    def index(self, table: TextTable) -> int | None:
        """Return the index of the selected column.

        It is None if the option only gives a unit.
        """
        message = f"columns: found {self.text!r} for the {self.key} column"
        return _find(table, self.number, (self.text, self.name), message)

    def unit_with(self, title: str) -> str | None:
        """Return the unit of a table column.

        The unit comes from this option or from the column header. Two different units are an error.

        Raises:
            CalibrationDataError: the option and the header have different units.
        """
        header_unit = split_title(title)[1]
        if self.unit is None or self.text == title:
            return header_unit
        if header_unit is not None and header_unit != self.unit:
            raise CalibrationDataError(
                f"columns: found two units for the {self.key}. The option gives the unit {self.unit!r}, but the column "
                f"header {title!r} gives the unit {header_unit!r}. Give only one unit"
            )
        return self.unit


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnOptions:
    """User options for the columns of a calibration table.

    They apply to the columns of distances and outputs.
    """

    distance: ColumnOption = ColumnOption(key="distance")
    output: ColumnOption = ColumnOption(key="output")

    @property
    def names_a_column(self) -> bool:
        """Whether the options select a table column.

        In this case, each row of the table contains one reading.
        """
        return self.distance.names_a_column or self.output.names_a_column

    @property
    def has_a_number(self) -> bool:
        """Whether an option selects a column by number.

        This also works for a table without a header.
        """
        return self.distance.number is not None or self.output.number is not None

    @property
    def declares_distances(self) -> bool:
        """Whether the options give a distance unit but no column."""
        return self.distance.unit is not None and not self.distance.names_a_column

    def names_one_of(self, header: Sequence[str]) -> bool:
        """Return True if a line contains a selected column header."""
        titles = {title.casefold() for title in header} | {split_title(title)[0].casefold() for title in header}
        return any(c.name and {c.text.casefold(), c.name.casefold()} & titles for c in (self.distance, self.output))


def parse_column_options(columns: Mapping[str, object] | None) -> ColumnOptions:
    """Parse the user's options for table columns."""
    options: dict[str, ColumnOption] = {}
    for key, value in (columns or {}).items():
        if key not in _KEYS:
            raise CalibrationDataError(
                f"columns: found the key {key!r}, but only the keys 'distance' and 'output' are allowed"
            )
        if isinstance(value, bool) or not isinstance(value, (str, int)) or not str(value).strip():
            raise CalibrationDataError(
                f"columns: found {value!r} for the {key} column, expected a column header, a column number or a "
                f'unit. Examples are {key}=1 and {key}="[{("mm" if key == "distance" else "V")}]"'
            )
        text = str(value).strip()
        match = re.fullmatch(r"(.*?)\s*\[([^\[\]]*)\]", text)
        name, unit = (match[1], match[2].strip()) if match else (text, None)
        unit = unit and (unit_in_words(unit) or unit)
        if key == "distance" and unit is not None and not is_length(unit):
            raise CalibrationDataError(
                f"columns: found the unit {unit!r} for the distance, expected a unit of length such as mm"
            )
        number = int(name) if re.fullmatch(r"\d{1,6}", name) else None
        options[key] = ColumnOption(
            key=key, text=text, number=number, name="" if number is not None else name, unit=unit
        )
    chosen = ColumnOptions()
    return replace(
        chosen, distance=options.get("distance", chosen.distance), output=options.get("output", chosen.output)
    )


def find_label_columns(table: TextTable, labels: Sequence[str | int]) -> tuple[int, ...]:
    """Return the indices of the label columns.

    The user gives label columns by header or by number, counted from 1.
    """
    indices = set()
    for label in [labels] if isinstance(labels, str) else labels:
        text = str(label).strip()
        number = int(text) if re.fullmatch(r"\d{1,6}", text) and text not in table.header else None
        indices.add(_find(table, number, (text, text), f"labels: found {text!r}"))
    return tuple(sorted(i for i in indices if i is not None))


def columns_hint(columns: str) -> str:
    """Return the option `--columns` with recommended values, for an error message."""
    return f'the option --columns "{columns}" (called columns in a scenario file and in Python)'


def _find(table: TextTable, number: int | None, names: tuple[str, str], message: str) -> int | None:
    """Find a table column by its number or header. The header may be given without its unit."""
    if number is not None:
        if not 1 <= number <= len(table.header):
            raise CalibrationDataError(f"{message}, expected a number from 1 to {len(table.header)}")
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
                f"{message}. This name is ambiguous. The columns {' and '.join(str(i + 1) for i in at[:2])} of the "
                f"file {table.file} have the same name. Give the column number instead"
            )
        if at:
            return at[0]
    titles = [quoted(title) for title in table.header]
    raise CalibrationDataError(f"{message}, expected one of {join_first(titles, _SHOWN)}")
