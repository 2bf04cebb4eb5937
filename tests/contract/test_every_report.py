"""Reports of every verb with every kind of input: a report is complete, and its faults hide no answer."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from command_text import command

import pretouch as pt
from page_checks import assert_sound
from pretouch._core.files import is_own_unchanged, write_text
from pretouch.cli import main
from refusals import refused

EXAMPLES = Path(__file__).parents[2] / "examples"
pytestmark = pytest.mark.usefixtures("short_rest")
FEW = "\n[verify]\nruns = 20\n"


def text_of(name: str) -> str:
    return (EXAMPLES / name).read_text(encoding="utf-8")


def with_sensor(text: str, lines: str) -> str:
    """Replace the section [sensor] of a scenario."""
    text = re.sub(r'^floor = ".*?"', 'floor = "30 counts"', text, flags=re.MULTILINE)  # of the other sensor
    return re.sub(r"\[sensor\]\n.*?(?=\n\[)", f"[sensor]\n{lines}\n", text, flags=re.DOTALL)


CALIBRATED = with_sensor(
    text_of("loop.toml").replace("runs = 500", "runs = 20"), 'calibration = "sensor.csv"\nrecess = "10 mm"'
)
INPUTS = {
    "approach.toml": text_of("approach.toml"),
    "course.toml": text_of("course.toml") + FEW,
    "drag.toml": text_of("drag.toml").replace("runs = 500", "runs = 20"),
    "fingertip.toml": text_of("fingertip.toml"),
    "loop.toml": text_of("loop.toml").replace("runs = 500", "runs = 20"),
    "robust.toml": text_of("robust.toml"),
    "scaled.toml": text_of("robust.toml").replace('velocity_scale = "0.3 m/s"', 'velocity_scale = "3 m/s"'),
    "tradeoff.toml": text_of("tradeoff.toml"),
    "calibrated.toml": CALIBRATED,
    "calibrated-drag.toml": with_sensor(
        text_of("drag.toml").replace("runs = 500", "runs = 20"), 'calibration = "sensor.csv"\nrecess = "10 mm"'
    ),
    "other-curve.toml": with_sensor(
        text_of("approach.toml"),
        'model = "exponential-2"\nscale = 0.48\nrate = "-74 1/m"\ncurvature = "474 1/m^2"\nmaximum_distance = "75 mm"',
    ),
    "infeasible.toml": text_of("approach.toml").replace('excursion = "0.2 m"', 'excursion = "1 um"'),
    "receding.toml": text_of("approach.toml").replace('"-0.3 m/s"', '"0.3 m/s"'),
}
GAIN = ("--gain", "-0.86 N*s")
CASES = [
    ("replay", "calibrated.toml", "approaches.csv", "--topic", "reading", *GAIN),
    ("robust", "scaled.toml", "--samples", "256"),
    ("design", "receding.toml"),
    ("design", "fingertip.toml"),
    ("design", "drag.toml"),
    ("design", "tradeoff.toml"),
    ("design", "other-curve.toml"),
    ("design", "infeasible.toml"),
    ("pareto", "approach.toml"),
    ("simulate", "course.toml"),
    ("simulate", "drag.toml"),
    ("simulate", "calibrated.toml", *GAIN),
    ("verify", "drag.toml", "--no-changes"),
    ("verify", "calibrated.toml", *GAIN, "--no-changes"),
    ("replay", "loop.toml", "approaches.csv", "--topic", "reading", "--truth", "contact", *GAIN),
    ("replay", "calibrated-drag.toml", "approaches.csv", "--topic", "reading"),
    ("replay", "loop.toml", "month-later.csv", "--topic", "output", "--reference", "distance", *GAIN, "--recheck"),
    ("fit", "sensor.csv"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reports")
    for name, text in INPUTS.items():
        (path / name).write_text(text, encoding="utf-8")
    for name in ("sensor.csv", "approaches.csv", "month-later.csv"):
        shutil.copy(EXAMPLES / name, path / name)
    return path


@pytest.fixture
def run(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    monkeypatch.chdir(folder)
    return command(monkeypatch, capsys)


@pytest.mark.slow(keep=3)
@pytest.mark.parametrize("arguments", CASES, ids=" ".join)
def test_an_answer_and_its_report_are_complete(run: Any, arguments: tuple[str, ...]) -> None:
    code, out, err = run(*arguments)
    assert err == ""
    assert (code in {0, 1}, "Report with figures: " in out) == (True, True)
    page = Path(out.split("Report with figures: ")[1].strip())
    assert is_own_unchanged(page)
    html = page.read_text(encoding="utf-8")
    assert_sound(html)
    assert "<svg" in html
    assert "PT423" not in html
    assert "<details open>\n<summary><h2>" in html, "what explains the answer"
    assert not re.search("<details open>\n<summary><h2>(Inputs|Method and assumptions|Provenance|The loop)<", html)


# --- reports with faults


@pytest.fixture
def broken_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise ZeroDivisionError("no <width>")

    monkeypatch.setattr("pretouch.report.plots.trade_off", fail)


def test_a_figure_that_cannot_be_drawn_is_replaced_by_its_reason(run: Any, broken_figure: None) -> None:
    code, out, err = run("design", "approach.toml", "--output", "broken.html")
    assert (code, err.count("PT423")) == (0, 1)
    assert "ZeroDivisionError: no <width>" in err
    assert "Report with figures: broken.html" in out
    html = Path("broken.html").read_text(encoding="utf-8")
    assert_sound(html)
    assert html.count("ZeroDivisionError: no &lt;width&gt;") == 2  # at its place, and among the warnings
    assert "<svg" in html


def test_python_is_warned_of_such_a_figure(broken_figure: None) -> None:
    design = pt.design(pt.load_scenario(EXAMPLES / "approach.toml"))
    with pytest.warns(UserWarning, match="PT423"):
        assert "\u22120.7463" in pt.report.report_html(design)
    assert "\u22120.7463" in design._repr_html_()


@pytest.mark.slow
def test_a_report_that_cannot_be_written_is_no_mistake_of_the_request(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pretouch.report.html.report_html", lambda *_, **__: "<html><head></head></html>")
    monkeypatch.setattr(os, "fsync", full)
    code, out, err = run("design", "fingertip.toml", "--force")
    assert (code, "D_p" in out, "Report" in out) == (0, True, False)
    assert err.startswith("pretouch: PT423: The report was not written.")
    assert "No space left on device" in err
    assert run("design", "receding.toml", "--force")[0] == 1
    code, out, err = run("design", "fingertip.toml", "--output", "asked.html")
    assert (code, "D_p" in out, err.count("PT423")) == (3, True, 1)
    with refused("any.txt", error=pt.errors.OutputError, value="No space left on device"):
        write_text("any.txt", "")


def test_a_fault_of_the_report_itself_does_not_hide_the_answer(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise AttributeError("no attribute 'sensor'")

    monkeypatch.setattr("pretouch.report.html.page_html", fail)
    code, out, err = run("design", "approach.toml", "--force")
    assert (code, "D_p" in out) == (0, True)
    assert "AttributeError: no attribute 'sensor'" in err
    monkeypatch.setattr(sys, "argv", ["pretouch", "design", "approach.toml", "--json", "--output", "asked.html"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 3
