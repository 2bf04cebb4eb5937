"""Every equation of the letter has a function that carries its id, and a test that checks it by an independent way.

A function or class carries the ids that the first two paragraphs of its docstring cite. A test checks the ids of its
mark `equation`, which names the independent way. Both are read from the source text, so the selection of tests to run
has no effect. Folders that only present or describe (SURFACE) carry nothing, however often they cite.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import pretouch
from pretouch._core.equations import EQUATIONS

SOURCE = Path(pretouch.__file__).parent
TESTS = Path(__file__).parents[1] / "equations"
SURFACE = {"_core", "cli", "config", "letter", "report"}
CITATION = re.compile(r"\bL\((\d+)\)(?:\s*[-–]\s*(?:L?\((\d+)\)|(\d+)))?")
Function = ast.FunctionDef | ast.AsyncFunctionDef
Definition = Function | ast.ClassDef


class Mark(NamedTuple):
    """One mark `equation`: the test that it sits on, its ids, and the independent way that it names."""

    test: str
    ids: list[str]
    by: str


def _cited(text: str) -> list[int]:
    """The numbers cited in a text, with all that a range such as L(16)-(19) covers."""
    cited = []
    for first, last, bare in CITATION.findall(text):
        low, high = int(first), int(last or bare or first)
        assert low <= high, f"L({low})-({high}) runs backward"
        cited += range(low, high + 1)
    return cited


def _definitions(tree: ast.AST, prefix: str = "") -> Iterator[tuple[str, Definition]]:
    """Every function, method and class, with its dotted name."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, Definition):
            yield prefix + node.name, node
            yield from _definitions(node, f"{prefix}{node.name}.")
        else:
            yield from _definitions(node, prefix)


def carriers(source: str) -> dict[str, list[str]]:
    """The functions and classes of a source text that carry each id."""
    found: dict[str, list[str]] = {}
    for name, node in _definitions(ast.parse(source)):
        opening = "\n\n".join(inspect.cleandoc(ast.get_docstring(node) or "").split("\n\n")[:2])
        for n in dict.fromkeys(_cited(opening)):
            found.setdefault(f"L({n})", []).append(name)
    return found


def _is_test(name: str) -> bool:
    """Tell whether pytest collects a definition of this dotted name."""
    *classes, function = name.split(".")
    return function.startswith("test_") and all(part.startswith("Test") for part in classes)


def _is_mark(node: ast.AST) -> bool:
    return isinstance(node, ast.Attribute) and node.attr == "equation" and ast.unparse(node).endswith("mark.equation")


def _literal(call: ast.Call) -> tuple[list[object], dict[str | None, object]]:
    """The arguments of a mark, None where one is not written out."""

    def value(node: ast.expr) -> object:
        return node.value if isinstance(node, ast.Constant) else None

    return [value(a) for a in call.args], {k.arg: value(k.value) for k in call.keywords}


def _flaws(name: str, node: Function, call: ast.expr) -> Iterator[str]:
    """What is wrong with one mark."""
    if not isinstance(call, ast.Call):
        yield f"{name}: the mark names no equation"
        return
    ids, named = _literal(call)
    by = named.get("by")
    if not ids:
        yield f"{name}: the mark names no equation"
    yield from (f"{name}: the mark names {i!r}, which is no id" for i in ids if i not in EQUATIONS)
    if not isinstance(by, str) or not by.strip():
        yield f"{name}: the mark does not say by which independent way"
    yield from (f"{name}: the mark has {key!r}, which it does not know" for key in named if key != "by")
    if not _is_test(name):
        yield f"{name}: is marked and is no test"
    if any(word in ast.unparse(d) for d in node.decorator_list for word in (".skip", ".xfail")):
        yield f"{name}: is marked and may not run"


def marks(source: str) -> tuple[list[Mark], list[str]]:
    """The marks of a test file, and what is wrong with them."""
    tree = ast.parse(source)
    found, flaws, seen = [], [], set()
    for name, node in _definitions(tree):
        for decorator in node.decorator_list:
            attribute = decorator.func if isinstance(decorator, ast.Call) else decorator
            if not _is_mark(attribute) or isinstance(node, ast.ClassDef):
                continue
            seen.add(id(attribute))
            wrong = list(_flaws(name, node, decorator))
            flaws += wrong
            if not wrong and isinstance(decorator, ast.Call):
                ids, named = _literal(decorator)
                found.append(Mark(test=name, ids=[str(i) for i in ids], by=str(named["by"])))
    stray = [node for node in ast.walk(tree) if _is_mark(node) and id(node) not in seen]
    flaws += [f"line {node.lineno}: a mark that sits on no function" for node in stray if isinstance(node, ast.expr)]
    return found, flaws


def missing(found: Iterable[str]) -> list[str]:
    """The ids that are not among those found, in the letter's order."""
    there = set(found)
    return [i for i in EQUATIONS if i not in there]


def _read(folder: Path, pattern: str, without: set[str]) -> Iterator[tuple[str, str]]:
    for path in sorted(folder.rglob(pattern)):
        place = path.relative_to(folder)
        if place.parts[0] not in without:
            yield str(place), path.read_text(encoding="utf-8")


def test_the_letter_has_equations_1_to_23() -> None:
    assert list(EQUATIONS) == [f"L({n})" for n in range(1, 24)]
    assert all(text.strip() for text in EQUATIONS.values())


def test_a_citation_is_read_with_its_range() -> None:
    assert _cited("by L(3), L(16)-(19) and L(5)-L(6), not ln(2) or XL(9)") == [3, 16, 17, 18, 19, 5, 6]


