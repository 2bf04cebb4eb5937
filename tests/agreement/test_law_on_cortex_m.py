"""An exported law on micro-controllers: compiled by the GNU Arm toolchain, and run by QEMU on its test vectors."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from cortex_m import HERE, IS_INSTALLED, TOOLS, code_size, counts, run_on_board, target
from exported_designs import DESIGNS
from pretouch.exports import export

PAGE = (Path(__file__).parents[2] / "docs/how-to/export/c.md").read_text(encoding="utf-8")
WARNINGS = "-Wall -Wextra -Wconversion -Wdouble-promotion -Werror"
RUNS = [
    ("Cortex-M4F", "float", "damper"),
    ("Cortex-M4F", "float", "drag"),
    ("Cortex-M4F", "float", "filters"),
    ("Cortex-M4F", "double", "filters"),
    ("Cortex-M7", "float", "drag"),
    ("Cortex-M7", "double", "drag"),
    ("Cortex-M7", "double", "filters"),
]

pytestmark = pytest.mark.skipif(not IS_INSTALLED, reason=f"one of {', '.join(TOOLS)} is not installed")


def flags(board: str, precision: str) -> list[str]:
    real = ["-DPRETOUCH_FLOAT"] if precision == "float" else []
    return [*f"-std=c99 -ffp-contract=off -O2 {WARNINGS}".split(), *target(board), *real]


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("exports")
    for name in ("damper", "drag", "filters"):
        assert export(DESIGNS[name](), root / name, verify=False).is_written
    return {name: root / name for name in ("damper", "drag", "filters")}


def documented(board: str, precision: str) -> dict[str, float]:
    """What the page promises at most for this processor and precision."""
    row = re.search(rf"^\| {board} \| {precision} \|(.*)\|$", PAGE, re.MULTILINE)
    assert row is not None
    numbers = [float(cell.replace(",", "")) for cell in row[1].split("|")]
    return dict(zip(("code", "state", "stack", "instructions"), numbers, strict=True))


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize(("board", "precision", "design"), RUNS)
def test_the_law_computes_its_vectors_within_the_documented_resources(
    board: str, precision: str, design: str, exports: dict[str, Path], tmp_path: Path
) -> None:
    folder = shutil.copytree(exports[design], tmp_path / "law")
    law = tmp_path / "law.o"
    command = ["arm-none-eabi-gcc", *flags(board, precision), "-c", str(folder / "pretouch_law.c"), "-o", str(law)]
    subprocess.run(command, check=True)
    options = [*flags(board, precision), f"-I{folder}"]
    said = run_on_board(board, options, folder / "test_law.c", law, folder, tmp_path / "test.elf")
    assert said.splitlines()[-1].endswith("0 with other status flags; passed"), said
    most = documented(board, precision)
    counted = counts(run_on_board(board, options, HERE / "count_steps.c", law, folder, tmp_path / "count.elf"))
    assert counted["steps"] > 1000
    assert 100 < counted["mean"] <= counted["most"] <= most["instructions"]
    assert counted["state"] <= most["state"]
    assert 64 < counted["stack"] <= most["stack"]
    assert code_size(law) <= most["code"]


def test_the_documented_resources_are_what_a_small_controller_has() -> None:
    """At most 6 kB of code, 0.7 kB of state, and 40 us a step at 168 MHz with one instruction per cycle."""
    most = documented("Cortex-M4F", "float")
    assert most["code"] <= 6 * 1024
    assert most["state"] <= 0.7 * 1024
    assert most["instructions"] <= 40e-6 * 168e6
