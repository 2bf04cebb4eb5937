"""One change of a text."""

from __future__ import annotations

from typing import NamedTuple


class Edit(NamedTuple):
    """Put `new` in the place of the characters from `start` to `end`."""

    start: int
    end: int
    new: str


def other_number(text: str) -> list[str]:
    """Return numbers to put in the place of one: nearby, and far off in size."""
    try:
        value: float = int(text, 0)
    except ValueError:
        value = float(text)
        return ["1.0"] if value == 0 else [repr(value * 1.1), repr(value * 2.0)]
    return ["1"] if value == 0 else [str(int(value) + 1), str(int(value) - 1)]
