"""A mistake in a scenario file names the line, the key, what was found and what is expected."""

from __future__ import annotations

import pytest

from pretouch._core.errors import InvalidInputError, ScenarioFileError
from pretouch.config import document, load_scenario
from refusals import refused
from scenario_text import (
    ADMITTANCE,
    GAIN,
    OBJECTIVE,
    SENSOR,
    STILL,
    WHOLE,
    error_of,
    line_of,
    places,
    refusal,
    replaced,
    writer,
)


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


@pytest.fixture
def message(write):
    return lambda text: refusal(write(text))


def test_the_file_of_the_issue_is_read_in_si(write):
    problem = load_scenario(write(WHOLE))
    assert problem.sensor.parameters == {"scale": 1.30e-5, "distance_offset": 0.0419, "exponent": 3.32}
    assert (problem.scenario.distance, problem.scenario.relative_velocity) == (0.0422, -0.3)
    assert problem.bounds == (-10.0, -0.01)
    assert [(c.name, c.limit) for c in problem.constraints] == [("excursion", 0.2)]
    assert [(t.quantity, t.scale, t.weight) for t in problem.objective.terms] == [
        ("displacement", 0.5, 1.0),
        ("relative_velocity", 0.3, 1.0),
    ]
    assert (problem.method, problem.horizon, problem.calibration, problem.impact) == ("auto", 600.0, None, None)
    assert problem.source.text == WHOLE
    assert len(problem.source.sha256) == 64


# (what is replaced, by what, the start of the line that is named, key)
VALUES = [
    ('"10 N*s/m"', '"10 N/m"', "damping", "admittance.damping"),
    ('"10 N*s/m"', '"-1 N*s/m"', "damping", "admittance.damping"),
    ('"1 kg"', '"1"', "mass", "admittance.mass"),
    ('"42.2 mm"', '"4.2"', "position", "obstacle.position"),
    ('"42.2 mm"', '"42.2"', "position", "obstacle.position"),
    ("1.30e-5", '"1.3"', "scale", "sensor.scale"),
    ('"-10 N*s"', '"-10"', "bounds", "gain.bounds[0]"),
    ('"1 kg"', '"0 kg"', "mass", "admittance.mass"),
    ('"1 kg"', "true", "mass", "admittance.mass"),
    ('"1 kg"', "[1, 2]", "mass", "admittance.mass"),
    ('"1 kg"', "{ a = 1 }", "mass", "admittance.mass"),
    ('"1 kg"', "2020-01-01", "mass", "admittance.mass"),
    ('"1 kg"', "nan", "mass", "admittance.mass"),
    ('"1 kg"', "inf", "mass", "admittance.mass"),
    ('"1 kg"', "1" + 400 * "0", "mass", "admittance.mass"),
    ('"1 kg"', '"1 kg^-99999"', "mass", "admittance.mass"),
    ('"1 kg"', '"1 mm^-99999"', "mass", "admittance.mass"),
    ('"1 kg"', '"heavy"', "mass", "admittance.mass"),
    ('"1 kg"', '"1 kg\x85\u2028\x9b2J"', "mass", "admittance.mass"),
    ('"1 kg"', '""', "mass", "admittance.mass"),
    ('"25 N/m"', '"25 furlong"', "stiffness", "admittance.stiffness"),
    ('"-0.3 m/s"', '"-1,250 m/s"', "velocity", "obstacle.velocity"),
    ("exponent = 3.32", "exponent = -3.32", "exponent", "sensor.exponent"),
    ("exponent = 3.32", 'exponent = "3.32 m"', "exponent", "sensor.exponent"),
    ("1.30e-5", '"1 kg"', "scale", "sensor.scale"),
    ('"41.9 mm"', '"-41.9 mm"', "distance_offset", "sensor.distance_offset"),
    ('"0.3 m/s"', '"obstacle sped"', "velocity_scale", "objective.velocity_scale"),
    ('"0.5 m"', "0", "position_scale", "objective.position_scale"),
    ('"0.2 m"', '"0 m"', "excursion", "constraints.excursion"),
    ('"0.2 m"', '"0.2 m/s"', "excursion", "constraints.excursion"),
    ('"-10 N*s"', '"-10 N"', "bounds", "gain.bounds[0]"),
    (', "-0.01 N*s"', "", "bounds", "gain.bounds"),
    ('["-10 N*s", "-0.01 N*s"]', "-10", "bounds", "gain.bounds"),
    ('"-10 N*s"', '"10 N*s"', "bounds", "gain.bounds"),
    ('"42.2 mm"', '"-1 mm"', "position", "obstacle.position"),
    ('"inverse-power"', '"inverse power"', "model", "sensor.model"),
    ('"inverse-power"', "3", "model", "sensor.model"),
    ('"excursion"', '"tme"', "kind", "objective.kind"),
]


