"""[law]: what contradicts itself is refused with line, key and sentence, and every gain has the unit of its law."""

from __future__ import annotations

import pytest
from loop_text import CHAIN, LOOPED

import pretouch as pt
from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario
from scenario_text import ADMITTANCE, GAIN, OBJECTIVE, SENSOR, STILL, WHOLE, line_of, refusal, replaced, writer


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


@pytest.fixture
def message(write):
    return lambda text: refusal(write(text))


LAW = '[law]\nkind = "virtual-drag"\n'
IN_DRAGS = '[gain]\nbounds = ["0.001 N*s^2", "0.2 N*s^2"]\n'
LOOP = replaced(GAIN, IN_DRAGS, LOOPED) + LAW
ALONE = SENSOR + ADMITTANCE + STILL  # neither an objective nor bounds
UNSURE = '[uncertainty]\nobstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }\n'

# (text, the start of the line that is named, key, what the sentence says)
MISTAKES = [
    (WHOLE + '[law]\nkind = "virtual-darg"\n', "kind =", "law.kind",
     'found "virtual-darg", expected one of "virtual-damper", "virtual-drag"; did you mean "virtual-drag"?'),
    (WHOLE + "[law]\nratio = 0.15\n", "[law]", "law.kind", 'missing, expected one of "virtual-damper", "virtual-drag"'),
    (WHOLE + '[law]\nkin = "virtual-drag"\n', "kin =", "law.kin", 'found an unknown key, expected "kind"'),
    (WHOLE + '[law]\nkind = "virtual-damper"\nratio = 0.15\n', "ratio", "law.ratio",
     'this key belongs to the variant "virtual-drag" of this section, but kind = "virtual-damper" selects'),
    (ALONE + LAW + "ratoi = 0.15\n", "ratoi", "law.ratoi", 'found an unknown key, expected "ratio"'),
    (ALONE + LAW + "ratio = 1.5\n", "ratio", "law.ratio", "found 1.5, expected a positive number up to 1"),
    (ALONE + LAW + "ratio = 0\n", "ratio", "law.ratio", "expected a positive number"),
    (ALONE + LAW + 'excursion = "60 N"\n', "excursion", "law.excursion", 'found "60 N", expected a quantity in m'),
    (ALONE + LAW + 'ratio = 0.1\nexcursion = "60 mm"\n', "excursion", "law.excursion", "found the keys ratio and ex"),
    (ALONE + LAW + 'ratio = 0.1\ndrag = "0.1 N*s^2"\n', "ratio", "law.ratio", "found the keys drag and ratio"),
    (ALONE + LAW + 'ratio = 0.1\nlargest_speed = "1 m/s"\n', "largest", "law.largest_speed",
     "but the section has the key ratio"),
    (WHOLE.replace(GAIN, IN_DRAGS) + LAW + "largest_speed = 1\n", "largest", "law.largest_speed", "has none of them"),
    (ALONE + LAW + 'impact_force = "9 N"\n', "impact_force", "law.impact_force", "needs the section [impact]"),
    (ALONE + UNSURE + LAW + 'contact_speed = "5 cm/s"\n', "[law]", "law.largest_speed",
     'because the approach speed is uncertain; add, for example: largest_speed ='),
    (replaced('"-0.3 m/s"', '"0 m/s"', ALONE).replace('"0 m/s^2"', "-1") + LAW + "acceleration = 2\n", "[law]",
     "law.largest_speed", "because the obstacle does not approach"),
    (WHOLE + LAW, "bounds", "gain.bounds[0]",
     'found "-10 N*s", expected a quantity in N*s², the unit of law kind virtual-drag'),
    (ALONE + OBJECTIVE + LAW, "kind =", "gain", 'expected [gain] with bounds = ["0.0001 N*s²", "1 N*s²"]'),
    (WHOLE.replace(GAIN, IN_DRAGS), "bounds", "gain.bounds[0]", "in N*s, the unit of law kind virtual-damper"),
    (ALONE + LAW + 'drag = "0.1 N*s"\n', "drag", "law.drag", 'found "0.1 N*s", expected a quantity in N*s²'),
    (ALONE + LAW + 'drag = "-0.1 N*s^2"\n', "drag", "law.drag", "expected a nonnegative quantity in N*s²"),
    (ALONE + LAW + 'ratio = 0.1\n[pareto]\nchoice = "-1 N*s"\n', "choice", "pareto.choice",
     "in N*s², the unit of law kind"),
    (ALONE + LAW + 'ratio = 0.1\n[constraints]\ngain = 1\n', "gain", "constraints.gain", "expected bounds in [gain]"),
    (ALONE + LAW + 'ratio = 0.1\ndead_zone = 9\n', "dead_zone", "law.dead_zone", "expected [chain] and [controller]"),
    (replaced('rate = "1 kHz"', "rate = 1e3\ngain = -0.7", LOOP), "gain =", "controller.gain",
     'but the scenario file uses another law; expected drag = "0.0144 N*s²" in'),
    (replaced('rate = "1 kHz"', "rate = 1e3\napproach_only = true", LOOP), "approach_only", "controller.approach_only",
     "expected only rate, period, floor"),
    (LOOP + 'noise = "1 mV"\n', "noise = \"1", "law.noise", 'found "1 mV", expected counts'),
    (LOOP + 'own_advance = "2 N*s"\n', "own_advance", "law.own_advance", "a positive gain would accelerate"),
    (LOOP + 'smoothing_time = "7 m"\n', "smoothing", "law.smoothing_time", "expected a quantity in s"),
    (replaced(CHAIN, '[chain]\npart = "VL53L5CX-4x4"\n', LOOP), "[law]", "law.noise",
     "because [chain] has a noise of distances, not of readings"),
    (replaced('rate = "1 kHz"', 'rate = 1e3\ngain = "0.01 N*s^2"', LOOPED), "gain =", "controller.gain",
     "expected a quantity in N*s, the unit of law kind virtual-damper"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "start", "key", "says"), MISTAKES)