def test_every_cited_equation_exists() -> None:
    unknown, count = [], 0
    for path in sorted(SOURCE.rglob("*.py")):
        for n in _cited(path.read_text(encoding="utf-8")):
            count += 1
            if f"L({n})" not in EQUATIONS:
                unknown.append(f"{path.relative_to(SOURCE)}: L({n})")
    assert not unknown
    assert count > len(EQUATIONS)  # else the pattern has stopped finding them


@pytest.mark.slow
def test_every_equation_has_a_function_that_carries_its_id() -> None:
    found = [i for _, source in _read(SOURCE, "*.py", SURFACE) for i in carriers(source)]
    assert not missing(found), (
        "cite these in the docstring of the function that implements them, in its first two paragraphs"
    )


def test_every_equation_has_a_test_by_an_independent_way() -> None:
    found = [i for _, source in _read(TESTS, "test_*.py", set()) for mark in marks(source)[0] for i in mark.ids]
    assert not missing(found), 'mark the tests that check these: @pytest.mark.equation("L(n)", by="...")'


@pytest.mark.slow
def test_every_mark_is_one_that_counts() -> None:
    flaws = [f"{file}: {f}" for file, source in _read(TESTS, "*.py", set()) for f in marks(source)[1]]
    assert not flaws
    elsewhere = [file for file, source in _read(TESTS.parent, "test_*.py", {"equations"}) if any(marks(source))]
    assert not elsewhere, "these marks are read from tests/equations only"


CODE = '''
"""The module cites L(1), which carries nothing."""
# nor does a comment, L(2)
FORMULA = "nor a text, L(3)"

class Curve:
    """The curve L(5)
    and its slope, L(6).

    A second paragraph, L(7).

    A third paragraph, L(22).
    """

    def force(self):
        """The force by L(10)-(12)."""
        def inner():
            """A step of L(20)-L(21)."""

def bare():
    return "L(8)"
'''


def test_the_reader_takes_the_first_two_paragraphs_of_functions_and_classes_and_nothing_else() -> None:
    assert carriers(CODE) == {
        "L(5)": ["Curve"],
        "L(6)": ["Curve"],
        "L(7)": ["Curve"],
        "L(10)": ["Curve.force"],
        "L(11)": ["Curve.force"],
        "L(12)": ["Curve.force"],
        "L(20)": ["Curve.force.inner"],
        "L(21)": ["Curve.force.inner"],
    }


def test_the_reader_misses_the_function_that_is_not_there() -> None:
    everything = 'def all_of_it():\n    """By L(1)-(23)."""\n'
    assert missing(carriers(everything)) == []
    assert missing(carriers(everything.replace("(1)-(23)", "(1)-(8) and L(10)-(23)"))) == ["L(9)"]
    assert missing(carriers(everything.replace('"""', '"""It.\n\n    Is.\n\n    ', 1))) == list(EQUATIONS)


MARKED = """
import pytest

@pytest.mark.parametrize("gain", [1.0])
@pytest.mark.equation("L(10)", "L(13)", by="matrix exponential")
def test_one(gain): ...

class TestMore:
    @pytest.mark.equation("L(2)", by="by hand")
    async def test_two(self): ...

def test_three(): ...
"""


def _changed(old: str, new: str) -> list[str]:
    assert old in MARKED
    return marks(MARKED.replace(old, new))[1]


def test_the_reader_takes_the_marks_of_tests() -> None:
    found, flaws = marks(MARKED)
    assert found == [
        Mark(test="test_one", ids=["L(10)", "L(13)"], by="matrix exponential"),
        Mark(test="TestMore.test_two", ids=["L(2)"], by="by hand"),
    ]
    assert not flaws


def test_the_reader_misses_the_test_that_is_not_there() -> None:
    everything = "".join(
        f"@pytest.mark.equation({i!r}, by='hand')\ndef test_{n}(): ...\n" for n, i in enumerate(EQUATIONS)
    )
    for source, absent in ((everything, []), (everything.replace("'L(4)'", "'L(5)'"), ["L(4)"]), ("", list(EQUATIONS))):
        found, flaws = marks(source)
        assert missing(i for mark in found for i in mark.ids) == absent
        assert not flaws


def test_a_mark_that_does_not_count_is_told_why() -> None:
    assert _changed('"L(13)"', '"L(24)"') == ["test_one: the mark names 'L(24)', which is no id"]
    assert _changed('"L(13)"', "*IDS") == ["test_one: the mark names None, which is no id"]
    assert _changed(', by="matrix exponential"', "") == ["test_one: the mark does not say by which independent way"]
    assert _changed('by="by hand"', 'by=" "') == ["TestMore.test_two: the mark does not say by which independent way"]
    assert _changed('by="by hand"', 'way="hand", by="x"') == [
        "TestMore.test_two: the mark has 'way', which it does not know"
    ]
    assert _changed('("L(2)", by="by hand")', "") == ["TestMore.test_two: the mark names no equation"]
    assert _changed('"L(2)", by', "by") == ["TestMore.test_two: the mark names no equation"]
    assert _changed("def test_one", "def one") == ["one: is marked and is no test"]
    assert _changed("class TestMore", "class More") == ["More.test_two: is marked and is no test"]
    assert _changed("    @pytest", "    @pytest.mark.skip\n    @pytest") == [
        "TestMore.test_two: is marked and may not run"
    ]
    assert _changed("def test_three", "pytestmark = pytest.mark.equation\ndef test_three") == [
        "line 12: a mark that sits on no function"
    ]
    assert _changed("class TestMore", '@pytest.mark.equation("L(3)", by="x")\nclass TestMore') == [
        "line 8: a mark that sits on no function"
    ]