@pytest.mark.parametrize(("old", "new", "start", "key"), VALUES)
def test_a_wrong_value_is_refused_at_its_line_and_key(write, old, new, start, key):
    text = replaced(old, new)
    error = error_of(write(text))
    assert [(mistake.line, mistake.key) for mistake in error.mistakes] == [(line_of(start, text), key)]
    assert error.argument == key
    assert str(error).startswith(f"approach.toml, line {line_of(start, text)}: {key}: ")
    assert str(error).isprintable()  # one line, and control characters of the file are escaped


# (what is replaced, by what, the start of the line that is named, key)
KEYS = [
    ("damping =", "dampng =", "dampng", "admittance.dampng"),
    ("[gain]", "[gian]", "[gian]", "gian"),
    ("exponent =", "Exponent =", "Exponent", "sensor.Exponent"),
    ("exponent =", "color =", "color", "sensor.color"),
    ("[gain]", "[colors]", "[colors]", "colors"),
    ("velocity_scale", "weight", "weight", "objective.weight"),
    ('model = "inverse-power"', "", "[sensor]", "sensor.model"),
    ("model =", "modle =", "modle", "sensor.modle"),
    ("exponent = 3.32", "", "[sensor]", "sensor.exponent"),
    ('mass = "1 kg"', "", "[admittance]", "admittance.mass"),
    ('bounds = ["-10 N*s", "-0.01 N*s"]', "", "[gain]", "gain.bounds"),
    ("exponent = 3.32", "exponent = 3\nrate = -60", "rate", "sensor.rate"),
    ("exponent = 3.32", "exponent = 3\nselect = {}", "select", "sensor.select"),
    ("model =", 'calibration = "s.csv"\nmodel =', "scale", "sensor.scale"),
    ("damping =", 'natural_frequency = "5 rad/s"\ndamping =', "damping", "admittance.damping"),
    ("exponent = 3.32", "exponent = 3\nmass = 1", "mass", "sensor.mass"),
    ("[sensor]", 'mass = "1 kg"\n[sensor]', "mass", "mass"),
    ('velocity_scale = "0.3 m/s"', "", "[objective]", "objective"),
    ("velocity_scale", "force_scale = 1\nvelocity_scale", "force_scale", "objective.force_scale"),
    ("velocity_scale", "force_weight = 1\nvelocity_scale", "force_weight", "objective.force_weight"),
    ("velocity_scale", "time_scale = 1\nvelocity_scale", "time_scale", "objective.time_scale"),
]


@pytest.mark.parametrize(("old", "new", "start", "key"), KEYS)
def test_a_wrong_or_missing_key_is_refused_at_its_line(write, old, new, start, key):
    text = replaced(old, new)
    assert (line_of(start, text), key) in places(write(text))


def test_a_misspelt_key_is_not_called_missing_as_well(write):
    assert [key for _, key in places(write(replaced("damping =", "dampng =")))] == ["admittance.dampng"]
    assert [key for _, key in places(write(replaced("[gain]", "[gian]")))] == ["gian"]


