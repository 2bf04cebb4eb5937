"""Provide the directive `page-figure`: a figure that is drawn from the numbers that the page computes.

The directive runs the Python examples of its page that have prompts, and then its own lines, which assign `figure`. The
figure is part of the page as SVG, so that it adapts to narrow screens and to dark mode. On a narrow screen, its panels
are one below the other.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from page_drawing import draw, run_examples
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from pretouch.report.style import draw_svg


class PageFigure(SphinxDirective):
    """A figure of the numbers on its page."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {"alt": directives.unchanged_required}

    def run(self) -> list[nodes.Node]:
        """Return the nodes of the figure."""
        (name,) = self.arguments
        computed = self.env.temp_data.get("page-figure-names")
        if computed is None:
            computed = run_examples(Path(self.env.doc2path(self.env.docname)).read_text(encoding="utf-8"))
            self.env.temp_data["page-figure-names"] = computed
        drawn = draw_svg(draw("\n".join(self.content), computed), name)
        label = self.options["alt"].replace('"', "&quot;")
        drawn = drawn.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)
        return [nodes.raw("", f'<div class="page-figure">{drawn}</div>', format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("page-figure", PageFigure)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
