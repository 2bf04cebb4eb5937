"""A mistake in a scenario file names the line, the key, what was found and what is expected."""

from __future__ import annotations

import pytest

from pretouch._core.errors import InvalidInputError, ScenarioFileError
from pretouch.config import document, load_scenario
from scenario_text import ADMITTANCE, GAIN, OBJECTIVE, SENSOR, STILL, WHOLE, line_of, refusal, replaced, writer


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


# (what is replaced, by what, the start of the line that is named, key, what was found, what is expected)
VALUES = [
    ('"10 N*s/m"', '"10 N/m"', "damping", "admittance.damping", '"10 N/m"', "a quantity in N*s/m"),
    ('"10 N*s/m"', '"-1 N*s/m"', "damping", "admittance.damping", '"-1 N*s/m"', "a nonnegative quantity in N*s/m"),
    ('"1 kg"', '"1"', "mass", "admittance.mass", '"1"', '"1 kg", or 1 without quotes (unit: kg)'),
    ('"42.2 mm"', '"4.2"', "position", "obstacle.position", '"4.2"', '"4.2 mm", or 4.2 without quotes (unit: m)'),
    ('"42.2 mm"', '"42.2"', "position", "obstacle.position", '"42.2"', 'unit, such as "42.2 mm" or "42.2 m"'),
    ("1.30e-5", '"1.3"', "scale", "sensor.scale", '"1.3"', '"1.3 V" or "1.3 counts", or the bare number 1.3'),
    ('"-10 N*s"', '"-10"', "bounds", "gain.bounds[0]", '"-10"', '"-10 N*s", or -10 without quotes (unit: N*s)'),
    ('"1 kg"', '"0 kg"', "mass", "admittance.mass", '"0 kg"', "a positive quantity in kg"),
    ('"1 kg"', "true", "mass", "admittance.mass", "true", "a quantity in kg"),
    ('"1 kg"', "[1, 2]", "mass", "admittance.mass", "a list of 2 values", "a quantity in kg"),
    ('"1 kg"', "{ a = 1 }", "mass", "admittance.mass", "a table", "a quantity in kg"),
    ('"1 kg"', "2020-01-01", "mass", "admittance.mass", "2020-01-01", "a quantity in kg"),
    ('"1 kg"', "nan", "mass", "admittance.mass", "nan", "a quantity in kg"),
    ('"1 kg"', "inf", "mass", "admittance.mass", "inf", "a finite quantity in kg"),
    ('"1 kg"', "1" + 400 * "0", "mass", "admittance.mass", "a very large integer", "a quantity in kg"),
    ('"1 kg"', '"1 kg^-99999"', "mass", "admittance.mass", '"1 kg^-99999"', "a quantity in kg"),
    ('"1 kg"', '"1 mm^-99999"', "mass", "admittance.mass", '"1 mm^-99999"', "a quantity in kg"),
    ('"1 kg"', '"heavy"', "mass", "admittance.mass", '"heavy"', "a quantity in kg"),
    ('"1 kg"', '"1 kg\x85\u2028\x9b2J"', "mass", "admittance.mass", r'"1 kg\x85\u2028\x9b2J"', "a quantity in kg"),
    ('"1 kg"', '""', "mass", "admittance.mass", '""', "a quantity in kg"),
    ('"25 N/m"', '"25 furlong"', "stiffness", "admittance.stiffness", '"25 furlong"', "'furlong' is unknown"),
    ('"-0.3 m/s"', '"-0,3 m/s"', "velocity", "obstacle.velocity", '"-0,3 m/s"', "a decimal point"),
    ("exponent = 3.32", "exponent = -3.32", "exponent", "sensor.exponent", "-3.32", "a positive number"),
    ("exponent = 3.32", 'exponent = "3.32 m"', "exponent", "sensor.exponent", '"3.32 m"', "a number"),
    ("1.30e-5", '"1 kg"', "scale", "sensor.scale", '"1 kg"', "a sensor output, a number or text in V or counts"),
    ('"41.9 mm"', '"-41.9 mm"', "distance_offset", "sensor.distance_offset", "-0.0419 m", "expected more than 0 m"),
    ('"0.3 m/s"', '"obstacle sped"', "velocity_scale", "objective.velocity_scale", "sped", 'm/s or "obstacle speed"'),
    ('"0.5 m"', "0", "position_scale", "objective.position_scale", "0", "a nonzero quantity in m"),
    ('"0.2 m"', '"0 m"', "excursion", "constraints.excursion", '"0 m"', "a positive quantity in m"),
    ('"0.2 m"', '"0.2 m/s"', "excursion", "constraints.excursion", '"0.2 m/s"', "a quantity in m"),
    ('"-10 N*s"', '"-10 N"', "bounds", "gain.bounds[0]", '"-10 N"', "a quantity in N*s"),
    (', "-0.01 N*s"', "", "bounds", "gain.bounds", "a list of 1 value", "a list of two quantities in N*s"),
    ('["-10 N*s", "-0.01 N*s"]', "-10", "bounds", "gain.bounds", "-10", "a list of two quantities in N*s"),
    ('"-10 N*s"', '"10 N*s"', "bounds", "gain.bounds", "from 10 N*s to -0.01 N*s", "the lower bound first"),
    ('"42.2 mm"', '"-1 mm"', "position", "obstacle.position", "is -0.001 m", "must be positive"),
    ('"inverse-power"', '"inverse power"', "model", "sensor.model", '"inverse power"', 'did you mean "inverse-power"?'),
    ('"inverse-power"', "3", "model", "sensor.model", "3", 'one of "exponential-1", "exponential-2"'),
    ('"excursion"', '"tme"', "kind", "objective.kind", '"tme"', 'did you mean "time"?'),
]


