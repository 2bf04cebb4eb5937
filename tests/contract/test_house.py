"""The house keeps its form: no circle among its modules, no name that means two things, no file grown out of reach."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src"
MODULES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted((SOURCE / "pretouch").rglob("*.py"))
}


def imported(name: str) -> Iterator[str]:
    """Yield every module that a module imports, wherever the import stands, for types alone as well."""
    package = name if MODULES[name].name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = ".".join(filter(None, [*package.split(".")[: len(package.split(".")) - node.level + 1], base]))
            for alias in node.names:
                found = f"{base}.{alias.name}" if f"{base}.{alias.name}" in MODULES else base
                if found in MODULES:
                    yield found


def circles() -> list[list[str]]:
    """Return the strongly connected parts of the graph of imports that have more than one module (Tarjan)."""
    graph = {name: sorted({other for other in imported(name) if other != name}) for name in MODULES}
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in graph[name]:
            if other not in index:
                visit(other)
            if other in stack:
                low[name] = min(low[name], low[other])
        if low[name] == index[name]:
            part = [stack.pop()]
            while part[-1] != name:
                part.append(stack.pop())
            found.append(sorted(part))

    for name in graph:
        if name not in index:
            visit(name)
    return [part for part in found if len(part) > 1]


def test_no_module_imports_itself_by_a_detour() -> None:
    assert circles() == []


def test_a_class_has_its_name_alone() -> None:
    names = Counter(
        node.name
        for path in MODULES.values()
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in names.items() if count > 1] == []


FILES = 250  # of the package and its compiled core
LINES = 53_000  # of both; grew with the checks of issue 23: arguments, library, readings, limits of files
LONGEST_FUNCTION = 60  # lines without its docstring
ROOMS_OF_DESIGN = 20
FILES_OF_A_VERDICT = 50

PASSED = """
import sys, threading
from pathlib import Path

import pretouch as pt

home, seen = str(Path(pt.__file__).parent), set()
task, verify = pt.load_scenario(sys.argv[1]), pt.verify_gain

def note(frame, event, _):
    if event == "call" and frame.f_code.co_flags & 1 and frame.f_code.co_filename.startswith(home):
        seen.add(frame.f_code.co_filename)  # a function's own variables tell it from the body of a class

threading.setprofile(note)
sys.setprofile(note)
verify(task)
sys.setprofile(None)
print(*sorted(seen), sep="\\n")
"""


def native_sources() -> list[Path]:
    return [path for part in ("core", "law") for path in sorted((ROOT / "native" / part).glob("*.[ch]*"))]


def test_the_house_does_not_grow_unasked() -> None:
    files = [*(SOURCE / "pretouch").rglob("*.py*"), *native_sources()]
    files = [path for path in files if path.suffix != ".pyc"]
    assert len(files) <= FILES
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files) <= LINES
    assert len([p for p in (SOURCE / "pretouch/design").iterdir() if p.name != "__pycache__"]) <= ROOMS_OF_DESIGN


def lines_without_docstring(function: ast.FunctionDef) -> int:
    first = function.body[0]
    has_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    said = first.end_lineno - first.lineno + 1 if has_docstring else 0
    return function.end_lineno - function.lineno + 1 - said


def test_no_function_is_too_long_to_read() -> None:
    functions = (
        (f"{name}.{node.name}", lines_without_docstring(node))
        for name, path in MODULES.items()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    )
    assert [(name, count) for name, count in functions if count > LONGEST_FUNCTION] == []


def test_a_verdict_passes_through_few_files() -> None:
    """Functions of so many files run, each once or more, between a scenario file that is read and its verdict."""
    scene = str(ROOT / "examples" / "loop.toml")
    answer = subprocess.run([sys.executable, "-c", PASSED, scene], capture_output=True, text=True, check=True)
    assert len(answer.stdout.split()) <= FILES_OF_A_VERDICT
