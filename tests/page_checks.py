"""What every HTML page must keep: well-formed, nothing fetched, nothing run, no promises."""

from __future__ import annotations

import re
from html.parser import HTMLParser

VOID = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
EVIL = "<script>alert('$x^2$ & \u96fb\u5727')</script>\"'"


class Page(HTMLParser):
    """Collects what is wrong with a page, its identifiers, its text, and everything that it would fetch or run."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.faults: list[str] = []
        self.ids: list[str] = []
        self.anchors: list[str] = []
        self.downloads: dict[str, str] = {}
        self.fetched: list[str] = []
        self.text: list[str] = []
        self.code: list[str] = []
        self.data: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        if tag == "pre":
            self.code.append("")
        self._look(tag, attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._look(tag, attrs)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open[-1] != tag:
            self.faults.append(f"</{tag}> at {self.getpos()} closes {self.open[-1:]}")
        else:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        if "script" in self.open:
            self.data.append(data)
        elif not {"style", "svg"} & set(self.open):
            self.text.append(data)
        if "pre" in self.open:
            self.code[-1] += data

    def _look(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        inert = tag == "script" and given.get("type") == "application/json" and "src" not in given
        if tag in {"script", "link", "iframe", "object", "embed", "img"} and not inert:
            self.fetched.append(tag)
        if "id" in given:
            self.ids.append(given["id"])
        for name, value in given.items():
            inside = tag == "a" and "download" in given and value.startswith("data:application/json,")
            if name == "href" and inside:
                self.downloads[given["download"]] = value
            elif name == "href" and value.startswith("#"):
                self.anchors.append(value[1:])
            elif name.startswith("on") or name in {"src", "href"}:
                self.fetched.append(f"{name}={value}")

    @property
    def words(self) -> str:
        """The text that a reader sees, spaces and line ends all alike."""
        return " ".join(" ".join(self.text).split())


def as_written(page: str) -> str:
    """Return HTML with the symbols and minus signs that the program writes: `D_p` and `-`."""
    return re.sub("\u2212(?=[\\d.\u221e])", "-", re.sub("<sub>(.*?)</sub>", r"_\1", page)).replace("\u2264", "<=")


def parse(page: str) -> Page:
    parser = Page()
    parser.feed(as_written(page))
    parser.close()
    return parser


def assert_sound(page: str) -> Page:
    parser = parse(page)
    assert parser.faults == []
    assert parser.open == []
    assert parser.fetched == []
    assert len(parser.ids) == len(set(parser.ids))
    assert set(parser.anchors) <= set(parser.ids)
    assert "http" not in page
    assert not re.search(r"@import|url\((?!#)", page)
    words = parser.words.lower()
    assert "safe" not in words
    assert "complian" not in words
    return parser
