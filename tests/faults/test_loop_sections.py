"""[chain], [controller], [robot], [contact], [loop]: what contradicts itself is refused with line, key and sentence."""

from __future__ import annotations

import re

import pytest

import pretouch as pt
from loop_text import CHAIN, CONTACT, CONTROLLER, ENCOUNTER, LOOP, LOOPED, ROBOT
from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario
from refusals import refused
from scenario_text import SENSOR, WHOLE, error_of, line_of, places, replaced, writer


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


DAMPING = '"250 N*s/m"'
IN_CHAIN, IN_CONTROLLER = 'noise = "20 counts"', 'rate = "1 kHz"'
STIFF, MARGIN = 'stiffness = "1.3e5 N/m^1.5"', "stability_margin = 2.0"


def controlled(*lines: str) -> str:
    """Return the rate of the controller, and more lines of its section."""
    return "\n".join(("rate = 1000", *lines))


def damped(*lines: str) -> str:
    """Return a value of the robot's damping, and more lines of its section."""
    return "\n".join(("1", *lines))


# (what is replaced, by what, the start of the line that is named, key)
MISTAKES = [
    ('part = "VCNL4010"', "", "[chain]", "chain"),
    ('"VCNL4010"', '"VNCL4010"', "part", "chain.part"),
    ('"VCNL4010"', "4010", "part", "chain.part"),
    ('"VCNL4010"', '"RPR-220"', "part", "chain.part"),
    (IN_CHAIN, 'noise = "20 mV"', "noise", "chain.noise"),
    (IN_CHAIN, 'noise = "-1 counts"', "noise", "chain.noise"),
    (IN_CHAIN, "noise = true", "noise", "chain.noise"),
    (IN_CHAIN, 'drift = "2 V/s"', "drift", "chain.drift"),
    (IN_CHAIN, 'drift = "2 counts"', "drift", "chain.drift"),
    (IN_CHAIN, 'exposure = "5 ms"', "exposure", "chain.exposure"),
    (IN_CHAIN, 'jitter = "2 ms"', "jitter", "chain.jitter"),
    (IN_CHAIN, "dropout = 1", "dropout", "chain.dropout"),
    (IN_CHAIN, 'highest = "-1 counts"', "highest", "chain.highest"),
    (IN_CHAIN, 'noise = 1\nhighest = "2 counts"', "highest", "chain.highest"),
    (IN_CHAIN, 'distance_noise = "1 mm"', "[chain]", "chain"),
    (IN_CHAIN, 'noise = 20\nmisfit = "2 %"', "[chain]", "chain.misfit_length"),
    (IN_CHAIN, "measures_distance = 1", "measures", "chain.measures_distance"),
    (IN_CHAIN, 'phase = "any"', "phase", "chain.phase"),
    (IN_CHAIN, 'rate = "0 Hz"', "rate", "chain.rate"),
    (IN_CHAIN, "nois = 20", "nois", "chain.nois"),
    (IN_CHAIN, 'rate = "2 kHz"', 'rate = "1', "controller.rate"),
    (IN_CHAIN, "noise = 0", "[controller]", "controller.floor"),
    (IN_CONTROLLER, "", "[controller]", "controller"),
    (IN_CONTROLLER, controlled('period = "1 ms"'), "period", "controller.period"),
    (IN_CONTROLLER, 'period = "5 ms"', "period", "controller.period"),
    (IN_CONTROLLER, controlled('floor = "1 mV"'), "floor", "controller.floor"),
    (IN_CONTROLLER, controlled("floor = 0"), "floor", "controller.floor"),
    (IN_CONTROLLER, controlled("floor = 3e4"), "scale", "sensor.scale"),
    (IN_CONTROLLER, controlled("saturation = 50"), "satur", "controller.saturation"),
    (IN_CONTROLLER, controlled("median_window = 17"), "median", "controller.median_window"),
    (IN_CONTROLLER, controlled("median_window = 3.0"), "median", "controller.median_window"),
    (IN_CONTROLLER, controlled("low_pass_order = 2"), "[controller]", "controller.cutoff"),
    (IN_CONTROLLER, controlled("low_pass_order = 2", 'cutoff = "200 Hz"'), "cutoff", "controller.cutoff"),
    (IN_CONTROLLER, controlled('timeout = "1 ms"'), "timeout", "controller.timeout"),
    (IN_CONTROLLER, controlled('gain = "-0.7 N"'), "gain", "controller.gain"),
    (IN_CONTROLLER, controlled("gain = 1e7"), "gain", "controller.gain"),
    (IN_CONTROLLER, controlled("largest_force = 1e10"), "largest_force", "controller.largest_force"),
    (IN_CONTROLLER, controlled("contact_gain = 1.5"), "contact_gain", "controller.contact_gain"),
    (IN_CONTROLLER, controlled('approach_only = "yes"'), "approach", "controller.approach_only"),
    (IN_CONTROLLER, controlled("sensor_period = 1"), "sensor_p", "controller.sensor_period"),
    ('kind = "impedance"', "", "[robot]", "robot.kind"),
    ('"impedance"', '"impedence"', "kind", "robot.kind"),
    ('"impedance"', '"position"', "stiffness", "robot.stiffness"),
    ('mass = "4 kg"\n', "", "[robot]", "robot.mass"),
    (DAMPING, '"250 N/m"', 'damping = "250', "robot.damping"),
    (DAMPING, damped("bandwidth = 80", "viscous_friction = 1"), "viscous", "robot.viscous_friction"),
    (DAMPING, damped("feedforward = 0"), "feedforward", "robot.feedforward"),
    ('"hunt-crossley"', '"hertz"', 'kind = "hertz"', "contact.kind"),
    (STIFF, 'stiffness = "1e6 N/m"', 'stiffness = "1e', "contact.stiffness"),
    (STIFF, 'stiffness = "1e6 V/m^1.5"', 'stiffness = "1e', "contact.stiffness"),
    (STIFF, "stiffness = -1", "stiffness = -1", "contact.stiffness"),
    (STIFF, "stiffness = 1e6\nexponent = 0.5", "exponent =", "contact.exponent"),
    (STIFF, "stiffness = 1e6\ndamping = 1", "damping = 1", "contact.damping"),
    ("runs = 500", "runs = 0", "runs", "verify.runs"),
    ("runs = 500", "confidence = 95", "confidence", "verify.confidence"),
    ("runs = 500", "speed_tolerance = -0.1", "speed", "verify.speed_tolerance"),
    (MARGIN, "runs = 5", "runs", "loop.runs"),
    (MARGIN, "seed = -1", "seed", "loop.seed"),
    (MARGIN, 'horizon = "0 s"', "horizon", "loop.horizon"),
    (MARGIN, "stability_margin = 1", "stability", "loop.stability_margin"),
    (MARGIN, 'stability_margin = "2 m"', "stability", "loop.stability_margin"),
    ('[plant]\nposition = "0 m"', "[plant]\nmass = 4", "mass = 4", "plant.mass"),
]


