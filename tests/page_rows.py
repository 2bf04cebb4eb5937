"""What a page or a terminal says, value by value: each is looked up in its row, under its title."""

from __future__ import annotations

from html.parser import HTMLParser

from page_checks import as_written


class _Tables(HTMLParser):
    """Collects the rows of all tables of a page, each with the title above it."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.rows: list[tuple[str, list[str]]] = []
        self._title = ""
        self._into: str | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        if tag == "tr":
            self.rows.append((self._title, []))
        elif tag in {"th", "td"}:
            self.rows[-1][1].append("")
        if tag in {"h1", "h2", "h3", "h4"}:
            self._title = ""
        self._into = tag if tag in {"h1", "h2", "h3", "h4", "th", "td"} else self._into

    def handle_endtag(self, tag: str) -> None:
        self._into = None if tag == self._into else self._into

    def handle_data(self, data: str) -> None:
        if self._into in {"th", "td"}:
            self.rows[-1][1][-1] += data
        elif self._into is not None:
            self._title += data


def table(page: str, title: str) -> list[list[str]]:
    """Return all rows below a title of a page (HTML), the heads of its tables included."""
    tables = _Tables()
    tables.feed(as_written(page))
    return [cells for above, cells in tables.rows if above == title]


def row(page: str, label: str, title: str | None = None) -> list[str]:
    """Return the cells behind a label: the one row of a page (HTML) that starts with it, below this title if given."""
    tables = _Tables()
    tables.feed(as_written(page))
    found = [cells[1:] for above, cells in tables.rows if cells[0] == label and title in {None, above}]
    assert len(found) == 1, f"{len(found)} rows {label!r} in {sorted({cells[0] for _, cells in tables.rows})}"
    return found[0]


def line(text: str, label: str) -> str:
    """Return what stands behind a label in the text of a terminal: the one line that starts with it."""
    lines = [" ".join(part.split()) for part in text.splitlines()]
    found = [part.removeprefix(label).strip() for part in lines if part.startswith(f"{label} ")]
    assert len(found) == 1, f"{len(found)} lines {label!r} in {text}"
    return found[0]
