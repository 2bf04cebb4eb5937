"""The terminal prints the answer first, in few lines of 100 columns; `--verbose` prints everything."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from command_text import in_this_process, stand_in_for_reports

import pretouch as pt
from pretouch._core.blocks import Page
from pretouch.cli.summary import WIDTH, summary_of

EXAMPLES = Path(__file__).parents[2] / "examples"
LINES = {"verify": 20, "fit": 20, "design EXAMPLES/tradeoff.toml": 20}  # a section to copy takes four lines


def printed(command: str, folder: Path) -> list[str]:
    answer = in_this_process(*command.replace("EXAMPLES", str(EXAMPLES)).split(), folder=folder)
    assert answer.returncode in {0, 1}, answer.stderr
    return answer.stdout.splitlines()


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        "fit EXAMPLES/sensor.csv",
        "design EXAMPLES/approach.toml",
        "design EXAMPLES/drag.toml",
        "design EXAMPLES/fingertip.toml",
        "design EXAMPLES/tradeoff.toml",
        "pareto EXAMPLES/tradeoff.toml",
        "robust EXAMPLES/robust.toml --samples 256",
        "simulate EXAMPLES/loop.toml",
        "simulate EXAMPLES/loop.toml --gain 0.5",
        "verify EXAMPLES/loop.toml --runs 40",
        "verify EXAMPLES/loop.toml --runs 40 --gain 0.5",
        "verify EXAMPLES/loop.toml --runs 40 --gain -3",
    ],
)
def test_a_verb_prints_few_lines(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in_for_reports(monkeypatch)
    lines = printed(command, tmp_path)
    verb = command.partition(" ")[0]
    assert len(lines) <= LINES.get(command, LINES.get(verb, 15)), "\n".join(lines)
    assert max(map(len, lines)) <= WIDTH
    assert "All numbers: --verbose" in lines
    assert lines[-1].startswith("Report with figures: ")
    assert Path(tmp_path, lines[-1].removeprefix("Report with figures: ")).exists()


def test_verbose_prints_the_tables_that_the_summary_leaves_out(tmp_path: Path) -> None:
    short = printed("design EXAMPLES/approach.toml --no-report", tmp_path)
    whole = printed("design EXAMPLES/approach.toml --no-report --verbose", tmp_path)
    assert whole[0].startswith(short[0])
    assert len(whole) > 2 * len(short)
    assert any(line.startswith("plant velocity at contact") for line in whole)


def page(warnings: int, findings: int = 0, figures: int = 4) -> Page:
    return Page(
        kind="test",
        headline="The answer is 12.5 N s.",
        key_figures=tuple((f"figure {i}; more {i}", "1 m") for i in range(figures)),
        findings=tuple(f"finding {i}" for i in range(findings)),
        warnings=tuple(f"Warning sentence {i} at 0.5 m/s. Details of it." for i in range(warnings)),
        next_step="do this",
    )


@pytest.mark.parametrize("lines", [8, 10, 15, 20])
@pytest.mark.parametrize("count", [0, 1, 3, 30])
def test_what_does_not_fit_is_counted(lines: int, count: int) -> None:
    text = summary_of(page(count, 2), lines=lines, ending=["the end"]).splitlines()
    assert len(text) <= lines
    assert text[0] == "The answer is 12.5 N s."
    assert text[-1] == "the end"
    shown = sum(line.startswith("Warning: Warning sentence") for line in text)
    counted = [line for line in text if "see --verbose" in line]
    assert shown == count or counted, "a warning is neither shown nor counted"
    if shown < count and lines >= 10:
        assert counted == [f"  ... and {count - shown} warning{'s' if count - shown > 1 else ''}: see --verbose"]
    assert not any("Details" in line for line in text)


def test_a_long_comparison_of_a_number_stands_on_a_line_of_its_own() -> None:
    compared = f"predicted 0.5 m/s; {'x' * 70}"
    text = summary_of(Page(kind="test", headline="Yes.", key_figures=((f"speed; {compared}", "1 m/s"),)), lines=15)
    assert text.splitlines()[2:] == ["  speed  1 m/s", f"    ({compared.replace('; ', ', ')})"]


def test_a_number_stays_with_its_unit() -> None:
    for start in range(60, 100):
        text = summary_of(Page(kind="test", headline=f"{'x' * start} 12.5 N s."), lines=15)
        assert "12.5 N s." in text


@pytest.mark.slow
@pytest.mark.parametrize(
    "verb", ["fit", "design", "sweep", "pareto", "robust", "simulate", "verify", "export", "replay", "reproduce"]
)
def test_the_help_of_a_verb_has_two_examples_that_run_and_a_page(verb: str, tmp_path: Path, short_rest: None) -> None:
    help_text = printed(f"{verb} --help", tmp_path)
    start = help_text.index("  Examples:")
    examples = [line.strip() for line in help_text[start + 1 : start + 3]]
    page = help_text[-1].removeprefix("  Documentation: ")
    assert (EXAMPLES.parent / page).is_file()
    for path in EXAMPLES.glob("*.*"):
        shutil.copy(path, tmp_path)
    for example in examples:
        words = shlex.split(example)
        assert words[:2] == ["pretouch", verb]
        quick = ["table-2"] if example == "pretouch reproduce" else ["--runs", "20"] if verb == "verify" else []
        quick += ["--no-report"] if verb not in {"sweep", "export", "reproduce"} else []  # nobody looks at it here
        answer = in_this_process(*words[1:], *quick, folder=tmp_path)
        assert answer.returncode in ({0, 1} if verb in {"verify", "replay"} else {0}), answer.stdout + answer.stderr


def test_a_wrong_name_of_the_package_suggests_the_right_one() -> None:
    for wrong, right in (("verfy", "verify"), ("paretto", "pareto"), ("Taks", "Task")):
        with pytest.raises(AttributeError, match=rf"has no attribute '{wrong}'; did you mean .*{right}"):
            getattr(pt, wrong)
    with pytest.raises(AttributeError, match=r"has no attribute 'zzzz'$"):
        pt.zzzz  # noqa: B018


def test_shell_completion_can_be_installed(tmp_path: Path) -> None:
    shown = printed("--help", tmp_path)
    assert any("--install-completion" in line for line in shown)


@pytest.mark.parametrize("length", [1, 3, 6])
@pytest.mark.parametrize("reservations", [0, 2, 8])
def test_the_next_step_is_always_printed(length: int, reservations: int) -> None:
    """With room for 15 lines, a headline of 6 lines leaves no room for figures, findings or reservations."""
    headline = " ".join(["word"] * 19 * length)
    many = replace(page(3, 4), headline=headline, reservations=("A reservation.",) * reservations)
    many = replace(many, next_step=" ".join(["step"] * 30))
    text = summary_of(many, lines=15, ending=["the calibration is usable", "the end"]).splitlines()
    assert len(text) <= 15
    assert "Next: step step" in "\n".join(text)
    assert text[-1] == "the end"
    assert any("see --verbose" in line for line in text)


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["design", "verify", "simulate --gain -0.7"])
def test_identifiers_of_statuses_are_not_printed(verb: str, tmp_path: Path, short_rest: None) -> None:
    text = (EXAMPLES / "loop.toml").read_text(encoding="utf-8")
    away = text.split("[uncertainty]")[0].replace('velocity = "-0.3 m/s"', 'velocity = "0.3 m/s"')
    (tmp_path / "away.toml").write_text(away + text[text.index("[chain]") :], encoding="utf-8")
    lines = [line for more in ("", " --verbose") for line in printed(f"{verb} away.toml --no-report{more}", tmp_path)]
    for identifier in ("implausible", "not within horizon", "never-in-contact"):
        assert identifier not in " ".join(lines)


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "status"), [("0.5", 1), ("-0.7", 0)])
def test_a_simulated_contact_that_is_harder_than_without_mitigation_has_the_exit_status_1(
    gain: str, status: int, tmp_path: Path
) -> None:
    answer = in_this_process("simulate", EXAMPLES / "loop.toml", "--gain", gain, "--no-report", folder=tmp_path)
    assert answer.returncode == status


def loop_task() -> pt.Task:
    return pt.load_scenario(EXAMPLES / "loop.toml")


def two_sided(task: pt.Task) -> pt.Task:
    """Return a task whose law also follows an object that recedes."""
    law = replace(task.loop.law, law=replace(task.loop.law.law, approach_only=False))
    return task.replace(loop=replace(task.loop, law=law))


def with_floor(task: pt.Task, floor: float) -> pt.Task:
    conditioning = replace(task.loop.law.conditioning, floor=floor, largest_rate=None)
    law = replace(task.loop.law, conditioning=conditioning)
    return task.replace(loop=replace(task.loop, law=law, chain=replace(task.loop.chain, dropout=0.01)))


@cache
def warnings_of_a_low_floor() -> tuple[str, ...]:
    task = two_sided(with_floor(loop_task(), 100.0)).replace(verify=pt.designs.VerifyOptions(runs=2), gain=-0.7)
    return pt.verify(task, changes=False).warnings


@pytest.mark.slow
@pytest.mark.parametrize(
    ("warnings", "consequence", "remedy"),
    [
        (
            warnings_of_a_low_floor,
            "moves a robot at rest by up to",
            "but detects objects only at",
        ),
        (
            warnings_of_a_low_floor,
            "makes the robot jump toward the object",
            "set largest_rate of the controller",
        ),
        (
            lambda: pt.simulate(with_floor(loop_task(), 6e4).replace(gain=-0.7)).warnings,
            "so there was no virtual force",
            "check floor, offset and sensor range",
        ),
        (
            lambda: pt.simulate(with_floor(loop_task(), 15e3).replace(gain=-0.7)).warnings,
            "detects the object only at",
            "or set floor = 1980 in [controller], and design again",
        ),
    ],
)
def test_the_sentence_of_a_warning_that_is_printed_has_its_consequence_and_remedy(
    warnings: Callable[[], tuple[str, ...]], consequence: str, remedy: str
) -> None:
    first = [
        line
        for line in summary_of(Page(kind="test", headline="", warnings=warnings()), lines=40).split("Warning: ")
        if consequence in " ".join(line.split())
    ]
    assert len(first) == 1
    assert remedy in " ".join(first[0].split())
