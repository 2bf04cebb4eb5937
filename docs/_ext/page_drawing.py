"""Run the Python examples of a page, and draw its figures from their numbers."""

from __future__ import annotations

import contextlib
import doctest
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SIZE = (4.1, 2.9)
"""Width and height of a single panel [inch]: on a phone, its text is hardly smaller than the text of the page."""

_EXAMPLES = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
_FIGURES = re.compile(r"^```\{page-figure\} ([\w-]+)\n((?::[^\n]*\n)*)\n?(.*?)^```", re.MULTILINE | re.DOTALL)


def run_examples(text: str) -> dict[str, Any]:
    """Run the Python examples of a page, and return their variables."""
    names: dict[str, Any] = {}
    with contextlib.chdir(ROOT), contextlib.redirect_stdout(None):
        for example in doctest.DocTestParser().get_examples("\n".join(_EXAMPLES.findall(text))):
            exec(compile(example.source, "page", "exec"), names)  # noqa: S102 - our own page
    return names


def draw(code: str, names: dict[str, Any]) -> Any:
    """Return the figure that some lines of Python assign; a single panel has the size of the page."""
    names = dict(names)
    with contextlib.chdir(ROOT):
        exec(compile(code, "page-figure", "exec"), names)  # noqa: S102 - our own page
    figure = names["figure"]
    if len(figure.axes) == 1:
        figure.set_size_inches(*SIZE)
    return figure


def figures_of(text: str) -> dict[str, str]:
    """Return the lines of all figures of a page by their names."""
    return {name: code for name, _, code in _FIGURES.findall(text)}
