"""Which tests can see a mutant: those that reach its line, or what uses the value that it defines."""

from __future__ import annotations

import ast
import re
from functools import cache

from mutants.drawing import Mutant
from mutants.reach import Reach


def seen_by(mutant: Mutant, texts: dict[str, str], known: Reach) -> set[str]:
    """Return the tests that can see a mutant.

    In a function of Python these are the tests that reach its line. Other lines run once, when the module is imported:
    their tests are those that reach a line that names what is defined there. Of the compiled core blocks of code are
    known, not lines: its tests are those that reach the function, or, of what the compiler computes, the file or any.
    """
    if not mutant.path.endswith(".py"):
        return _seen_by_native(mutant, texts, known)
    tree = _parsed(texts[mutant.path])
    function = _innermost(tree, mutant.line, (ast.FunctionDef,))
    if isinstance(function, ast.FunctionDef):
        assert function.end_lineno is not None
        body = range(function.body[0].lineno, function.end_lineno + 1)
        if mutant.line < body.start:  # a default
            return known.tests(mutant.path, body)
        here = known.tests(mutant.path, range(mutant.line, mutant.line + 1))
        statement = _innermost(tree, mutant.line, (ast.stmt,)) or function
        return here or known.tests(mutant.path, range(statement.lineno, mutant.line + 1))
    return _users(mutant, texts, known)


def _seen_by_native(mutant: Mutant, texts: dict[str, str], known: Reach) -> set[str]:
    lines = texts[mutant.path].splitlines()
    found = known.tests(mutant.path, _native_function(lines, mutant.line))
    found = found or known.tests(mutant.path, range(1, len(lines) + 1))
    if found:
        return found
    return set().union(*(known.tests(p, range(1, len(texts[p]))) for p in texts if p.startswith("native/core")))


@cache
def _parsed(text: str) -> ast.Module:
    return ast.parse(text)


def _innermost(tree: ast.Module, line: int, kinds: tuple[type[ast.stmt], ...]) -> ast.stmt | None:
    """Return the statement of some kinds that holds a line and begins last."""
    held = [n for n in ast.walk(tree) if isinstance(n, kinds) and n.lineno <= line <= (n.end_lineno or 0)]
    return max(held, key=lambda node: (node.lineno, -(node.end_lineno or 0)), default=None)


def _users(mutant: Mutant, texts: dict[str, str], known: Reach) -> set[str]:
    """Return the tests that reach a line in which a name stands that is defined at a line outside of functions."""
    names = _defined(_parsed(texts[mutant.path]), mutant.line)
    seen: set[str] = set()
    found: set[str] = set()
    while names - seen:
        name = (names - seen).pop()
        seen.add(name)
        word = re.compile(rf"\b{re.escape(name)}\b")
        for path in [mutant.path] if name.startswith("_") else [p for p in texts if p.endswith(".py")]:
            if not word.search(texts[path]):
                continue
            for number, line in enumerate(texts[path].splitlines(), 1):
                if word.search(line):
                    found |= known.tests(path, range(number, number + 1))
                    if not line.startswith((" ", "from", "import", "def", "class", "@")):
                        names |= _defined(_parsed(texts[path]), number)  # a value made of that value
    return found or known.tests(mutant.path, range(1, texts[mutant.path].count("\n") + 2))


def _defined(tree: ast.Module, line: int) -> set[str]:
    """Return the names that the statement at a line defines, for its module or for a class."""
    statement = _innermost(tree, line, (ast.Assign, ast.AnnAssign, ast.ClassDef))
    targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
    names = {
        node.id for target in targets if target is not None for node in ast.walk(target) if isinstance(node, ast.Name)
    }
    return names | ({statement.name} if isinstance(statement, ast.ClassDef) else set())


def _native_function(lines: list[str], number: int) -> range:
    """Return the lines from the last one at or before a line that begins a function at the margin to its end."""

    def begins(line: str) -> bool:
        return bool(line) and line[0] not in " })]#/" and not line.startswith(("namespace", "__attribute__"))

    first = next((i for i in range(number, 0, -1) if begins(lines[i - 1])), 1)
    last = next((i for i in range(number + 1, len(lines) + 1) if begins(lines[i - 1])), len(lines) + 1)
    return range(first, last)
