"""Read tables of text as people, instruments and loggers write them: dialect, header, units, numbers and times."""

from .column_options import ColumnOption, ColumnOptions, columns_hint, find_label_columns, parse_column_options
from .text_table import read_table

__all__ = [
    "ColumnOption",
    "ColumnOptions",
    "columns_hint",
    "find_label_columns",
    "parse_column_options",
    "read_table",
]
