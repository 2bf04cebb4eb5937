"""Where each key of a TOML text stands: a small scan, because neither tomllib nor tomlkit tells.

The scan trusts that `tomllib` has accepted the text, so it only has to find keys, not to check anything.
"""

from __future__ import annotations

import bisect
import re
import tomllib
from collections.abc import Mapping
from typing import Final

from .quantities import KeyPath

__all__ = ["key_lines"]

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
