"""Machine code is kept where it can be written and nobody else can have put it, and nowhere if need be.

Tests may run as root, whom no permission stops: a folder that cannot be made is one below a regular file.
"""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pretouch.motion.kernels import compiler

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="permissions are those of POSIX")
ME = os.getuid() if hasattr(os, "getuid") else 0
SOLVE = """
import os
from pretouch.motion import Admittance, Obstacle, Scenario, find_contact
from pretouch.motion.kernels.compiler import cache_folder
from pretouch.sensors import ExponentialFirstOrder
scenario = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.0422, velocity=-0.3)
)
contact = find_contact(scenario, ExponentialFirstOrder(scale=0.458, rate=-61.0), -1.0).contact
print(f"{contact.position:.4f}", cache_folder())
"""


@pytest.fixture
def nowhere(tmp_path: Path) -> str:
    """A folder that cannot be made, not even by root."""
    (tmp_path / "file").write_text("")
    return str(tmp_path / "file" / "below")


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch, nowhere: str) -> Iterator[Callable[..., Path | None]]:
    """`cache_folder` in an environment of its own, where nothing can be written unless said."""

    def find(*, numba: str = "", cache: str = nowhere, home: str = nowhere, temporary: str = nowhere) -> Path | None:
        monkeypatch.setattr(compiler.config, "CACHE_DIR", numba)
        monkeypatch.setattr(sys, "platform", "linux")
        for name, value in (("XDG_CACHE_HOME", cache), ("HOME", home)):
            monkeypatch.setenv(name, value) if value else monkeypatch.delenv(name, raising=False)
        monkeypatch.setattr(tempfile, "tempdir", temporary)
        compiler.cache_folder.cache_clear()
        return compiler.cache_folder()

    yield find
    compiler.cache_folder.cache_clear()


def _solve(**environment: str) -> tuple[str, str]:
    """Solve an encounter in a process of its own; return the plant's position at contact and the cache folder."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA", "XDG"))}
    answer = subprocess.run(
        [sys.executable, "-c", SOLVE],
        capture_output=True,
        text=True,
        check=False,
        env=kept | environment,
    )
    assert answer.returncode == 0, answer.stderr
    position, _, folder = answer.stdout.strip().partition(" ")
    return position, folder


def test_a_motion_is_solved_where_only_a_temporary_folder_can_be_written(tmp_path: Path, nowhere: str) -> None:
    """The plant's position is the letter's, Section IV-D: -0.135 m, to four digits -0.1353."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    environment = {"XDG_CACHE_HOME": nowhere, "HOME": nowhere, "TMPDIR": str(temporary)}
    position, folder = _solve(**environment)
    assert position == "-0.1353"
    private = temporary / f"pretouch-{ME}"
    assert Path(folder).parent == private
    assert stat.S_IMODE(private.stat().st_mode) == 0o700
    assert stat.S_IMODE(Path(folder).stat().st_mode) == 0o700
    code = {path: path.stat().st_mtime_ns for path in Path(folder).rglob("*.nbc")}
    assert code, "machine code was kept"
    assert _solve(**environment) == (position, folder)
    assert {path: path.stat().st_mtime_ns for path in Path(folder).rglob("*.nbc")} == code, "and used again"


def test_a_motion_is_solved_where_nothing_can_be_written(nowhere: str, tmp_path: Path) -> None:
    """TMPDIR alone would not do, Python falls back to /tmp: an unfit folder of ours stands in the way there."""
    (tmp_path / f"pretouch-{ME}").write_text("a file in the place of the folder")
    position, folder = _solve(XDG_CACHE_HOME=nowhere, HOME=nowhere, TMPDIR=str(tmp_path))
    assert (position, folder) == ("-0.1353", "None")


def test_the_users_cache_folder_comes_first(found: Callable, tmp_path: Path) -> None:
    folder = found(cache=str(tmp_path), temporary=str(tmp_path))
    assert folder.parent == tmp_path / "pretouch"
    assert folder.name.startswith("kernels-")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_without_one_it_is_below_the_home_folder(found: Callable, tmp_path: Path) -> None:
    assert found(cache="", home=str(tmp_path)).parent == tmp_path / ".cache" / "pretouch"


def test_a_relative_cache_folder_is_ignored(found: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert found(cache="here") is None
    assert not (tmp_path / "here").exists()


def test_numbas_own_setting_comes_before_all(found: Callable, tmp_path: Path) -> None:
    numba, other = tmp_path / "numba", tmp_path / "other"
    assert found(numba=str(numba), cache=str(other)).parent == numba / "pretouch"
    assert not other.exists()


def test_numbas_own_setting_is_passed_over_where_it_cannot_be_written(
    found: Callable, tmp_path: Path, nowhere: str
) -> None:
    assert found(numba=nowhere, cache=str(tmp_path)).parent == tmp_path / "pretouch"


def test_a_temporary_folder_is_made_private(found: Callable, tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        folder = found(temporary=str(tmp_path))
    finally:
        os.umask(before)
    assert folder.parent == tmp_path / f"pretouch-{ME}"
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o750, 0o701, 0o704])
def test_a_temporary_folder_that_others_can_look_into_is_not_used(found: Callable, tmp_path: Path, mode: int) -> None:
    folder = tmp_path / f"pretouch-{ME}"
    folder.mkdir()
    folder.chmod(mode)
    assert found(temporary=str(tmp_path)) is None
    assert not list(folder.iterdir())


def test_a_temporary_folder_that_is_a_link_is_not_used(found: Callable, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    (tmp_path / f"pretouch-{ME}").symlink_to(elsewhere)
    assert found(temporary=str(tmp_path)) is None
    assert not list(elsewhere.iterdir())


@pytest.mark.skipif(ME != 0, reason="only root can give a folder away")
def test_a_temporary_folder_of_somebody_else_is_not_used(found: Callable, tmp_path: Path) -> None:
    folder = tmp_path / f"pretouch-{ME}"
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, -1)
    assert found(temporary=str(tmp_path)) is None


def test_where_nothing_can_be_written_there_is_no_folder(found: Callable) -> None:
    assert found() is None


def test_not_even_a_temporary_folder_has_to_exist(found: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> str:
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(tempfile, "gettempdir", none)
    assert found() is None


@pytest.mark.parametrize("changed", ["motion/kernels/endings.py", "design/kernels/sampling.py"])
def test_other_sources_are_other_machine_code(
    found: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    """The folder follows the sources of all kernels, not only that of the function that is called."""
    before = found(cache=str(tmp_path / "cache"))
    package, copy = Path(compiler.__file__).parents[2], tmp_path / "package"
    for path in package.glob("*/kernels/*.py"):
        (copy / path.relative_to(package)).parent.mkdir(parents=True, exist_ok=True)
        (copy / path.relative_to(package)).write_bytes(path.read_bytes())
    monkeypatch.setattr(compiler, "__file__", str(copy / "motion" / "kernels" / "compiler.py"))
    assert found(cache=str(tmp_path / "cache")) == before
    with (copy / changed).open("a") as stream:
        stream.write("# changed\n")
    assert found(cache=str(tmp_path / "cache")) != before