def test_a_mistake_is_named_with_line_and_key(message, text, start, key, says):
    told = message(text)
    line = next((line for line in told.splitlines() if f": {key}: " in line), told)
    place, _, sentence = line.partition(f": {key}: ")
    after = text.splitlines().index("[law]") if start.startswith(("kind", "noise")) else 0  # of several with one name
    rest = "\n".join(text.splitlines()[after:])
    assert place == f"approach.toml, line {after + line_of(start, rest)}", told
    assert says in sentence


def test_a_kind_that_is_none_leaves_no_other_mistakes(message):
    told = message(LOOP.replace('"virtual-drag"', '"drag"'))
    assert told.splitlines() == [told]
    told = message(LOOP.replace("[law]", "[lav]"))
    assert told.splitlines() == [told]
    assert "lav: found an unknown section, expected [law]" in told


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
    with pytest.raises(ScenarioFileError) as refused:
        pt.design(load_scenario(write(text)))
    told = str(refused.value)
    assert told.startswith(f"approach.toml, line {line_of('stability', text)}: loop.stability_margin: no drag within ")
    assert "has the required gain margin of 1e+06. At a sensor rate of " in told
    assert " Hz, the strongest drag with this margin is " in told
    assert ". The bounds of [gain] are 0.001 to 0.2 N*s^2. Choose" in told
    assert ". Choose a smaller margin" in told


def test_the_undamaged_files_are_read(write):
    assert load_scenario(write(LOOP)).law.kind == "virtual-drag"
    assert load_scenario(write(ALONE + LAW + "ratio = 0.15\n")).objective is None
    assert load_scenario(write(WHOLE + '[law]\nkind = "virtual-damper"\n')) == load_scenario(write(WHOLE))
