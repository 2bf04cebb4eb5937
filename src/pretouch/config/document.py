"""A scenario file as text and as data, the line of every key in it, and what was probably meant where it is no TOML.

Where each key of a TOML text stands: a small scan, because neither tomllib nor tomlkit tells. The scan trusts that
`tomllib` has accepted the text, so it only has to find keys, not to check anything.
"""

from __future__ import annotations

import bisect
import difflib
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pretouch._core.errors import ScenarioFileError
from pretouch._core.files import read_regular_file

from .quantities import KeyPath, printable

_PLACE: Final = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
_MOST_BYTES: Final = 1_000_000
_DEEPEST: Final = 32
_PART: Final = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP: Final = re.compile(rf"(?<![\w.\"'-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_DEEPEST},}}+")
_TWICE: Final = re.compile(r"Cannot (overwrite|declare|mutate|redefine)|already")


def read_document(path: str | os.PathLike[str]) -> tuple[bytes, str, dict[str, Any]]:
    """Return bytes, text and data of a file; raise ScenarioFileError where it cannot be read or is no valid TOML."""
    place = Path(path)
    content = _read(place)
    text = _decode(place, content)
    return content, text, _parse(place, text)


def _read(path: Path) -> bytes:
    """Read the bytes of a file, or say why not."""
    try:
        return read_regular_file(path, most=_MOST_BYTES, refuse=ScenarioFileError)
    except FileNotFoundError:
        near = difflib.get_close_matches(path.name, _names_beside(path), n=1)
        hint = f"; did you mean {path.with_name(near[0])}?" if near else ""
        raise ScenarioFileError(f"{path}: there is no such file{hint}") from None
    except IsADirectoryError:
        raise ScenarioFileError(f"{path}: found a folder, expected a scenario file (TOML)") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioFileError(f"{path}: cannot be read ({reason})") from None


def _names_beside(path: Path) -> list[str]:
    try:
        return [p.name for p in path.parent.glob("*.toml")]
    except OSError:
        return []


