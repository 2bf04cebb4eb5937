"""`pretouch sweep`: what it prints, what it writes, how it ends; and the pictures of a sweep."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_text import SCENARIO, command, lay_out, strict

import pretouch as pt
from figure_checks import assert_legible
from pretouch import load_scenario, sweep
from pretouch.designs import Task
from pretouch.report import plots
from pretouch.sweeps import results
from pretouch.sweeps.axes import read_axis
from refusals import refused
from sweep_samples import CURVED
from sweep_samples import SCENARIO as ENCOUNTER

xr = pytest.importorskip("xarray", reason="needs the extra 'sweep'")
pytest.importorskip("zarr", reason="needs the extra 'sweep'")
pytest.importorskip("h5py", reason="needs the extra 'sweep'")

ROOT = Path(__file__).parents[2]
SPEEDS = "obstacle.velocity=-1 m/s:-1 cm/s:10"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return lay_out(tmp_path, monkeypatch)


@pytest.fixture
def run(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    return command(monkeypatch, capsys)


def test_help_names_every_option(run: Any) -> None:
    code, out, err = run("sweep", "--help")
    assert (code, err) == (0, "")
    told = " ".join(out.split())
    options = ["--axis", "--result", "--gain", "--output", "--figure", "--dask", "--json", "--force"]
    assert [o for o in ["FILE", *options, "Exit status: 0", "1 none", "2 a mistake"] if o not in told] == []


def test_designs_are_those_of_the_scenario_file(run: Any, folder: Path) -> None:
    code, out, err = run("sweep", "approach.toml", "--axis", SPEEDS, "--json")
    assert (code, err) == (0, "")
    told = strict(out)
    assert told["counts"]["optimal"] == told["encounters"] == 10
    assert told["dimensions"] == ["obstacle.velocity"]
    assert told["axes"]["obstacle.velocity"]["values"] == pytest.approx(np.linspace(-1, -0.01, 10))
    problem = load_scenario("approach.toml")
    wanted = pt.sweep(problem, {"obstacle.velocity": np.linspace(-1, -0.01, 10)})
    assert told["results"]["gain"]["values"] == wanted["gain"].values.tolist()
    assert told["results"]["gain"]["unit"] == "N*s"
    assert told["inputs"]["constraints"] == {"excursion": 0.2}
    assert (told["output"], told["figure"], told["seed"]) == (None, None, None)
    assert sorted(p.name for p in folder.iterdir()) == sorted(
        p for p in ("approach.toml", "sensor.csv", "two.csv", "flat.csv")
    )


def test_the_object_of_a_sweep_has_each_ending_where_there_are_few_and_none_where_there_are_many(
    run: Any, monkeypatch: Any
) -> None:
    """An object that comes reaches the robot, one that goes never does: 0 and the number of that status."""
    asked = ("sweep", "approach.toml", "--gain", "-0.5", "--axis", "obstacle.velocity=-0.3 m/s,0.3 m/s", "--json")
    monkeypatch.setattr(results, "_MOST_VALUES", 2)
    told = strict(run(*asked)[1])
    contact, never = (pt.motion.ContactStatus.CONTACT, pt.motion.ContactStatus.NEVER)
    assert told["statuses"] == [contact, never]
    task = load_scenario("approach.toml")
    time = pt.find_contact(task.scenario, task.sensor, -0.5).end.time
    assert told["results"]["time"]["values"][0] == pytest.approx(time, rel=1e-9)
    assert told["results"]["time"]["values"][1] is None
    monkeypatch.setattr(results, "_MOST_VALUES", 1)
    told = strict(run(*asked)[1])
    assert (told["statuses"], told["results"]["time"]["values"]) == (None, None)
    assert told["axes"]["obstacle.velocity"]["values"] is None
    assert told["counts"][contact.label] == told["counts"][never.label] == 1
    assert told["results"]["time"]["lowest"] == told["results"]["time"]["highest"] == pytest.approx(time, rel=1e-9)


def test_contacts_are_found_with_the_gain_that_is_given(run: Any) -> None:
    code, out, err = run(
        *(
            "sweep",
            "approach.toml",
            "--axis",
            SPEEDS,
            "--gain",
            "-0.5 N*s",
            "--result",
            "time",
            "--result",
            "drive_force",
        )
    )
    assert (code, out) == (2, "")
    assert err.startswith("pretouch: results: the result 'drive_force' needs an impact model")
    code, out, err = run("sweep", "approach.toml", "--axis", SPEEDS, "--gain", "-0.5 N*s", "--result", "time")
    assert (code, err) == (0, "")
    assert out.startswith("10 encounters: 10 contact\n")
    assert "time" in out
    code, out, _ = run("sweep", "approach.toml", "--axis", "gain=-0.7,-0.5 N*s", "--json")
    assert strict(out)["counts"]["contact"] == 2


@pytest.mark.parametrize("name", ["out.zarr", "out.nc"])
def test_the_dataset_goes_where_it_is_asked_for_and_stays(run: Any, name: str) -> None:
    asked = ("sweep", "approach.toml", "--axis", SPEEDS, "--gain", "-0.5", "--output", name)
    code, out, err = run(*asked)
    assert (code, err) == (0, "")
    assert out.splitlines()[-1] == f"Dataset: {name}"
    assert run(*asked) == (0, out, "")
    other = (*asked[:5], "-0.4", *asked[6:])
    code, out, err = run(*other)
    assert (code, out) == (2, "")
    assert err.startswith(f"pretouch: {name}: ")
    assert "sweep in gain. Therefore" in err
    assert "--output" in err
    assert run(*other, "--force")[0] == 0
    if name.endswith(".nc"):
        with xr.open_dataset(name, engine="h5netcdf") as found:
            assert found["time"].attrs["units"] == "s"


def test_a_small_sweep_prints_each_encounter_and_a_large_one_how_to_get_them(run: Any) -> None:
    code, out, err = run(
        "sweep", "approach.toml", "--axis", "gain=-1,-0.5,-0.1", "--axis", "obstacle.velocity=-0.3,0.3"
    )
    assert (code, err) == (0, "")
    head, *rows = (line.split("  ") for line in out.splitlines()[2:])
    assert [cell.strip() for cell in head if cell] == [
        *("gain", "obstacle.velocity", "time", "relative_velocity", "displacement", "status")
    ]
    cells = [[cell.strip() for cell in row if cell] for row in rows]
    assert [row[0] for row in cells] == ["-1 N s"] * 2 + ["-0.5 N s"] * 2 + ["-0.1 N s"] * 2
    assert [row[-1] for row in cells] == ["contact", "never-in-contact"] * 3
    assert all(row[2:5] == ["-", "-", "-"] for row in cells[1::2])
    task = load_scenario("approach.toml")
    expected = [
        float(pt.find_contact(task.scenario, task.sensor, gain).end.relative_velocity) for gain in (-1, -0.5, -0.1)
    ]
    shown = [float(row[3].removesuffix(" m/s")) for row in cells[::2]]
    assert shown == pytest.approx(expected, rel=1e-3)
    code, out, _ = run("sweep", "approach.toml", "--axis", "gain=-1:-0.1:21")
    assert "lowest" in out
    shown = [line for line in out.splitlines() if line.endswith("contact")][1:]
    assert (len(shown), shown[0].split()[0], shown[-1].split()[0]) == (10, "-1", "-0.1")
    assert "--table" in out.splitlines()[-2]


@pytest.mark.parametrize("name", ["all.csv", "all.md"])
def test_the_table_of_a_sweep_has_every_encounter_with_its_unit(run: Any, name: str) -> None:
    axes = ["--axis", "gain=-1:-0.1:21", "--axis", "obstacle.velocity=-30,30 cm/s"]
    code, out, err = run("sweep", "approach.toml", *axes, "--table", name)
    assert (code, err, f"Table: {name}" in out) == (0, "", True)
    head, *rows = Path(name).read_text().splitlines()
    if name.endswith(".csv"):
        assert head == "gain [N*s],obstacle.velocity [m/s],time [s],relative_velocity [m/s],displacement [m],status"
        cells = [row.split(",") for row in rows]
        contacts = pt.find_contact(*(getattr(load_scenario("approach.toml"), n) for n in ("scenario", "sensor")), -1.0)
        assert float(cells[0][3]) == pytest.approx(float(contacts.end.relative_velocity), rel=1e-9)
        assert cells[1][2:5] == ["", "", ""]
        assert {row[1] for row in cells} == {"-0.3", "0.3"}
    else:
        assert head.startswith("| gain | obstacle.velocity |")
        rows = rows[1:]
        assert rows[0].startswith("| -1 N s | -0.3 m/s |")
    assert len(rows) == 42
    assert run("sweep", "approach.toml", *axes, "--table", name)[0] == 2  # exists
    assert run("sweep", "approach.toml", *axes, "--table", "all.xls")[0] == 2


def test_a_sweep_over_gains_says_nothing_about_the_designed_gain(run: Any) -> None:
    text = Path("approach.toml").read_text().split("[admittance]", 1)[1]
    Path("fitted.toml").write_text('[sensor]\ncalibration = "sensor.csv"\n[admittance]' + text)
    over_gains = strict(run("sweep", "fitted.toml", "--axis", "gain=-1,-0.1", "--json")[1])
    assert over_gains["calibration"]["witness"] is None
    designed = strict(run("sweep", "fitted.toml", "--axis", "obstacle.velocity=-0.3,-0.2", "--json")[1])
    assert designed["calibration"]["witness"] is not None


def test_a_sweep_whose_answer_is_no_ends_with_1(run: Any) -> None:
    Path("away.toml").write_text(SCENARIO.replace('"-0.3 m/s"', '"0.3 m/s"'))
    code, out, _ = run("sweep", "away.toml", "--axis", "admittance.mass=1,2 kg", "--json")
    assert code == 1
    told = strict(out)
    assert told["counts"]["no-contact"] == 2
    assert told["results"]["gain"]["values"] == [None, None]


@pytest.mark.parametrize(
    ("axes", "sentence"),
    [
        (["obstacle.velocity"], "--axis: found 'obstacle.velocity'"),
        (["obstacle.velocity=1:2"], "expected NAME=START:STOP:COUNT"),
        (["obstacle.velocity=-1:-2:3:linear"], "expected NAME=START:STOP:COUNT"),
        (
            ["obstacle.velocity=-1:-2:many"],
            "found 'many' as the number of values of the input obstacle.velocity, expected a whole number",
        ),
        (
            ["obstacle.velocity=-1:1:10:log"],
            "but logarithmic spacing needs nonzero start and stop values of the same sign",
        ),
        (["obstacle.velocity=-1 kg:-2 kg:3"], "obstacle.velocity: found '-1 kg', expected a quantity in m/s"),
        (["obstacle.speed=-1:-2:3"], "'obstacle.speed' is not an input of this sweep"),
        (["obstacle.velocity=-1", "obstacle.velocity=-2"], "obstacle.velocity is given twice"),
    ],
)
def test_a_mistake_in_an_axis_is_told(run: Any, axes: list[str], sentence: str) -> None:
    code, out, err = run("sweep", "approach.toml", *(part for text in axes for part in ("--axis", text)))
    assert (code, out) == (2, "")
    assert sentence in err


def test_values_may_carry_units_and_equal_ratios() -> None:
    name, values = read_axis("l = 1 mm : 100 mm : 3 : log", {"l": "m"})
    assert name == "l"
    assert values == pytest.approx([0.001, 0.01, 0.1], rel=1e-12)
    assert read_axis("g=-1:-0.01:3:log", {"g": ""})[1] == pytest.approx([-1.0, -0.1, -0.01], rel=1e-12)


@pytest.mark.slow
def test_a_figure_is_written_once_and_what_cannot_be_drawn_is_refused_first(run: Any, monkeypatch: Any) -> None:
    asked = ("sweep", "approach.toml", "--axis", SPEEDS, "--gain", "-0.5")
    for name, start in (("a.png", b"\x89PNG"), ("a.svg", b"<?xml"), ("a.pdf", b"%PDF")):
        code, out, err = run(*asked, "--figure", name)
        assert (code, err) == (0, "")
        assert out.splitlines()[-1] == f"Figure: {name}"
        assert Path(name).read_bytes().startswith(start)
    monkeypatch.setattr(sys.modules["pretouch.sweeps"], "sweep", None)  # not reached
    assert "a.png: this file already exists, and pretouch does not overwrite it" in run(*asked, "--figure", "a.png")[2]
    assert "expected a file name that ends in .png or .svg or .pdf" in run(*asked, "--figure", "a.jpg")[2]
    single = ("sweep", "approach.toml", "--axis", "obstacle.velocity=-1", "--figure", "b.png")
    assert "--figure: found 0 axes with several values" in run(*single)[2]


def test_an_interrupt_says_how_to_go_on(run: Any, monkeypatch: Any) -> None:
    def interrupt(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["pretouch.sweeps"], "sweep", interrupt)
    asked = ("sweep", "approach.toml", "--axis", SPEEDS)
    assert run(*asked) == (130, "", "")
    code, out, err = run(*asked, "--output", "out.zarr")
    assert (code, out, err) == (130, "", "pretouch: interrupted; run the same command again to resume\n")


# --- figures

FIGURES: dict[str, dict[str, Any]] = {
    "one axis": {"obstacle.velocity": np.linspace(-1, 0.1, 50), "gain": [-0.5]},
    "few curves": {"gain": [-0.2, -0.7, -1.4], "obstacle.velocity": np.linspace(-1, 0.1, 50)},
    "a map": {"obstacle.velocity": np.linspace(-1, -0.01, 30), "gain": np.linspace(-2, -0.02, 25)},
    "a map with holes": {"obstacle.velocity": np.linspace(-1, 0.1, 30), "gain": np.linspace(-2, -0.02, 25)},
    "a map over ratios": {"obstacle.position": np.geomspace(1e-3, 0.1, 20), "gain": np.linspace(-2, -0.02, 25)},
    "samples": {"sample": {"obstacle.velocity": np.linspace(-1, -0.1, 9)}, "gain": [-0.5]},
}


@pytest.mark.slow(keep=3)
@pytest.mark.parametrize("kind", FIGURES)
@pytest.mark.parametrize("results", [("time",), ("relative_velocity", "largest_excursion", "time")])
def test_the_picture_of_a_sweep_is_legible(kind: str, results: tuple[str, ...]) -> None:
    figure = plots.sweep(sweep(Task(ENCOUNTER, CURVED, horizon=20.0), FIGURES[kind], results=results))
    assert_legible(figure)
    assert len([axes for axes in figure.axes if axes.get_xlabel()]) == len(results)
    titles = " ".join(axes.get_title(loc="left") for axes in figure.axes)
    assert ("hatched: no value" in titles) == (kind == "a map with holes")


def test_what_cannot_be_drawn_is_refused() -> None:
    axes = {"obstacle.velocity": [-0.3, -0.2], "gain": [-0.5, -0.4], "admittance.mass": [1.0, 2.0]}
    with refused("dataset"):
        plots.sweep(sweep(Task(ENCOUNTER, CURVED), axes))
    flat = sweep(Task(ENCOUNTER, CURVED, gain=-0.5, horizon=5.0), {"obstacle.velocity": [0.3, 0.2]})
    with refused("time"):
        plots.sweep(flat, ["time"])
    with refused("results"):
        plots.sweep(flat, ["nonsense"])


# --- the page of documentation


def test_the_examples_of_the_page_run_one_after_another(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Any
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(
        r"```python\n(.*?)```", (ROOT / "docs" / "how-to/sweeps.md").read_text(encoding="utf-8"), re.DOTALL
    )
    assert len(blocks) == 3
    names: dict[str, Any] = {}
    for block in blocks:
        exec(block, names)  # noqa: S102 - our own page
    printed = capsys.readouterr().out
    assert "-0.079 m/s" in printed
    assert float(names["gains"]["gain"].max()) < 0
    assert "is best on average" in printed
    assert Path("contacts.png").exists()


# --- gains that nobody should use on a robot


@pytest.fixture
def looped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Task:
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "examples/loop.toml", tmp_path)
    return load_scenario("loop.toml")


def test_gains_that_pull_or_oscillate_are_counted(looped: Task, run: Any) -> None:
    strongest = looped.loop.stability_limit(looped.scenario, looped.sensor).strongest
    gains = [1.02 * strongest, 0.98 * strongest, -0.1, 0.0, 0.2]
    listed = ",".join(map(repr, gains))
    code, out, _ = run("sweep", "loop.toml", "--axis", f"gain={listed}", "--axis", "obstacle.velocity=-0.3,-0.2,-0.1")
    assert code == 0
    said = " ".join(out.split())
    assert "Warning: in 3 of 15 encounters, the gain pulls the robot toward the object" in said
    assert f"beyond the stability limit of the sampled loop, D_p = {strongest:.4g} N s: on a robot" in said
    assert said.count("beyond the stability limit") == 1
    near = (
        "in 3 of 15 encounters, the gain margin of the sampled loop is below 2; the strongest gain with this margin is"
    )
    assert f"{near} D_p = {strongest / 2:.4g} N s" in said
    assert len(strict(run("sweep", "loop.toml", "--axis", f"gain={listed}", "--json")[1])["warnings"]) == 3


@pytest.mark.parametrize(
    ("words", "unstable", "pulling", "unchecked"),
    [
        (["--axis", "gain=-0.8:-0.1:4"], 0, 0, False),
        (["--axis", "gain=0.1:1:4"], 0, 4, False),
        (["--gain", "-50 N*s", "--axis", "obstacle.velocity=-0.3:-0.1:5"], 5, 0, False),
        (["--gain", "-0.5 N*s", "--axis", "obstacle.velocity=-0.3:-0.1:5"], 0, 0, False),
        (["--gain", "-50 N*s", "--axis", "obstacle.position=0.03:0.04:5"], 0, 0, True),
        (["--gain", "-50 N*s", "--axis", "admittance.mass=1:2:2"], 0, 0, True),
        (["--axis", "obstacle.velocity=-0.3:-0.1:5"], 0, 0, False),
    ],
    ids=["good", "wrong sign", "too strong", "one good gain", "other start", "other mass", "designed"],
)
def test_only_such_gains_are_warned_of(
    words: list[str], unstable: int, pulling: int, unchecked: bool, looped: Task, run: Any
) -> None:
    found = strict(run("sweep", "loop.toml", *words, "--json")[1])["warnings"]
    counted = {text.split(" of ")[0].removeprefix("in ") for text in found if text.startswith("in ")}
    assert counted == {str(count) for count in (unstable, pulling) if count}
    assert any("not checked" in text for text in found) == unchecked


def test_a_drag_beyond_its_limit_is_warned_of_and_without_a_loop_nothing_is_said(run: Any, tmp_path: Path) -> None:
    shutil.copy(ROOT / "examples/drag.toml", tmp_path)
    task = load_scenario("drag.toml")
    high = task.loop.stable_bounds((0.0, np.inf), task.scenario, task.sensor, 1.0)[1]
    found = [strict(run("sweep", "drag.toml", "--axis", f"gain={f * high}", "--json")[1]) for f in (0.98, 1.02)]
    assert [len(one["warnings"]) for one in found] == [0, 1]
    assert strict(run("sweep", "approach.toml", "--axis", "gain=-50", "--json")[1])["warnings"] == []
