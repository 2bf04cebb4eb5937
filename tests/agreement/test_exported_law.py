"""An exported law, compiled by the compilers at hand, computes what the package computes."""

from __future__ import annotations

import csv
import dataclasses
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from exported_designs import DESIGNS
from pretouch.control import Arrival, Status
from pretouch.exports import export
from pretouch.exports.law_design import law_design
from pretouch.exports.law_source import structures
from pretouch.verification.verdict import chosen_gain

WARNINGS = "-Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -pedantic -Werror"
COMPILERS = [
    pytest.param(name, marks=pytest.mark.skipif(shutil.which(name) is None, reason=f"{name} is not installed"))
    for name in ("gcc", "clang")
]


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[pt.Task, Path]]:
    """The examples and their exports without verification, which other tests run. Tests change copies only."""
    root = tmp_path_factory.mktemp("exports")
    tasks = {name: design() for name, design in DESIGNS.items()}
    for name, task in tasks.items():
        assert export(task, root / name, verify=False).is_written
    return {name: (task, root / name) for name, task in tasks.items()}


@pytest.fixture
def exported(exports: dict[str, tuple[pt.Task, Path]], tmp_path: Path) -> Callable[[str], pt.Task]:
    """A function that copies the export of an example to `law`, and returns the example."""

    def copy(design: str) -> pt.Task:
        task, folder = exports[design]
        shutil.copytree(folder, tmp_path / "law")
        return task

    return copy