@pytest.mark.parametrize(("old", "new", "start", "key"), MISTAKES)
def test_a_mistake_is_named_with_line_and_key(write, old, new, start, key):
    text = replaced(old, new, LOOPED)
    section = key.split(".")[0]
    first = text.splitlines().index(f"[{section}]")  # keys of one name stand in several sections
    rest = "\n".join(text.splitlines()[first:])
    assert (first + line_of(start, rest), key) in places(write(text))


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
def test_a_part_of_a_loop_alone_is_refused(write, sections, named, missing):
    text = ENCOUNTER + sections
    mistakes = error_of(write(text)).mistakes
    line = line_of(f"[{named}]", text)
    assert any((m.line, m.key) == (line, named) and f"[{missing}]" in m.sentence for m in mistakes)


def test_a_misspelt_section_is_not_called_missing_as_well(write):
    for section in ("controller", "robot"):  # its contact is not one of an ideal robot
        (place,) = places(write(LOOPED.replace(f"[{section}]", f"[{section}s]")))
        assert place[1] == f"{section}s"


@pytest.mark.parametrize("robot", ["", '[robot]\nkind = "ideal"\n'])
def test_an_ideal_robot_has_no_contact(write, robot):
    text = LOOPED.replace(ROBOT, robot)
    assert places(write(text)) == [(line_of("[contact]", text), "contact")]


