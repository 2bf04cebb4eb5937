"""What a scenario file says of its law arrives in the task, in the sampled law, and in what the verbs make of them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from command_text import command, stand_in_for_reports, strict

import pretouch as pt
from pretouch.config import load_scenario
from pretouch.config.schema import keys_of
from pretouch.control import VirtualDrag
from pretouch.designs import DragEffect
from pretouch.motion import DAMPER, DRAG
from refusals import refused
from scenario_text import ADMITTANCE, GAIN, SENSOR, STILL, WHOLE, replaced

pytestmark = pytest.mark.usefixtures("short_rest")

EXAMPLE = Path(__file__).parents[2] / "examples" / "drag.toml"
TEXT = EXAMPLE.read_text(encoding="utf-8")
LAW = 'kind = "virtual-drag"\n'
ALONE = SENSOR + ADMITTANCE + STILL + f"[law]\n{LAW}"
IMPACT = '[impact]\nrobot_mass = "4 kg"\nstiffness = "10 kN/m"\n'
# every key of the sampled law with a value that is no default
SAMPLED = """\
drag = "0.02 N*s^2"
noise = "30 counts"
relative_noise = "1 %"
resolution = "4 counts"
smoothing_time = "6 ms"
dead_zone = 9
still_rate = 2
hold_time = "30 ms"
own_advance = "-3 N*s"
known_acceleration = "-9.81 m/s^2"
"""
DRAG_LAW = VirtualDrag(
    drag=0.02,
    noise=30.0,
    relative_noise=0.01,
    resolution=4.0,
    smoothing_time=6e-3,
    dead_zone=9.0,
    still_rate=2.0,
    hold_time=0.03,
    own_advance=-3.0,
    known_acceleration=-9.81,
)


@pytest.fixture
def read(tmp_path):
    def load(text):
        file = tmp_path / "drag.toml"
        file.write_text(text, encoding="utf-8")
        return load_scenario(file)

    return load


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("drag.toml").write_text(replaced("runs = 500", "runs = 20", TEXT), encoding="utf-8")
    stand_in_for_reports(monkeypatch)
    return command(monkeypatch, capsys)


def test_without_a_law_a_file_means_the_damper(read):
    assert read(WHOLE).law is DAMPER
    assert read(WHOLE + '[law]\nkind = "virtual-damper"\n') == read(WHOLE)


def test_every_key_arrives_in_the_sampled_law(read):
    task = read(replaced('ratio = 0.15                                   # contact speed over approach speed\n'
                         'smoothing_time = "5 ms"\n', SAMPLED, TEXT))  # fmt: skip
    assert task.law is DRAG
    assert task.loop.law.law == DRAG_LAW
    assert (task.gain, task.drag_effect) == (0.02, None)
    assert pt.simulate(task).gain == 0.02
    keys = {line.split(" = ")[0] for line in SAMPLED.splitlines()}
    assert keys | {"kind", "largest_speed", *DragEffect.__dataclass_fields__} == set(keys_of("law"))
    assert {f.name for f in dataclasses.fields(VirtualDrag)} == keys


def test_the_noise_of_readings_is_that_of_the_chain(read):
    task = read(TEXT)
    law, chain = task.loop.law.law, task.loop.chain
    assert (law.noise, law.relative_noise, law.resolution) == (chain.noise, chain.relative_noise, chain.resolution)
    assert (law.noise, law.smoothing_time, law.drag) == (20.0, 5e-3, 0.0)


@pytest.mark.parametrize(
    ("text", "effect"),
    [
        ("ratio = 0.15\n", {"ratio": 0.15}),
        ('excursion = "60 mm"\n', {"excursion": 0.06}),
        ('acceleration = "2 m/s^2"\n', {"acceleration": 2.0}),
        ('contact_speed = "5 cm/s"\nlargest_speed = "0.5 m/s"\n', {"contact_speed": 0.05, "largest_speed": 0.5}),
        ('impact_force = "9 N"\n' + IMPACT, {"impact_force": 9.0}),
    ],
)
def test_an_effect_arrives_and_chooses_the_drag(read, text, effect):
    task = read(ALONE + text)
    assert task.drag_effect == DragEffect(**effect)
    assert (task.law, task.gain, task.objective, task.bounds) == (DRAG, None, None, None)
    speed = effect.get("largest_speed", 0.3)  # that of the encounter
    with_loop = task.replace(loop=read(TEXT).loop, sensor=read(TEXT).sensor)
    expected, _ = DragEffect(**{**effect, "largest_speed": speed}).drag(with_loop.sensor, 0.0422, 1.0, task.impact)
    assert pt.simulate(with_loop).gain == expected


def test_bounds_and_choice_are_drags(read):
    drags = replaced(GAIN, '[gain]\nbounds = ["1 g*m", "0.2 kg*m"]\n[pareto]\nchoice = "0.0144 N*s^2"\n', WHOLE)
    task = read(drags + f"[law]\n{LAW}")
    assert (task.bounds, task.pareto.choice, task.drag_effect) == ((0.001, 0.2), 0.0144, None)
    assert pt.pareto(task).choice.gain == 0.0144
    assert 0.001 < pt.design(task).gain < 0.2


def test_a_verdict_is_of_the_drag_that_the_effect_chooses(read):
    task = read(TEXT)
    found = pt.verify(task.replace(verify=pt.designs.VerifyOptions(runs=20)), changes=False)
    assert found.gain == DragEffect(ratio=0.15).drag(task.sensor, 0.0422, 1.0)[0]
    assert found.status.value == "holds"
    assert found.stability.margin > task.stability_margin
    assert pt.verify(task.replace(verify=pt.designs.VerifyOptions(runs=20), gain=0.01), changes=False).gain == 0.01
    with refused("law", error=pt.errors.ScenarioFileError) as caught:
        pt.verify(task.replace(bounds=None))
    assert [m.line for m in caught.value.mistakes] == [TEXT.splitlines().index("[law]") + 1]


def test_a_gain_of_the_command_line_has_the_unit_of_the_law(run):
    code, out, _ = run("simulate", "drag.toml", "--gain", "0.02 N*s^2", "--json")
    assert code == 0
    assert strict(out)["gain"] == 0.02
    for verb in (("simulate",), ("verify",), ("sweep", "--axis", "obstacle.velocity=-0.3,-0.2")):
        code, _, err = run(*verb, "drag.toml", "--gain", "-0.7 N*s")
        assert code == 2
        assert "--gain: found '-0.7 N*s'" in err
        assert err.endswith("the unit of law kind virtual-drag\n")
    code, out, err = run("sweep", "drag.toml", "--axis", "gain=0.01 N*s^2,0.02 N*s^2", "--json")
    assert (code, err) == (0, "")
    assert strict(out)["axes"]["gain"]["unit"] == "N*s^2"


def test_a_sweep_of_designs_gives_drags(read):
    task = read(replaced(GAIN, '[gain]\nbounds = ["1 g*m", "0.2 kg*m"]\n', WHOLE) + f"[law]\n{LAW}")
    assert pt.sweep(task, {"obstacle.velocity": [-0.3]})["gain"].attrs["units"] == "N*s^2"
