"""Check a built site: every internal link leads somewhere, and nothing is fetched from elsewhere."""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_FETCHING = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}
_OUTSIDE = re.compile(r"""(?:@import|url\()\s*["']?((?:https?:)?//[^"')]+)""")
_NOT_FETCHED = {"canonical", "index", "search", "next", "prev", "genindex", "author", "copyright", "edit"}


class SitePage(HTMLParser):
    """Collects the identifiers of a page, its links and what a browser fetches for it."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note identifiers, links and fetched files of one element."""
        values = {name: value or "" for name, value in attrs}
        self.ids |= {values[name] for name in ("id", "name") if values.get(name)}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        key = _FETCHING.get(tag)
        if key in values and not (tag == "link" and set(values.get("rel", "").split()) & _NOT_FETCHED):
            self.fetched.append(values[key])


def read_pages(site: Path) -> dict[Path, SitePage]:
    """Parse all pages of a site."""
    pages = {}
    for path in sorted(site.rglob("*.html")):
        page = SitePage()
        page.feed(path.read_text(encoding="utf-8"))
        pages[path.resolve()] = page
    return pages


def problems(site: Path) -> list[str]:
    """List broken links and everything that would be fetched from elsewhere."""
    pages = read_pages(site)
    found = []
    for path, page in pages.items():
        name = path.relative_to(site.resolve())
        for address in page.fetched + page.links:
            parts = urlsplit(address)
            if address in page.fetched and (parts.netloc or parts.scheme not in {"", "data"}):
                found.append(f"{name}: fetches {address}")
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                found.append(f"{name}: {address} leads nowhere")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids:
                found.append(f"{name}: {address} has no such section")
    for path, page in pages.items():
        if path.name.startswith("plot_") and not any("sphx_glr_plot" in source for source in page.fetched):
            found.append(f"{path.relative_to(site.resolve())}: has no figure")
    for path in site.rglob("*.css"):
        outside = _OUTSIDE.findall(path.read_text(encoding="utf-8"))
        found += [f"{path.relative_to(site)}: fetches {address}" for address in outside]
    return found


def main() -> int:
    """Print all problems of the site that the command line names, and return the exit status."""
    site = Path(sys.argv[1])
    found = problems(site)
    print(
        "\n".join(found)
        or f"{len(list(site.rglob('*.html')))} pages: all links lead somewhere, nothing is fetched from elsewhere"
    )
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
