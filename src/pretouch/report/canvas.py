"""Define a Matplotlib figure that notebooks can display without the module pyplot."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from matplotlib.figure import Figure

from .style import drawing


class ReportFigure(Figure):
    """A Matplotlib figure that notebooks display as an image.

    Notebooks show a plain `Figure` as text.
    """

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save the figure so that repeated saving gives identical files.

        The settings are fixed, and no date is saved.

        Args:
            fname: a path or a binary file.
            options: options of `matplotlib.figure.Figure.savefig`.
        """
        path = str(getattr(fname, "name", fname))
        kind = str(options.get("format") or (path.rsplit(".", 1)[-1] if "." in path else "png")).lower()
        if kind in {"svg", "pdf"}:
            date = "Date" if kind == "svg" else "CreationDate"
            options["metadata"] = {date: None, **(options.get("metadata") or {})}
        with drawing():
            super().savefig(fname, **options)

    def _repr_png_(self) -> bytes:
        content = BytesIO()
        self.savefig(content, format="png", dpi=110)
        return content.getvalue()
