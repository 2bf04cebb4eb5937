"""[chain], [controller], [robot], [contact], [loop]: what contradicts itself is refused with line, key and sentence."""

from __future__ import annotations

import re

import pytest
from loop_text import CHAIN, CONTACT, CONTROLLER, ENCOUNTER, LOOP, LOOPED, ROBOT

import pretouch as pt
from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario
from scenario_text import SENSOR, WHOLE, line_of, refusal, replaced, writer


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


@pytest.fixture
def message(write):
    return lambda text: refusal(write(text))


IN_CHAIN, IN_CONTROLLER = 'noise = "20 counts"', 'rate = "1 kHz"'
STIFF, MARGIN = 'stiffness = "1.3e5 N/m^1.5"', "stability_margin = 2.0"

# (what is replaced, by what, the start of the line that is named, key, what the sentence says)
MISTAKES = [
    ('part = "VCNL4010"', "", "[chain]", "chain", 'missing rate, expected rate = "250 Hz"'),
    ('"VCNL4010"', '"VNCL4010"', "part", "chain.part", 'did you mean "VCNL4010"?'),
    ('"VCNL4010"', "4010", "part", "chain.part", "found 4010, expected text"),
    ('"VCNL4010"', '"RPR-220"', "part", "chain.part", "curve are in counts (see the key sensor.scale, line 3)"),
    (IN_CHAIN, 'noise = "20 mV"', "noise", "chain.noise", 'found "20 mV", expected counts, the unit of sensor.scale'),
    (IN_CHAIN, 'noise = "-1 counts"', "noise", "chain.noise", "expected a nonnegative sensor output"),
    (IN_CHAIN, "noise = true", "noise", "chain.noise", "found true, expected a sensor output"),
    (IN_CHAIN, 'drift = "2 V/s"', "drift", "chain.drift", 'found "2 V/s", expected counts'),
    (IN_CHAIN, 'drift = "2 counts"', "drift", "chain.drift", "a sensor output per second, a number or text in V/s or"),
    (IN_CHAIN, 'exposure = "5 ms"', "exposure", "chain.exposure", "expected at most the period of 0.004 s"),
    (IN_CHAIN, 'jitter = "2 ms"', "jitter", "chain.jitter", "at most a quarter of the sensor's period of 0.004 s"),
    (IN_CHAIN, "dropout = 1", "dropout", "chain.dropout", "found 1, expected a probability below 1"),
    (IN_CHAIN, 'highest = "-1 counts"', "highest", "chain.highest", "expected more than the lower clipping limit"),
    (IN_CHAIN, 'noise = 1\nhighest = "2 counts"', "highest", "chain.highest", "the readings saturate at 2"),
    (IN_CHAIN, 'distance_noise = "1 mm"', "[chain]", "chain", "only for a sensor that measures a distance"),
    (IN_CHAIN, 'noise = 20\nmisfit = "2 %"', "[chain]", "chain.misfit_length", "needs a correlation length"),
    (IN_CHAIN, "measures_distance = 1", "measures", "chain.measures_distance", "found 1, expected true or false"),
    (IN_CHAIN, 'phase = "any"', "phase", "chain.phase", 'found "any", expected a quantity in s or "random"'),
    (IN_CHAIN, 'rate = "0 Hz"', "rate", "chain.rate", "expected a positive quantity in Hz"),
    (IN_CHAIN, "nois = 20", "nois", "chain.nois", 'found an unknown key, expected "noise"'),
    (IN_CHAIN, 'rate = "2 kHz"', 'rate = "1', "controller.rate", 'needs at least 2000 Hz, the rate of the sensor'),
    (IN_CHAIN, "noise = 0", "[controller]", "controller.floor", "of the noise, but the section [chain] has"),
    (IN_CONTROLLER, "", "[controller]", "controller", 'missing rate, expected one of rate = "1 kHz" and period'),
    (IN_CONTROLLER, 'rate = 1000\nperiod = "1 ms"', "period", "controller.period", "found both rate and period"),
    (IN_CONTROLLER, 'period = "5 ms"', "period", "controller.period", 'set rate = "200 Hz" in'),
    (IN_CONTROLLER, 'rate = "1 kHz"\nfloor = "1 mV"', "floor", "controller.floor", 'found "1 mV", expected counts'),
    (IN_CONTROLLER, 'rate = "1 kHz"\nfloor = 0', "floor", "controller.floor", "expected a positive sensor output"),
    (IN_CONTROLLER, "rate = 1000\nfloor = 3e4", "scale", "sensor.scale", "below the controller's floor of 3e+04"),
    (IN_CONTROLLER, "rate = 1000\nsaturation = 50", "satur", "controller.saturation", "the sum of offset and floor"),
    (IN_CONTROLLER, "rate = 1000\nmedian_window = 17", "median", "controller.median_window",
     "from 1 (no median filter) to 16"),
    (IN_CONTROLLER, "rate = 1000\nmedian_window = 3.0", "median", "controller.median_window", "a whole number of at l"),
    (IN_CONTROLLER, "rate = 1000\nlow_pass_order = 2", "[controller]", "controller.cutoff", "a low-pass filter of"),
    (IN_CONTROLLER, 'rate = 1000\nlow_pass_order = 2\ncutoff = "200 Hz"', "cutoff", "controller.cutoff",
     "expected less than 125 Hz, which is half of the sensor's sampling rate"),
    (IN_CONTROLLER, 'rate = 1000\ntimeout = "1 ms"', "timeout", "controller.timeout", "which is the time between"),
    (IN_CONTROLLER, 'rate = 1000\ngain = "-0.7 N"', "gain", "controller.gain", "expected a quantity in N*s"),
    (IN_CONTROLLER, "rate = 1000\ngain = 1e7", "gain", "controller.gain", "expected a gain between -1e6 and 1e6 N*s"),
    (IN_CONTROLLER, "rate = 1000\nlargest_force = 1e10", "largest_force", "controller.largest_force", "at most 1e+09"),
    (IN_CONTROLLER, "rate = 1000\ncontact_gain = 1.5", "contact_gain", "controller.contact_gain", "a fraction between"),
    (IN_CONTROLLER, 'rate = 1000\napproach_only = "yes"', "approach", "controller.approach_only", "true or false"),
    (IN_CONTROLLER, "rate = 1000\nsensor_period = 1", "sensor_p", "controller.sensor_period", "an unknown key"),
    ('kind = "impedance"', "", "[robot]", "robot.kind", 'missing, expected one of "ideal", "impedance", "position"'),
    ('"impedance"', '"impedence"', "kind", "robot.kind", 'did you mean "impedance"?'),
    ('"impedance"', '"position"', "stiffness", "robot.stiffness", 'to the variant "impedance" of'),
    ('mass = "4 kg"\n', "", "[robot]", "robot.mass", 'missing, expected a quantity in kg; add, for example'),
    ('"250 N*s/m"', '"250 N/m"', 'damping = "250', "robot.damping", "expected a quantity in N*s/m"),
    ('"250 N*s/m"', '1\nbandwidth = 80\nviscous_friction = 1', "viscous", "robot.viscous_friction", "only without a"),
    ('"250 N*s/m"', "1\nfeedforward = 0", "feedforward", "robot.feedforward", "found 0, expected true or false"),
    ('"hunt-crossley"', '"hertz"', 'kind = "hertz"', "contact.kind", 'found "hertz", expected one of "hunt-crossley"'),
    (STIFF, 'stiffness = "1e6 N/m"', 'stiffness = "1e', "contact.stiffness", 'N/m^1.5, such as "1e6 N/m^1.5"'),
    (STIFF, 'stiffness = "1e6 V/m^1.5"', 'stiffness = "1e', "contact.stiffness",
     "a positive quantity in the unit N/m^1.5"),
    (STIFF, "stiffness = -1", "stiffness = -1", "contact.stiffness", "a positive quantity in N/mⁿ"),
    (STIFF, "stiffness = 1e6\nexponent = 0.5", "exponent =", "contact.exponent", "found 0.5, which must be at least 1"),
    (STIFF, "stiffness = 1e6\ndamping = 1", "damping = 1", "contact.damping", 'to the variant "spring-damper" of'),
    ("runs = 500", "runs = 0", "runs", "verify.runs", "expected a whole number of at least 1, such as 1000"),
    ("runs = 500", "confidence = 95", "confidence", "verify.confidence", "expected a probability between 0 and 1"),
    ("runs = 500", "speed_tolerance = -0.1", "speed", "verify.speed_tolerance", "expected a nonnegative number"),
    (MARGIN, "runs = 5", "runs", "loop.runs", "found a key of [verify], expected only seed, horizon, follow_time"),
    (MARGIN, "seed = -1", "seed", "loop.seed", "expected a whole number of at least 0"),
    (MARGIN, 'horizon = "0 s"', "horizon", "loop.horizon", "expected a positive quantity in s"),
    (MARGIN, "stability_margin = 1", "stability", "loop.stability_margin", "margin of 1, expected a number above 1"),
    (MARGIN, 'stability_margin = "2 m"', "stability", "loop.stability_margin", 'found "2 m", expected a number'),
    ('[plant]\nposition = "0 m"', "[plant]\nmass = 4", "mass = 4", "plant.mass", "a key of [admittance] or [robot]"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "start", "key", "says"), MISTAKES)
