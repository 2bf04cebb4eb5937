"""What the README shows is what happens: its Python runs, its numbers hold, its links lead somewhere."""

from __future__ import annotations

import doctest
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from command_text import in_this_process, stand_in_for_reports

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
ROBUST = (ROOT / "docs" / "how-to/robust.md").read_text(encoding="utf-8")
FEATURES = (ROOT / "docs" / "explanation/features.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", [README, FEATURES, ROBUST], ids=["README", "features", "robust"])
def test_the_python_example_runs(monkeypatch: pytest.MonkeyPatch, page: str) -> None:
    monkeypatch.chdir(ROOT)
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    blocks = "\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
    runner.run(parser.get_doctest(blocks, {}, "page", "page", 0))
    assert runner.summarize().failed == 0


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize("page", ["explanation/design.md", "explanation/gradients.md", "explanation/verification.md"])
def test_the_examples_of_a_page_run(page: str) -> None:
    """Block by block, later ones with the names of earlier ones."""
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner(optionflags=flags)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    names: dict[str, Any] = {}
    for block in blocks:
        test = parser.get_doctest(block, names, page, page, 0)
        runner.run(test, clear_globs=False)
        names |= test.globs
    assert runner.summarize().failed == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [
        "explanation/simulation.md",
        "explanation/control.md",
        "explanation/drag.md",
        "how-to/own-law.md",
        "how-to/extending.md",
    ],
)
def test_the_programs_of_a_page_run(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, short_rest: None
) -> None:
    """All blocks of a page, one after the other, as a reader would try them: later ones use names of earlier ones."""
    monkeypatch.chdir(tmp_path)  # some of them write figures and pages
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert blocks
    names: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)  # noqa: S102 - our own page
    if "encounter" in names:  # the page shows how the summary of its run begins
        assert " ".join(names["encounter"].headline.split()) in " ".join(text.split())


def test_the_numbers_under_the_figure_are_those_of_the_example() -> None:
    """141 ms at 0.3 m/s without, 464 ms at 0.079 m/s with, after 97 mm."""
    import pretouch as pt

    design = pt.design(pt.load_scenario(ROOT / "examples" / "approach.toml"))
    before, after = design.no_mitigation.contact, design.result.contact
    assert (round(before.time, 3), round(after.time, 3)) == (0.141, 0.464)
    assert (round(before.relative_velocity, 3), round(after.relative_velocity, 3)) == (-0.3, -0.079)
    assert round(after.largest_excursion, 3) == 0.097


def test_the_numbers_about_the_drag_are_those_of_the_example() -> None:
    """15 % after 60 mm, 26 % after 97 mm; at 0.05 m/s half the speed after 50 mm; from 21 mm 0.085 and 0.065 m/s."""
    import pretouch as pt

    task = pt.load_scenario(ROOT / "examples" / "approach.toml")
    drag, gain = pt.design(task.replace(drag_effect=pt.DragEffect(ratio=0.15))), pt.design(task)
    own, admittance = gain.result.contact, task.scenario.admittance
    assert (round(drag.ratio, 2), round(drag.excursion, 3)) == (0.15, 0.060)
    assert (round(own.relative_velocity / -0.3, 2), round(own.displacement, 3)) == (0.26, -0.097)
    slow = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-0.05))
    there = pt.find_contact(slow, task.sensor, gain.gain).contact
    assert (round(there.relative_velocity / -0.05, 1), round(there.displacement, 2)) == (0.5, -0.05)
    near = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.021, velocity=-0.3))
    speeds = [
        pt.find_contact(near, task.sensor, v, law=w).contact.relative_velocity
        for v, w in ((drag.drag, "virtual-drag"), (gain.gain, "virtual-damper"))
    ]
    assert [round(v, 3) for v in speeds] == [-0.085, -0.065]


def test_the_readme_is_short_and_shows_the_drag_after_the_first_success() -> None:
    assert len(README.splitlines()) <= 120
    assert README.index("pretouch design examples") < README.index("virtual drag")


def test_every_make_target_of_the_readme_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^make (\w+)", README, re.MULTILINE)
    assert targets == ["demo", "test"]
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)


@pytest.mark.parametrize(
    "page",
    ["README.md", "CONTRIBUTING.md", *(p.relative_to(ROOT).as_posix() for p in sorted(ROOT.glob("docs/**/*.md")))],
)
def test_every_link_leads_to_a_file(page: str) -> None:
    path = ROOT / page
    for target in re.findall(r"\]\(([^)#]+?)\)", path.read_text(encoding="utf-8")):
        if not target.startswith(("http", "api/")):  # the pages of the API are written when the site is built
            assert (path.parent / target).exists(), target


def test_the_synthetic_calibration_is_what_its_program_prints() -> None:
    run = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "make_sensor_csv.py")], capture_output=True, text=True, check=True
    )
    assert run.stdout == (ROOT / "examples" / "sensor.csv").read_text(encoding="utf-8")


def as_process(command: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
    assert command[:3] == [sys.executable, "-m", "pretouch"]
    return in_this_process(*command[3:], folder=Path())


@pytest.mark.slow
def test_the_demonstration_writes_its_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """examples/demo.py from a copy; its commands run in this process. Other tests draw the reports of these verbs."""
    stand_in_for_reports(monkeypatch)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(subprocess, "run", as_process)
    runpy.run_path(str(tmp_path / "examples" / "demo.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert {p.name for p in (tmp_path / "demo-output").iterdir()} == {
        "sensor-fit.html",
        "approach-design.html",
        "fingertip-design.html",
        "letter-reproduction.html",
        "loop-simulate.html",
        "loop-verify-stronger.html",
        "loop-verify.html",
        "robust-robust.html",
        "tradeoff-pareto.html",
        "index.html",
    }
    assert len(printed.splitlines()) <= 82
    index = (tmp_path / "demo-output" / "index.html").read_text(encoding="utf-8")
    assert all(f'href="{p.name}"' in index for p in (tmp_path / "demo-output").iterdir() if p.name != "index.html")
