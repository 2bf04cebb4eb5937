"""What a calibration leaves open stands in text, JSON and page of every verb that uses the sensor."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from command_text import SCENARIO, command, lay_out, strict

import pretouch as pt
from page_checks import assert_sound

REST = "\n".join(SCENARIO.splitlines()[4:])
BESIDE = """
[uncertainty]
obstacle.velocity = { uniform = ["-0.31 m/s", "-0.29 m/s"] }
[robust]
samples = 32
[chain]
rate = "1 kHz"
[controller]
rate = "1 kHz"
[verify]
runs = 8
"""
VERBS = {
    "design": (),
    "robust": (),
    "pareto": (),
    "simulate": (),
    "verify": ("--no-changes",),
    "sweep": ("--axis", "obstacle.velocity=-0.3:-0.2:2"),
}
CLIPPED = 'calibration = "clipped.csv"\nmodel = "exponential-1"'
WHOLE = 'calibration = "sensor.csv"\nmodel = "exponential-1"\nmaximum_distance = "60 mm"'
UNSUPPORTED = (
    "PT202: Not supported by data: this result uses the fitted exponential-1 curve where the calibration has no "
    "usable readings: from "
)


def scenario(name: str, sensor: str, *changes: tuple[str, str]) -> str:
    text = f"[sensor]\n{sensor}\n{REST}{BESIDE}"
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    Path(name).write_text(text)
    return name


def near_end() -> tuple[str, str]:
    """Where the window of `clipped.csv` starts, and why, as the calibration says it."""
    window = pt.load_scenario(scenario("asked.toml", CLIPPED + '\nminimum_distance = "0 mm"')).calibration.window
    assert "clip" in window.start_reason
    return f"{1e3 * window.l_min:.4g} mm", window.start_reason


@pytest.fixture
def run(tmp_path, monkeypatch, capsys, short_rest):
    """Lay out `sensor.csv`, which falls from contact to 56 mm, and `clipped.csv`, the same clipped up to 8 mm."""
    lay_out(tmp_path, monkeypatch)
    head, *rows = Path("sensor.csv").read_text().splitlines()
    clipped = (f"{distance},{min(float(output), 1.25)}" for distance, output in (row.split(",") for row in rows))
    Path("clipped.csv").write_text("\n".join([head, *clipped]) + "\n")
    # The texts do not depend on the number of possible sensor curves that a verdict simulates.
    monkeypatch.setattr("pretouch.verification.calibration_check._DRAWS", 20)
    return command(monkeypatch, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_says_what_the_calibration_leaves_open(run, verb):
    file = scenario("whole.toml", WHOLE)
    report = pt.load_scenario(file).calibration
    whole = () if verb == "sweep" else ("--verbose",)
    code, out, _ = run(verb, file, *VERBS[verb], *whole)
    assert code == 0
    assert not out.startswith("Not supported")
    assert f"calibration sensor.csv: {report.verdict}\n" in out
    for reason in report.reasons:
        assert f"  - {reason}\n" in out
    assert f"to 56 mm ({report.window.end_reason})" in out
    assert (
        f"the controller and exported laws subtract the {report.offset.kind} offset from each reading: "
        f"{report.offset.value:.4g} ± " in out
    )
    if verb != "sweep":
        words = assert_sound(Path(f"whole-{verb}.html").read_text(encoding="utf-8")).words
        assert "Not supported by data" not in words
        assert "Data support the exponential-1 curve from contact (first measured distance) to 56 mm" in words
    told = strict(run(verb, file, *VERBS[verb], "--json")[1])
    known = told["calibration"]
    assert (known["verdict"], known["reasons"]) == (report.verdict, list(report.reasons))
    assert known["offset"]["value"] == report.offset.value
    assert (known["offset"]["kind"], known["output_unit"]) == ("measured", "V")
    assert known["supported"] == [report.window.l_min, report.window.l_max]
    assert (known["headline"], known["is_contact_supported"], known["share_beyond"]) == (None, True, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_says_first_where_no_data_support_its_answer(run, verb):
    file = scenario("clipped.toml", CLIPPED + '\nminimum_distance = "0 mm"')
    whole = () if verb == "sweep" else ("--verbose",)
    _, out, _ = run(verb, file, *VERBS[verb], *whole)
    first = out.splitlines()[0]
    near, reason = near_end()
    assert f"{UNSUPPORTED}{near} ({reason}) to contact at 0 mm." in first
    assert "Not supported by the readings: " in first  # they are flat near contact, and the extended curve is not
    assert f"mount the sensor {near} behind the contact surface, and set recess =" in first
    without_force = f"If no virtual force acted at distances below {near}, the contact speed would be "
    assert (without_force in first) == (verb != "pareto")
    if verb != "sweep":
        words = assert_sound(Path(f"clipped-{verb}.html").read_text(encoding="utf-8")).words
        top = words.index(UNSUPPORTED + near)
        assert top < words.index("D_p")
        assert "Sensor calibration: clipped.csv" in words
        assert "The controller and exported laws subtract the " in words
        brief = run(verb, file, *VERBS[verb], "--no-report")[1]
        assert " ".join(brief.split()).startswith(first), "the summary begins with it, too"
        offset = pt.load_scenario(file).calibration.offset.value
        subtracted = f"the controller and exported laws subtract the offset {offset:.4g} V"
        ending = f"Calibration clipped.csv: usable, but not accurate enough for this contact speed; {subtracted} "
        assert ending in " ".join(brief.split())
    told = strict(run(verb, file, *VERBS[verb], "--json")[1])
    assert next(iter(told)) == "headline"
    assert told["headline"].startswith(first)
    assert told["calibration"]["headline"] == first
    assert told["calibration"]["is_contact_supported"] is False


def test_an_offset_of_the_controller_is_named_instead_of_that_of_the_calibration(run):
    """The exported law subtracts the offset of the controller."""
    file = scenario("offset.toml", WHOLE, ("[controller]", '[controller]\noffset = "20 mV"'))
    task = pt.load_scenario(file)
    measured = task.calibration.offset.value
    assert task.subtracted_offset == task.loop.law.conditioning.offset == 0.02 != pytest.approx(measured)
    _, out, _ = run("design", file, "--no-report", "--verbose")
    assert "the controller and exported laws subtract 0.02 V from each reading, the offset of the scenario" in out
    assert f"the measured offset of the calibration is {measured:.4g} ± " in out
    brief = " ".join(run("design", file)[1].split())
    assert f"with an offset of {measured:.4g} V; the controller and exported laws subtract 0.02 V, " in brief
    assert "subtract 0.02 V from each reading" in assert_sound(Path("offset-design.html").read_text()).words
    told = strict(run("design", file, "--json")[1])["calibration"]
    assert (told["subtracted_offset"], told["offset"]["value"]) == (0.02, measured)
    told = strict(run("design", scenario("same.toml", WHOLE), "--json")[1])["calibration"]
    assert told["subtracted_offset"] == told["offset"]["value"] == measured


def test_a_calibration_is_fitted_once_by_a_command_and_again_if_it_changes(run, monkeypatch):
    fitted, fit = [], pt.calibration.fit

    def counted(calibration, *more, **options):
        fitted.append(len(calibration.outputs))
        return fit(calibration, *more, **options)

    monkeypatch.setattr("pretouch.calibration.fit", counted)
    text = Path("sensor.csv").read_text().replace("distance [mm]", "l [mm]")  # as no other test has it
    Path("own.csv").write_text(text)
    assert run("init", "own.csv")[0] == 0  # reads it three times
    Path("own.csv").write_text("\n".join(text.splitlines()[:-1]) + "\n")
    first = pt.load_scenario("scenario.toml").calibration
    section = Path("scenario.toml").read_text().replace('own.csv"', 'own.csv"\nfloor_sigmas = 4.0')
    Path("stricter.toml").write_text(section)
    assert pt.load_scenario("stricter.toml").calibration != first
    readings = len(text.splitlines()) - 9  # of an object, and 8 without
    assert fitted == [readings] * 3


@pytest.mark.parametrize("verb", VERBS)
def test_a_sensor_given_by_numbers_says_nothing_of_a_calibration(run, verb):
    Path("numbers.toml").write_text(SCENARIO.replace("scale = 0.458", 'scale = "0.458 V"') + BESIDE)
    told = strict(run(verb, "numbers.toml", *VERBS[verb], "--json")[1])
    assert "calibration" not in told
    assert verb == "verify" or "headline" not in told


def test_a_start_beyond_the_data_is_said_first_where_it_is_decisive(run):
    head, *rows = Path("sensor.csv").read_text().splitlines()
    near = [row for row in rows if row.startswith("inf") or float(row.split(",")[0]) <= 20]
    Path("near.csv").write_text("\n".join([head, *near]) + "\n")
    sensor = 'calibration = "near.csv"\nmodel = "exponential-1"\nmaximum_distance = "60 mm"'
    _, out, _ = run("design", scenario("far.toml", sensor), "--no-report", "--verbose")
    # of a constant slope the impulse is that of the distances: 22.2 of 42.2 mm
    assert out.startswith(
        UNSUPPORTED
        + "the start at 42.2 mm to 20 mm (last measured distance). The sensor curve beyond 20 mm contributes 53 % of "
        "the impulse"
    )
    assert (
        "To remove this warning, calibrate the sensor up to a distance of 42.2 mm with more readings at each "
        "distance, or start the encounter at 20 mm." in out
    )
    _, out, _ = run("design", scenario("less.toml", sensor, ("42.2 mm", "20.9 mm")), "--no-report", "--verbose")
    assert out.startswith("Optimal gain")
    assert (
        "at distances beyond 20 mm, the sensor curve is extrapolated; this part of the curve contributes 4.3 % of"
        in out
    )


def test_a_motion_that_leaves_the_data_names_the_calibration(run):
    away = ('velocity = "-0.3 m/s"', 'velocity = "0.3 m/s"'), ('"-0.31 m/s", "-0.29 m/s"', '"0.29 m/s", "0.31 m/s"')
    file = scenario("away.toml", CLIPPED + '\nrecess = "12 mm"', *away)
    code, out, _ = run("design", file, "--no-report", "--verbose")
    assert code == 1
    assert out.startswith(
        "PT203: The object recedes at the start. For an approach, give the obstacle a negative velocity. "
        "PT202: Not supported by data: the motion leaves the calibrated distances before contact. The calibration "
        "supports the fitted "
    )


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("verb", VERBS)
def test_a_contact_nearer_than_the_data_is_refused_with_the_calibration_as_the_reason(run, verb):
    code, _, err = run(verb, scenario("clipped.toml", CLIPPED), *VERBS[verb])
    near, reason = near_end()
    assert code == 2
    assert (
        f"the sensor curve starts at the distance {near} ({reason.partition(' (')[0]}), but must reach contact" in err
    )
    mounting = (
        f'mount the sensor {near} behind the contact surface, and set recess = "{near}" (positions count from the '
    )
    assert f"{mounting}new surface), or calibrate with lower amplification" in err
    assert len(err.partition("sensor: ")[2].split()) <= 50


@pytest.mark.slow
def test_the_ways_out_of_a_refusal_lead_out(run):
    recessed = CLIPPED + '\nrecess = "5 mm"'
    err = run("design", scenario("clipped.toml", recessed))[2]
    assert "starts at the distance 7 mm" in err
    assert 'mount the sensor 12 mm (now 5 mm) behind the contact surface, and set recess = "12 mm"' in err
    assert run("design", scenario("sunk.toml", CLIPPED + '\nrecess = "12 mm"'), "--no-report")[0] == 0
    code, out, _ = run(
        "design", scenario("both.toml", recessed + '\nminimum_distance = "0 mm"'), "--no-report", "--verbose"
    )
    assert code == 0
    assert out.startswith(f"{UNSUPPORTED}7 mm ({near_end()[1]}) to contact at 0 mm.")
    assert (
        "Distances in brackets count from the zero of the sensor's distance scale, which is 5 mm behind the contact "
        "surface." in out
    )
    far = scenario("far.toml", WHOLE.splitlines()[0], ("42.2 mm", "70 mm"))
    assert "the end of the calibrated range (last measured distance)" in run("design", far)[2]


def test_a_curve_that_the_file_cuts_is_not_blamed_on_the_calibration(run):
    err = run("design", scenario("cut.toml", WHOLE + '\nminimum_distance = "2 mm"'))[2]
    assert "starts at the distance 2 mm, but must reach contact" in err
    assert 'or extend the curve with minimum_distance = "0 mm"' in err


@pytest.mark.parametrize(
    ("verb", "options"),
    [("robust", ()), ("verify", ("--no-changes",)), ("sweep", ("--axis", "obstacle.position=20mm:30mm:3"))],
)
def test_encounters_that_start_beyond_the_data_are_refused_with_the_calibration_as_the_reason(run, verb, options):
    sensor = WHOLE.replace("60 mm", "25 mm")
    known = ("[robust]", 'obstacle.position = { uniform = ["20 mm", "30 mm"] }\n[robust]')
    code, _, err = run(verb, scenario("far.toml", sensor, ("42.2 mm", "22 mm"), known), *options)
    assert code == 2
    assert (
        "; the calibration covers only distances from 0 mm to 56 mm. Reason for the lower limit: first measured "
        "distance. Reason for the upper limit: last measured distance." in err
    )


@pytest.mark.slow
def test_the_mounting_of_a_sensor_is_named_by_its_fit_and_assumed_by_design_and_verdict(run):
    near, _ = near_end()
    _, out, _ = run("fit", "clipped.csv", "--no-report")
    # how the sensor is mounted is for the user to state, so the line is a comment
    remark = f"state how far the sensor is behind the contact surface: {near} or more"
    assert f'  # recess = "{near}"  # {remark}\n' in out
    _, whole, _ = run("fit", "sensor.csv", "--no-report")
    assert (
        'Next: put these lines into the section [sensor] of a scenario file.\n  calibration = "sensor.csv"\n' in whole
    )
    assert "recess" not in whole
    recessed = scenario("sunk.toml", CLIPPED + '\nrecess = "12 mm"')
    for verb in ("design", "verify"):
        run(verb, recessed, *VERBS[verb])
        page = Path(f"sunk-{verb}.html").read_text(encoding="utf-8")
        assert "The sensor is mounted 12 mm behind the contact surface. Positions and distances count from" in page
    run("design", scenario("flush.toml", WHOLE))
    assert "mounted" not in Path("flush-design.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_an_exported_law_subtracts_the_offset_of_the_calibration(run):
    assert run("init", "sensor.csv", "--rate", "1 kHz")[0] == 0
    offset = pt.load_scenario("scenario.toml").calibration.offset.value
    assert run("export", "json", "scenario.toml", "--output", "law", "--force")[0] == 0
    text = Path("law/design.json").read_text(encoding="utf-8")
    assert re.findall(r'"offset": ([\d.e-]+)', text) == [repr(offset)]
    assert "reading - p.offset" in Path("law/pretouch_step.m").read_text(encoding="utf-8")
