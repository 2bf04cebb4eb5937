"""[law]: what contradicts itself is refused with line, key and sentence, and every gain has the unit of its law."""

from __future__ import annotations

import pytest

import pretouch as pt
from loop_text import CHAIN, LOOPED
from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario
from refusals import refused
from scenario_text import ADMITTANCE, GAIN, OBJECTIVE, SENSOR, STILL, WHOLE, line_of, places, replaced, writer


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


LAW = '[law]\nkind = "virtual-drag"\n'
IN_DRAGS = '[gain]\nbounds = ["0.001 N*s^2", "0.2 N*s^2"]\n'
LOOP = replaced(GAIN, IN_DRAGS, LOOPED) + LAW
ALONE = SENSOR + ADMITTANCE + STILL  # neither an objective nor bounds
UNSURE = '[uncertainty]\nobstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }\n'

# (text, the start of the line that is named, key)
MISTAKES = [
    (WHOLE + '[law]\nkind = "virtual-darg"\n', "kind =", "law.kind"),
    (WHOLE + "[law]\nratio = 0.15\n", "[law]", "law.kind"),
    (WHOLE + '[law]\nkin = "virtual-drag"\n', "kin =", "law.kin"),
    (WHOLE + '[law]\nkind = "virtual-damper"\nratio = 0.15\n', "ratio", "law.ratio"),
    (ALONE + LAW + "ratoi = 0.15\n", "ratoi", "law.ratoi"),
    (ALONE + LAW + "ratio = 1.5\n", "ratio", "law.ratio"),
    (ALONE + LAW + "ratio = 0\n", "ratio", "law.ratio"),
    (ALONE + LAW + 'excursion = "60 N"\n', "excursion", "law.excursion"),
    (ALONE + LAW + 'ratio = 0.1\nexcursion = "60 mm"\n', "excursion", "law.excursion"),
    (ALONE + LAW + 'ratio = 0.1\ndrag = "0.1 N*s^2"\n', "ratio", "law.ratio"),
    (ALONE + LAW + 'ratio = 0.1\nlargest_speed = "1 m/s"\n', "largest", "law.largest_speed"),
    (WHOLE.replace(GAIN, IN_DRAGS) + LAW + "largest_speed = 1\n", "largest", "law.largest_speed"),
    (ALONE + LAW + 'impact_force = "9 N"\n', "impact_force", "law.impact_force"),
    (ALONE + UNSURE + LAW + 'contact_speed = "5 cm/s"\n', "[law]", "law.largest_speed"),
    (
        replaced('"-0.3 m/s"', '"0 m/s"', ALONE).replace('"0 m/s^2"', "-1") + LAW + "acceleration = 2\n",
        "[law]",
        "law.largest_speed",
    ),
    (WHOLE + LAW, "bounds", "gain.bounds[0]"),
    (ALONE + OBJECTIVE + LAW, "kind =", "gain"),
    (WHOLE.replace(GAIN, IN_DRAGS), "bounds", "gain.bounds[0]"),
    (ALONE + LAW + 'drag = "0.1 N*s"\n', "drag", "law.drag"),
    (ALONE + LAW + 'drag = "-0.1 N*s^2"\n', "drag", "law.drag"),
    (ALONE + LAW + 'ratio = 0.1\n[pareto]\nchoice = "-1 N*s"\n', "choice", "pareto.choice"),
    (ALONE + LAW + "ratio = 0.1\n[constraints]\ngain = 1\n", "gain", "constraints.gain"),
    (ALONE + LAW + "ratio = 0.1\ndead_zone = 9\n", "dead_zone", "law.dead_zone"),
    (replaced('rate = "1 kHz"', "rate = 1e3\ngain = -0.7", LOOP), "gain =", "controller.gain"),
    (replaced('rate = "1 kHz"', "rate = 1e3\napproach_only = true", LOOP), "approach_only", "controller.approach_only"),
    (LOOP + 'noise = "1 mV"\n', 'noise = "1', "law.noise"),
    (LOOP + 'own_advance = "2 N*s"\n', "own_advance", "law.own_advance"),
    (LOOP + 'smoothing_time = "7 m"\n', "smoothing", "law.smoothing_time"),
    (replaced(CHAIN, '[chain]\npart = "VL53L5CX-4x4"\n', LOOP), "[law]", "law.noise"),
    (replaced('rate = "1 kHz"', 'rate = 1e3\ngain = "0.01 N*s^2"', LOOPED), "gain =", "controller.gain"),
]


@pytest.mark.parametrize(("text", "start", "key"), MISTAKES)
def test_a_mistake_is_named_with_line_and_key(write, text, start, key):
    after = text.splitlines().index("[law]") if start.startswith(("kind", "noise")) else 0  # of several with one name
    rest = "\n".join(text.splitlines()[after:])
    assert (after + line_of(start, rest), key) in places(write(text))


def test_a_kind_that_is_none_leaves_no_other_mistakes(write):
    assert [key for _, key in places(write(LOOP.replace('"virtual-drag"', '"drag"')))] == ["law.kind"]
    assert [key for _, key in places(write(LOOP.replace("[law]", "[lav]")))] == ["lav"]


@pytest.mark.parametrize("value", ["true", "-1", '"inf"', "nan", '""', '"5 V"', "[]", "{}", '"virtual-drag"', "1e300"])
def test_whatever_stands_in_the_section_is_read_or_refused(write, value):
    for key in ("kind", "ratio", "largest_speed", "noise", "dead_zone", "hold_time", "own_advance"):
        text = (LOOP if key != "kind" else LOOP.removesuffix(LAW) + "[law]\n") + f"{key} = {value}\n"
        told = ""
        try:
            load_scenario(write(text))
        except ScenarioFileError as refused:
            told = str(refused)
        assert told.startswith("approach.toml, line ") or not told


def test_a_margin_that_leaves_no_drag_is_placed(write):
    text = replaced("stability_margin = 2.0", "stability_margin = 1e6", LOOP)
    with refused("loop.stability_margin", error=ScenarioFileError) as caught:
        pt.design(load_scenario(write(text)))
    assert [m.line for m in caught.value.mistakes] == [line_of("stability", text)]


def test_the_undamaged_files_are_read(write):
    assert load_scenario(write(LOOP)).law.kind == "virtual-drag"
    assert load_scenario(write(ALONE + LAW + "ratio = 0.15\n")).objective is None
    assert load_scenario(write(WHOLE + '[law]\nkind = "virtual-damper"\n')) == load_scenario(write(WHOLE))
