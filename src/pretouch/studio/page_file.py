"""Bundle the studio page into one HTML document.

The code of the live figures becomes one script.

A browser does not load JavaScript modules into a document that is opened from a file, so this code joins the modules to
one script. Each module imports by name from modules before it, and no two modules define the same name. Therefore it is
sufficient to remove the import statements and the word `export`.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from string import Template
from typing import Any, Final

from pretouch._core.errors import BrokenCoreError
from pretouch._core.units import unit_tables

_FOLDER: Final = Path(__file__).with_name("page")
CORE: Final = _FOLDER / "core.wasm"
"""The compiled core of the page. Wheels without it were built without zig."""

BUILD_CORE: Final = (
    "run make page in the source tree"
    if (_FOLDER.parents[3] / "native/build.py").exists()  # pretouch runs from its source tree
    else "run make page in the source tree of pretouch, and then pip install '.[studio]' there"
)
"""How to get a missing core of the page."""

_FIGURES: Final = ("core", "model", "charts", "encounter", "live", "figures")
_PAGE: Final = ("core", "model", "charts", "encounter", "live", "app", "start")
_STUDIO: Final = (*_PAGE[:-1], "server", "start")
_IMPORT: Final = re.compile(r"^import\s[^;]*;\n", re.MULTILINE)
_TRAILING: Final = re.compile(r"(?<=[;{},(]) +// [^\"'`]*$")
_EXPORT: Final = re.compile(r"^export (?=async|class|const|function|let)", re.MULTILINE)
_POLICY: Final = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
    "script-src 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; img-src data:\">"
)


def page_text(
    server: Mapping[str, Any] | None = None, *, scenario: Mapping[str, Any] | None = None, nonce: str | None = None
) -> str:
    """Return the studio page as one HTML document.

    The document makes requests to its own server only.

    Args:
        server: the data with which the page connects to its server, such as the token; None for a page without server.
        scenario: the scenario with which a page without server starts, from `scenario_of_page`; None for the example of
            the letter.
        nonce: the nonce of the scripts, if the content security policy of the server requires one.

    Returns:
        The document.
    """
    data = _data() | {name: value for name, value in (("server", server), ("scenario", scenario)) if value is not None}
    content = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    allowed = "" if nonce is None else f' nonce="{nonce}"'
    data_of_page = "JSON.parse(document.getElementById('pretouch-data').textContent)"
    run = f"start({data_of_page}{'' if server is None else ', connect'});"
    modules = _PAGE if server is None else _STUDIO
    scripts = (
        f'<script type="application/json" id="pretouch-data">{content}</script>\n'
        f"<script{allowed}>{_library()}</script>\n<script{allowed}>{_joined(modules, run)}</script>"
    )
    page = Template((_FOLDER / "page.html").read_text(encoding="utf-8"))
    opened = server or scenario
    title = "pretouch: try it" if opened is None else f"{opened['title']} - pretouch studio"
    policy = _POLICY if server is None else ""
    return page.substitute(title=_escaped(title), style=_page_style(), scripts=scripts, policy=policy)


def figures_text() -> str:
    """Return a script that mounts all live figures of a document.

    A figure is an element such as `<div data-pretouch-figure="gain">`. The script is not a JavaScript module, so that
    it works in documents that are opened from a file.

    Returns:
        The script.
    """
    style = json.dumps(_figure_style())
    add = f"const style = document.createElement('style'); style.textContent = {style}; document.head.prepend(style);"
    run = f"{add} start({json.dumps(_data(), separators=(',', ':'))});"
    wait = f"const begin = () => {{ {run} }};\n"
    wait += "if (document.readyState === 'loading') addEventListener('DOMContentLoaded', begin); else begin();"
    text = f"{_library()}\n{_joined(_FIGURES, wait)}\n"
    return text.encode("ascii", "backslashreplace").decode()  # correct in documents of every encoding


def _joined(names: Sequence[str], run: str) -> str:
    """Join JavaScript modules to one script.

    Returns:
        The script, with the statements `run` at its end.
    """
    modules = [(_FOLDER / f"{name}.js").read_text(encoding="utf-8") for name in names]
    bare = "\n".join(_EXPORT.sub("", _IMPORT.sub("", text)) for text in modules)
    return f'"use strict";\n(() => {{\n{_tight(bare)}\n{run}\n}})();'


def _tight(text: str) -> str:
    """Remove indentation, comments and needless line ends from a script; what may be part of a quoted text stays."""
    bare = re.sub(r"^\s*/\*\*.*?\*/\n", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = [_TRAILING.sub("", line.strip()) for line in bare.split("\n")]
    return re.sub(r"(?<=[{(\[,;])\n", "", "\n".join(line for line in lines if line and not line.startswith("//")))


def _library() -> str:
    return (_FOLDER / "vendor/uPlot.iife.min.js").read_text(encoding="utf-8")


def _page_style() -> str:
    light, dark = _colors()
    roots = (
        f":root {{ color-scheme: light dark; {light} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}"
    )
    style = "\n".join([_read("vendor/uPlot.min.css"), roots, _read("figures.css"), _read("style.css")])
    return re.sub(r"\s*([{};,])\s*|(?<=:) ", r"\1", style).replace(";}", "}")  # as short as browsers read it


def _figure_style() -> str:
    """Return the CSS of live figures in other documents. Its colors suit light and dark themes, such as Furo's."""
    light, dark = _colors()
    own = ".pretouch-figure"
    return "\n".join(
        [
            _read("vendor/uPlot.min.css"),
            f"{own} {{ {light} }}",
            f'@media (prefers-color-scheme: dark) {{ body:not([data-theme="light"]) {own} {{ {dark} }} }}',
            f'body[data-theme="dark"] {own} {{ {dark} }}',
            re.sub(r"^(?=\.(?!pretouch))", f"{own} ", _read("figures.css"), flags=re.MULTILINE),
        ]
    )


def _colors() -> list[str]:
    """Return the CSS colors for light and dark pages. The colors for light pages are first."""
    blocks = re.findall(r"\{ (.*?) \}", _read("colors.css"), flags=re.DOTALL)
    return [re.sub(r"\s+", " ", part) for part in blocks]


def _read(name: str) -> str:
    return re.sub(r"\n\s*", "\n", (_FOLDER / name).read_text(encoding="utf-8"))


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;")


@lru_cache(maxsize=1)
def _data() -> dict[str, Any]:
    """Return the page's compiled core and table of units."""
    try:
        content = CORE.read_bytes()
    except FileNotFoundError:
        raise BrokenCoreError(
            f"the page of pretouch studio needs the file {CORE.name}. This file is missing in the folder "
            f"{CORE.parent}. To build the file, {BUILD_CORE}"
        ) from None
    from .field_rules import field_rules, largest_values  # noqa: PLC0415 - the schema, only for a page

    packed = gzip.compress(content, compresslevel=9, mtime=0)
    return {
        "core": base64.b64encode(packed).decode(),
        "units": {**unit_tables(), "rules": field_rules(), "largest": largest_values()},
    }
