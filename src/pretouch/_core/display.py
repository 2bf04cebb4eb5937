"""Give results a text, a figure and a notebook display without knowing the code that makes them.

Results do not import reports. The package registers a renderer instead, which is loaded when a result is first shown.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Protocol


class Renderer(Protocol):
    """Functions that show a result in the media of a Python session."""

    def text(self, result: Any) -> str:
        """Return the text that `str(result)` returns."""

    def figure(self, result: Any) -> Any:
        """Return the main figure of the result."""

    def excerpt(self, result: Any) -> str:
        """Return the HTML elements that a notebook shows."""


_LOADERS: Final[list[Callable[[], Renderer]]] = []


def register_renderer(load: Callable[[], Renderer]) -> None:
    """Register the renderer of all results; `load` imports it when a result is first shown."""
    _LOADERS[:] = [load]


class Described:
    """Base class of results, and of the values that they are made of, which a report page describes.

    Notebooks show headline, figure and table of the page. `str` returns its text, unless a class shows its fields.
    """

    __slots__ = ()

    def plot(self) -> Any:
        """Draw the main figure of this result.

        The functions in `pretouch.plots` draw all other figures.

        Returns:
            A Matplotlib figure. A result without a figure, for example without contact, raises a
            ResultUnavailableError.
        """
        return _LOADERS[0]().figure(self)

    def __str__(self) -> str:
        return _LOADERS[0]().text(self)

    def _repr_html_(self) -> str | None:
        return _LOADERS[0]().excerpt(self)
