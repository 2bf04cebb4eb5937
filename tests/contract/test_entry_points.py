"""What a file may name comes from pretouch or from an installed package, by one mechanism for every kind."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from command_text import command, strict

import pretouch as pt
import scenario_text
from installed import install
from page_checks import as_written
from refusals import refused
from verification_samples import SCENARIO, SENSOR

pytestmark = pytest.mark.usefixtures("short_rest")

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
[verify]
runs = 20
[law]
kind = "cube"
rate = "3 1/s"
"""
)
BAD = {
    "nowhere": (
        "no_such_module:Law",
        'cannot be imported from no_such_module:Law. The error is "ModuleNotFoundError: .*Repair or',
    ),
    "missing": ("cube_law:Nothing", 'cannot be imported from cube_law:Nothing. The error is "AttributeError: '),
    "failing": (
        "failing_law:Law",
        'cannot be imported from failing_law:Law. The error is "ZeroDivisionError: division by zero"',
    ),
    "number": (
        "cube_law:NUMBER",
        "is invalid: found 3, expected a control law. A control law is a class or an object with all members of "
        "pretouch.motion.ContinuousLaw",
    ),
    "other": ("cube_law:Cube", 'the kind of the law is "cube", but the name of its entry point is "other"'),
    "undeclared": (
        "cube_law:Undeclared",
        "a scenario file cannot set the field other of the class; declare this field by pretouch.fields",
    ),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    install(tmp_path / "site", monkeypatch, "cube_law", LAW, {LAWS: {"cube": "cube_law:Cube"}})
    (tmp_path / "cube.toml").write_text(FILE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["design", "pareto", "robust", "simulate", "verify", "sweep"])
def test_every_verb_takes_a_file_that_names_an_installed_law(verb, folder, monkeypatch, capsys):
    run = command(monkeypatch, capsys)
    if verb == "sweep":
        pytest.importorskip("h5netcdf")
    options = ["--axis", "obstacle.velocity=-0.4 m/s,-0.2 m/s"] if verb == "sweep" else ["--output", "page.html"]
    code, out, err = run(verb, "cube.toml", "--json", *options)
    assert code in {0, 1}, err
    answer = strict(out)
    assert answer["status"] not in {"error", "infeasible"}
    if verb != "sweep":
        assert "N s\u00b3" in (folder / "page.html").read_text(encoding="utf-8")


def test_the_file_sets_what_the_law_declares(folder):
    task = pt.load_scenario("cube.toml")
    assert (task.law.kind, task.law.rate, task.bounds) == ("cube", 3.0, (0.0025, 2.5))
    assert task.loop.continuous == task.law
    assert pt.design(task).headline.startswith("Optimal cube c = 0.08293 N s\u00b3")
    Path("cube.toml").write_text(FILE + 'cube = "0.05 N*s^3"\n', encoding="utf-8")
    task = pt.load_scenario("cube.toml")
    assert (task.gain, task.loop.law.law.value) == (0.05, 0.05)


@pytest.mark.parametrize(
    ("old", "new", "fields"),
    [
        ('"3 1/s"', '"3 m"', {"argument": "law.rate", "value": "3 m"}),
        ('"2.5 N*s^3"', '"2.5 N*s"', {"argument": "gain.bounds[1]", "value": "2.5 N*s"}),
        (
            'rate = "3 1/s"',
            'ratio = "1"',
            {"argument": "law.ratio", "value": "1"},
        ),
        (
            'kind = "cube"',
            'kind = "cub"',
            {"argument": "law.kind", "value": "cub"},
        ),
    ],
)
def test_a_mistake_is_found_at_its_line(folder, old, new, fields):
    Path("cube.toml").write_text(scenario_text.replaced(old, new, FILE), encoding="utf-8")
    with refused(**fields, error=pt.errors.ScenarioFileError):
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
    ("entry", "fields"),
    [
        (
            "cube",
            {"argument": "law.kind", "value": "cube"},
        ),
        ("virtual-drag", {"argument": "law.kind", "value": "cube"}),
    ],
)
def test_a_name_that_is_used_twice_is_refused(folder, monkeypatch, entry, fields):
    install(folder / "other", monkeypatch, "other_law", LAW, {LAWS: {entry: "other_law:Cube"}})
    sys.path.append(sys.path.pop(0))  # behind the first package, which is then found first
    with refused(**fields, error=pt.errors.ScenarioFileError):
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
    with refused("law.kind", error=pt.errors.ScenarioFileError, value="still"):
        pt.load_scenario("cube.toml")


