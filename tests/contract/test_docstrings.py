"""What is public says what it takes, verbs show how, files stay short, and no text promises what nobody can."""

from __future__ import annotations

import ast
import enum
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import pretouch

SOURCE = Path(pretouch.__file__).parent
FILES = sorted(SOURCE.rglob("*.py"))
VERBS = (
    "find_contact",
    "solve_motion",
    "design_gain",
    "design_admittance",
    "pareto",
    "check_sensor",
    "fit",
    "fit_sensor",
    "read_calibration",
    "sweep",
    "simulate",
    "simulate",
    "gain_limit",
    "lowest_rate",
    "verify",
)
# "safe" and "compliant" are verdicts of standards on whole machines, which no program about a gain can give
FORBIDDEN = re.compile(r"\b(safe|compliant)\b", re.IGNORECASE)


def _public() -> dict[str, object]:
    """Every function and class in the __all__ of pretouch and of the packages below it."""
    packages = [m.name for m in pkgutil.walk_packages(pretouch.__path__, "pretouch.") if m.ispkg]
    found: dict[str, object] = {}
    for package in ("pretouch", "pretouch.report.plots", *packages):
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if inspect.isfunction(value) or inspect.isclass(value):
                found[f"{value.__module__}.{value.__qualname__}"] = value
    return found


PUBLIC = _public()


def _documented(doc: str) -> list[str]:
    """The names in the Args section of a docstring."""
    section = re.search(r"^Args:\n((?:    .*\n|\n)*)", doc + "\n", re.MULTILINE)
    return re.findall(r"^    \*{0,2}(\w+)(?: \(.*\))?:", section[1], re.MULTILINE) if section else []


def _parameters(value: object) -> list[str]:
    no_call = inspect.isclass(value) and issubclass(value, (BaseException, enum.Enum))
    if no_call or getattr(value, "_is_protocol", False):
        return []
    return [name for name in inspect.signature(value).parameters if name != "self"]  # type: ignore[arg-type]


def test_the_packages_offer_something() -> None:
    assert {f"pretouch.motion.{n}" for n in ("evaluator.find_contact", "scenario.Scenario")} <= set(PUBLIC)
    assert len(PUBLIC) > 40


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_args_name_exactly_the_parameters(name: str) -> None:
    value = PUBLIC[name]
    doc = inspect.cleandoc(vars(value).get("__doc__") or "" if inspect.isclass(value) else inspect.getdoc(value) or "")
    assert doc, "has no docstring of its own"
    assert re.match(r"[A-Z`].*[.:]$", doc.split("\n\n")[0].replace("\n", " ")), "starts with a sentence"
    assert sorted(_documented(doc)) == sorted(_parameters(value))


def continued(source: str) -> list[str]:
    """The functions and classes whose docstring goes on as a comment below it."""
    lines = source.splitlines()
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node) is not None:
            end = node.body[0].end_lineno or 0
            if end < len(lines) and lines[end].lstrip().startswith("#"):
                found.append(node.name)
    return found


def test_a_docstring_is_written_in_one_piece() -> None:
    """Nobody who reads the help of a function sees a comment."""
    assert continued('def f():\n    """Return it."""\n    # None without one.\n    return None\n') == ["f"]
    cut = {path: continued(path.read_text(encoding="utf-8")) for path in FILES}
    assert {path.name: names for path, names in cut.items() if names} == {}


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_shows_how_it_is_used(verb: str) -> None:
    verbs = {name: value for name, value in PUBLIC.items() if not name.startswith("pretouch.report.")}
    (doc,) = {inspect.getdoc(value) or "" for name, value in verbs.items() if name.rpartition(".")[2] == verb}
    assert re.search(r"^Examples:\n    (.*\n)*?    >>> ", doc, re.MULTILINE)
    assert f"{verb}(" in doc.partition("Examples:")[2]


def _texts(path: Path) -> Iterator[tuple[int, str]]:
    """The text constants of a file, docstrings included, with their lines; of a template, every line."""
    source = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        yield from enumerate(source.splitlines(), 1)
        return
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


@pytest.mark.parametrize("pattern", ["*.py", "*.j2", "*.html", "*.css"])
def test_no_text_calls_anything_safe_or_compliant(pattern: str) -> None:
    promises = [
        f"{path.relative_to(SOURCE)}:{line}: {text[:80]}"
        for path in sorted(SOURCE.rglob(pattern))
        for line, text in _texts(path)
        # {{ value | safe }} is a filter of the template language
        if FORBIDDEN.search(re.sub(r"\|\s*safe\b", "", text) if path.suffix in {".j2", ".html"} else text)
    ]
    assert not promises


def test_whole_words_only_are_promises() -> None:
    assert FORBIDDEN.search("This gain is Safe.")
    assert not FORBIDDEN.search("unsafe, safely, compliance")
