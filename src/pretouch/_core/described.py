"""Results that have a page: their text, and what a notebook shows of them."""

from __future__ import annotations

from importlib import import_module
from typing import ClassVar

from .block_html import page_as_excerpt
from .block_text import page_as_text
from .blocks import Page

__all__ = ["Described", "page_of"]


class Described:
    """A result that has a page: its text, and what a notebook shows of it.

    A class names the function that describes it by text, so that no result imports its description.
    """

    __slots__ = ()

    page: ClassVar[str]
    """Module and function, such as `pretouch.design.page:gain_page`."""

    def __str__(self) -> str:
        return page_as_text(page_of(self))

    def _repr_html_(self) -> str | None:
        return page_as_excerpt(page_of(self))


def page_of(result: Described) -> Page:
    """Describe a result.

    Args:
        result: a result whose class names its description.

    Returns:
        Its page.
    """
    module, _, name = result.page.partition(":")
    page: Page = getattr(import_module(module), name)(result)
    return page
