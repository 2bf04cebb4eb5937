"""What a file may name comes from pretouch or from an installed package, by one mechanism for every kind."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from command_text import command, strict

import pretouch as pt
import scenario_text
from installed import install
from verification_samples import SCENARIO, SENSOR

HERE = Path(__file__)
LAW = (HERE.parents[1] / "made_law.py").read_text(encoding="utf-8")
LAWS = "pretouch.laws"
FILE = (
    scenario_text.WHOLE.replace('["-10 N*s", "-0.01 N*s"]', '["0.0025 N*s^3", "2.5 N*s^3"]')
    + """\
[uncertainty]
obstacle.velocity = { uniform = ["-0.35 m/s", "-0.25 m/s"] }
[robust]
samples = 16
validation = 16
[chain]
rate = "250 Hz"
noise = 1e-3
[controller]
rate = "1 kHz"
[loop]
runs = 20
[law]
kind = "cube"
rate = "3 1/s"
"""
)
BAD = {
    "nowhere": ("no_such_module:Law", r"cannot be imported from no_such_module:Law \(ModuleNotFoundError: .*repair or"),
    "missing": ("cube_law:Nothing", r"cannot be imported from cube_law:Nothing \(AttributeError: "),
    "failing": ("failing_law:Law", r"cannot be imported from failing_law:Law \(ZeroDivisionError: division by zero\)"),
    "number": ("cube_law:NUMBER", "is 3, expected a class or value with the members of pretouch.motion.ContinuousLaw"),
    "other": ("cube_law:Cube", 'is a law of the kind "cube"; both names must be equal'),
    "undeclared": (
        "cube_law:Undeclared",
        "has the field other, which a file cannot set; declare it by pretouch.fields",
    ),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    install(tmp_path / "site", monkeypatch, "cube_law", LAW, {LAWS: {"cube": "cube_law:Cube"}})
    (tmp_path / "cube.toml").write_text(FILE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("verb", ["design", "pareto", "robust", "simulate", "verify", "sweep"])
def test_every_verb_takes_a_file_that_names_an_installed_law(verb, folder, monkeypatch, capsys):
    run = command(monkeypatch, capsys)
    if verb == "sweep":
        pytest.importorskip("h5netcdf")
    options = ["--axis", "obstacle.velocity=-0.4 m/s,-0.2 m/s"] if verb == "sweep" else []
    code, out, err = run(verb, "cube.toml", "--json", *options)
    assert code in {0, 1}, err
    answer = strict(out)
    assert answer["status"] not in {"error", "infeasible"}
    if verb != "sweep":
        assert run(verb, "cube.toml")[0] == code
        assert "N s\u00b3" in (folder / f"cube-{verb}.html").read_text(encoding="utf-8")


def test_the_file_sets_what_the_law_declares(folder):
    task = pt.load_scenario("cube.toml")
    assert (task.law.kind, task.law.rate, task.bounds) == ("cube", 3.0, (0.0025, 2.5))
    assert task.loop.continuous == task.law
    assert pt.design_gain(task).headline.startswith("Optimal cube c = 0.08293 N s\u00b3")
    Path("cube.toml").write_text(FILE + 'cube = "0.05 N*s^3"\n', encoding="utf-8")
    task = pt.load_scenario("cube.toml")
    assert (task.gain, task.loop.law.law.value) == (0.05, 0.05)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"3 1/s"', '"3 m"', "law.rate: found .3 m., expected a quantity in 1/s"),
        ('"2.5 N*s^3"', '"2.5 N*s"', r"gain.bounds\[1\]: found .2.5 N\*s., expected a quantity in N\*s³"),
        ('rate = "3 1/s"', 'ratio = "1"', 'law.ratio: found a key of "virtual-drag", which "cube" does not have'),
        (
            'kind = "cube"',
            'kind = "cub"',
            r'found "cub", expected one of "virtual-damper", "virtual-drag", "cube"; did',
        ),
    ],
)
def test_a_mistake_is_found_at_its_line(folder, old, new, message):
    Path("cube.toml").write_text(scenario_text.replaced(old, new, FILE), encoding="utf-8")
    with pytest.raises(pt.errors.ScenarioFileError, match=rf"line \d+: .*{message}"):
        pt.load_scenario("cube.toml")


@pytest.mark.parametrize("name", BAD)
def test_a_broken_entry_point_ends_in_one_sentence(folder, monkeypatch, name):
    (folder / "site" / "failing_law.py").write_text("1 / 0\n", encoding="utf-8")
    source = LAW + "NUMBER = 3\n\n@dataclass(frozen=True, kw_only=True)\nclass Undeclared(Cube):\n    other: float\n"
    source += "    kind = 'undeclared'\n"
    value, message = BAD[name]
    install(folder / "more", monkeypatch, "cube_law", source, {LAWS: {name: value}})
    Path("cube.toml").write_text(FILE.replace('"cube"', f'"{name}"'), encoding="utf-8")
    with pytest.raises(pt.errors.ScenarioFileError) as raised:
        pt.load_scenario("cube.toml")
    assert len(str(raised.value).splitlines()) == 1
    assert raised.match(f'law.kind: found "{name}", but the entry point "{name}" of pretouch.laws in the package cube')
    assert raised.match(message)
    with pytest.raises(pt.errors.InvalidInputError, match=message):
        pt.Task(SCENARIO, SENSOR, law=name)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("cube", 'the entry point "cube" .* in the package other_law is also in the package cube_law; uninstall one'),
        ("virtual-drag", 'entry point "virtual-drag" .* in the package other_law has the name of a built-in kind'),
    ],
)
def test_a_name_that_is_used_twice_is_refused(folder, monkeypatch, entry, message):
    install(folder / "other", monkeypatch, "other_law", LAW, {LAWS: {entry: "other_law:Cube"}})
    sys.path.append(sys.path.pop(0))  # behind the first package, which is then found first
    with pytest.raises(pt.errors.ScenarioFileError, match=message.replace("cube_law; un", "(cube|other)_law; un")):
        pt.load_scenario("cube.toml")


def test_no_package_is_searched_where_all_kinds_are_built_in(folder, monkeypatch):
    def refuse(**_):
        raise AssertionError("entry points were read")

    monkeypatch.setattr("importlib.metadata.entry_points", refuse)
    Path("plain.toml").write_text(scenario_text.WHOLE, encoding="utf-8")
    assert pt.load_scenario("plain.toml").law == pt.motion.DAMPER
    with pytest.raises(AssertionError, match="entry points were read"):
        pt.load_scenario("cube.toml")


def test_a_law_without_a_sampled_form_is_refused_on_a_loop(folder, monkeypatch):
    source = LAW.replace("def sampled(", "def not_sampled(").replace('"cube"', '"still"')
    install(folder / "still", monkeypatch, "still_law", source, {LAWS: {"still": "still_law:Cube"}})
    Path("cube.toml").write_text(FILE.replace('"cube"', '"still"'), encoding="utf-8")
    with pytest.raises(pt.errors.ScenarioFileError, match=r'law\.kind: found "still", which cannot run on the loop'):
        pt.load_scenario("cube.toml")
