"""An exported law on micro-controllers: compiled by the GNU Arm toolchain, and run by QEMU on its test vectors."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from exported_designs import DESIGNS
from pretouch.exports import export

HERE = Path(__file__).parents[1] / "embedded"
PAGE = (Path(__file__).parents[2] / "docs/how-to/export/c.md").read_text(encoding="utf-8")
BOARDS = {
    "Cortex-M4F": ("mps2-an386", "cortex-m4", "fpv4-sp-d16"),
    "Cortex-M7": ("mps2-an500", "cortex-m7", "fpv5-d16"),
}
WARNINGS = "-Wall -Wextra -Wconversion -Wdouble-promotion -Werror"
TOOLS = ("arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm")
RUNS = [
    ("Cortex-M4F", "float", "damper"),
    ("Cortex-M4F", "float", "drag"),
    ("Cortex-M4F", "float", "filters"),
    ("Cortex-M4F", "double", "filters"),
    ("Cortex-M7", "float", "drag"),
    ("Cortex-M7", "double", "drag"),
    ("Cortex-M7", "double", "filters"),
]

pytestmark = pytest.mark.skipif(
    any(shutil.which(tool) is None for tool in TOOLS), reason=f"one of {', '.join(TOOLS)} is not installed"
)


def flags(board: str, precision: str) -> list[str]:
    _, processor, fpu = BOARDS[board]
    real = ["-DPRETOUCH_FLOAT"] if precision == "float" else []
    target = f"-mcpu={processor} -mthumb -mfloat-abi=hard -mfpu={fpu}"
    return [*f"-std=c99 -ffp-contract=off -O2 {target} {WARNINGS}".split(), *real]


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("exports")
    for name in ("damper", "drag", "filters"):
        assert export(DESIGNS[name](), root / name, verify=False).is_written
    return {name: root / name for name in ("damper", "drag", "filters")}


def run_on_board(board: str, precision: str, program: Path, law: Path, folder: Path) -> str:
    """Compile a program, link it with the law, run it in the folder of the vectors, and return what it prints."""
    image = folder / f"{program.stem}.elf"
    link = ["--specs=rdimon.specs", "-T", str(HERE / "mps2.ld"), str(HERE / "startup.c"), str(program), str(law)]
    command = ["arm-none-eabi-gcc", *flags(board, precision), f"-I{folder}", *link, "-lm", "-o", str(image)]
    subprocess.run(command, check=True)
    quiet = "-nographic -monitor none -serial none -semihosting-config enable=on,target=native"
    emulator = ["qemu-system-arm", "-M", BOARDS[board][0], "-icount", "shift=0", *quiet.split(), "-kernel", str(image)]
    return subprocess.run(emulator, capture_output=True, text=True, check=False, cwd=folder).stdout


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
    said = run_on_board(board, precision, folder / "test_law.c", law, folder)
    assert said.splitlines()[-1].endswith("0 with other status flags; passed"), said
    most = documented(board, precision)
    count = run_on_board(board, precision, HERE / "count_steps.c", law, folder)
    counted = {name: int(value) for name, value in re.findall(r"(\w+) (\d+)", count)}
    assert counted["steps"] > 1000
    assert 100 < counted["mean"] <= counted["most"] <= most["instructions"]
    assert counted["state"] <= most["state"]
    assert 64 < counted["stack"] <= most["stack"]
    sizes = subprocess.run(["arm-none-eabi-size", str(law)], capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, sizes.splitlines()[1].split()[:3])
    assert text <= most["code"]
    assert (data, bss) == (0, 0)  # the law has no variables of its own


def test_the_documented_resources_are_what_a_small_controller_has() -> None:
    """At most 6 kB of code, 0.7 kB of state, and 40 us a step at 168 MHz with one instruction per cycle."""
    most = documented("Cortex-M4F", "float")
    assert most["code"] <= 6 * 1024
    assert most["state"] <= 0.7 * 1024
    assert most["instructions"] <= 40e-6 * 168e6
