"""`pretouch fit`, and the sensors that `pretouch design` fits on the way."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from command_text import SCENARIO, command, curve, lay_out, stand_in_for_reports, strict

import pretouch as pt


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


def test_lines_to_copy_have_no_absolute_path(run, folder):
    whole = run("fit", str(folder / "sensor.csv"), "--no-report")[1]
    assert 'calibration = "sensor.csv"' in whole
    assert str(folder) not in whole
    nearer = f"../{folder.name}/sensor.csv"
    assert f'calibration = "{nearer}"' in run("fit", nearer, "--no-report")[1]


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


def test_too_few_distances_are_not_called_a_missing_signal(run):
    Path("four.csv").write_text("distance [mm],output [counts]\n2,5000\n10,3000\n20,1500\n40,700\n")
    code, out, _ = run("fit", "four.csv", "--no-report")
    assert code == 1
    few = "The number of usable distances is 4, but a curve needs at least 5"
    assert out.startswith(f"four.csv: too few distances. {few}.\n")
    assert "signal" not in out
    assert "first measured distance" not in out
    assert f"Warning PT101: {few}: measure at 8 or more" in " ".join(out.split())
    clipped = "distance [mm],output [counts]\n2,1023\n5,1023\n10,900\n20,500\n40,200\n50,150\n"
    Path("clipped.csv").write_text(clipped)
    out = " ".join(run("fit", "clipped.csv", "--no-report")[1].split())
    because = "because the output clips at 1023 counts up to 5 mm (within 1 % of the full scale of a 10-bit converter)"
    assert f"The number of usable distances is 4, {because}, but a curve needs at least 5." in out
    code, _, err = run("init", "four.csv")
    assert code == 2
    assert "four.csv: too few distances, so no sensor curve can be fitted. The number of usable distances is" in err


def test_the_summary_of_a_rising_output_has_a_remedy_that_works(run):
    head, *rows = Path("sensor.csv").read_text().splitlines()
    pairs = [row.split(",") for row in rows]
    Path("rising.csv").write_text("\n".join([head, *(f"{d},{2.5 - float(y)}" for d, y in pairs)]) + "\n")
    code, out, _ = run("fit", "rising.csv", "--no-report")
    out = " ".join(out.split())
    assert code == 1
    (constant,) = re.findall(r"replace each reading by ([\d.]+) V minus the reading, in the file and on the robot", out)
    upright = (f"{d},{float(constant) - (2.5 - float(y))}" for d, y in pairs)
    Path("upright.csv").write_text("\n".join([head, *upright]) + "\n")
    fits = [strict(run("fit", name, "--json")[1]) for name in ("sensor.csv", "upright.csv")]
    rates = [m["parameters"]["rate"] for fit in fits for m in fit["models"] if m["name"] == "exponential-1"]
    assert rates[1] == pytest.approx(rates[0], rel=1e-6)
    assert fits[1]["left_out"] == fits[0]["left_out"] == []
    assert "if the sensor reports a distance, write a scenario file with pretouch init --part VL53L0X" in out


def test_a_sensor_that_reports_distances_is_led_to_a_scenario_that_needs_no_calibration(run):
    Path("range.csv").write_text("distance [mm],output [mm]\n" + "".join(f"{d},{d + 2}\n" for d in range(0, 60, 5)))
    code, out, _ = run("fit", "range.csv", "--no-report")
    assert code == 1
    assert "with pretouch init --part VL53L0X, and correct rate and noise in [chain] of this file." in " ".join(
        out.split()
    )
    code, out, _ = run("init", "--part", "VL53L0X")
    assert code == 0
    assert out.startswith("scenario.toml: this first scenario file uses the sensor part VL53L0X. This part needs no")
    assert "replace it by your calibration" not in out
    assert "pretouch record" not in Path("scenario.toml").read_text()
    assert run("design", "scenario.toml", "--no-report")[0] == 0


def test_a_negative_distance_has_a_remedy(run):
    Path("below.csv").write_text("distance [mm],output [V]\n-4,3\n10,2\n20,1\n")
    code, _, err = run("fit", "below.csv")
    assert code == 2
    assert "below.csv, line 2: found the distance -4, but distances must not be negative; if these are" in err
    assert "subtract P from each, where P is the position at contact; if the number means that no object" in err


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        ("two.csv", "--select", "unit=b"),
        ("days.csv", "--select", "day=30", "--select", "sensor no=1.5 m"),
        ("bare.csv", "--columns", "distance=1 [mm],output=3 [V]", "--labels", "none"),
        ("days.csv", "--labels", "day", "--select", "day=30"),
        ("sensor.csv", "--model", "inverse-power", "--model", "exponential-1", "--offset", "0.12 V"),
        ("sensor.csv", "--near-field-peak", "7 mm", "--floor-sigmas", "5", "--saturation", "1.9"),
        ("sensor.csv", "--no-object", "0.11", "--offset", "fit", "--near-field-peak", "none"),
        ("sensor.csv", "--no-object", "dark.csv"),
    ],
    ids=" ".join,
)
def test_the_lines_that_a_fit_proposes_repeat_the_fit_in_a_scenario(run, options):
    rows = [row.replace(",", ",9.9,") + f",{i}" for i, row in enumerate(curve())]
    Path("bare.csv").write_text("\n".join(rows) + "\n")
    days = [f"{day},1.5 m,{row}" for day in (30, 60) for row in curve(rate=-day)]
    Path("days.csv").write_text("\n".join(["day,sensor no,distance [mm],output [V]", *days]) + "\n")
    Path("dark.csv").write_text("output [V]\n0.119\n0.121\n0.12\n0.122\n")
    out = run("fit", *options, "--no-report")[1]
    lines = out.partition("Next: put these lines into the section [sensor] of a scenario file.\n")[2].splitlines()
    said = [line.replace("# recess", "recess") for line in lines[: lines.index("All numbers: --verbose")]]
    Path("said.toml").write_text(calibrated(*said))  # the user completes the recess
    sensor = pt.load_scenario("said.toml").sensor
    told = strict(run("fit", *options, "--json")[1])
    best = next(m for m in told["models"] if m["name"] == told["best"])
    curve_of_sensor = getattr(sensor, "sensor", sensor)  # without the recess
    assert curve_of_sensor.parameters == pytest.approx(best["parameters"], rel=1e-12)


def test_notes_are_wrapped_and_count_rows_without_an_output(run):
    rows = [f"{row},9,7,8,6" for row in curve()]
    rows[4] = ",".join([rows[4].split(",")[0], "", *rows[4].split(",")[2:]])
    header = "distance [mm],the output of the sensor without a unit,first,second,temperature,gain"
    Path("gap.csv").write_text("\n".join([header, *rows]) + "\n")
    out = run("fit", "gap.csv", "--columns", "output=2", "--labels", "none", "--no-report")[1]
    assert "note: Number of rows or cells without an output (empty, nan or -): 1. They are not used.\n" in out
    assert "note: The column 'the output of the sensor without a unit' of sensor outputs has no unit, so" in out
    assert max(map(len, out.splitlines())) <= 100


@pytest.mark.slow
def test_fit_and_init_warn_of_distances_beyond_ten_meters(run):
    text = Path("sensor.csv").read_text().replace("distance [mm]", "distance [m]")
    Path("far.csv").write_text(text)
    warning = (
        "Warning PT114: The distances reach 56 m, which is too far for a proximity sensor: for millimeters, use the "
        "header distance [mm]."
    )
    for words in (("fit", "far.csv", "--no-report"), ("init", "far.csv")):
        code, out, _ = run(*words)
        assert code == 0
        assert warning in " ".join(out.split())
    (told,) = strict(run("init", "far.csv", "--force", "--json")[1])["warnings"]
    assert told.startswith("PT114: ")


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
        (["--select", "unit"], "--select: found 'unit'"),
        (
            ["--columns", "distance"],
            "--columns: found 'distance'",
        ),
        (
            ["--columns", "range=1"],
            "columns: found the key 'range'",
        ),
        (["--columns", "output=4"], "columns: found '4' for the output column"),
        (
            ["--columns", "output=height"],
            "columns: found 'height' for the output column",
        ),
        (
            ["--columns", "distance=[V]"],
            "columns: found the unit 'V' for the distance",
        ),
        (["--columns", "distance=1,output=1"], "columns: column 1 is given as the distance and also as the output"),
        (["--labels", "side"], "labels: found 'side'"),
        (["--select", "unit=c"], "no curve with the labels unit=c; labels available in two.csv: unit=a"),
        (["--offset", "much"], "--offset: found 'much'"),
        (["--offset", "3 counts"], "offset: found 3 counts"),
        (
            ["--saturation", "3 m"],
            "--saturation: found '3 m'",
        ),
        (["--near-field-peak", "3 V"], "--near-field-peak: found '3 V'"),
        (["--no-object", "dark"], "--no-object: found 'dark'"),
        (["--no-object", "none.csv"], "none.csv"),
        (["--model", "polynomial"], "model: found 'polynomial'"),
        (["--floor-sigmas", "-1"], "floor_sigmas"),
    ],
)
def test_a_wrong_option_of_fit_ends_with_2_and_says_what_is_expected(run, options, says):
    code, out, err = run("fit", "two.csv", *options, "--json")
    assert code == 2
    assert says in strict(out)["message"]
    assert says in err


@pytest.mark.parametrize("options", [["--model", "polynomial"], ["--floor-sigmas", "-1"]])
def test_nothing_is_printed_before_a_refusal(run, options):
    assert run("fit", "two.csv", *options)[:2] == (2, "")


def test_the_selection_that_several_curves_name_is_one_that_works(run):
    _, out, _ = run("fit", "two.csv")
    selection = shlex.split(out[out.rindex("--select") :])
    assert run("fit", "two.csv", *selection, "--json")[0] == 0


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


def test_columns_and_labels_are_chosen_on_the_command_line_as_the_messages_say(run):
    rows = [row.replace(",", f",{i % 7},") for i, row in enumerate(curve())]
    Path("equal.csv").write_text("\n".join(["distance,output,output", *rows]) + "\n")
    code, _, err = run("fit", "equal.csv", "--json")
    assert code == 2
    assert '--columns "output=2" (called columns in a scenario file and in Python)' in err
    code, _, err = run("fit", "equal.csv", "--columns", "output=3", "--json")
    assert (code, '--columns "distance=1 [UNIT]"' in err) == (2, True)
    code, out, _ = run("fit", "equal.csv", "--columns", "distance=1 [mm], output=3 [V]", "--json")
    assert (code, strict(out)["best"]) == (0, "exponential-1")
    code, out, _ = run("fit", "two.csv", "--labels", "none", "--json")
    assert "curves" not in strict(out)


def test_labels_with_blanks_are_shown_as_they_are_typed(run):
    rows = [f"{current},{row}" for current in (20, 50) for row in curve(seed=current)]
    Path("currents.csv").write_text("\n".join(["drive current [mA],distance [mm],output [V]", *rows]) + "\n")
    code, _, err = run("fit", "currents.csv", "--output", "r.html")
    assert (code, "--select 'drive current [mA]=20'" in err) == (2, True)
    Path("several.toml").write_text(calibrated('calibration = "currents.csv"'))
    code, _, err = run("design", "several.toml")
    assert (code, '{ "drive current [mA]" = 20 }' in err) == (2, True)
    chosen = 'select = { "drive current [mA]" = 20 }'
    Path("one.toml").write_text(calibrated('calibration = "currents.csv"', chosen, 'maximum_distance = "50 mm"'))
    assert run("design", "one.toml", "--json")[0] == 0


def test_what_was_assumed_is_told(run, pages):
    wide = {row.split(",")[0]: [] for row in curve()}
    for row in [*curve(), *curve(seed=5)]:
        wide[row.split(",")[0]].append(row.split(",")[1])
    heads = [f"{distance} mm" if distance != "inf" else "inf" for distance in wide]
    rows = [" ".join(cells[i] for cells in wide.values()) for i in range(6)]
    Path("wide.csv").write_text("\n".join(["Bench 4, day 2", "  ".join(heads), *rows]) + "\n")
    code, out, err = run("fit", "wide.csv", "--columns", "output=[V]")
    assert (code, err) == (0, "")
    assert out.startswith(
        "note: Line 1 is above the header and is not read.\n"
        f"note: The column headers 0 mm to {heads[-2]} are interpreted as distances, and each row as one repetition\n"
        "  of the measurement.\n"
    )
    assert run("fit", "wide.csv", "--json")[0] == 0


def test_gathered_distances_are_told_once(run):
    rows = [f"{0.2 * i:.1f},{3 * 2.718281828 ** (-0.012 * i):.3f}" for i in range(400)]
    Path("dense.csv").write_text("\n".join(["distance [mm],output [V]", *rows]) + "\n")
    out = run("fit", "dense.csv", "--no-report")[1]
    note = (
        "note: The readings at 400 distances were combined into 50 groups of neighboring distances. "
        "The readings of each group were averaged. The narrowest group is 0.793 mm wide, and the widest group is "
        "2.08 mm wide."
    )
    assert (" ".join(out.split()).count(note), out.count("combined")) == (1, 1)


def test_a_missing_file_ends_with_2(run):
    for verb in ("fit", "design"):
        code, out, err = run(verb, "nothing.here")
        assert (code, out) == (2, "")
        assert err.startswith("pretouch: nothing.here: ")


# --- a scenario whose sensor is fitted on the way


def calibrated(*lines):
    return "\n".join(["[sensor]", *lines, *SCENARIO.splitlines()[4:]]) + "\n"


def fitted_rate(run):
    (model,) = strict(run("fit", "sensor.csv", "--model", "exponential-1", "--json")[1])["models"]
    return model["parameters"]["rate"]


def test_design_fits_the_sensor_on_the_way_relative_to_the_scenario(run, folder):
    Path("sub").mkdir()
    Path("sub/sensor.csv").write_text(Path("sensor.csv").read_text())
    Path("sub/approach.toml").write_text(
        calibrated('calibration = "sensor.csv"', 'model = "exponential-1"', 'maximum_distance = "50 mm"')
    )
    code, out, _ = run("design", "sub/approach.toml", "--json")
    told = strict(out)
    assert (code, told["status"]) == (0, "optimal")
    assert told["gain"] == pytest.approx(-0.8081 * 61 / -fitted_rate(run), rel=1e-4)  # D_p g is what the motion feels
    Path("sub/sensor.csv").write_text("\n".join(["distance [mm],output [V]", *curve(rate=-50.0)]) + "\n")
    again = strict(run("design", "sub/approach.toml", "--json")[1])
    assert again["gain"] == pytest.approx(-0.8081 * 61 / 50, rel=0.02)  # 20 % stronger on a slope 20 % less steep


def test_a_scenario_chooses_columns_and_labels(run):
    rows = [row.replace(",", ",9.9,") + f",{i}" for i, row in enumerate(curve())]
    Path("bare.csv").write_text("\n".join(rows) + "\n")
    chosen = ['columns = { distance = "1 [mm]", output = "3 [V]" }', "labels = []", 'maximum_distance = "50 mm"']
    Path("bare.toml").write_text(calibrated('calibration = "bare.csv"', 'model = "exponential-1"', *chosen))
    code, out, err = run("design", "bare.toml", "--json")
    assert (code, err) == (0, "")
    assert strict(out)["gain"] == pytest.approx(-0.8081 * 61 / -fitted_rate(run), rel=1e-4)  # as of the same curve


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("lines", "line", "key", "says"),
    [
        (['calibration = "none.csv"'], 2, "sensor.calibration", "none.csv"),
        (['calibration = "flat.csv"'], 2, "sensor.calibration", "no usable signal"),
        (['calibration = "approach.toml"'], 2, "sensor.calibration", "approach.toml"),
        (['calibration = "two.csv"'], 2, "sensor.calibration", "the file two.csv contains 2 curves, but exactly"),
        (['calibration = "two.csv"'], 2, "sensor.calibration", 'by its labels, for example { unit = "a" }'),
        (
            ['calibration = "two.csv"', "select = { unit = 3 }"],
            3,
            "sensor.select",
            "no curve with the labels unit=3; labels available in",
        ),
        (['calibration = "two.csv"', "columns = 3"], 3, "sensor.columns", "expected a table of distance and output"),
        (['calibration = "two.csv"', "columns = { range = 1 }"], 3, "sensor.columns", "expected a table of distance"),
        (['calibration = "two.csv"', "columns = { output = 7 }"], 3, "sensor.columns", "a number from 1 to 3"),
        (['calibration = "two.csv"', 'labels = "unit"'], 3, "sensor.labels", "expected a list of headers or numbers"),
        (['calibration = "two.csv"', 'labels = ["side"]'], 3, "sensor.labels", "found 'side', expected one of 'unit'"),
        (['calibration = "two.csv"', "select = 3"], 3, "sensor.select", "expected a table of label columns"),
        (['calibration = "sensor.csv"', 'offset = "3 counts"'], 3, "sensor.offset", "the unit of the calibration (V)"),
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