OTHERS = """
from dataclasses import dataclass
import numpy as np
from pretouch.sensors import SensorModel
from pretouch.fields import INPUT, check_declared, quantity
from pretouch.sensors import parameter
from pretouch.simulation import PlantModel
from pretouch.uncertainty import Distribution

@dataclass(frozen=True, slots=True, kw_only=True)
class TwoSources(SensorModel):
    scale: float = parameter("a", "", sign="positive", example="1.0", of_output="m^2")
    spread: float = parameter("b", "m", sign="positive", example='"20 mm"')
    name = "installed-sources"

    def _log_output(self, distance):
        return np.log(self.scale) - np.log(self.spread**2 + distance**2) - 10 * distance

    def _log_slope(self, distance):
        return -2 * distance / (self.spread**2 + distance**2) - 10

    @classmethod
    def fit_start(cls, slope, curvature, middle):
        return {"spread": middle}

@dataclass(frozen=True, kw_only=True)
class Comfort:
    weight: float = quantity("1/m^2", sign="positive", example='"40 1/m^2"')
    scale: float = quantity("m/s", 0.3, sign="positive")

    def value(self, state, obstacle_speed, impact):
        return self.weight * state.displacement**2 + (state.relative_velocity / self.scale) ** 2

def plain(state):
    return 40 * state.displacement**2 + state.relative_velocity**2

@dataclass(frozen=True, slots=True, kw_only=True)
class Triangular(Distribution):
    low: float = quantity(INPUT)
    high: float = quantity(INPUT)
    lean: float = quantity("", 0.5, sign="positive")

    def __post_init__(self):
        check_declared(self)

    @property
    def support(self):
        return self.low, self.high

    def _quantile(self, probability):
        half = np.sqrt(np.minimum(probability, 1 - probability) / 2)
        return self.low + (self.high - self.low) * np.where(probability < 0.5, half, 1 - half)

@dataclass(frozen=True, slots=True, kw_only=True)
class Geared(PlantModel):
    kind = "geared"
    inertia: float = quantity("kg*m^2", sign="positive", example='"0.02 kg*m^2"')
    pitch: float = quantity("m", sign="positive")

    def coefficients(self):
        mass = self.inertia / self.pitch**2
        return mass, 4000.0, 180.0, 180.0, mass, 0.0, 0.0, 1e-3
"""
ENTRIES = {
    "pretouch.sensors": {"installed-sources": "others:TwoSources"},
    "pretouch.objectives": {"comfort": "others:Comfort", "plain": "others:plain", "wrong": "others:np"},
    "pretouch.distributions": {"triangular": "others:Triangular", "abstract": "others:Distribution"},
    "pretouch.plants": {"geared": "others:Geared"},
}
EVERYTHING = (
    """\
[sensor]
model = "installed-sources"
scale = 2.0
spread = "20 mm"
[objective]
kind = "comfort"
weight = "40 1/m^2"
[uncertainty]
obstacle.velocity = { triangular = { low = "-0.35 m/s", high = "-25 cm/s" } }
sensor.spread = { triangular = { low = "19 mm", high = "21 mm", lean = 0.4 } }
[robust]
samples = 16
validation = 16
[chain]
rate = "250 Hz"
noise = 1e-3
[controller]
rate = "1 kHz"
[robot]
kind = "geared"
inertia = "0.02 kg*m^2"
pitch = "100 mm"
[verify]
runs = 12
"""
    + scenario_text.ADMITTANCE
    + scenario_text.STILL
    + scenario_text.GAIN
)