def replayed(folder: Path, compiler: str, flags: str) -> dict[str, float]:
    """The differences that the exported test prints, by the name of the output."""
    if shutil.which("make") is None:
        pytest.skip("make is not installed")
    command = ["make", "-B", "-s", "-C", str(folder), "test", f"CC={compiler}", f"CFLAGS=-O2 {WARNINGS} {flags}"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    *lines, last = run.stdout.splitlines()
    assert last.endswith("0 with other status flags; passed")
    return {line[:14].strip(): float(line[14:]) for line in lines}


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("design", DESIGNS)
def test_in_double_precision_every_bit_is_the_same(
    design: str, compiler: str, tmp_path: Path, exported: Callable[[str], pt.Task]
) -> None:
    exported(design)
    differences = replayed(tmp_path / "law", compiler, "")
    assert differences == dict.fromkeys(("position", "velocity", "acceleration", "virtual force", "log level"), 0.0)


@pytest.mark.parametrize("design", DESIGNS)
def test_in_single_precision_outputs_agree_within_1e_4(
    design: str, tmp_path: Path, exported: Callable[[str], pt.Task]
) -> None:
    exported(design)
    differences = replayed(tmp_path / "law", "cc", "-DPRETOUCH_FLOAT") if shutil.which("cc") else pytest.skip("no cc")
    limited = {"velocity", "acceleration"} if design == "filters" else set()  # see test_law.c
    assert all(0 < value < 1e-4 for name, value in differences.items() if name not in limited)  # 0: double precision


def test_sanitizers_find_nothing(tmp_path: Path, exported: Callable[[str], pt.Task]) -> None:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    exported("drag")
    replayed(tmp_path / "law", "gcc", "-fsanitize=address,undefined -fno-sanitize-recover=all")


@pytest.mark.parametrize(
    ("old", "new"),
    [("PRETOUCH_R(-0.86)", "PRETOUCH_R(-0.8600001)"), ("PRETOUCH_R(0.04),", "PRETOUCH_R(0.05),")],
    ids=["gain", "timeout"],
)
def test_the_exported_test_notices_a_changed_constant(
    old: str, new: str, tmp_path: Path, exported: Callable[[str], pt.Task]
) -> None:
    exported("damper")
    header = tmp_path / "law/pretouch_design.h"
    text = header.read_text()
    assert text.count(old) == 1
    header.write_text(text.replace(old, new))
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    run = subprocess.run(
        ["make", "-s", "-C", str(tmp_path / "law"), "test"], capture_output=True, text=True, check=False
    )
    assert run.returncode != 0
    assert "FAILED" in run.stdout


def test_the_header_compiles_in_c_plus_plus(tmp_path: Path, exported: Callable[[str], pt.Task]) -> None:
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    exported("drag")
    source = tmp_path / "use.cpp"
    source.write_text(
        '#include "pretouch_design.h"\n'
        "double use(const pretouch_sample &sample) {\n"
        "    pretouch_design_state state; pretouch_output out;\n"
        "    pretouch_design_start(&state); pretouch_design_step(&state, &sample, &out);\n"
        "    return out.position;\n}\n"
    )
    flags = ["-std=c++17", "-Wall", "-Wextra", "-Werror", f"-I{tmp_path / 'law'}", "-c", "-o", str(tmp_path / "use.o")]
    subprocess.run(["g++", *flags, str(source)], check=True)


@pytest.mark.parametrize("design", DESIGNS)
def test_vectors_restore_every_number_and_start_from_the_simulation(
    design: str, tmp_path: Path, exported: Callable[[str], pt.Task]
) -> None:
    """The vectors repeat the outputs of the controller, and their first case repeats the closed loop itself."""
    task = exported(design)
    lines = [line for line in (tmp_path / "law/vectors.csv").read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    names = ("position", "velocity", "acceleration", "virtual_force", "log_level")
    controller = task.loop.law.with_value(chosen_gain(task))
    run, case, seen = controller.begin(), "0", set()
    for row in rows:
        if row["case"] != case:
            run, case = controller.begin(), row["case"]
        inputs = {k: float(row[k]) for k in ("contact_force", *(f"reference_{n}" for n in names[:3]))}
        out = run.step(float(row["reading"]), int(row["fresh"]), float(row["age"]), **inputs)
        assert [getattr(out, n) for n in names] == [float(row[n]) for n in names]
        assert out.status == int(row["status"])
        seen |= {flag for flag in Status if out.status & flag}
    assert case == "10"
    # every fault of the cases is really met; LOST follows from the gap
    assert seen >= {Status.DETECTING, Status.STALE, Status.LOST, Status.INVALID, Status.SATURATED, Status.INPUT_FAULT}
    trace = task.loop.run(task.scenario, task.sensor, controller.law.value).trace()
    first = [float(row["virtual_force"]) for row in rows if row["case"] == "0"]
    np.testing.assert_array_equal(first[: len(trace.virtual_force)], trace.virtual_force[: len(first)])


def test_the_vectors_of_a_pressing_object_fail_with_a_wrong_sign() -> None:
    """A robot that is pressed retreats; a reversed contact force or position gives other outputs."""
    law = law_design(DESIGNS["filters"](), verify=False)
    (case,) = (case for case in law.cases if case.name == "pressed")
    positions = np.array([out.position for out in case.outputs])
    assert law.controller.contact_gain > 0
    assert min(sample.contact_force for sample in case.samples) < 0
    assert positions.min() < -1e-5
    assert positions.max() <= 0
    run = law.controller.begin()
    reversed_signs = [
        run.step(sample.reading, sample.fresh, sample.age, contact_force=-sample.contact_force).position
        for sample in case.samples
    ]
    np.testing.assert_array_equal(reversed_signs, -positions)


def test_every_constant_has_its_comment_from_the_c_header(tmp_path: Path, exported: Callable[[str], pt.Task]) -> None:
    exported("drag")
    text = (tmp_path / "law/pretouch_design.h").read_text()
    for kind in ("sensing", "drive", "drag", "admittance"):
        for field in structures()[f"pretouch_{kind}_numbers"]:
            assert f"/* {field.name}" in text
            is_part = field.type.startswith("pretouch_") and field.type != "pretouch_real"
            assert field.comment or is_part, f"{kind}: {field.name} has no comment in pretouch_law.h"


def test_parameters_in_the_header_are_those_of_the_controller(
    tmp_path: Path, exported: Callable[[str], pt.Task]
) -> None:
    """Every number of the initializer, in its order, restores the memory of the parameters."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    task = exported("damper")
    program = tmp_path / "show.c"
    program.write_text(
        '#include "pretouch_design.h"\n#include <stdio.h>\n'
        "int main(void) { fwrite(&pretouch_design, sizeof pretouch_design, 1, stdout); return 0; }\n"
    )
    command = ["gcc", "-std=c99", f"-I{tmp_path / 'law'}", str(program), "-o", str(tmp_path / "show")]
    subprocess.run(command, check=True)
    found = subprocess.run([str(tmp_path / "show")], capture_output=True, check=True).stdout
    parameters: Any = task.loop.law.with_value(-0.86).parameters()
    assert found == bytes(parameters)


def test_a_hostile_file_name_cannot_end_the_comment(tmp_path: Path) -> None:
    name = "x*/ int evil; /*.toml"
    task = DESIGNS["damper"]()
    path = tmp_path / "a" / name
    source = dataclasses.replace(task.source, path=path)
    result = export(task.replace(source=source), tmp_path / "law", verify=False)
    assert result.is_written
    if shutil.which("gcc"):
        replayed(tmp_path / "law", "gcc", "")


@pytest.mark.skipif(shutil.which("octave") is None, reason="octave is not installed")
@pytest.mark.parametrize("design", ["drag", "course", "filters"])
def test_the_difference_equations_in_matlab_code_agree(design: str, tmp_path: Path) -> None:
    """They share no code with the C law: the same equations, written again.

    Octave is slow. The course, which alone has a reference that moves, runs its first case only, and the damper is
    left out, because it is the law of the filters.
    """
    assert export(DESIGNS[design](), tmp_path / "law", "json", verify=False).is_written
    if design == "course":
        vectors = tmp_path / "law/vectors.csv"
        lines = vectors.read_text().splitlines(keepends=True)
        vectors.write_text("".join(line for line in lines if not line[0].isdigit() or line.startswith("0,")))
    command = ["octave", "--no-gui", "--norc", "--eval", "test_law"]
    run = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path / "law")
    *lines, last = run.stdout.splitlines()
    assert last.endswith(" 0 with other status flags"), run.stdout + run.stderr
    assert max(float(line[14:]) for line in lines) < 1e-10  # rounding of some thousand steps


def test_the_json_has_every_parameter_with_its_meaning(tmp_path: Path) -> None:
    task = DESIGNS["filters"]()
    assert export(task, tmp_path / "law", "json", verify=False).is_written
    content = json.loads((tmp_path / "law/design.json").read_text())
    assert content["parameters"]["law"]["gain"] == -0.86
    assert content["parameters"]["drive"]["limits"]["excursion"] == 0.04
    assert [s["b0"] > 0 for s in content["parameters"]["sensing"]["low_pass"]] == [True, True, True, False]
    assert content["meanings"]["law.gain"] == "D_p [N s]"

    def paths(values: dict[str, Any], before: str = "") -> set[str]:
        inner = {k: v for k, v in values.items() if isinstance(v, dict)}
        return {before + k for k in set(values) - set(inner)}.union(
            *(paths(v, f"{before}{k}.") for k, v in inner.items())
        )

    assert paths(content["parameters"]) == set(content["meanings"])


def adversarial(folder: Path, flags: str = "") -> Path:
    """The program that drives an exported law with impossible samples."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    source, program = Path(__file__).parents[1] / "embedded/adversarial.c", folder / "adversarial"
    options = f"-std=c99 -O2 -ffp-contract=off {WARNINGS} {flags}".split()
    sources = [str(source), str(folder / "pretouch_law.c")]
    subprocess.run(["gcc", *options, f"-I{folder}", *sources, "-lm", "-o", str(program)], check=True)
    return program


@pytest.mark.slow
@pytest.mark.parametrize("design", ["filters", "drag"])
def test_a_million_adversarial_steps_give_the_same_bits_as_the_package(
    design: str, tmp_path: Path, exported: Callable[[str], pt.Task]
) -> None:
    task = exported(design)
    rng, count = np.random.default_rng(26), 500_000
    level = 100 * np.exp(8 * rng.random(count // 100)).repeat(100)
    samples = np.column_stack([rng.random((count, 1)) * level[:, None], rng.normal(size=(count, 5))])
    samples[:, 1] = rng.choice([0.0, 1e-3, 3e-3, 0.039, 0.05, -1e-9], count)
    special = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e300, -1e300, 5e-324, 1e6, 1e9])
    replaced = rng.random(samples.shape) < 0.02
    samples[replaced] = rng.choice(special, int(replaced.sum()))
    fresh = rng.choice([Arrival.NOTHING, Arrival.READING, Arrival.NO_OBJECT], count, p=[0.4, 0.57, 0.03])
    given = np.column_stack([samples, fresh.astype(float)])
    program = adversarial(tmp_path / "law")
    said = subprocess.run([str(program), "replay"], input=given.tobytes(), capture_output=True, check=True).stdout
    found = np.frombuffer(said).reshape(count, 6)
    run = task.loop.law.with_value(chosen_gain(task)).begin()
    names = ("contact_force", "reference_position", "reference_velocity", "reference_acceleration")
    expected = np.array(
        [
            run.step(s[0], int(f), s[1], **dict(zip(names, s[2:], strict=True)))
            for s, f in zip(samples.tolist(), fresh, strict=True)
        ]
    )
    np.testing.assert_array_equal(found.view(np.int64), expected.astype(np.float64).view(np.int64))
    assert 0.04 < (found[:, 3] != 0).mean() < 0.99  # most jumps of the readings are rejected


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("design", DESIGNS)
def test_outputs_stay_finite_and_within_limits_for_any_sample(
    design: str, precision: str, tmp_path: Path, exported: Callable[[str], pt.Task]
) -> None:
    """A million samples here; docs/how-to/export/c.md has the number that was run once."""
    exported(design)
    flags = "-DPRETOUCH_FLOAT -Wno-float-conversion" if precision == "float" else ""
    program = adversarial(tmp_path / "law", flags)
    run = subprocess.run([str(program), "1000000", "1"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
    steps, forces = map(int, re.findall(r"\d+", run.stdout))
    assert steps == 1_000_000
    assert forces > 5_000


def test_the_search_for_outputs_beyond_a_limit_finds_one(tmp_path: Path, exported: Callable[[str], pt.Task]) -> None:
    """A law that exceeds its excursion by a millionth is noticed."""
    exported("filters")
    source = tmp_path / "law/pretouch_law.c"
    text = source.read_text()
    old = "p->period * wanted->velocity / 2, p->excursion);"
    assert text.count(old) == 1
    source.write_text(text.replace(old, "p->period * wanted->velocity / 2, p->excursion * (1 + 1e-6));"))
    run = subprocess.run(
        [str(adversarial(tmp_path / "law")), "1000000", "1"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 1
