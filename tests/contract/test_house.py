"""The package has no import cycle, none by strings, one table of pages, and no two classes with the same name."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest

from pretouch._core import arguments
from pretouch._core.display import Described
from pretouch.config import load_scenario
from pretouch.designs import design
from pretouch.errors import InvalidInputError
from pretouch.motion import Admittance, Obstacle, Scenario
from pretouch.report import plots, report_html
from pretouch.report.pages import PAGES, page_of

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


@pytest.mark.slow
def test_no_module_imports_itself_by_a_detour() -> None:
    assert circles() == []


IMPORTERS = {
    "import_module",
    "__import__",
    "reload",
    "find_spec",
    "resolve_name",
    "load_module",
    "attach",
    "attach_stub",
}
ALLOWED = {
    "pretouch": "attach_stub",  # the public names, imported when they are first used
    "pretouch.config": "attach_stub",
    "pretouch.report": "attach_stub",
    "pretouch.report.plots": "import_module",  # modules that it also imports for type checkers, see below
    "pretouch._core.errors": "import_module",  # optional libraries of others, see `require`
    "pretouch.robots.descriptions": "find_spec import_module",  # collections of models, if they are installed
    "pretouch.robots.urdf": "import_module",  # xacro, which is no extra of pretouch
    "pretouch.robots.rendering": "import_module reload",  # MuJoCo's backend of OpenGL
}


def imports_by_string(source: str) -> Iterator[str]:
    """Yield the calls that import a module by its name, and the strings that name a module of pretouch.

    A group of entry points may have the name of a module: its keyword says that it is a group.
    """
    tree = ast.parse(source)
    groups = {
        id(k.value) for node in ast.walk(tree) if isinstance(node, ast.Call) for k in node.keywords if k.arg == "group"
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in IMPORTERS:
                yield name
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in groups:
            module, _, attribute = node.value.partition(":")
            if module.startswith("pretouch.") and (module in MODULES or attribute.isidentifier()):
                yield node.value


@pytest.mark.parametrize(
    "source",
    [
        'page = "pretouch.designs.page:gain_page"',
        'from importlib import import_module; import_module("pretouch.report.html")',
        'import importlib; importlib.import_module(f"{__package__}.table_1")',
        '__import__("pretouch.report")',
        'require("pretouch.report")',
        'HOME = "pretouch.report.html"',
    ],
)
def test_imports_by_string_are_seen(source: str) -> None:
    assert list(imports_by_string(source))


@pytest.mark.parametrize(
    "source", ['Extensions(group="pretouch.sensors")', 'require("mujoco")', "import pretouch.designs"]
)
def test_other_strings_are_no_imports(source: str) -> None:
    assert not list(imports_by_string(source))


def test_no_module_is_imported_by_a_string() -> None:
    """Otherwise no tool sees the import, and neither a circle nor a layer is checked."""
    found = {name: set(imports_by_string(path.read_text(encoding="utf-8"))) for name, path in MODULES.items()}
    assert {name: " ".join(sorted(strings)) for name, strings in found.items() if strings} == ALLOWED


def test_plot_functions_are_imported_from_where_type_checkers_look() -> None:
    """So that tools see the imports that are made by name."""
    imports = [node for node in ast.walk(ast.parse(inspect.getsource(plots))) if isinstance(node, ast.ImportFrom)]
    seen = {node.module: tuple(alias.name for alias in node.names) for node in imports if node.level}
    assert seen == plots._MODULES


def shown_classes(kind: type) -> Iterator[type]:
    """Yield the classes of pretouch that have a display, without those that others only extend."""
    for sub in kind.__subclasses__():
        if sub.__module__.startswith("pretouch."):
            yield from shown_classes(sub)
            is_copy = vars(sys.modules[sub.__module__])[sub.__name__] is not sub  # a dataclass with slots replaces it
            if not is_copy and sub.__name__ not in {"Answer", "GainEvidence"}:
                yield sub


def test_every_result_has_one_page_in_the_table() -> None:
    for name in MODULES:
        if name != "pretouch.__main__":
            importlib.import_module(name)
    rows = {kind: make for folder in PAGES.values() for kind, make in folder().items()}
    assert set(rows) == set(shown_classes(Described))
    for kind, make in rows.items():
        assert next(iter(make.__annotations__.values())) == kind.__name__
    homes = [(folder, kind.__module__) for folder, make in PAGES.items() for kind in make()]
    assert all(module.rpartition(".")[0] == f"pretouch.{folder}" for folder, module in homes)


def test_an_object_without_a_page_is_a_mistake() -> None:
    class Unknown(Described):
        __slots__ = ()

    with pytest.raises(InvalidInputError, match="no report page describes"):
        str(Unknown())


def test_a_subclass_has_the_page_of_its_base() -> None:
    class Encounter(Scenario):
        pass

    scenario = Encounter(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.04, velocity=-0.3)
    )
    assert page_of(scenario).kind == "Encounter"


def test_a_report_is_made_of_everything_that_a_page_describes() -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.04, velocity=-0.3)
    )
    assert "starts at a distance of 40 mm" in report_html(scenario)
    assert str(scenario).startswith("Scenario(admittance=")


def test_the_text_of_a_design_loads_no_figure_and_no_other_verb() -> None:
    code = (
        "import pretouch as pt, sys; from pretouch.letter.inputs import approach, sensor;"
        "objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3);"
        "text = str(pt.design(pt.Task(approach(), sensor('inverse-power'), objective, bounds=(-10.0, -0.01))));"
        "print(text[:12], *sys.modules, sep='\\n')"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    text, *modules = answer.stdout.splitlines()
    assert text == "Optimal gain"
    assert "pretouch.report.pages" in modules
    assert not {"pretouch.report.html", "pretouch.verification", "pretouch.robots", "matplotlib"} & set(modules)


def test_a_design_checks_the_arguments_of_its_verb_only() -> None:
    """What a verb has checked is not checked again by the functions that it calls."""
    task = load_scenario(ROOT / "examples/approach.toml")
    str(design(task))  # makes the rules
    calls = []

    def count(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_name == "call" and frame.f_code.co_filename == arguments.__file__:
            calls.append(frame.f_locals["function"].__name__)

    sys.setprofile(count)
    try:
        str(design(task))
    finally:
        sys.setprofile(None)
    assert calls == ["design_gain"]


def test_a_class_has_its_name_alone() -> None:
    names = Counter(
        node.name
        for path in MODULES.values()
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in names.items() if count > 1] == []