@pytest.mark.parametrize(("old", "new", "start", "key", "found", "expected"), VALUES)
def test_a_wrong_value_is_named_with_line_key_found_and_expected(message, old, new, start, key, found, expected):
    text = replaced(old, new)
    told = message(text)
    place, _, sentence = told.partition(f": {key}: ")
    assert place == f"approach.toml, line {line_of(start, text)}"
    assert "\n" not in told
    assert found in (sentence if found.startswith("is ") else sentence[sentence.index("found") :])
    assert expected in sentence


def test_the_message_of_the_issue_is_word_for_word(message):
    told = message(replaced('"10 N*s/m"', '"10 N/m"'))
    assert told == 'approach.toml, line 8: admittance.damping: found "10 N/m", expected a quantity in N*s/m'


# (what is replaced, by what, the start of the line that is named, key, what the sentence says)
KEYS = [
    ("damping =", "dampng =", "dampng", "admittance.dampng", 'found an unknown key, expected "damping"'),
    ("[gain]", "[gian]", "[gian]", "gian", "found an unknown section, expected [gain]"),
    ("exponent =", "Exponent =", "Exponent", "sensor.Exponent", 'expected "exponent"'),
    ("exponent =", "color =", "color", "sensor.color", "found an unknown key, expected one of recess"),
    ("[gain]", "[colors]", "[colors]", "colors", "found an unknown section, expected one of [sensor], [admittance]"),
    ("velocity_scale", "weight", "weight", "objective.weight", "unknown key"),
    ('model = "inverse-power"', "", "[sensor]", "sensor.model", 'missing, expected one of "exponential-1"'),
    ("model =", "modle =", "modle", "sensor.modle", 'expected "model"'),
    ("exponent = 3.32", "", "[sensor]", "sensor.exponent", "missing, expected a number; add, for example: exponent = "),
    ('mass = "1 kg"', "", "[admittance]", "admittance.mass", 'add, for example: mass = "1 kg"'),
    ('bounds = ["-10 N*s", "-0.01 N*s"]', "", "[gain]", "gain.bounds", 'add, for example: bounds = ["-10 N*s"'),
    (
        "exponent = 3.32",
        "exponent = 3\nrate = -60",
        "rate",
        "sensor.rate",
        'but model = "inverse-power" selects another variant',
    ),
    ("exponent = 3.32", "exponent = 3\nselect = {}", "select", "sensor.select", "expected the key calibration as well"),
    (
        "model =",
        'calibration = "s.csv"\nmodel =',
        "scale",
        "sensor.scale",
        "together with a calibration (line 2); give either",
    ),
    (
        "damping =",
        'natural_frequency = "5 rad/s"\ndamping =',
        "damping",
        "admittance.damping",
        "found together with mass",
    ),
    ("exponent = 3.32", "exponent = 3\nmass = 1", "mass", "sensor.mass", "found a key of [admittance]"),
    (
        "[sensor]",
        'mass = "1 kg"\n[sensor]',
        "mass",
        "mass",
        "belongs in [admittance]",
    ),
    ('velocity_scale = "0.3 m/s"', "", "[objective]", "objective", "missing velocity_scale"),
    ("velocity_scale", "force_scale = 1\nvelocity_scale", "force_scale", "objective.force_scale", "found both"),
    (
        "velocity_scale",
        "force_weight = 1\nvelocity_scale",
        "force_weight",
        "objective.force_weight",
        "without the key force_scale",
    ),
    (
        "velocity_scale",
        "time_scale = 1\nvelocity_scale",
        "time_scale",
        "objective.time_scale",
        'this key belongs to the variant "time" of this section',
    ),
]


@pytest.mark.parametrize(("old", "new", "start", "key", "says"), KEYS)
def test_a_wrong_or_missing_key_is_named_with_its_line(message, old, new, start, key, says):
    text = replaced(old, new)
    first = next(line for line in message(text).splitlines() if f": {key}: " in line)
    place, _, sentence = first.partition(f": {key}: ")
    assert place == f"approach.toml, line {line_of(start, text)}"
    assert says in sentence
    assert any(
        remedy in sentence for remedy in ("expected", "add, for example", "give ", "belongs in", "allowed keys are")
    )


def test_a_misspelt_key_is_not_called_missing_as_well(message):
    assert "missing" not in message(replaced("damping =", "dampng ="))
    assert message(replaced("[gain]", "[gian]")).count("\n") == 0


