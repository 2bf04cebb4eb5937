"""Write the pages of the API reference from the public names, and make docstrings readable for Sphinx."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

MODULES = (
    *("pretouch", "pretouch.sensors", "pretouch.calibration", "pretouch.motion", "pretouch.designs"),
    *("pretouch.uncertainty", "pretouch.control", "pretouch.simulation", "pretouch.verification", "pretouch.sweeps"),
    "pretouch.robots",
    *("pretouch.recording", "pretouch.exports", "pretouch.letter", "pretouch.plots", "pretouch.report"),
    *("pretouch.fields", "pretouch.errors"),
)
_EXCLUDED = "page, kind, number, degree, status"  # fields that the Args of the class describe
INDEX = """\
# Python API

Common names are in `pretouch` itself. All other names are in its modules, which load when they are first used.

```{{toctree}}
:maxdepth: 1

{pages}
```
"""


def write_pages(app: Sphinx) -> None:
    """Write a page for each public module into docs/reference/api."""
    folder = Path(app.srcdir) / "reference" / "api"
    folder.mkdir(exist_ok=True)
    done: set[int] = set()
    for name in MODULES:
        _write(folder / f"{name}.rst", page_of(import_module(name), done))
    _write(folder / "index.md", INDEX.format(pages="\n".join(MODULES)))


def page_of(module: ModuleType, done: set[int]) -> str:
    """Return the page of a module; a name that another page already has is not repeated."""
    lines = [
        f"``{module.__name__}``",
        "=" * (len(module.__name__) + 4),
        "",
        (module.__doc__ or "").split("\n\n")[0],
        "",
    ]
    for name in sorted(getattr(module, "__all__", ()), key=str.lower):
        value = getattr(module, name)
        if isinstance(value, ModuleType) or id(value) in done:
            continue
        kind = "function" if inspect.isroutine(value) else "class" if inspect.isclass(value) else "data"
        if kind == "data":
            continue
        done.add(id(value))
        title = f"{name}"
        lines += [title, "-" * len(title), "", f".. auto{kind}:: {module.__name__}.{name}"]
        if kind == "class":
            lines += ["   :members:", f"   :exclude-members: {_EXCLUDED}"]
        lines.append("")
    return "\n".join(lines)


def _write(path: Path, text: str) -> None:
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def escape(app: Sphinx, what: str, name: str, value: object, options: object, lines: list[str]) -> None:  # noqa: ARG001
    """Escape characters of formulas that reStructuredText would read as markup: bars and trailing underscores."""
    for i, line in enumerate(lines):
        if line.lstrip().startswith((">>>", "...")):
            continue
        code = re.split(r"(`[^`]*`)", line)
        lines[i] = "".join(
            part
            if part.startswith("`")
            else re.sub(r"(?<=\w)_(?!\w)", r"\\_", part.replace("|", r"\|").replace("*", r"\*"))
            for part in code
        )


def keep_first_line(app: Sphinx, what: str, name: str, value: object, options: object, lines: list[str]) -> None:  # noqa: ARG001
    """Prevent that Napoleon reads the first line of a property, such as "The latency: time until ...", as a type."""
    if what in {"property", "attribute"} and lines and ":" in lines[0]:
        lines[:0] = ["..", ""]  # an empty comment takes the place of the first line


def shorten_defaults(
    app: Sphinx,  # noqa: ARG001
    what: str,  # noqa: ARG001
    name: str,  # noqa: ARG001
    value: object,  # noqa: ARG001
    options: object,  # noqa: ARG001
    signature: str | None,
    returns: str | None,
) -> tuple[str | None, str | None]:
    """Replace the default `<factory>` of a dataclass field, because Sphinx cannot parse it and then shows raw text."""
    return signature and signature.replace("<factory>", "..."), returns


def set_dashes(app: Sphinx, doctree: nodes.document) -> None:  # noqa: ARG001
    """Set the dash between a parameter and its description, which Sphinx writes as two hyphens."""
    for text in list(doctree.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" \N{EN DASH} "))


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the functions to the build."""
    app.connect("builder-inited", write_pages)
    app.connect("autodoc-process-docstring", escape, priority=400)  # before the sections are parsed
    app.connect("autodoc-process-docstring", keep_first_line, priority=410)
    app.connect("autodoc-process-signature", shorten_defaults)
    app.connect("doctree-read", set_dashes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
