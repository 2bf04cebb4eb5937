"""Provide the directive `live-figure`: a place for an interactive figure, with a static picture as its fallback."""

from __future__ import annotations

from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

NAMES = ("gain", "drag", "pedestal")


class LiveFigure(SphinxDirective):
    """A picture inside an element that a script may replace by an interactive figure.

    The element has the attribute `data-pretouch-figure` with the name of the figure. Without a script, readers see the
    picture and its caption.
    """

    required_arguments = 1
    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {
        "image": directives.unchanged_required,
        "alt": directives.unchanged_required,
    }

    def run(self) -> list[nodes.Node]:
        """Return the nodes of the figure."""
        (name,) = self.arguments
        if name not in NAMES:
            raise self.error(f"live-figure: found {name!r}, expected one of {', '.join(NAMES)}")
        image = nodes.image(uri=self.options["image"], alt=self.options["alt"])
        figure = nodes.figure("", image)
        if self.content:
            figure += nodes.caption("", "", *self.state.inline_text(" ".join(self.content), self.lineno)[0])
        start = nodes.raw("", f'<div class="live-figure" data-pretouch-figure="{name}">', format="html")
        return [start, figure, nodes.raw("", "</div>", format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive, and show CSV files as plain text."""
    app.add_lexer("csv", TextLexer)
    app.add_directive("live-figure", LiveFigure)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
