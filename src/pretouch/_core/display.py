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


class InNotebooks:
    """Base class of results with a display in Jupyter notebooks.

    The display consists of a headline, a figure and a table.
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

    def _repr_html_(self) -> str | None:
        return _LOADERS[0]().excerpt(self)


class Described(InNotebooks):
    """Base class of results with a short report as text.

    `str(result)` returns this report, which the terminal shows.
    """

    __slots__ = ()

    def __str__(self) -> str:
        return _LOADERS[0]().text(self)