def test_a_mistake_is_named_with_line_and_key(message, old, new, start, key, says):
    text = replaced(old, new, LOOPED)
    section = key.split(".")[0]
    first = text.splitlines().index(f"[{section}]")  # keys of one name stand in several sections
    rest = "\n".join(text.splitlines()[first:])
    told = message(text)
    line = next((line for line in told.splitlines() if f": {key}: " in line), told)
    place, _, sentence = line.partition(f": {key}: ")
    assert place == f"approach.toml, line {first + line_of(start, rest)}", told
    assert says in sentence
    assert re.search(r"\b(found|missing|only|needs|belongs to|but|expected)\b", sentence)


ODD = [
    "true",
    "-1",
    "0",
    "1e300",
    '"inf"',
    "nan",
    '""',
    '"5 V"',
    '"1 counts"',
    "[]",
    "{}",
    '[{ a = "1 V" }]',
    '"ideal"',
]


@pytest.mark.parametrize("value", ODD)
def test_whatever_stands_at_a_key_is_read_or_refused(write, value):
    lines = LOOPED.splitlines()
    for i, line in enumerate(lines):
        key = "sensor" if line == "[sensor]" else line.partition(" = ")[0]
        damaged = [*lines[:i], f"{key} = {value}", *lines[i + 1 :]]
        if line == "[sensor]":
            damaged = [damaged[0], *lines[5:]]
        elif line.startswith("["):
            continue
        told = ""
        try:
            load_scenario(write("\n".join(damaged) + "\n"))
        except ScenarioFileError as refused:
            told = str(refused)
        assert re.match(r"approach\.toml, line \d+: \w", told) or not told


