"""Numbers in files that no arithmetic goes with, and mutated files that once ended badly."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest

from pretouch._core import progress
from pretouch.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    """Run the command line in an empty folder; what it warns of is an error, as in all tests."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[Any, str, str]:
        monkeypatch.setattr(sys, "argv", ["pretouch", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, *capsys.readouterr()

    return run


def lay(name: str, *changes: tuple[str, str]) -> None:
    """Write an example into the working folder, with changes."""
    text = (EXAMPLES / name).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    Path(name).write_text(text, encoding="utf-8")


@pytest.mark.parametrize("number", ["1e308", "-1e308", "1e61", "5e-324", "-1e-308"])
def test_a_reading_that_no_arithmetic_goes_with_is_named_with_line_and_column(run: Any, number: str) -> None:
    lay("sensor.csv", ("82.5,76\n", f"82.5,{number}\n"))
    line = Path("sensor.csv").read_text(encoding="utf-8").split("\n").index(f"82.5,{number}") + 1
    code, out, err = run("fit", "sensor.csv")
    assert (code, out) == (2, "")
    assert err.startswith(f"pretouch: sensor.csv, line {line}: found '{number}' ")


def test_so_is_a_distance(run: Any) -> None:
    lay("sensor.csv", ("82.5,76\n", "1e70,76\n"))
    line = Path("sensor.csv").read_text(encoding="utf-8").split("\n").index("1e70,76") + 1
    code, _, err = run("fit", "sensor.csv")
    assert code == 2
    assert err.startswith(f"pretouch: sensor.csv, line {line}: found '1e70' ")


@pytest.mark.parametrize("number", ["1e308", "1e-308", "-5e-324"])
def test_so_is_a_quantity_of_a_scenario_file(run: Any, number: str) -> None:
    lay("approach.toml", ('"-0.3 m/s"', f'"{number} m/s"'))
    code, _, err = run("design", "approach.toml")
    assert code == 2
    assert f'line 16: obstacle.velocity: found "{number} m/s"' in err


def test_and_one_of_the_command_line(run: Any) -> None:
    lay("loop.toml")
    code, _, err = run("simulate", "loop.toml", "--gain", "-1e308")
    assert code == 2
    assert err.startswith("pretouch: --gain: ")


@pytest.mark.parametrize("verb", ["simulate", "verify"])
@pytest.mark.parametrize(
    ("old", "new"), [('horizon = "5 s"', 'horizon = "5e9 s"'), ('rate = "1 kHz"', 'rate = "99999 kHz"')]
)
def test_a_loop_that_no_memory_holds_is_refused_with_its_key(run: Any, verb: str, old: str, new: str) -> None:
    lay("loop.toml", (old, new))
    code, _, err = run(verb, "loop.toml", "--gain", "-0.7")
    assert code == 2
    assert ": loop.horizon: " in err


# --- numbers with which no search ends, or that no robot has


@pytest.mark.parametrize(
    ("verb", "example", "changes", "key"),
    [
        ("design", "approach.toml", [('"25 N/m"', '"1e15 N/m"')], "admittance.stiffness"),
        ("pareto", "approach.toml", [('"25 N/m"', '"1e15 N/m"')], "admittance.stiffness"),
        ("robust", "robust.toml", [('"25 N/m"', '"1e15 N/m"')], "admittance.stiffness"),
        ("pareto", "tradeoff.toml", [('"10 rad/s"]', '"1e8 rad/s"]')], "admittance.natural_frequency_bounds"),
        ("design", "tradeoff.toml", [('"41.9 mm"', '"1e-8 m"')], "sensor"),
        ("design", "approach.toml", [('"41.9 mm"', '"1.5e-7 m"'), ("3.32", "6267")], "sensor"),
        ("robust", "loop.toml", [('"4 kN/m"', '"1e15 kN/m"')], "robot.stiffness"),
        ("simulate", "loop.toml", [('"4 kN/m"', '"1e15 kN/m"')], "robot.stiffness"),
        ("verify", "loop.toml", [('"4 kN/m"', '"1e15 kN/m"')], "robot.stiffness"),
        ("verify", "drag.toml", [('"5 ms"', '"1e15 s"')], "law.smoothing_time"),
    ],
)
def test_a_number_with_which_no_search_ends_is_refused_at_its_key(
    run: Any, verb: str, example: str, changes: list[tuple[str, str]], key: str
) -> None:
    """They took minutes, or ended in overflows: typing errors of a prefix or of an exponent."""
    lay(example, *changes)
    code, out, err = run(verb, example)
    assert (code, out) == (2, "")
    assert re.match(rf"pretouch: {example}, line \d+: {key}: ", err), err


@pytest.mark.slow
def test_the_largest_numbers_that_are_taken_end_in_an_answer(run: Any) -> None:
    lay("drag.toml", ('"5 ms"', '"60 s"'))
    assert run("verify", "drag.toml", "--runs", "4", "--no-changes", "--no-report")[0] == 1  # the law hears nothing
    lay("approach.toml", ('"25 N/m"', '"9.9e7 N/m"'))
    assert run("design", "approach.toml", "--no-report")[0] == 0
    lay("loop.toml", ('"4 kN/m"', '"2e9 kN/m"'))
    assert run("simulate", "loop.toml", "--gain", "-0.7", "--no-report")[0] in {0, 1}


def test_one_distance_far_beyond_all_others_is_a_typing_error_or_means_no_object(run: Any) -> None:
    """A number such as 99999 mm made the sensor usable to 100 m, with overflows on the way."""
    lay("sensor.csv")
    with Path("sensor.csv").open("a", encoding="utf-8") as file:
        file.write("99999,81\n")
    code, out, err = run("fit", "sensor.csv")
    assert (code, out) == (2, "")
    assert err.startswith("pretouch: sensor.csv: ")


@pytest.mark.slow
def test_a_person_who_waits_is_told_how_far_the_work_is(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_INTERVAL", 0.0)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    lay("tradeoff.toml")
    code, _, err = run("design", "tradeoff.toml", "--no-report")
    told = re.findall(r"^pretouch: ([\d,]+) encounters solved in \d+ s, still running$", err, re.MULTILINE)
    counts = [int(count.replace(",", "")) for count in told]
    assert code == 0
    assert len(counts) > 1
    assert counts == sorted(set(counts))
    lay("loop.toml")
    _, _, err = run("verify", "loop.toml", "--runs", "8", "--no-report")
    for work in (
        "simulating 8 encounters",
        r"the best gain on the .*loop; \d+ gains were simulated",
        "simulating change 1 of ",
        "a robot at rest",
    ):
        assert re.search(rf"^pretouch: .*{work}.* \(\d+ s\)$", err, re.MULTILINE), work
