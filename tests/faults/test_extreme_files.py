"""Numbers in files that no arithmetic goes with, and mutated files that once ended badly."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

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
    assert f"sensor.csv, line {line}: found '{number}' in column 'output [counts]'" in err
    assert "of a magnitude from 1e-60 to 1e+60, or 0" in err


def test_so_is_a_distance(run: Any) -> None:
    lay("sensor.csv", ("82.5,76\n", "1e70,76\n"))
    code, _, err = run("fit", "sensor.csv")
    assert code == 2
    assert "found '1e70' in column 'distance [mm]'" in err
    assert "(in m)" in err


@pytest.mark.parametrize("number", ["1e308", "1e-308", "-5e-324"])
def test_so_is_a_quantity_of_a_scenario_file(run: Any, number: str) -> None:
    lay("approach.toml", ('"-0.3 m/s"', f'"{number} m/s"'))
    code, _, err = run("design", "approach.toml")
    assert code == 2
    assert f'line 16: obstacle.velocity: found "{number} m/s", expected a quantity in m/s of a magnitude' in err


def test_and_one_of_the_command_line(run: Any) -> None:
    lay("loop.toml")
    code, _, err = run("simulate", "loop.toml", "--gain", "-1e308")
    assert code == 2
    assert "--gain: found '-1e308', expected a quantity in N*s of a magnitude" in err


@pytest.mark.parametrize("verb", ["simulate", "verify"])
@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('horizon = "5 s"', 'horizon = "5e9 s"', "loop.horizon: found 5e+09 s, which is 5e+12 steps"),
        ('rate = "1 kHz"', 'rate = "99999 kHz"', "loop.horizon: found 5 s, which is 5e+08 steps"),
    ],
)
def test_a_loop_that_no_memory_holds_is_refused_with_its_key(
    run: Any, verb: str, old: str, new: str, what: str
) -> None:
    lay("loop.toml", (old, new))
    code, _, err = run(verb, "loop.toml", "--gain", "-0.7")
    assert code == 2
    assert what in err
    assert "expected at most" in err