def _decode(path: Path, content: bytes) -> str:
    """Turn bytes into text: UTF-8, with or without a mark at its start, any line ends."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise ScenarioFileError(f"{path}, line 1: found text in UTF-16, expected UTF-8; save the file as UTF-8")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        found = content[error.start : error.start + 1].hex()
        raise ScenarioFileError(
            f"{path}, line {line}: found the byte 0x{found}, expected text in UTF-8; save the file as UTF-8"
        ) from None


def _parse(path: Path, text: str) -> dict[str, Any]:
    """Read TOML, or say in which line it breaks, and what people often mean there."""
    deep = _DEEP.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise ScenarioFileError(
            f"{path}, line {line}: found a key of more than {_DEEPEST} parts, expected at most that; a scenario takes "
            "section.key"
        )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ScenarioFileError(f"{path}, line 1: found lists nested too deeply, expected a scenario file") from None
    except ValueError as error:  # TOMLDecodeError, or an integer with thousands of digits
        lines = text.split("\n")
        message = str(error)
        place = _PLACE.search(message)
        number = int(place.group(1)) if place and place.group(1) else len(text.rstrip().split("\n"))
        if place is None:
            number = max(range(len(lines)), key=lambda i: len(lines[i])) + 1
        what = _PLACE.sub("", message)
        found = lines[number - 1].strip() if number <= len(lines) else ""
        found = found if len(found) <= 60 else f"{found[:57]}..."
        hint = printable(_hint(path, what, found))
        raise ScenarioFileError(f"{path}, line {number}: found {found!r}, which is not valid TOML: {hint}") from None


def _hint(path: Path, what: str, found: str) -> str:
    """Say what the parser says, or what is probably meant."""
    key, _, value = (part.strip() for part in re.sub(r"\s#.*", "", found).partition("="))
    if path.suffix.lower() in {".csv", ".tsv", ".txt"}:
        return "expected a scenario file; for a calibration use: pretouch fit"
    if _TWICE.search(what):
        return f"this {'section' if found.startswith('[') else 'key'} is given twice, expected it once"
    if re.fullmatch(r"[-+]?\d+,\d+.*", value):
        return f"expected a decimal point in the place of the comma: {key} = {value.replace(',', '.', 1)}"
    if re.fullmatch(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*[^\W\d].*", value) and '"' not in value:
        return f'a quantity with a unit is text, expected {key} = "{value}"'
    if re.fullmatch(r"[^\W\d][^\"'\[\]{}=#]*", value):
        return f'text stands in quotes, expected {key} = "{value}"'
    return f"{what[:1].lower()}{what[1:]}"


_BLANK: Final = re.compile(r"[ \t]*")
_BETWEEN: Final = re.compile(r"(?:[\s,]|#[^\n]*)*")
_KEY: Final = re.compile(r"""("(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[^\s.=\[\]"'{},#]+)""")
_STRING: Final = re.compile(
    r'"""(?:[^\\]|\\.)*?"""("{0,2})' "|" r"'''.*?'''('{0,2})" "|" r'"(?:[^"\\\n]|\\.)*"' "|" r"'[^'\n]*'", re.DOTALL
)
_PLAIN: Final = re.compile(r"[^,\]}#\n]*")


def key_lines(text: str) -> Mapping[KeyPath, int]:
    r"""Map every key of a text that `tomllib.loads` accepts to the line on which it stands.

    Returns:
        The line, from 1, by path.

    Examples:
        >>> lines = key_lines('[gain]\nbounds = [\n  "-10 N*s",\n  "-0.01 N*s",\n]\n')
        >>> lines["gain",], lines["gain", "bounds"], lines["gain", "bounds", 1]
        (1, 2, 4)
    """
    return _Scan(text.replace("\r\n", "\n")).run()


class _Scan:
    def __init__(self, text: str) -> None:
        self.text = text
        self.position = 0
        self.found: dict[KeyPath, int] = {}
        self.tables: dict[KeyPath, int] = {}  # last index of each array of tables
        self.starts = [0, *(m.end() for m in re.finditer("\n", text))]

    def run(self) -> dict[KeyPath, int]:
        """Read the document, header by header."""
        section: KeyPath = ()
        self.skip(_BETWEEN)
        while self.position < len(self.text):
            if self.text[self.position] == "[":
                section = self.header()
            else:
                self.pair(section)
            self.skip(_BETWEEN)
        return self.found

    def header(self) -> KeyPath:
        """Read `[a.b]` or `[[a.b]]`; return the path of what follows."""
        start = self.position
        double = self.text.startswith("[[", start)
        self.position += 2 if double else 1
        keys = self.dotted()
        path: KeyPath = ()
        for i, key in enumerate(keys):
            path = (*path, key)
            self.mark(path, start)
            if double and i == len(keys) - 1:
                self.tables[path] = self.tables.get(path, -1) + 1
            if path in self.tables:
                path = (*path, self.tables[path])
                self.mark(path, start)
        self.position += 2 if double else 1
        return path

    def pair(self, section: KeyPath) -> None:
        """Read `key = value`."""
        start = self.position
        path = section
        for key in self.dotted():
            path = (*path, key)
            self.mark(path, start)
        self.position += 1  # the sign of equality
        self.value(path)

    def dotted(self) -> list[str]:
        """Read a key and what its dots divide it into, up to the sign that ends it."""
        keys = []
        while True:
            self.skip(_BLANK)
            match = _KEY.match(self.text, self.position)
            if match is None:
                raise ValueError(f"no key at {self.position}")
            self.position = match.end()
            keys.append(_plain_key(match.group(1)))
            self.skip(_BLANK)
            if not self.text.startswith(".", self.position):
                return keys
            self.position += 1

    def value(self, path: KeyPath) -> None:
        """Read over a value, marking what is inside it."""
        self.skip(_BLANK)
        opening = self.text[self.position : self.position + 1]
        if opening in {'"', "'"}:
            self.skip(_STRING)
        elif opening == "[":
            self.position += 1
            self.skip(_BETWEEN)
            index = 0
            while not self.text.startswith("]", self.position):
                self.mark((*path, index), self.position)
                self.value((*path, index))
                self.skip(_BETWEEN)
                index += 1
            self.position += 1
        elif opening == "{":
            self.position += 1
            self.skip(_BETWEEN)
            while not self.text.startswith("}", self.position):
                self.pair(path)
                self.skip(_BETWEEN)
            self.position += 1
        else:
            self.skip(_PLAIN)

    def skip(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self.text, self.position)
        if match is None:
            raise ValueError(f"nothing readable at {self.position}")
        self.position = match.end()

    def mark(self, path: KeyPath, position: int) -> None:
        self.found.setdefault(path, bisect.bisect_right(self.starts, position))


def _plain_key(key: str) -> str:
    return next(iter(tomllib.loads(f"{key} = 0"))) if key[0] in "\"'" else key
