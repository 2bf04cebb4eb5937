"""Find the line number of every key in a TOML text.

Neither tomllib nor tomlkit reports the lines of keys. The scan requires a text that `tomllib` has accepted. So it only
finds keys and checks nothing.
"""

from __future__ import annotations

import bisect
import re
import tomllib
from collections.abc import Mapping
from typing import Final

from .quantities import KeyPath

_BLANK: Final = re.compile(r"[ \t]*")
_BETWEEN: Final = re.compile(r"(?:[\s,]|#[^\n]*)*")
_KEY: Final = re.compile(r"""("(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[^\s.=\[\]"'{},#]+)""")
_STRING: Final = re.compile(
    r'"""(?:[^\\]|\\.)*?"""("{0,2})' "|" r"'''.*?'''('{0,2})" "|" r'"(?:[^"\\\n]|\\.)*"' "|" r"'[^'\n]*'", re.DOTALL
)
_PLAIN: Final = re.compile(r"[^,\]}#\n]*")


def key_lines(text: str) -> Mapping[KeyPath, int]:
    r"""Return the line number of every key of a TOML text.

    Returns:
        The line number of each key, counted from 1, by the path of the key.

    Examples:
        >>> lines = key_lines('[gain]\nbounds = [\n  "-10 N*s",\n  "-0.01 N*s",\n]\n')
        >>> lines["gain",], lines["gain", "bounds"], lines["gain", "bounds", 1]
        (1, 2, 4)
    """
    return _Scan(text.replace("\r\n", "\n")).run()


class _Scan:
    """A parser for the line numbers of keys in TOML."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.position = 0
        self.lines: dict[KeyPath, int] = {}
        self.tables: dict[KeyPath, int] = {}  # last index of each array of tables
        self.starts = [0, *(m.end() for m in re.finditer("\n", text))]

    def run(self) -> dict[KeyPath, int]:
        """Return the line number of every key in the text."""
        section: KeyPath = ()
        self.skip(_BETWEEN)
        while self.position < len(self.text):
            if self.text[self.position] == "[":
                section = self.header()
            else:
                self.pair(section)
            self.skip(_BETWEEN)
        return self.lines

    def header(self) -> KeyPath:
        """Parse the names in a TOML section header. The header has the form `[a.b]` or `[[a.b]]`."""
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
        """Parse one TOML entry and record its line.

        An entry has the form `key = value`.
        """
        start = self.position
        path = section
        for key in self.dotted():
            path = (*path, key)
            self.mark(path, start)
        self.position += 1  # the equals sign
        self.value(path)

    def dotted(self) -> list[str]:
        """Parse the names in a dotted TOML key."""
        keys = []
        while True:
            self.skip(_BLANK)
            match = _KEY.match(self.text, self.position)
            if match is None:
                raise ValueError(f"no key at {self.position}")
            self.position = match.end()
            keys.append(_unquote(match.group(1)))
            self.skip(_BLANK)
            if not self.text.startswith(".", self.position):
                return keys
            self.position += 1

    def value(self, path: KeyPath) -> None:
        """Parse a TOML value and record the line numbers inside it.

        They are the line numbers of keys and list elements.
        """
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
        """Skip the text that matches a pattern."""
        match = pattern.match(self.text, self.position)
        if match is None:
            raise ValueError(f"nothing readable at {self.position}")
        self.position = match.end()

    def mark(self, path: KeyPath, position: int) -> None:
        """Record the line number of a key of the TOML text."""
        self.lines.setdefault(path, bisect.bisect_right(self.starts, position))


def _unquote(key: str) -> str:
    return next(iter(tomllib.loads(f"{key} = 0"))) if key[0] in "\"'" else key
