"""`pretouch fit`, and the sensors that `pretouch design` fits on the way."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_text import SCENARIO, command, curve, lay_out, stand_in_for_reports, strict


@pytest.fixture
def folder(tmp_path, monkeypatch):
    return lay_out(tmp_path, monkeypatch)


@pytest.fixture
def run(folder, monkeypatch, capsys):
    return command(monkeypatch, capsys)


@pytest.fixture
def pages(monkeypatch):
    stand_in_for_reports(monkeypatch)


def test_fit_prints_its_verdict_and_where_the_report_is(run, pages):
    code, out, err = run("fit", "sensor.csv")
    assert (code, err) == (0, "")
    assert "usable" in out
    assert "exponential-1" in out
    assert "sensor-fit.html" in out.splitlines()[-1]


def test_fit_as_json_is_one_object(run):
    code, out, err = run("fit", "sensor.csv", "--json")
    assert (code, err) == (0, "")
    told = strict(out)
    assert {"verdict", "best", "window", "offset", "models"} <= set(told)
    for model in told["models"]:
        assert {"name", "parameters", "r_squared", "rmse_log_output", "aicc"} <= set(model)
    rate = next(m for m in told["models"] if m["name"] == "exponential-1")["parameters"]["rate"]
    assert rate == pytest.approx(-60, rel=0.02)


def test_no_usable_signal_ends_with_1_and_its_object(run):
    code, out, err = run("fit", "flat.csv", "--json")
    assert (code, err) == (1, "")
    told = strict(out)
    assert (told["verdict"], told["best"]) == ("no usable signal", None)
    assert run("fit", "flat.csv", "--no-report")[0] == 1


def test_several_curves_are_a_row_or_an_object_each(run):
    code, out, _ = run("fit", "two.csv")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[1:3]] == ["unit=a", "unit=b"]
    code, out, _ = run("fit", "two.csv", "--json")
    told = strict(out)
    assert code == 0
    assert (told["usable"], [c["label"] for c in told["curves"]]) == (2, ["unit=a", "unit=b"])
    assert {"verdict", "best", "window", "offset", "models"} <= set(told["curves"][0])
    code, _, err = run("fit", "two.csv", "--output", "r.html")
    assert code == 2
    assert "--select unit=a" in err


def test_one_of_several_curves_is_selected_and_has_a_report_of_its_own(run, pages):
    code, out, _ = run("fit", "two.csv", "--select", "unit=b")
    assert code == 0
    assert "two-unit-b-fit.html" in out
    assert Path("two-unit-b-fit.html").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--select", "unit"], "--select: found 'unit', expected COLUMN=VALUE"),
        (["--select", "unit=c"], "select: found unit=c, expected labels of a curve in two.csv (unit=a; unit=b)"),
        (["--offset", "much"], "--offset: found 'much', expected a number or text in V or counts"),
        (["--offset", "3 counts"], "offset: found 3 counts, expected the unit of the calibration, V"),
        (["--saturation", "3 m"], "--saturation: found '3 m', expected a number or text in V or counts"),
        (["--near-field-peak", "3 V"], "--near-field-peak: found '3 V', expected a quantity in m"),
        (["--no-object", "dark"], "--no-object: found 'dark', expected"),
        (["--no-object", "none.csv"], "none.csv"),
        (["--model", "polynomial"], "model: found 'polynomial', expected one of"),
        (["--floor-sigmas", "-1"], "floor_sigmas"),
    ],
)
def test_a_wrong_option_of_fit_ends_with_2_and_says_what_is_expected(run, options, says):
    code, out, err = run("fit", "two.csv", *options, "--json")
    assert code == 2
    assert says in strict(out)["message"]
    assert says in err


def test_options_of_fit_reach_the_fit(run):
    code, out, _ = run(
        *("fit", "two.csv", "--select", "unit=a", "--model", "exponential-1", "--model", "table", "--json"),
        *("--offset", "110 mV", "--saturation", "1.5 V", "--near-field-peak", "none", "--floor-sigmas", "4"),
    )
    told = strict(out)
    assert code == 0
    assert {m["name"] for m in told["models"]} | set(told["not_fitted"]) == {"exponential-1", "table"}
    assert (told["offset"]["value"], told["saturation"]) == (0.11, 1.5)


def test_readings_without_an_object_may_be_a_number_or_a_file(run):
    rows = [row for row in ["distance [mm],output [V]", *curve()] if not row.startswith("inf")]
    Path("bare.csv").write_text("\n".join(rows) + "\n")
    Path("dark.csv").write_text("output [V]\n0.1\n0.101\n0.099\n")
    for given in ("100 mV", "0.1", "dark.csv"):
        code, out, _ = run("fit", "bare.csv", "--no-object", given, "--json")
        assert code == 0
        assert strict(out)["offset"]["value"] == pytest.approx(0.1, abs=0.002)


def test_a_missing_file_ends_with_2(run):
    for verb in ("fit", "design"):
        code, out, err = run(verb, "nothing.here")
        assert (code, out) == (2, "")
        assert err.startswith("pretouch: nothing.here: ")


# --- a scenario whose sensor is fitted on the way


def calibrated(*lines):
    return "\n".join(["[sensor]", *lines, *SCENARIO.splitlines()[4:]]) + "\n"


def test_design_fits_the_sensor_on_the_way_relative_to_the_scenario(run, folder):
    Path("sub").mkdir()
    Path("sub/sensor.csv").write_text(Path("sensor.csv").read_text())
    Path("sub/approach.toml").write_text(
        calibrated('calibration = "sensor.csv"', 'model = "exponential-1"', 'maximum_distance = "50 mm"')
    )
    code, out, _ = run("design", "sub/approach.toml", "--json")
    told = strict(out)
    assert (code, told["status"]) == (0, "optimal")
    assert told["gain"] == pytest.approx(-0.8081 * 61 / 60, rel=0.02)  # D_p g is what the motion feels


@pytest.mark.parametrize(
    ("lines", "line", "key", "says"),
    [
        (['calibration = "none.csv"'], 2, "sensor.calibration", "none.csv"),
        (['calibration = "flat.csv"'], 2, "sensor.calibration", "no usable signal"),
        (['calibration = "approach.toml"'], 2, "sensor.calibration", "approach.toml"),
        (['calibration = "two.csv"'], 2, "sensor.calibration", "found 2 curves in two.csv, expected one"),
        (['calibration = "two.csv"', "select = { unit = 3 }"], 3, "sensor.select", "found unit=3, expected labels of"),
        (['calibration = "two.csv"', "select = 3"], 3, "sensor.select", "expected a table of label columns"),
        (['calibration = "sensor.csv"', 'offset = "3 counts"'], 3, "sensor.offset", "the unit of the calibration, V"),
        (['calibration = "sensor.csv"', 'offset = "much"'], 3, "sensor.offset", 'or "auto" or "fit" or "zero"'),
        (['calibration = "sensor.csv"', 'no_object = "x"'], 3, "sensor.no_object", 'or a file such as "dark.csv"'),
        (['calibration = "sensor.csv"', 'model = "exponential"'], 3, "sensor.model", 'did you mean "exponential-'),
        (["calibration = 3"], 2, "sensor.calibration", "found 3, expected text"),
    ],
)
def test_a_mistake_in_a_calibrated_sensor_is_placed(run, lines, line, key, says):
    Path("wrong.toml").write_text(calibrated(*lines))
    code, _, err = run("design", "wrong.toml")
    assert code == 2
    assert err.startswith(f"pretouch: wrong.toml, line {line}: {key}: ")
    assert says in err