def test_the_undamaged_file_is_read(write):
    assert load_scenario(write(LOOPED)).loop is not None
    assert load_scenario(write(ENCOUNTER)).loop is None


@pytest.mark.parametrize(
    ("sections", "named", "missing"),
    [
        (CHAIN, "chain", "controller"),
        (CONTROLLER, "controller", "chain"),
        (ROBOT, "robot", "chain"),
        (ROBOT, "robot", "controller"),
        (LOOP + CHAIN, "chain", "controller"),
        (ROBOT + CONTACT + CONTROLLER, "controller", "chain"),
        ("[verify]\nruns = 5\n", "verify", "controller"),
    ],
)
def test_a_part_of_a_loop_alone_is_refused(message, sections, named, missing):
    text, keys = ENCOUNTER + sections, {"chain": 'part = "VCNL4010" or rate =', "controller": 'rate = "1 kHz"'}
    place = f"line {line_of(f'[{named}]', text)}: {named}: the section [{named}] also needs the section [{missing}]"
    (told,) = (line for line in message(text).splitlines() if place in line)
    assert f"add, for example: [{missing}] with {keys[missing]}" in told


def test_a_misspelt_section_is_not_called_missing_as_well(message):
    told = message(LOOPED.replace("[controller]", "[controler]"))
    assert told.splitlines() == [told]
    assert "controler: found an unknown section, expected [controller]" in told
    told = message(LOOPED.replace("[robot]", "[robots]"))
    assert told.splitlines() == [told]  # and its contact is not one of an ideal robot


@pytest.mark.parametrize("robot", ["", '[robot]\nkind = "ideal"\n'])
def test_an_ideal_robot_has_no_contact(message, robot):
    text = LOOPED.replace(ROBOT, robot)
    told = message(text)
    assert (
        f"line {line_of('[contact]', text)}: contact: found a contact model for an ideal robot, which has no mass"
        in told
    )
    assert 'kind = "impedance" or kind = "position"' in told


