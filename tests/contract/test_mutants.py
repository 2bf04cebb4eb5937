"""`make mutants` changes what decides something and nothing else, and tries each change on the tests that see it."""

from __future__ import annotations

import ast
import difflib
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from mutants.drawing import Mutant, draw, mutants_of
from mutants.reach import Reach, build_module, marking_jobs, moved
from mutants.tested_by import seen_by

PYTHON = '''"""Words are 3 and more."""

from typing import Final

_LIMIT: Final = 0.5  # not 7


def held(value: float, *, most: int = 4) -> bool:
    """Return 1 < 2."""
    if value < 0 or most == 3:
        raise ValueError(f"found {value:.3f} at 5 and 6")
    place(value, size=8)
    return value * most <= _LIMIT
'''
NATIVE = """#include <x>
// 1 + 2
template <int N>
inline double bent(const double *x, Lanes &y) {
    const double z = x[0] * 2.5 + y.a;  // < 3
    y.a = larger(z, 1.0);
    y.b += z;
    return z < 4.0 && y.a > 0.0 ? z : -z;
}
"""


def changes(path: str, text: str) -> set[tuple[str, str]]:
    """What is put in the place of what, over all mutants."""
    every = [mutant for ways in mutants_of(path, text).values() for mutant in ways]
    assert all(text != mutant.applied(text) for mutant in every)
    return {(text[m.edit.start : m.edit.end].strip(), m.edit.new.strip()) for m in every}


def test_python_is_changed_where_it_decides_something() -> None:
    found = changes("src/x.py", PYTHON)
    assert {("<", "<="), ("<", ">="), ("or", "and"), ("==", "!="), ("*", "/"), ("<=", ">"), ("4", "5")} <= found
    assert {("0.5", "0.55"), ("value * most <= _LIMIT", "None"), ("place(value, size=8)", "pass")} <= found
    assert any(old.startswith("raise ValueError") and new == "pass" for old, new in found)
    numbers = {old for old, _ in found if old.isdigit()}
    assert numbers == {"0", "3", "4"}, "neither words, comments, types, nor how a number is written or drawn"
    lines = set(mutants_of("src/x.py", PYTHON))
    assert lines == {5, 8, 10, 11, 12, 13}


def test_every_mutant_of_a_module_is_python_still() -> None:
    text = Path(__file__).parents[2].joinpath("src/pretouch/motion/drag.py").read_text(encoding="utf-8")
    every = [mutant for ways in mutants_of("src/x.py", text).values() for mutant in ways]
    assert len(every) > 100
    for mutant in every[::7]:
        ast.parse(mutant.applied(text))
        changed = [
            line for line in difflib.ndiff(text.splitlines(), mutant.applied(text).splitlines()) if line[0] in "+-"
        ]
        assert [line[2:] for line in changed] == [mutant.before.rstrip("\n"), mutant.after.rstrip("\n")]


def test_native_code_is_changed_where_it_decides_something() -> None:
    found = changes("native/core/x.hpp", NATIVE)
    assert {("*", "/"), ("+", "-"), ("<", "<="), ("&&", "||"), ("larger", "smaller"), ("2.5", "5.0")} <= found
    assert {("y.b += z;", ";"), ("+=", "-="), ("0.0", "1.0")} <= found
    assert set(mutants_of("native/core/x.hpp", NATIVE)) == {5, 6, 7, 8}


def test_mutants_are_those_of_the_seed_and_more_of_them_begin_with_the_same() -> None:
    sources = {"src/x.py": PYTHON, "native/core/x.hpp": NATIVE}
    first, again, other = (list(islice(draw(sources, seed), 8)) for seed in (1, 1, 2))
    assert first == again != other
    assert list(islice(draw(sources, 1), 4)) == first[:4]
    assert len({(m.path, m.line) for m in draw(sources, 1)}) == len(list(draw(sources, 1))) == 10, "each line once"


def mutant(line: int, path: str = "src/x.py", text: str = PYTHON) -> Mutant:
    return mutants_of(path, text)[line][0]


@pytest.mark.parametrize(
    ("reached", "line", "seen"),
    [
        ({13: {"one"}, 12: {"two"}}, 13, {"one"}),
        ({10: {"one"}, 13: {"two"}}, 8, {"one", "two"}),  # a default: whoever calls the function
        ({5: {"importer"}, 13: {"one"}, 12: {"two"}}, 5, {"importer", "one"}),  # a constant: whoever uses it
        ({12: {"two"}}, 13, set()),
    ],
)
def test_a_mutant_is_tried_on_the_tests_that_see_it(reached: dict[int, Any], line: int, seen: set[str]) -> None:
    known = Reach(Path())
    known.by_line["src/x.py"].update(reached)
    assert seen_by(mutant(line), {"src/x.py": PYTHON}, known) == seen


def test_tests_that_fail_without_a_change_tell_nothing_of_one() -> None:
    known = Reach(Path(), failing={"one"})
    known.by_line["src/x.py"][13] = {"one", "two"}
    assert seen_by(mutant(13), {"src/x.py": PYTHON}, known) == {"two"}


def test_a_mutant_of_native_code_is_tried_on_the_tests_that_reach_its_function() -> None:
    known = Reach(Path())
    known.by_line["native/core/x.hpp"].update({5: {"one"}, 9: {"two"}, 14: {"other"}})
    text = NATIVE + NATIVE.partition("// 1 + 2\n")[2]
    assert seen_by(mutant(8, "native/core/x.hpp", text), {"native/core/x.hpp": text}, known) == {"one", "two"}


def test_lines_that_move_keep_their_tests() -> None:
    before, now = "a\nb\nc\nd", "new\na\nb changed\nmore\nc\nd"
    assert moved(before, now) == {1: 2, 2: 3, 3: 5, 4: 6}
    assert moved(before, before) == {1: 1, 2: 2, 3: 3, 4: 4}


def test_every_native_source_is_compiled_with_marks() -> None:
    """The rest of it runs only in `make mutants`, for minutes."""
    root = Path(__file__).parents[2]
    jobs = marking_jobs(build_module(root), (["cc"], ["c++"]))
    sources = {*root.glob("native/core/*.cpp"), *root.glob("native/law/*.c")}
    assert {Path(job[-1]) for job in jobs} == sources
    assert all("-fsanitize-coverage=trace-pc" in job for job in jobs)
