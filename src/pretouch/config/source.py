"""The file that a task was read from, and where in it a mistake stands, also one that is found later."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final, TypeAlias

from pretouch._core.errors import InvalidInputError, OutOfRangeError, ScenarioFileError

from .positions import key_lines
from .quantities import KeyPath
from .schema import SECTIONS, keys_of

__all__ = ["Mistake", "ScenarioSource", "place"]

Mistake: TypeAlias = tuple[KeyPath, str]
"""The key that a mistake is about, and a sentence with what was found and what is expected."""

_HOME: Final[dict[str, KeyPath]] = {
    "bounds": ("gain", "bounds"),
    "method": ("motion", "method"),
    "horizon": ("motion", "horizon"),
    "scale": ("objective",),
    "terms": ("objective", "terms"),
    "quantity": ("objective",),
    "distance": ("sensor",),
    "scenario": ("obstacle",),
    "sensor": ("sensor",),
    "natural_frequency": ("admittance", "natural_frequency_bounds"),
    "damping_ratio": ("admittance", "damping_ratio_bounds"),
    "quantities": ("pareto", "quantities"),
    "choice": ("pareto", "choice"),
    "impact_force": ("impact",),
    "drive_force": ("impact",),
    "uncertainty": ("uncertainty",),
    "samples": ("robust", "samples"),
    "seed": ("robust", "seed"),
    "confidence": ("robust", "confidence"),
    "stability_margin": ("loop", "stability_margin"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioSource:
    """The file that a task was read from.

    Args:
        path: where it stood.
        text: its text, so that a report can show it.
        sha256: the hash of its bytes, in hexadecimal.
        supported: where the calibration of its sensor supports the curve, as a sentence; empty without one.
    """

    path: Path
    text: str = field(repr=False)
    sha256: str
    supported: str = field(default="", repr=False)

    @property
    def lines(self) -> Mapping[KeyPath, int]:
        """The line of every key."""
        return _lines_of(self.text)

    @contextmanager
    def placing(self) -> Iterator[None]:
        """Turn what a verb refuses into a mistake of the file, with its line and its key as near as they are known.

        Yields:
            Nothing.

        Raises:
            ScenarioFileError: the verb refused something.
        """
        try:
            yield
        except InvalidInputError as error:
            told = self.explained(error)
            path, sentence = place(told, "")
            known = path[:1] in self.lines
            raise ScenarioFileError(self.listed([(path, sentence)]) if known else f"{self.path}: {told}") from error

    def explained(self, error: InvalidInputError) -> str:
        """Return the message of an error, with the calibration as the reason where a sensor says nothing."""
        return f"{error}; {self.supported}" if self.supported and isinstance(error, OutOfRangeError) else str(error)

    def listed(self, mistakes: Iterable[Mistake]) -> str:
        """List mistakes, one sentence each, by line: that of the key, of what would hold it, or the last."""
        last = self.text.rstrip().count("\n") + 1
        told = []
        for path, sentence in dict.fromkeys(mistakes):
            line = next((self.lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in self.lines), last)
            told.append((line, f"{_dotted(path)}: {sentence}" if path else sentence))
        ordered = sorted(told, key=lambda each: each[0])
        return "\n".join(f"{self.path}, line {line}: {text}" for line, text in ordered)


_lines_of = lru_cache(maxsize=4)(key_lines)


def _dotted(path: KeyPath) -> str:
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            shown = part if re.fullmatch(r"[\w-]{1,60}", part) else repr(part[:60])
            text += f".{shown}" if text else shown
    return text


def place(message: str, section: str) -> Mistake:
    """Split a message `name: found ..., which ...` into the key that it speaks of, and the sentence.

    The name may be a key of the section that was being built, where one is given, or the words of a key.

    Returns:
        The path of the key, as near as it is known, and the sentence.

    Examples:
        >>> place("obstacle position: found a distance of 0 m", "")
        (('obstacle', 'position'), 'found a distance of 0 m')
        >>> place("mass: found -1 kg, which must be positive", "admittance")
        (('admittance', 'mass'), 'found -1 kg, which must be positive')
    """
    name, colon, sentence = message.partition(": ")
    if not colon:
        return ((section,) if section else ()), message
    words, key = name.split(" ", 1), name.replace(" ", "_")
    if section and key in keys_of(section):
        return (section, key), sentence
    if len(words) == 2 and words[0] in SECTIONS and words[1].replace(" ", "_") in keys_of(words[0]):
        return (words[0], words[1].replace(" ", "_")), sentence
    if len(words) == 2 and words[0] == "constraint" and words[1] in keys_of("constraints"):
        return ("constraints", words[1]), sentence
    if section:
        return (section,), message
    return (_HOME[name], sentence) if name in _HOME else ((), message)