def test_several_mistakes_are_told_at_once(message):
    text = LOOPED.replace('"20 counts"', '"20 mV"').replace(
        '"1 kHz"', '"1 kHz"\nmedian_window = 20\nlargest_force = 1e10'
    )
    text = text.replace('"250 N*s/m"', "1\nbandwidth = 80\nviscous_friction = 1").replace('"1.3e5 N/m^1.5"', '"1 m"')
    told = message(text).splitlines()
    keys = [line.split(": ")[1] for line in told]
    assert keys == [
        "chain.noise",
        "controller.median_window",
        "controller.largest_force",
        "robot.viscous_friction",
        "contact.stiffness",
    ]


def test_a_bare_curve_is_in_the_unit_of_the_part_and_must_be_of_its_size(write, message):
    bare = LOOPED.replace('"0.533 counts"', "0.533")
    assert load_scenario(write(bare)).sensor_part.unit == "counts"
    told = message(LOOPED.replace('"0.533 counts"', "1.30e-5"))
    assert (
        "line 3: sensor.scale: the sensor output at contact is 0.4877, which is below the controller's floor of 60"
        in told
    )
    assert "well above the floor. Give outputs, noise and floor in counts, the unit of VCNL4010" in told


def test_without_any_other_unit_the_outputs_of_a_loop_share_one(message):
    text = WHOLE + '[chain]\nrate = "250 Hz"\nnoise = "1 mV"\n[controller]\nrate = "1 kHz"\nfloor = "3 counts"\n'
    told = message(text)
    assert (
        f'controller.floor: found "3 counts", expected V, the unit of chain.noise, line {line_of("noise", text)}'
        in told
    )


def test_a_margin_belongs_to_one_admittance(message):
    told = message(replaced('stiffness = "25 N/m"', "stiffness = 25\ndamping_ratio_bounds = [0.7, 1]", LOOPED))
    assert "loop.stability_margin: found a margin together with bounds in [admittance]" in told


def test_a_margin_that_leaves_no_gain_is_placed(write):
    text = replaced(MARGIN, "stability_margin = 1000", LOOPED)
    problem = load_scenario(write(text))
    for verb in (lambda: pt.design(problem), lambda: pt.sweep(problem, {"obstacle.velocity": [-0.3, -0.2]})):
        with pytest.raises(ScenarioFileError) as refused:
            verb()
        told = str(refused.value)
        assert told.startswith(
            f"approach.toml, line {line_of('stability', text)}: loop.stability_margin: no gain within "
        )
        assert "has the required gain margin of 1000. At a sensor rate of " in told
        assert ". The bounds of [gain] are -10 to -0.01 N*s. Choose" in told


@pytest.mark.parametrize(
    "axes", [{"admittance.mass": [1, 2]}, {"start": {"obstacle.position": [0.03, 0.04], "obstacle.velocity": [-1, -2]}}]
)
def test_a_margin_does_not_hold_for_a_sweep_that_moves_the_limit(write, axes):
    with pytest.raises(ScenarioFileError, match=r"loop\.stability_margin: a sweep over the input \w+\.\w+"):
        pt.sweep(load_scenario(write(LOOPED)), axes)


def test_a_file_without_a_loop_has_no_limit_of_stability(write):
    problem = load_scenario(write(WHOLE))
    assert problem.stable_bounds() == problem.bounds
    with pytest.raises(ScenarioFileError, match=r"^approach\.toml: .*found no sections \[chain\] and \[controller\]"):
        pt.verify(problem)


def test_a_start_outside_of_the_limits_is_refused(message):
    text = replaced(IN_CONTROLLER, 'rate = "1 kHz"\nlargest_excursion = "1 mm"', LOOPED)
    text = text.replace('[plant]\nposition = "0 m"', '[plant]\nposition = "5 mm"')
    told = message(text)
    assert f"line {line_of('[controller]', text)}: controller: start: " in told


def test_a_curve_in_volts_takes_no_part_in_counts(message):
    told = message(LOOPED.replace('"0.533 counts"', '"13 uV"'))
    assert (
        "chain.part: the sensor component reports readings in counts, but the outputs of the sensor curve are in V"
        in told
    )
    table = '[sensor]\nmodel = "table"\ndistances = ["0 mm", "50 mm"]\noutputs = ["4 V", "1 V"]\n'
    told = message(LOOPED.replace(SENSOR.replace("1.30e-5", '"0.533 counts"'), table))
    assert "but the outputs of the sensor curve are in V (see the key sensor.outputs, line 4)" in told