@pytest.mark.parametrize("section", [SENSOR, ADMITTANCE, STILL, OBJECTIVE, GAIN])
def test_a_missing_section_is_named_with_an_example(message, section):
    name = section.split("]")[0].strip("[")
    text = WHOLE.replace(section, "")
    told = message(text)
    last = len(text.splitlines())
    assert told.startswith(f"approach.toml, line {last}: {name}: found no such section, expected [{name}] with ")
    assert "=" in told


@pytest.mark.parametrize(("new", "found"), [("sensor = 3\n", "found 3"), ("[[sensor]]\n", "found [[sensor]]")])
def test_a_section_that_is_none_is_refused(message, new, found):
    assert f"line 1: sensor: {found}, expected a section [sensor]" in message(new + WHOLE.replace(SENSOR, ""))


def test_all_mistakes_are_listed_in_the_order_of_their_lines(message):
    text = replaced('"1 kg"', '"1 s"', replaced('"0.2 m"', '"0.2 kg"', replaced("[gain]", "[gian]")))
    lines = message(text).splitlines()
    assert [line.split(":")[0].rsplit(" ", 1)[1] for line in lines] == ["7", "18", "26"]


def test_an_empty_file_misses_every_required_section(message):
    told = message("").splitlines()
    assert len(told) == 5
    assert all(line.startswith("approach.toml, line 1: ") for line in told)


# --- files that are no TOML at all


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ('"1 kg"', "1 kg", 7, 'not valid TOML: a quantity with a unit needs quotation marks: mass = "1 kg"'),
        ('"1 kg"', "1,5", 7, "not valid TOML: write a decimal point instead of the comma: mass = 1.5"),
        (
            '"inverse-power"',
            "inverse-power # L(3)",
            2,
            'not valid TOML: text needs quotes, expected model = "inverse-power"',
        ),
        ('"1 kg"', '"1 kg', 7, "not valid TOML"),
        ('mass = "1 kg"', 'mass = "1 kg"\nmass = 2', 8, "not valid TOML: this key is given twice, expected once"),
        ("[gain]", "[sensor]\n[gain]", 18, "not valid TOML: this section is given twice, expected once"),
        ('["-10 N*s", "-0.01 N*s"]', '["-10 N*s"', 20, "not valid TOML"),
        ('"1 kg"', "[" * 5000, 1, "nested too deeply"),
        ('"1 kg"', "1" * 5000, 7, "not valid TOML: a number has thousands of digits"),
    ],
)
def test_what_is_no_toml_is_refused_with_its_line(message, old, new, line, says):
    told = message(replaced(old, new))
    assert told.startswith(tuple(f"approach.toml, line {line}: the {what}" for what in ("text '", "lists ")))
    assert says in told
    assert "\n" not in told


def test_line_ends_and_byte_order_mark_change_nothing(write, message):
    windows = b"\xef\xbb\xbf" + WHOLE.replace("\n", "\r\n").encode()
    assert load_scenario(write(windows)).scenario == load_scenario(write(WHOLE)).scenario
    assert message(windows.replace(b"10 N*s/m", b"10 N/m")).startswith("approach.toml, line 8: admittance.damping: ")


def test_a_text_that_is_no_utf_8_is_refused_with_its_line(message):
    assert message(WHOLE.encode("utf-16")).startswith("approach.toml, line 1: the text is encoded in UTF-16; save")
    told = message(replaced('"1 kg"', '"1 kg" # \xe9').encode("latin-1"))
    assert told.startswith("approach.toml, line 7: the byte 0xe9 is not valid UTF-8")


def test_a_file_that_cannot_be_read_is_refused_with_its_name(write, tmp_path):
    write(WHOLE)
    cases = {
        "aproach.toml": "aproach.toml: there is no such file; did you mean approach.toml?",
        "nothing.toml": "nothing.toml: there is no such file",
        ".": ".: this path is a folder, but a scenario file (TOML) is needed",
        "a\0b": "cannot be read",
    }
    for name, says in cases.items():
        with pytest.raises(ScenarioFileError) as refused:
            load_scenario(name)
        assert says in str(refused.value)


def test_a_file_without_permission_is_refused(write, monkeypatch):
    def refuse(path, **_):
        raise PermissionError(13, "Permission denied")

    file = write(WHOLE)
    monkeypatch.setattr(document, "read_regular_file", refuse)
    with pytest.raises(ScenarioFileError, match=r"approach\.toml: cannot be read \(Permission denied\)"):
        load_scenario(file)


def test_a_calibration_in_the_place_of_a_scenario_is_recognized(tmp_path):
    file = tmp_path / "sensor.csv"
    file.write_text("distance [mm],output [V]\n0,2\n")
    with pytest.raises(ScenarioFileError, match=r"line 1: .* for a calibration run: pretouch fit"):
        load_scenario(file)


def test_every_refusal_can_be_caught_as_one(write):
    with pytest.raises(InvalidInputError):
        load_scenario(write(""))