@pytest.mark.parametrize("section", [SENSOR, ADMITTANCE, STILL, OBJECTIVE, GAIN])
def test_a_missing_section_is_named(write, section):
    text = WHOLE.replace(section, "")
    assert (len(text.splitlines()), section.split("]")[0].strip("[")) in places(write(text))


@pytest.mark.parametrize("new", ["sensor = 3\n", "[[sensor]]\n"])
def test_a_section_that_is_none_is_refused(write, new):
    assert (1, "sensor") in places(write(new + WHOLE.replace(SENSOR, "")))


def test_all_mistakes_are_listed_in_the_order_of_their_lines(write):
    text = replaced('"1 kg"', '"1 s"', replaced('"0.2 m"', '"0.2 kg"', replaced("[gain]", "[gian]")))
    assert [line for line, _ in places(write(text))] == [7, 18, 26]


def test_an_empty_file_misses_every_required_section(message):
    told = message("").splitlines()
    assert len(told) == 5
    assert all(line.startswith("approach.toml, line 1: ") for line in told)


# --- files that are no TOML at all


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('"1 kg"', "1 kg", 7),
        ('"1 kg"', "1,5", 7),
        ('"inverse-power"', "inverse-power # L(3)", 2),
        ('"1 kg"', '"1 kg', 7),
        ('mass = "1 kg"', 'mass = "1 kg"\nmass = 2', 8),
        ("[gain]", "[sensor]\n[gain]", 18),
        ('["-10 N*s", "-0.01 N*s"]', '["-10 N*s"', 20),
        ('"1 kg"', "[" * 5000, 1),
        ('"1 kg"', "1" * 5000, 7),
    ],
)
def test_what_is_no_toml_is_refused_with_its_line(message, old, new, line):
    told = message(replaced(old, new))
    assert told.startswith(f"approach.toml, line {line}: ")
    assert "\n" not in told


def test_line_ends_and_byte_order_mark_change_nothing(write, message):
    windows = b"\xef\xbb\xbf" + WHOLE.replace("\n", "\r\n").encode()
    assert load_scenario(write(windows)).scenario == load_scenario(write(WHOLE)).scenario
    assert message(windows.replace(b"10 N*s/m", b"10 N/m")).startswith("approach.toml, line 8: admittance.damping: ")


def test_a_text_that_is_no_utf_8_is_refused_with_its_line(message):
    assert message(WHOLE.encode("utf-16")).startswith("approach.toml, line 1: ")
    told = message(replaced('"1 kg"', '"1 kg" # \xe9').encode("latin-1"))
    assert told.startswith("approach.toml, line 7: ")
    assert "0xe9" in told


def test_a_file_that_cannot_be_read_is_refused_with_its_name(write, tmp_path):
    write(WHOLE)
    for name, remedy in {"aproach.toml": "approach.toml", "nothing.toml": "", ".": "", "a\0b": ""}.items():
        with refused(name, error=ScenarioFileError, remedy=remedy):
            load_scenario(name)


def test_a_file_without_permission_is_refused(write, monkeypatch):
    def refuse(path, **_):
        raise PermissionError(13, "Permission denied")

    file = write(WHOLE)
    monkeypatch.setattr(document, "read_regular_file", refuse)
    with refused("approach.toml", error=ScenarioFileError):
        load_scenario(file)


def test_a_calibration_in_the_place_of_a_scenario_is_recognized(tmp_path):
    file = tmp_path / "sensor.csv"
    file.write_text("distance [mm],output [V]\n0,2\n")
    with refused(f"{file}, line 1", error=ScenarioFileError, remedy="pretouch fit"):
        load_scenario(file)


def test_every_refusal_can_be_caught_as_one(write):
    with pytest.raises(InvalidInputError):
        load_scenario(write(""))
