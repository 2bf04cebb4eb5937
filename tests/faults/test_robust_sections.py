"""[uncertainty] and [robust]: read in SI, or refused with line, key, what was found and what is expected."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario
from pretouch.designs import ConditionalValueAtRisk, Expected, Quantile, RobustOptions, WorstCase
from pretouch.uncertainty import CorrelatedNormal, Empirical, Interval, Normal, TruncatedNormal, Uniform
from refusals import refused
from scenario_text import SENSOR, WHOLE, line_of, places, replaced, writer

KNOWN = """\
[uncertainty]
obstacle.velocity = { normal = ["-0.3 m/s", "10 cm/s"], between = ["-0.6 m/s", "-0.05 m/s"] }
obstacle.position = { uniform = ["38 mm", "46 mm"] }
plant.velocity = { samples = ["2 cm/s", "0 m/s", "1 cm/s"] }
sensor.exponent = { normal = [3.32, 0.1] }
admittance.damping = { uniform = ["9 N*s/m", "11 N*s/m"] }
"""
ASKED = """\
[robust]
measure = "tail-mean"
probability = 0.9
required = { excursion = 0.99 }
seed = 7
"""
UNCERTAIN = WHOLE + KNOWN + ASKED


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


def test_what_is_known_is_read_in_si_and_in_the_order_of_the_file(write):
    asked = load_scenario(write(UNCERTAIN))
    assert list(asked.uncertainty.items()) == [
        ("obstacle.velocity", TruncatedNormal(location=-0.3, deviation=0.1, low=-0.6, high=-0.05)),
        ("obstacle.position", Uniform(low=0.038, high=0.046)),
        ("plant.velocity", Empirical(samples=(0.0, 0.01, 0.02))),
        ("sensor.exponent", Normal(mean=3.32, deviation=0.1)),
        ("admittance.damping", Uniform(low=9.0, high=11.0)),
    ]
    assert [(r.constraint.name, r.probability) for r in asked.constraints] == [("excursion", 0.99)]
    measure = ConditionalValueAtRisk(probability=0.9)
    assert asked.robust == RobustOptions(measure=measure, samples=4096, validation=4096, seed=7)


def test_one_side_may_be_open_and_tables_may_be_sections(write):
    text = '[uncertainty.obstacle.velocity]\nnormal = [-0.3, 0.1]\nbetween = ["-inf", "-0.05 m/s"]\n'
    known = load_scenario(write(WHOLE + text)).uncertainty
    assert known == {"obstacle.velocity": TruncatedNormal(location=-0.3, deviation=0.1, high=-0.05)}


@pytest.mark.parametrize(
    ("text", "measure"),
    [
        ("", Expected()),
        ('measure = "expected"', Expected()),
        ('measure = "quantile"\nprobability = 0.9', Quantile(probability=0.9)),
        ('measure = "worst-case"', WorstCase()),
    ],
)
def test_every_measure_is_built(write, text, measure):
    asked = load_scenario(write(WHOLE + KNOWN + "[robust]\n" + text + "\n"))
    assert asked.robust.measure == measure
    assert asked.constraints == load_scenario(write(WHOLE)).constraints


def test_an_interval_is_for_the_worst_case(write):
    text = '[uncertainty]\nobstacle.velocity = { interval = [-0.4, -0.2] }\n[robust]\nmeasure = "worst-case"\n'
    assert load_scenario(write(WHOLE + text)).uncertainty == {"obstacle.velocity": Interval(low=-0.4, high=-0.2)}


def test_a_file_that_says_nothing_of_it_is_designed_and_not_robustly(write):
    problem = load_scenario(write(WHOLE))
    assert problem.uncertainty == {}
    with refused("uncertainty", error=ScenarioFileError):
        pt.robust(problem)


def test_the_nominal_design_does_not_see_it(write):
    assert pt.design(load_scenario(write(UNCERTAIN))).gain == pt.design(load_scenario(write(WHOLE))).gain


def test_a_robust_design_is_that_of_the_file(write):
    problem = load_scenario(write(UNCERTAIN.replace("seed = 7", "seed = 7\nsamples = 64\nvalidation = 32")))
    found = pt.robust(problem)
    assert (found.samples, found.seed, found.validation.samples) == (64, 7, 32)
    assert list(found.uncertainty) == list(problem.uncertainty)
    other = pt.robust(problem.replace(robust=replace(problem.robust, samples=16, seed=1, validation=16)))
    assert (other.samples, other.seed, other.validation.samples) == (16, 1, 16)
    assert other.gain != found.gain


# (what is replaced, by what, the start of the line that is named, key)
MISTAKES = [
    ('"10 cm/s"', '"10 cm"', "obstacle.vel", "uncertainty.obstacle.velocity.normal[1]"),
    ('"10 cm/s"', '"-10 cm/s"', "obstacle.vel", "uncertainty.obstacle.velocity.normal"),
    (', "10 cm/s"', "", "obstacle.vel", "uncertainty.obstacle.velocity.normal"),
    ('"-0.6 m/s"', '"0 m/s"', "obstacle.vel", "uncertainty.obstacle.velocity.between"),
    ("normal = [3.32", "uniform = [3.32", "sensor.exp", "uncertainty.sensor.exponent.uniform"),
    ("{ normal = [3.32, 0.1] }", "{ norml = [1, 2] }", "sensor.exp", "uncertainty.sensor.exponent.norml"),
    ("{ normal = [3.32, 0.1] }", "{}", "sensor.exp", "uncertainty.sensor.exponent"),
    ("{ normal = [3.32, 0.1] }", "3.3", "sensor.exp", "uncertainty.sensor.exponent"),
    ("[3.32, 0.1] }", "[3.32, 0.1], uniform = [3, 4] }", "sensor.exp", "uncertainty.sensor.exponent"),
    ('{ uniform = ["38', '{ between = [0, 1], uniform = ["38', "obstacle.p", "uncertainty.obstacle.position.between"),
    ('["2 cm/s", "0 m/s", "1 cm/s"]', '["2 cm/s"]', "plant.v", "uncertainty.plant.velocity.samples"),
    ("sensor.exponent", "sensor.rate", "sensor.rate", "uncertainty.sensor.rate"),
    ("sensor.exponent", "sensor.order", "sensor.order", "uncertainty.sensor.order"),
    ("sensor.exponent = { normal = [3.32, 0.1] }", 'sensor = "calibration"', "sensor =", "uncertainty.sensor"),
    (
        "sensor.exponent = { normal = [3.32, 0.1] }",
        'sensor.parameters = "fit"',
        "sensor.par",
        "uncertainty.sensor.parameters",
    ),
    (
        "sensor.exponent = { normal = [3.32, 0.1] }",
        'sensor.parameters = "calibration"',
        "sensor.par",
        "uncertainty.sensor.parameters",
    ),
    ("obstacle.position =", "obstacle.positon =", "obstacle.positon", "uncertainty.obstacle.positon"),
    ("plant.velocity", "plnt.velocity", "plnt", "uncertainty.plnt"),
    (
        "admittance.damping = { uniform",
        "admittance.damping = { interval",
        "admittance.d",
        "uncertainty.admittance.damping.interval",
    ),
    ('["9 N*s/m", "11 N*s/m"]', '["-11 N*s/m", "-9 N*s/m"]', "[uncertainty]", "uncertainty"),
    (
        "admittance.damping = {",
        "admittance.natural_frequency = { uniform = [4, 6] }\nadmittance.damping = {",
        "[uncertainty]",
        "uncertainty",
    ),
    ('"tail-mean"', '"mean"', "measure", "robust.measure"),
    ("probability = 0.9", "", "[robust]", "robust"),
    ("probability = 0.9", "probability = 1.0", "probability", "robust.probability"),
    ('"tail-mean"', '"expected"', "probability", "robust.probability"),
    ("seed = 7", "seed = -1", "seed", "robust.seed"),
    ("seed = 7", "seed = true", "seed", "robust.seed"),
    ("seed = 7", "samples = 1", "samples", "robust.samples"),
    ("seed = 7", "samples = 4e3", "samples", "robust.samples"),
    ("seed = 7", 'sampling = "grid"', "sampling", "robust.sampling"),
    ("seed = 7", "confidence = 95", "confidence", "robust.confidence"),
    ("seed = 7", "sed = 7", "sed", "robust.sed"),
    ("{ excursion = 0.99 }", "{ excursion = 99 }", "required", "robust.required.excursion"),
    ("{ excursion = 0.99 }", "{ excursn = 0.9 }", "required", "robust.required.excursn"),
    ("{ excursion = 0.99 }", "{ time = 0.9 }", "required", "robust.required.time"),
    ("{ excursion = 0.99 }", "0.9", "required", "robust.required"),
]


@pytest.mark.parametrize(("old", "new", "start", "key"), MISTAKES)
def test_a_mistake_is_named_with_line_and_key(write, old, new, start, key):
    text = replaced(old, new, UNCERTAIN)
    assert (line_of(start, text), key) in places(write(text))


def test_robust_without_uncertainty_is_refused(write):
    assert (27, "robust") in places(write(WHOLE + "[robust]\nseed = 1\n"))
    assert (27, "uncertainty") in places(write(WHOLE + "[uncertainty]\n"))


def test_what_only_sampling_finds_out_is_placed_too(write):
    wide = replaced("[3.32, 0.1]", "[3.32, 2.0]", UNCERTAIN)
    with refused("uncertainty", error=ScenarioFileError, limit=(0.0, math.inf)) as caught:
        pt.robust(load_scenario(write(wide)))
    assert caught.value.value < 0
    assert [m.line for m in caught.value.mistakes] == [line_of("[uncertainty]", wide)]


# --- the covariance of a calibration

FITTED = '[sensor]\ncalibration = "sensor.csv"\nmodel = "inverse-power"\nminimum_distance = 0\n'


def readings(folder: Path, exponent: float = 2.2) -> None:
    random = np.random.default_rng(2)
    rows = ["distance [mm],output [V]"]
    for d in np.repeat(np.arange(0, 62, 2), 4):
        signal = 1e-3 / (1e-3 * d + 0.02) ** exponent
        rows.append(
            f"{d},{0.1 + signal * (1 + 0.005 * random.standard_normal()) + 5e-4 * random.standard_normal():.5f}"
        )
    rows += [f"inf,{0.1 + 5e-4 * random.standard_normal():.5f}" for _ in range(30)]
    (folder / "sensor.csv").write_text("\n".join(rows) + "\n")


def test_the_covariance_of_a_calibration_is_taken(write, tmp_path):
    readings(tmp_path)
    text = WHOLE.replace(SENSOR, FITTED) + '[uncertainty]\nsensor.parameters = "calibration"\n'
    problem = load_scenario(write(text))
    known = problem.uncertainty["calibration"]
    assert isinstance(known, CorrelatedNormal)
    assert known.names == ("sensor.distance_offset", "sensor.exponent")
    best = problem.calibration.best
    np.testing.assert_array_equal(known.covariance, best.covariance[1:, 1:])
    found = pt.robust(problem.replace(robust=replace(problem.robust, samples=128, validation=128)))
    assert found.gain == pytest.approx(found.nominal_gain, rel=0.05)
    own = text + 'sensor.recess = { uniform = ["0 mm", "1 mm"] }\n'
    recessed = own.replace("minimum_distance = 0", 'minimum_distance = "0 mm"\nrecess = "0.5 mm"')
    assert list(load_scenario(write(recessed)).uncertainty) == ["calibration", "sensor.recess"]
    twice = places(write(text + "sensor.exponent = { normal = [2.2, 0.1] }\n"))
    assert "uncertainty.sensor.exponent" in [key for _, key in twice]


def test_a_curve_whose_parameters_run_away_has_no_covariance(write, tmp_path):
    rows = ["distance [mm],output [V]"]
    random = np.random.default_rng(1)
    distances = np.repeat(np.arange(0, 60, 4), 3)
    # an exponential: exponent and offset of a power law have no bound
    rows += [f"{d},{np.exp(-0.04 * d) * (1 + 0.01 * random.standard_normal()):.5f}" for d in distances]
    (tmp_path / "sensor.csv").write_text("\n".join(rows) + "\n")
    text = WHOLE.replace(SENSOR, FITTED.replace("mini", 'offset = "zero"\nmini')) + (
        '[uncertainty]\nsensor.parameters = "calibration"\n'
    )
    assert (line_of("sensor.par", text), "uncertainty.sensor.parameters") in places(write(text))
