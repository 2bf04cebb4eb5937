"""Every warning has a code, and every code has a page that explains it."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import pretouch as pt
from page_checks import assert_sound
from pretouch._core import warning_codes as module
from pretouch._core.blocks import Page
from pretouch._core.warning_codes import (
    caution,
    codes_in,
    explanation,
    page_of_code,
    split_code,
    warning_codes,
    with_context,
)
from pretouch.report.html import page_html

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "pretouch"
FILES = sorted(SOURCE.rglob("*.py"))
FORWARDED = {"chase_in_words"}  # a reason of a verdict as well; `harm_in_words` adds the code


def functions(path: Path) -> Iterator[ast.FunctionDef]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            yield node


def yields_warnings(node: ast.FunctionDef) -> bool:
    doc = (ast.get_docstring(node) or "").split("\n\n")[0]
    return re.match(r"Yield .*(warning|sentences on (properties|readings))", doc, re.DOTALL) is not None


def test_every_warning_that_is_yielded_has_a_code() -> None:
    bare, checked = [], 0
    for path in FILES:
        for function in functions(path):
            if not yields_warnings(function) or function.name in FORWARDED:
                continue
            checked += 1
            bare += [
                f"{path.name}:{node.lineno}"
                for node in ast.walk(function)
                if isinstance(node, ast.Yield) and isinstance(node.value, (ast.Constant, ast.JoinedStr, ast.BinOp))
            ]
    assert checked > 12
    assert bare == []


def test_every_code_is_used_and_no_other() -> None:
    used = set()
    for path in FILES:
        if path.name != "warning_codes.py":
            used |= set(re.findall(r'"(PT\d{3})"', path.read_text(encoding="utf-8")))
    assert used == set(warning_codes())


@pytest.mark.parametrize("code", warning_codes())
def test_a_code_has_a_page_that_says_what_to_do(code: str) -> None:
    entry = explanation(code)
    words = " ".join((ROOT / page_of_code(code)).read_text(encoding="utf-8").split())
    for text in (entry.title, entry.meaning, entry.why, entry.remedy, entry.example):
        assert len(text.split()) >= 2
        assert text in words
        assert "##" not in text
    assert words.count(f"{code}: ") == 2
    assert all(text.endswith(".") for text in (entry.meaning, entry.why, entry.remedy))
    assert not split_code(entry.example)[0]


def test_the_wheel_contains_the_pages() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    assert ROOT / "src" / included["docs/warnings"] == Path(module.__file__).with_name("warnings")


def test_a_code_is_split_from_its_text() -> None:
    text = caution("PT301", "the optimum lies on a bound")
    assert split_code(text) == ("PT301", "the optimum lies on a bound")
    assert split_code("no code: here") == ("", "no code: here")
    assert with_context("finger", text) == "PT301: finger: the optimum lies on a bound"
    assert with_context("finger", "bare") == "finger: bare"
    assert codes_in([text, "PT999: unknown", "x PT101: y"]) == ("PT101", "PT301")


def test_terminal_json_and_report_name_the_code() -> None:
    task = pt.load_scenario(ROOT / "examples/approach.toml").replace(bounds=(-0.5, -0.01))
    design = pt.design(task)
    assert split_code(design.warnings[0])[0] == "PT301"
    assert design.to_dict()["warnings"][0].startswith("PT301: ")
    assert "warning PT301: the optimal gain" in str(design)
    assert "Warning PT301: the optimal gain" in design._repr_html_()
    page = assert_sound(pt.report.report_html(design))
    assert "pt301" in page.anchors
    assert "pt301" in page.ids
    assert explanation("PT301").remedy.split("`")[0] in page.words


@pytest.mark.parametrize("code", warning_codes())
def test_a_report_explains_each_code(code: str) -> None:
    page = assert_sound(page_html(Page(kind="test", headline="x", warnings=(caution(code, "text"),))))
    assert explanation(code).title in page.words
    assert code.lower() in page.anchors


ACTS = re.compile(
    r"(?:Also|Then|To use|If (?:it|this) is|Add|Check|Choose|Copy|Correct|Extend|Give|Let|Lower|Measure|Mount|Or|Raise"
    r"|Record|Reduce|Remove|Repeat|Replace|Run|Set|Use|Write) [a-z]"
)
"""How a sentence begins that tells what to do."""


def sentences(node: ast.expr) -> list[str]:
    """Return the sentences of a text in the source; a value in it is an X."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    text = "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in parts)
    return re.split(r"(?<=[\w)%][.!?])\s+(?=[A-Z])", text)


def test_the_first_sentence_of_a_warning_has_the_whole_remedy() -> None:
    """The terminal prints the first sentence only, so who follows it must get where the whole text leads."""
    late, checked = [], 0
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "caution":
                checked += 1
                late += [f"{path.name}:{node.lineno}: {s}" for s in sentences(node.args[1])[1:] if ACTS.match(s)]
    assert checked > 60
    assert late == []
