"""CBMC proves for an exported law: no undefined behavior, and finite outputs within the limits after any samples."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from exported_designs import DESIGNS
from pretouch.export import export_law

PROOF = Path(__file__).parents[1] / "embedded/proof.c"
CHECKS = ("bounds", "pointer", "div-by-zero", "signed-overflow", "undefined-shift", "conversion", "pointer-overflow")

pytestmark = pytest.mark.skipif(
    None in (shutil.which("cbmc"), shutil.which("gcc")), reason="cbmc, or gcc that it calls, is not installed"
)


def failures(folder: Path, *flags: str) -> list[str]:
    """The properties that CBMC refutes; none if all are proved."""
    checks = [f"--{name}-check" for name in CHECKS]
    single = ["-DPRETOUCH_FLOAT", "-D__builtin_isfinite=__CPROVER_isfinitef"]  # which CBMC 5.12 does not know
    command = ["cbmc", str(PROOF), str(folder / "pretouch_law.c"), "-I", str(folder), *single, *flags, *checks]
    run = subprocess.run(
        [*command, "--unwind", "18", "--unwinding-assertions"], capture_output=True, text=True, check=False
    )
    refuted = re.findall(r"^\[(\S+)\] .*: FAILURE$", run.stdout, re.MULTILINE)
    assert "main.assertion.1" in run.stdout, run.stdout + run.stderr
    return [name for name in refuted if not name.startswith("__builtin_inff")]  # CBMC's own 1 / 0 for INFINITY


@pytest.mark.parametrize("design", ["damper", "drag"])
def test_the_first_state_is_within_bounds(design: str, tmp_path: Path) -> None:
    export_law(DESIGNS[design](), tmp_path / "law", verify=False)
    assert failures(tmp_path / "law", "-DSTART", *(["-DDRAG"] if design == "drag" else [])) == []


@pytest.mark.parametrize("design", ["damper", "drag"])
def test_every_step_keeps_the_bounds_and_the_limits(design: str, tmp_path: Path) -> None:
    if design == "drag" and "PRETOUCH_ALL_PROOFS" not in os.environ:
        pytest.skip("takes three minutes; set PRETOUCH_ALL_PROOFS=1")
    export_law(DESIGNS[design](), tmp_path / "law", verify=False)
    assert failures(tmp_path / "law", *(["-DDRAG"] if design == "drag" else [])) == []


def test_a_first_state_outside_of_the_bounds_is_found(tmp_path: Path) -> None:
    export_law(DESIGNS["damper"](), tmp_path / "law", verify=False)
    source = tmp_path / "law/pretouch_law.c"
    text = source.read_text()
    old = "s->level = s->filtered = p->floor;"
    assert text.count(old) == 1
    source.write_text(text.replace(old, "s->level = s->filtered = 0;"))
    assert failures(tmp_path / "law", "-DSTART") == ["main.assertion.1"]
