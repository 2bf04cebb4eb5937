"""Show a result as text, as a figure or in a notebook, by the page that describes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pretouch._core.display import Described

from .pages import page_of
from .text import page_as_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def text(result: Described) -> str:
    """Return the plain text that describes a result."""
    return page_as_text(page_of(result))


def figure(result: Described) -> Figure:
    """Return the main figure of a result."""
    from .html import lead_figure  # noqa: PLC0415 - loads the code of all figures

    return lead_figure(page_of(result))


def excerpt(result: Described) -> str:
    """Return the HTML elements that a notebook shows for a result."""
    from .html import excerpt_html  # noqa: PLC0415 - loads the code of all figures

    return excerpt_html(page_of(result))
