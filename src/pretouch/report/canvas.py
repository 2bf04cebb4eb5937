"""A figure that shows itself in a notebook without pyplot; imported only when a figure is drawn."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from matplotlib.figure import Figure

from .style import drawing


class ReportFigure(Figure):
    """A matplotlib figure that a notebook displays; a bare `Figure` is shown as text only."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save as matplotlib does, with pretouch's settings and without the date, so that bytes repeat.

        Args:
            fname: a path or a binary file.
            options: what `matplotlib.figure.Figure.savefig` takes.
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
