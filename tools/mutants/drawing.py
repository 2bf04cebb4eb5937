"""Draw mutants: which lines of the sources decide something, and how each of them can be changed."""

from __future__ import annotations

import random
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate

from mutants import native_source, python_source
from mutants.edits import Edit

GENERATED = ("native/core/radau_tables.hpp",)
"""Tables of constants that a test computes anew; a random one of hundreds of equal lines tells nothing."""


@dataclass(frozen=True)
class Mutant:
    """One change of one source.

    Args:
        path: the source.
        line: the line that is changed, from 1.
        before: that line.
        after: the line as changed.
        edit: the change in the whole text.
    """

    path: str
    line: int
    before: str
    after: str
    edit: Edit

    @property
    def name(self) -> str:
        """What is changed into what, wherever the line stands."""
        return f"{self.path}: {self.before.strip()}  ->  {self.after.strip()}"

    def applied(self, text: str) -> str:
        """Return the text of the source with the change."""
        return text[: self.edit.start] + self.edit.new + text[self.edit.end :]


def mutants_of(path: str, text: str) -> dict[int, list[Mutant]]:
    """Return every change of each line of a source that decides something."""
    source = python_source if path.endswith(".py") else native_source
    lines = text.splitlines(keepends=True)
    begins = [0, *accumulate(map(len, lines))]
    found: dict[int, list[Mutant]] = {}
    for edit in sorted(set(source.edits(text))):
        number = bisect_right(begins, edit.start)
        before, begin = lines[number - 1], begins[number - 1]
        after = before[: edit.start - begin] + edit.new + before[edit.end - begin :]
        found.setdefault(number, []).append(Mutant(path, number, before, after, edit))
    return found


def draw(sources: dict[str, str], seed: int) -> Iterator[Mutant]:
    """Yield one mutant of each line that decides something, in a random order that does not depend on their number."""
    chance = random.Random(seed)  # noqa: S311
    every = [
        ways
        for path, text in sorted(sources.items())
        if path not in GENERATED
        for _, ways in sorted(mutants_of(path, text).items())
    ]
    chance.shuffle(every)
    for ways in every:
        yield chance.choice(ways)
