"""Every section of a scenario file: as it may be, and what contradicts itself in it."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import pretouch as pt
from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario
from pretouch.config.quantities import Quantity
from pretouch.config.schema import SECTIONS, keys_of, variants
from pretouch.config.section import REQUIRED
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, MittagLeffler, Recessed, Table
from refusals import refused
from scenario_text import ADMITTANCE, OBJECTIVE, SENSOR, WHOLE, error_of, line_of, places, replaced, writer


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


def test_every_model_is_built(write):
    def sensor(text):
        return load_scenario(write("[sensor]\n" + text + WHOLE.replace(SENSOR, ""))).sensor

    assert sensor('model = "exponential-1"\nscale = "458 mV"\nrate = "-61.0 /m"\n') == ExponentialFirstOrder(
        scale=0.458, rate=-61.0
    )
    assert sensor(
        'model = "exponential-2"\nscale = 0.48\nrate = "-0.074 1/mm"\ncurvature = "474 /m^2"\n'
        'maximum_distance = "70 mm"\n'
    ) == ExponentialSecondOrder(scale=0.48, rate=-74.0, curvature=474.0, maximum_distance=0.07)
    assert sensor('model = "mittag-leffler"\nscale = "2 counts"\nrate = -60\norder = 0.9\n') == MittagLeffler(
        scale=2.0, rate=-60.0, order=0.9
    )
    assert sensor('model = "table"\ndistances = ["0 mm", "5 cm"]\noutputs = ["4 V", "200 mV"]\n') == Table(
        distances=(0.0, 0.05), outputs=(4.0, 0.2)
    )
    recessed = sensor('model = "exponential-1"\nscale = 1\nrate = -60\nrecess = "5 mm"\nmaximum_distance = "inf m"\n')
    assert recessed == Recessed(sensor=ExponentialFirstOrder(scale=1.0, rate=-60.0), recess=0.005)


@pytest.mark.parametrize(
    ("sensor", "key"),
    [
        ('model = "table"\ndistances = ["0 m", "1 cm"]\noutputs = ["4 V", "3 counts"]\n', "outputs"),
        ('model = "table"\ndistances = ["0 m", "1 cm"]\noutputs = ["4 V", "5 V"]\n', "outputs"),
        ('model = "table"\ndistances = ["0 m"]\noutputs = ["4 V", "3 V"]\n', "distances"),
        ('model = "table"\ndistances = ["0 m", 1, 2]\noutputs = ["4 V", "3 V"]\n', "outputs"),
        ('model = "table"\ndistances = ["0 m", "1 s"]\noutputs = [2, 1]\n', "distances[1]"),
        ('model = "exponential-1"\nscale = 1\nrate = 60\n', "rate"),
        ('model = "mittag-leffler"\nscale = 1\nrate = -60\norder = 2\n', "order"),
        ('model = "exponential-1"\nscale = 1\nrate = -60\nrecess = "1 s"\n', "recess"),
        ('model = "exponential-1"\nscale = 1\nrate = -6\nmaximum_distance = "0 m"\n', "maximum_distance"),
    ],
)
def test_a_sensor_that_is_none_is_refused_at_its_key(write, sensor, key):
    text = "[sensor]\n" + sensor + WHOLE.replace(SENSOR, "")
    assert places(write(text))[0] == (line_of(key.split("[")[0], text), f"sensor.{key}")


def test_a_sensor_that_does_not_reach_contact_is_refused_with_the_way_out(write):
    table = 'model = "table"\ndistances = ["5 mm", "50 mm"]\noutputs = ["4 V", "1 V"]\n'
    (mistake,) = error_of(write("[sensor]\n" + table + WHOLE.replace(SENSOR, ""))).mistakes
    assert (mistake.line, mistake.key) == (1, "sensor")
    assert 'recess = "5 mm"' in mistake.sentence


def test_an_encounter_that_starts_beyond_the_sensor_is_refused(write):
    text = replaced("exponent = 3.32", 'exponent = 3.32\nmaximum_distance = "42 mm"')
    assert [key for _, key in places(write(text))] == ["obstacle.position"]


def test_natural_frequency_is_in_rad_per_second_and_never_in_hertz(write):
    def admittance(text):
        return WHOLE.replace(ADMITTANCE, "[admittance]\n" + text)

    for given_as in ('"5 rad/s"', '"5 1/s"', "5"):
        built = load_scenario(write(admittance(f'mass = "1 kg"\nnatural_frequency = {given_as}\n'))).scenario.admittance
        assert (built.damping, built.stiffness) == (10.0, 25.0)
    half = load_scenario(write(admittance("mass = 1\nnatural_frequency = 5\ndamping_ratio = 0.5\n"))).scenario
    assert half.admittance.damping == 5.0
    for given_as in ('"5 Hz"', '"5 kHz"'):
        assert places(write(admittance(f"mass = 1\nnatural_frequency = {given_as}\n"))) == [
            (8, "admittance.natural_frequency")
        ]


def test_objectives_and_impact_are_built(write):
    def objective(text, more=""):
        return WHOLE.replace(OBJECTIVE, "[objective]\n" + text) + more

    impact = '[impact]\nrobot_mass = "4 kg"\nobstacle_mass = "inf"\nstiffness = "10 kN/m"\n'
    hertz = '[impact]\nrobot_mass = "4 kg"\nobstacle_mass = 1\neffective_modulus = "10 MPa"\nradius = "10 mm"\n'
    time = load_scenario(write(objective('kind = "time"\ntime_scale = "1 s"\nvelocity_scale = "obstacle speed"\n')))
    assert [(t.quantity, t.scale) for t in time.objective.terms] == [
        ("time", 1.0),
        ("relative_velocity", "obstacle speed"),
    ]
    force = 'kind = "excursion"\nposition_scale = 1\nforce_scale = "100 N"\nforce_weight = 2\n'
    spring = load_scenario(write(objective(force, impact)))
    assert [(t.quantity, t.weight) for t in spring.objective.terms] == [("displacement", 1.0), ("impact_force", 2.0)]
    assert spring.impact.obstacle_mass == math.inf
    assert load_scenario(write(objective(force, hertz))).impact.radius == 0.01
    assert [key for _, key in places(write(objective(force)))] == ["objective.force_scale"]

    terms = 'kind = "custom"\nterms = [\n  { quantity = "time", scale = "1 s" },\n  %s,\n]\n'
    custom = load_scenario(write(objective(terms % '{ quantity = "largest_speed", scale = "1 m/s", weight = 3 }')))
    assert [(t.quantity, t.scale, t.weight) for t in custom.objective.terms] == [
        ("time", 1.0, 1.0),
        ("largest_speed", 1.0, 3.0),
    ]
    for wrong, key in [
        ('{ quantity = "largest_speed", scale = "1 m" }', ".scale"),
        ('{ quantity = "speed", scale = 1 }', ".quantity"),
        ('{ quantity = "time" }', ".scale"),
        ('{ quantity = "time", scale = 1, wait = 2 }', ".wait"),
        ('"time"', ""),
    ]:
        assert places(write(objective(terms % wrong)))[0] == (18, f"objective.terms[1]{key}")


def test_the_speed_of_an_obstacle_at_rest_is_no_scale(write):
    text = replaced('"-0.3 m/s"', "0", replaced('velocity_scale = "0.3 m/s"', 'velocity_scale = "obstacle speed"'))
    assert places(write(text)) == [(17, "objective.velocity_scale")]


def test_a_limit_that_needs_the_physical_mass_says_so(write):
    assert places(write(WHOLE + 'impact_force = "10 N"\n')) == [(27, "constraints.impact_force")]


def test_method_and_horizon(write):
    problem = load_scenario(write(WHOLE + '[motion]\nmethod = "integration"\nhorizon = "2 min"\n'))
    assert (problem.method, problem.horizon) == ("integration", 120.0)
    assert places(write(WHOLE + '[motion]\nmethod = "integrate"\n')) == [(28, "motion.method")]


def test_what_only_the_design_finds_out_is_placed_too(write):
    problem = load_scenario(write(WHOLE + '[motion]\nmethod = "closed-form"\n'))
    with refused("motion.method", error=ScenarioFileError):
        pt.design(problem)


def documented():
    """Read the tables of docs/reference/scenario-file.md: section -> key -> (unit, default)."""
    text = (Path(__file__).parents[2] / "docs" / "reference/scenario-file.md").read_text(encoding="utf-8")
    found = {}
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        if match := re.match(r"\[(\w+)\]", part):
            rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \|", part, flags=re.MULTILINE)
            assert len(rows) == len({key for key, _, _ in rows})
            found[match.group(1)] = {key: (unit.strip(), default.strip()) for key, unit, default in rows}
    return found


def test_the_reference_lists_every_section_and_key_and_no_other():
    assert {name: set(keys) for name, keys in documented().items()} == {name: set(keys_of(name)) for name in SECTIONS}


@pytest.mark.parametrize("section", SECTIONS)
def test_the_reference_gives_every_unit_and_default(section):
    for key, (unit, default) in documented()[section].items():
        # a key that several variants take means the same in each; `model` is optional beside a calibration only
        field = next(v.keys[key] for v in variants(section).values() if key in v.keys)
        if isinstance(field.read, Quantity):
            assert unit == (field.read.unit or "number"), key
        elif key != "no_object" and (section, key) != ("robot", "offset"):  # numbers with a unit, or words, or a list
            assert unit in {"text", "list", "table", "whole number", "number", "true or false"}, key
        if field.default is REQUIRED:
            assert default == "required", key
        elif field.default is None:
            assert default == "none", key
        elif isinstance(field.default, bool):
            assert default == str(field.default).lower(), key
        elif isinstance(field.default, str):
            assert default == f'`"{field.default}"`', key
        else:
            assert float(default) == field.default, key


def test_the_example_of_the_reference_is_read(write):
    text = (Path(__file__).parents[2] / "docs" / "reference/scenario-file.md").read_text(encoding="utf-8")
    example = re.search(r"```toml\n(.*?)```", text, flags=re.DOTALL).group(1)
    assert load_scenario(write(example)).bounds == (-10.0, -0.01)


def test_a_distance_without_a_unit_that_no_sensor_reaches_is_asked_about(write):
    """60 is 60 m; who means that says it. The largest number without a unit is 5."""
    error = error_of(write(replaced('"42.2 mm"', "60")))
    assert (error.argument, error.value) == ("obstacle.position", 60)
    assert load_scenario(write(replaced('"42.2 mm"', '"60 m"'))).scenario.distance == 60.0
    assert load_scenario(write(replaced('"42.2 mm"', "5"))).scenario.distance == 5.0
    for old, new, key in (
        ('position_scale = "0.5 m"', "position_scale = 200", "objective.position_scale"),
        ('excursion = "0.2 m"', "excursion = 200", "constraints.excursion"),
    ):
        error = error_of(write(replaced(old, new)))
        assert (error.argument, error.value) == (key, 200)


def test_an_object_that_recedes_is_told_that_an_approach_is_negative(write):
    found = pt.design(load_scenario(write(replaced('"-0.3 m/s"', '"0.3 m/s"'))))
    assert found.status.value == "no-contact"
    assert found.warnings[0].startswith("PT307")
