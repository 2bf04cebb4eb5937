"""CBMC proves for an exported law: no undefined behavior, and finite outputs within the limits after any samples."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from exported_designs import DESIGNS
from pretouch.exports import export

PROOF = Path(__file__).parents[1] / "embedded/proof.c"
CHECKS = ("bounds", "pointer", "div-by-zero", "signed-overflow", "undefined-shift", "conversion", "pointer-overflow")

pytestmark = pytest.mark.skipif(
    None in (shutil.which("cbmc"), shutil.which("gcc")), reason="cbmc, or gcc that it calls, is not installed"
)


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("proved")
    for name in ("damper", "drag"):
        export(DESIGNS[name](), root / name, verify=False)
    return {name: root / name for name in ("damper", "drag")}


def replace_once(source: Path, old: str, new: str) -> None:
    text = source.read_text()
    assert text.count(old) == 1
    source.write_text(text.replace(old, new))


def failures(folder: Path, *parts: str) -> list[str]:
    """The properties that CBMC refutes; none if all are proved."""
    if "DRIVE" in parts:
        replace_once(folder / "pretouch_law.c", "= limit_motion(", "= limit_as_proved(")
    checks = [f"--{name}-check" for name in CHECKS]
    single = ["-DPRETOUCH_FLOAT", "-D__builtin_isfinite=__CPROVER_isfinitef"]  # which CBMC 5.12 does not know
    defined = [f"-D{part}" for part in parts]
    command = ["cbmc", str(PROOF), "-I", str(folder), *single, *defined, *checks]
    run = subprocess.run(
        [*command, "--unwind", "18", "--unwinding-assertions"], capture_output=True, text=True, check=False
    )
    refuted = re.findall(r"^\[(\S+)\] .*: FAILURE$", run.stdout, re.MULTILINE)
    assert "main.assertion.1" in run.stdout, run.stdout + run.stderr
    return [name for name in refuted if not name.startswith("__builtin_inff")]  # CBMC's own 1 / 0 for INFINITY


@pytest.mark.parametrize("part", ["START", "OBSERVE", "LAW", "LIMIT", "DRIVE"])
@pytest.mark.parametrize("design", ["damper", "drag"])
def test_every_block_keeps_the_bounds_and_the_limits(
    design: str, part: str, exports: dict[str, Path], tmp_path: Path
) -> None:
    folder = shutil.copytree(exports[design], tmp_path / "law")
    assert failures(folder, part, *(["DRAG"] if design == "drag" else [])) == []


@pytest.mark.parametrize(
    ("part", "old", "new"),
    [
        ("START", "= 0;\n    s->level = s->filtered = p->floor;", "= 0;\n    s->level = s->filtered = 0;"),
        (
            "OBSERVE",
            "OBJECT;\n        s->level = s->filtered = p->floor;",
            "OBJECT;\n        s->level = s->filtered = 0;",
        ),
        ("OBSERVE", "s->quiet = usable ? 0 : smaller(quiet, 2 * p->timeout);", "s->quiet = quiet;"),
        ("OBSERVE", "p->floor < above && above < (real)INFINITY ? above : p->floor;", "above;"),
        ("LAW", "larger(s->ramp - p->ramp_step, 0)", "s->ramp - p->ramp_step"),
        ("LIMIT", "period * wanted->velocity / 2, p->excursion);", "period * wanted->velocity / 2, 1);"),
        ("DRIVE", "no_reference ? s->reference : sample->reference_position;", "sample->reference_position;"),
        ("OBSERVE", "s->measured = usable ? sample->age :", "s->measured = usable ? sample->reading :"),
    ],
    ids=["first level", "level without object", "quiet", "level", "ramp", "excursion", "reference", "no object"],
)
def test_a_fault_of_the_law_is_found(part: str, old: str, new: str, exports: dict[str, Path], tmp_path: Path) -> None:
    folder = shutil.copytree(exports["damper"], tmp_path / "law")
    replace_once(folder / "pretouch_law.c", old, new)
    assert "main.assertion.1" in failures(folder, part)