@pytest.fixture
def others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    install(tmp_path / "site", monkeypatch, "others", OTHERS, ENTRIES)
    (tmp_path / "everything.toml").write_text(EVERYTHING, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    sys.modules.pop("others", None)
    gc.collect()


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["design", "pareto", "robust", "simulate", "verify", "sweep"])
def test_every_verb_takes_a_file_of_installed_kinds(verb, others, monkeypatch, capsys):
    run = command(monkeypatch, capsys)
    if verb == "sweep":
        pytest.importorskip("h5netcdf")
    options = ["--axis", "sensor.spread=19 mm,21 mm"] if verb == "sweep" else ["--output", "page.html"]
    code, out, err = run(verb, "everything.toml", "--json", *options)
    assert code in {0, 1}, err
    assert strict(out)["status"] not in {"error", "infeasible"}
    if verb == "sweep":
        return
    page = as_written((others / "page.html").read_text(encoding="utf-8"))
    assert "installed-sources" in page
    words = {
        "design": "Comfort",
        "robust": "Triangular, -0.35 m/s to -0.25 m/s",
        "simulate": "Geared",
        "verify": "Geared",
    }
    assert words.get(verb, "") in page


def test_a_fit_takes_an_installed_curve(others, monkeypatch, capsys):
    distance = np.repeat(np.arange(2, 40) * 0.002, 3)
    noise = 1 + 2e-3 * np.random.default_rng(5).standard_normal(len(distance))
    outputs = 0.1 + 2e-3 / (0.031**2 + distance**2) * np.exp(-10 * distance) * noise
    rows = [f"{1e3 * d:.9g},{v:.9g}" for d, v in zip(distance, outputs, strict=True)] + ["inf,0.0999", "inf,0.1001"]
    Path("sensor.csv").write_text("\n".join(["distance [mm],output [V]", *rows]), encoding="utf-8")
    code, out, err = command(monkeypatch, capsys)("fit", "sensor.csv", "--model", "installed-sources", "--json")
    assert code in {0, 1}, err
    assert "installed-sources" in out
    with refused("model", value="other"):
        pt.calibration.fit_sensor(pt.read_calibration("sensor.csv"), "other")


def test_a_function_is_an_objective_without_keys(others):
    text = EVERYTHING.replace('"comfort"\nweight = "40 1/m^2"', '"plain"')
    Path("everything.toml").write_text(text, encoding="utf-8")
    assert pt.load_scenario("everything.toml").objective.name == "plain"


@pytest.mark.parametrize(
    ("old", "new", "fields"),
    [
        ('"installed-sources"', '"sources"', {"argument": "sensor.model", "value": "sources"}),
        ('"comfort"', '"wrong"', {"argument": "objective.kind", "value": "wrong"}),
        (
            '"comfort"',
            '"ease"',
            {"argument": "objective.kind", "value": "ease"},
        ),
        ('"40 1/m^2"', '"40 1/m"', {"argument": "objective.weight", "value": "40 1/m"}),
        (
            'weight = "40 1/m^2"\n',
            "",
            {"argument": "objective.weight"},
        ),
        ('"-25 cm/s"', '"-25 cm"', {"argument": "uncertainty.obstacle.velocity.triangular.high", "value": "-25 cm"}),
        ("lean = 0.4", 'lean = "0.4 m"', {"argument": "uncertainty.sensor.spread.triangular.lean", "value": "0.4 m"}),
        ("lean = 0.4", "lean = -0.4", {"argument": "uncertainty.sensor.spread.triangular.lean", "value": -0.4}),
        (
            '{ triangular = { low = "19 mm"',
            '{ triangle = { low = "19 mm"',
            {"argument": "uncertainty.sensor.spread.triangle"},
        ),
        (
            '{ triangular = { low = "19 mm"',
            '{ abstract = { low = "19 mm"',
            {"argument": "uncertainty.sensor.spread.abstract"},
        ),
        ('"geared"', '"gear"', {"argument": "robot.kind", "value": "gear"}),
        ('pitch = "100 mm"', "", {"argument": "robot.pitch"}),
    ],
)
def test_a_mistake_in_a_file_of_installed_kinds_is_found(others, old, new, fields):
    Path("everything.toml").write_text(scenario_text.replaced(old, new, EVERYTHING), encoding="utf-8")
    with refused(**fields, error=pt.errors.ScenarioFileError):
        pt.load_scenario("everything.toml")
