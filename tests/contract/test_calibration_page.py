"""docs/explanation/calibration.md describes the file: its examples are read, and what they come to is what they
show.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from pretouch.calibration import read_calibration, read_calibrations

PAGE = (Path(__file__).parents[2] / "docs" / "explanation/calibration.md").read_text(encoding="utf-8")
LONG, WIDE, EXPORTED = re.findall(r"```csv\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "sensor.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_the_long_table_holds_a_curve_for_each_sensor(file):
    left, right = read_calibrations(file(LONG))
    assert (left.label, right.label) == ("sensor=left", "sensor=right")
    assert left.distances.tolist() == right.distances.tolist() == [0.0, 0.005, 0.01]
    assert (left.outputs.tolist(), left.no_object.tolist(), left.unit) == ([1650, 1012, 655], [98], "counts")
    assert (right.outputs.tolist(), right.no_object.tolist()) == ([1702, 1043, 671], [101])
    assert left.source.notes == ()


def test_the_wide_table_holds_one_curve_of_repeats(file):
    curve = read_calibration(file(WIDE))
    assert curve.distinct_distances.tolist() == [0.0, 0.01, 0.02, 0.04]
    at = [curve.outputs[curve.distances == d].tolist() for d in curve.distinct_distances]
    assert at == [[2.513, 2.508, 2.517], [1.672, 1.680, 1.669], [1.170, 1.166, 1.173], [0.633, 0.630]]
    assert (curve.no_object.tolist(), curve.unit, curve.source.dropped) == ([0.121, 0.119, 0.120], "V", 1)
    assert curve.source.notes == (
        "Number of rows or cells without an output (empty, nan or -): 1. They are not used.",
        "The column headers 0 cm to 4 cm are interpreted as distances, and each row as one repetition of the "
        "measurement.",
        "Column 'output [V]' is not used: it counts the rows.",
    )


def test_the_export_holds_a_curve_for_each_setting(file):
    low, high = read_calibrations(file(EXPORTED))
    assert (low.label, high.label) == ("drive current [mA]=20", "drive current [mA]=50")
    np.testing.assert_allclose(low.outputs, [1.812, 0.903, 0.471], rtol=1e-15)
    np.testing.assert_allclose(high.no_object, [0.091], rtol=1e-15)
    assert high.distances.tolist() == [0.0, 0.01, 0.02]
    assert (low.unit, low.source.delimiter, low.source.output_column) == ("V", " ", "sensor output [mV]")
    assert low.source.notes == ("Lines 1 to 3 are above the header and are not read.",)


@pytest.mark.parametrize("columns", re.findall(r"`columns=(\{.*?\})`", PAGE))
def test_what_the_table_of_choices_shows_is_understood(file, columns):
    text = "gap [mm],reference [counts],raw\n0,7,90\n5,7,80\n10,7,70\n15,7,60\n"
    if "[mm]" in columns:
        text = text.replace("gap [mm]", "gap")
    curve = read_calibration(file(text), columns=eval(columns))  # noqa: S307 - our own page
    assert (curve.distances.tolist(), curve.outputs.tolist()) == ([0, 0.005, 0.01, 0.015], [90, 80, 70, 60])
    assert curve.unit == "counts"


def test_the_table_of_choices_is_read():
    assert len(re.findall(r"`columns=(\{.*?\})`", PAGE)) == 3
