"""Run programs on emulated Cortex-M processors: the GNU Arm toolchain compiles them, QEMU runs them."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent / "embedded"
BOARDS = {
    "Cortex-M0+": ("mps2-an386", "-mcpu=cortex-m0plus -mfloat-abi=soft"),  # its instructions run on any Cortex-M
    "Cortex-M4F": ("mps2-an386", "-mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16"),
    "Cortex-M7": ("mps2-an500", "-mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16"),
}
TOOLS = ("arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm")
IS_INSTALLED = all(shutil.which(tool) for tool in TOOLS)


def target(board: str) -> list[str]:
    """Return the options of the compiler for a processor."""
    return [*BOARDS[board][1].split(), "-mthumb"]


def run_on_board(board: str, options: list[str], program: Path, law: Path, folder: Path, image: Path) -> str:
    """Compile a program, link it with the law, run it in the folder of the vectors, and return what it prints.

    Args:
        board: a key of BOARDS.
        options: further options of the compiler.
        program: source of the program.
        law: the compiled law.
        folder: the folder in which the program runs.
        image: path of the new image.
    """
    start = image.with_name("startup.o")
    fpu = target(board) if "hard" in BOARDS[board][1] else ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=soft"]
    subprocess.run(["arm-none-eabi-gcc", *fpu, "-O2", "-c", str(HERE / "startup.c"), "-o", str(start)], check=True)
    link = ["--specs=rdimon.specs", "-T", str(HERE / "mps2.ld"), str(start), str(program), str(law)]
    command = ["arm-none-eabi-gcc", *options, *target(board), *link, "-lm", "-o", str(image)]
    subprocess.run(command, check=True)
    quiet = "-nographic -monitor none -serial none -semihosting-config enable=on,target=native"
    emulator = ["qemu-system-arm", "-M", BOARDS[board][0], "-icount", "shift=0", *quiet.split(), "-kernel", str(image)]
    return subprocess.run(emulator, capture_output=True, text=True, check=False, cwd=folder).stdout


def counts(printed: str) -> dict[str, int]:
    """Return the numbers that `count_steps.c` prints, by their names."""
    return {name: int(value) for name, value in re.findall(r"(\w+) (\d+)", printed)}


def code_size(law: Path) -> int:
    """Return the size of the compiled law in bytes; it has no variables of its own."""
    sizes = subprocess.run(["arm-none-eabi-size", str(law)], capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, sizes.splitlines()[1].split()[:3])
    assert (data, bss) == (0, 0)
    return text