def test_several_mistakes_are_told_at_once(write):
    text = replaced(IN_CHAIN, 'noise = "20 mV"', LOOPED)
    text = replaced(IN_CONTROLLER, controlled("median_window = 20", "largest_force = 1e10"), text)
    text = replaced(DAMPING, damped("bandwidth = 80", "viscous_friction = 1"), text)
    text = replaced(STIFF, 'stiffness = "1 m"', text)
    assert [key for _, key in places(write(text))] == [
        "chain.noise",
        "controller.median_window",
        "controller.largest_force",
        "robot.viscous_friction",
        "contact.stiffness",
    ]


def test_a_bare_curve_is_in_the_unit_of_the_part_and_must_be_of_its_size(write):
    bare = LOOPED.replace('"0.533 counts"', "0.533")
    assert load_scenario(write(bare)).sensor_part.unit == "counts"
    assert places(write(LOOPED.replace('"0.533 counts"', "1.30e-5"))) == [(3, "sensor.scale")]


def test_without_any_other_unit_the_outputs_of_a_loop_share_one(write):
    text = WHOLE + '[chain]\nrate = "250 Hz"\nnoise = "1 mV"\n[controller]\nrate = "1 kHz"\nfloor = "3 counts"\n'
    sentences = {m.key: m.sentence for m in error_of(write(text)).mistakes}
    assert f"line {line_of('noise', text)}" in sentences["controller.floor"]  # the key that has another unit


def test_a_margin_belongs_to_one_admittance(write):
    text = replaced('stiffness = "25 N/m"', "stiffness = 25\ndamping_ratio_bounds = [0.7, 1]", LOOPED)
    assert [key for _, key in places(write(text))] == ["loop.stability_margin"]


def test_a_margin_that_leaves_no_gain_is_placed(write):
    text = replaced(MARGIN, "stability_margin = 1000", LOOPED)
    problem = load_scenario(write(text))
    for verb in (lambda: pt.design(problem), lambda: pt.sweep(problem, {"obstacle.velocity": [-0.3, -0.2]})):
        with refused("loop.stability_margin", error=ScenarioFileError) as caught:
            verb()
        assert [m.line for m in caught.value.mistakes] == [line_of("stability", text)]


@pytest.mark.parametrize(
    "axes", [{"admittance.mass": [1, 2]}, {"start": {"obstacle.position": [0.03, 0.04], "obstacle.velocity": [-1, -2]}}]
)
def test_a_margin_does_not_hold_for_a_sweep_that_moves_the_limit(write, axes):
    with refused("loop.stability_margin", error=ScenarioFileError):
        pt.sweep(load_scenario(write(LOOPED)), axes)


def test_a_file_without_a_loop_has_no_limit_of_stability(write):
    problem = load_scenario(write(WHOLE))
    assert problem.stable_bounds() == problem.bounds
    with refused("loop", error=ScenarioFileError):
        pt.verify(problem)


def test_a_start_outside_of_the_limits_is_refused(write):
    text = replaced(IN_CONTROLLER, controlled('largest_excursion = "1 mm"'), LOOPED)
    text = text.replace('[plant]\nposition = "0 m"', '[plant]\nposition = "5 mm"')
    assert (line_of("[controller]", text), "controller") in places(write(text))


def test_a_curve_in_volts_takes_no_part_in_counts(write):
    assert "chain.part" in [key for _, key in places(write(LOOPED.replace('"0.533 counts"', '"13 uV"')))]
    table = '[sensor]\nmodel = "table"\ndistances = ["0 mm", "50 mm"]\noutputs = ["4 V", "1 V"]\n'
    mistakes = error_of(write(LOOPED.replace(SENSOR.replace("1.30e-5", '"0.533 counts"'), table))).mistakes
    assert any(m.key == "chain.part" and "sensor.outputs, line 4" in m.sentence for m in mistakes)
