"""What can be reproduced, in the order of the letter, and the verb that does it."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Final

from pretouch._core.errors import InvalidInputError

from .result import LetterReport, Reproduction

__all__ = ["IDS", "reproduce"]

IDS: Final = (
    *("table-1", "figure-3", "figure-4", "figure-5", "table-2", "figure-6", "one-gain", "table-3"),
    *("attraction", "constraints", "impact-force"),
)
"""The names of all reproductions, in the order of the letter."""


def reproduce(ids: Sequence[str] = (), *, progress: Callable[[str], None] | None = None) -> LetterReport:
    """Compute tables, figures and sections of the letter again, and compare each printed number with ours.

    Args:
        ids: which ones, of IDS; all where none is given.
        progress: called with each id as its work begins.

    Returns:
        The reproductions, in the order of the letter.

    Raises:
        InvalidInputError: an id is not known.

    Examples:
        >>> report = reproduce(["figure-3"])
        >>> report.holds
        True
    """
    unknown = [name for name in ids if name not in IDS]
    if unknown:
        near = difflib.get_close_matches(unknown[0].lower().replace("_", "-"), IDS, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise InvalidInputError(f"reproduce: found {unknown[0]!r}, expected one or more of {', '.join(IDS)}{hint}")
    done = []
    for name in IDS:
        if not ids or name in ids:
            if progress is not None:
                progress(name)
            done.append(_reproduction(name))
    return LetterReport(reproductions=tuple(done))


def _reproduction(name: str) -> Reproduction:
    experiment = import_module(f"{__package__}.experiments.{name.replace('-', '_')}")  # loads only what it needs
    found: Reproduction = experiment.reproduce()
    return found
