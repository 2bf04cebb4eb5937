"""`pretouch reproduce`: the tables and figures of the letter, computed again."""

from __future__ import annotations

from typing import Annotated

import typer

from .terminal import Presentation, print_progress, verb

__all__ = ["reproduce"]


@verb
def reproduce(
    shown: Presentation,
    *,
    ids: Annotated[
        list[str] | None, typer.Argument(metavar="ID", help="What to reproduce; all of it where none is named.")
    ] = None,
) -> None:
    """Compute the letter's tables and figures again.

    Sets every printed number beside ours. Prints how many agree, what disagrees and why, and where the letter's text
    contradicts its own equations; writes letter-reproduction.html in this folder, a report with figures, the code of
    each, and all numbers.

    \b
    ID is one of:
      table-1  figure-3  figure-4  figure-5  table-2  figure-6  one-gain  table-3
      attraction  constraints  impact-force

    Exit status: 0 every difference is explained, 1 not everything comes out, 2 a mistake in the request.
    """  # noqa: D301 - the escape keeps the lines of the list together
    from pretouch.letter import reproduce as compute  # noqa: PLC0415 - `pretouch --help` stays quick

    found = compute(ids or (), progress=lambda name: print_progress(f"computing {name}"))
    shown.show(found, "letter-reproduction.html", good=found.holds)
