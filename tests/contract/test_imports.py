"""The front door: what importing pretouch loads, and what it offers."""

from __future__ import annotations

import importlib
import inspect
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import pytest

import pretouch
from pretouch.report import plots

EXTRA = {"xarray", "zarr", "dask", "distributed", "h5netcdf", "h5py", "pandas", "mujoco", "rosbags", "mcap"}
HEAVY = {"scipy", "matplotlib", "pydantic", "typer", *EXTRA}


@pytest.mark.slow(keep=3)
@pytest.mark.parametrize(
    "folder",
    [
        "",
        ".sensors",
        ".control",
        ".motion",
        ".designs",
        ".simulation",
        ".robots",
        ".sweeps",
        ".verification",
        ".recording",
    ],
)
def test_importing_loads_nothing_heavy(folder: str) -> None:
    code = f"import sys, pretouch{folder}; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in answer.stdout.split()}
    assert "pretouch" in loaded
    assert not loaded & HEAVY


def test_the_check_above_would_see_what_is_loaded() -> None:
    code = "import sys, scipy.interpolate; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "scipy" in {name.partition(".")[0] for name in answer.stdout.split()}


def test_the_control_law_stands_on_the_core_alone() -> None:
    """It is what a robot runs, and what is exported: no model of a sensor, no solver, comes with it."""
    code = "import sys, pretouch.control; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    ours = {name.split(".")[1] for name in answer.stdout.split() if name.startswith("pretouch.")}
    assert ours == {"_core", "control"}


def test_the_public_names_are_sorted_and_listed_once() -> None:
    assert list(pretouch.__all__) == sorted(set(pretouch.__all__))


@pytest.mark.parametrize("package", [pretouch, pretouch.report], ids=["pretouch", "report"])
def test_every_name_of_the_stub_is_one_that_type_checkers_know_too(package: ModuleType) -> None:
    """They take the form `import NAME as NAME` alone for a name that is offered, and would not see another."""
    lines = Path(f"{package.__file__}i").read_text(encoding="utf-8").splitlines()
    names = [re.fullmatch(r"from \.[\w.]* import (\w+) as \1", line) for line in lines if line.startswith("from")]
    others = [line for line in lines if line and not line.startswith("from")]
    assert others == (["__version__: str"] if package is pretouch else [])
    assert sorted(match[1] for match in names if match) == sorted(dir(package)) == sorted(package.__all__)
    assert len(set(dir(package))) == len(names)


@pytest.mark.parametrize("name", pretouch.plots.__all__)
def test_every_figure_is_there_and_documented(name: str) -> None:
    figure = getattr(pretouch.plots, name)
    assert figure is getattr(plots, name)
    assert figure.__name__ == name
    assert "Returns:" in figure.__doc__


def test_without_the_stub_the_message_names_it(tmp_path: Path) -> None:
    shutil.copytree(
        Path(pretouch.__file__).parent, tmp_path / "pretouch", ignore=shutil.ignore_patterns("__init__.pyi")
    )
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import pretouch"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert re.search(r"non-existent stub .*__init__\.pyi", answer.stderr)


@pytest.mark.parametrize("name", pretouch.__all__)
def test_every_public_name_is_there_documented_and_offered_to_completion(name: str) -> None:
    value = getattr(pretouch, name)
    assert name in dir(pretouch)
    assert (inspect.getdoc(value) or "").strip()
    if inspect.isclass(value):  # dataclasses write a docstring of their signature where there is none
        assert value.__doc__
        assert not value.__doc__.startswith(f"{value.__name__}(")


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nonsense"):
        pretouch.nonsense  # noqa: B018


def test_public_names_are_the_same_objects_as_in_their_folders() -> None:
    for folder in (
        "sensors",
        "motion",
        "designs",
        "calibration",
        "config",
        "report",
        "simulation",
        "sweeps",
        "verification",
    ):
        module = importlib.import_module(f"pretouch.{folder}")
        for name in set(module.__all__) & set(pretouch.__all__):
            assert getattr(pretouch, name) is getattr(module, name)


ROOMS = [name for name in pretouch.__all__ if isinstance(getattr(pretouch, name), ModuleType)]


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    "code", ["import pretouch.{room} as room; import pretouch", "import pretouch; room = pretouch.{room}"]
)
def test_a_room_can_be_imported_by_the_name_that_the_docs_write(code: str) -> None:
    """`import pretouch.plots` works like `pretouch.plots`."""
    lines = ["import sys, importlib"]
    for room in ROOMS:
        lines += [
            code.format(room=room),
            f"from pretouch.{room} import *",
            "home = sys.modules[room.__name__]",
            f"print(room is pretouch.{room} is sys.modules['pretouch.{room}'] is home)",
            "print(room.__spec__.name == room.__name__)",
        ]
    command = [sys.executable, "-W", "error", "-c", "\n".join(lines)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (answer.stdout.split(), answer.stderr) == (["True"] * 2 * len(ROOMS), "")
    assert len(ROOMS) == 17


@pytest.mark.parametrize("name", ["Admittance", "nonsense", "errors.nonsense", "plots.motion"])
def test_what_is_no_module_cannot_be_imported_as_one(name: str) -> None:
    with pytest.raises(ModuleNotFoundError, match=f"No module named 'pretouch.{name}'"):
        importlib.import_module(f"pretouch.{name}")


def test_the_version_is_that_of_the_package() -> None:
    assert pretouch.__version__ == version("pretouch")


def test_sweep_is_the_verb_whatever_is_imported_first() -> None:
    code = (
        "import pretouch.sweeps.plan, pretouch.cli.sweep; print(type(pretouch.sweep).__name__, pretouch.sweep.__name__)"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.split() == ["function", "sweep"]


def test_the_report_of_a_design_loads_only_its_own_figures() -> None:
    scenario = Path(__file__).parents[2] / "examples" / "approach.toml"
    code = (
        "import sys, pretouch as pt; from pretouch.report import report_html; "
        f"report_html(pt.design(pt.load_scenario({str(scenario)!r}))); print(*sys.modules)"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(answer.stdout.split())
    assert "pretouch.report.motion_figures" in loaded
    parts = ("simulation", "verification", "recording", "robots", "calibration", "sweeps")
    assert not loaded & {"scipy", *(f"pretouch.{part}" for part in parts)}


def test_a_verdict_without_a_calibration_loads_no_fits() -> None:
    code = "import sys, pretouch.verification; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(answer.stdout.split())
    assert "pretouch.verification.verdict" in loaded
    assert not any(name.startswith("pretouch.calibration") for name in loaded)
