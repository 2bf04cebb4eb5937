"""How a C or C++ source can be changed: in the form that clang-format gives it, operators have spaces around them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from mutants.edits import Edit, other_number

OPERATORS = {
    " + ": (" - ",),
    " - ": (" + ",),
    " * ": (" / ",),
    " / ": (" * ",),
    " += ": (" -= ",),
    " -= ": (" += ",),
    " *= ": (" /= ",),
    " < ": (" <= ", " >= "),
    " <= ": (" < ", " > "),
    " > ": (" >= ", " <= "),
    " >= ": (" > ", " < "),
    " == ": (" != ",),
    " != ": (" == ",),
    " && ": (" || ",),
    " || ": (" && ",),
    " & ": (" | ",),
    " | ": (" & ",),
}
OPPOSITES = {"larger": "smaller", "smaller": "larger", "true": "false", "false": "true", "floor": "ceil"}
HIDDEN = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'', re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])(?:\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+|\d+)(?![\w.])")
DROPPED = re.compile(r"^ +(?:[\w.\[\]>-]+ (?:[-+*/|&]?=) [^;]*|[\w.]+\([^;]*\)|break|continue);$", re.MULTILINE)
DECLARES = re.compile(
    r"^\s*(?:#|template|using|namespace|struct|typedef|static_assert|extern|return;|void|__attribute__)"
)


def edits(text: str) -> Iterator[Edit]:
    """Yield every change of a C or C++ source; some do not compile, and are none."""
    bare = HIDDEN.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)
    begin = 0
    for line in bare.splitlines(keepends=True):
        if not DECLARES.match(line) and (line[0] == " " or "constexpr" in line):
            yield from _edits_of_line(line, begin, text)
        begin += len(line)


def _edits_of_line(line: str, begin: int, text: str) -> Iterator[Edit]:
    for old, others in OPERATORS.items():
        for match in re.finditer(f"(?={re.escape(old)})", line.rstrip()):
            start = begin + match.start()
            yield from (Edit(start, start + len(old), new) for new in others)
    for match in re.finditer(r"\b(?:larger|smaller|true|false|floor)\b", line):
        yield Edit(begin + match.start(), begin + match.end(), OPPOSITES[match.group()])
    for match in NUMBER.finditer(line):
        for new in other_number(match.group()):
            yield Edit(begin + match.start(), begin + match.end(), new)
    if DROPPED.match(line.rstrip("\n")):
        start = begin + len(line) - len(line.lstrip())
        yield Edit(start, begin + len(line.rstrip()), ";")
