"""Forty real curves go through unattended, and what comes out agrees with what the eye sees."""

import json
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
import scenario_text
from pretouch._core.files import as_json
from pretouch.calibration import fit, read_calibration, read_calibrations
from pretouch.sensors import check_sensor

FILE = Path(__file__).parents[2].parent / "shared" / "calibrations" / "khepera" / "khepera_ir.csv"
pytestmark = pytest.mark.skipif(not FILE.exists(), reason=f"the Khepera calibrations are not there: {FILE}")
LABELS = [f"day={day}, sensor={sensor}" for day in (30, 31, 3, 4, 5) for sensor in range(8)]


@pytest.fixture(scope="module")
def curves():
    return {curve.label: curve for curve in read_calibrations(FILE)} if FILE.exists() else {}


def test_there_are_forty(curves):
    assert list(curves) == LABELS


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("label", LABELS[::3])  # each day and each sensor
def test_every_curve_comes_to_a_fit_or_a_verdict(curves, label):
    measured = curves[label]
    report = fit(measured)
    found = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    # the offset lies near the plateau: the mean of the three farthest readings, of which a curve that falls as 1/l^2
    # from 250 counts at 10 mm still is some 25 counts above it, and a single bad reading moves by a third of itself
    plateau = np.median(measured.outputs[-4:])
    assert report.offset.low < plateau + 6
    assert report.offset.high > plateau - 30
    assert report.offset.value < plateau + 6
    assert report.offset.low <= report.offset.value <= report.offset.high
    assert 4 / np.sqrt(12) <= report.noise.output < 16  # quantization in steps of 4; a few steps at most
    assert report.noise.resolution == 4
    clipped = measured.distances[measured.outputs >= 1013]
    if report.best is None:
        assert report.verdict == "no usable signal"
        assert report.reasons
        return
    assert any(text.startswith("PT102: ") for text in (*report.reasons, *report.notes))  # each distance was read once
    assert report.verdict in {"usable", "usable with reservations"}
    assert report.window.l_min > clipped.max(initial=-1.0)
    assert len(report.window.distances) >= 3
    for model, entry in zip(report.fits, found["models"], strict=True):
        assert check_sensor(model.sensor).conforms
        assert np.isfinite(model.residuals).all()
        assert all(value is not None for value in entry["parameters"].values())
        assert entry["middle_slope"]["value"] < 0


@pytest.mark.slow
def test_nearly_all_are_usable_and_none_is_taken_as_perfect(curves):
    usable = [label for label in LABELS[:8] if fit(curves[label], ("exponential-1",)).best is not None]
    assert len(usable) >= 7  # of eight sensors on the first day, sensor 0 is the noisiest


def test_the_dropped_reading_is_left_out(curves):
    report = fit(curves["day=30, sensor=4"], ("inverse-power",))
    assert report.best.outliers == (9,)


def test_a_pedestal_left_in_weakens_the_slope_of_a_real_sensor(curves):
    measured = curves["day=3, sensor=7"]
    honest, naive = (fit(measured, ("inverse-power",), offset=o).best for o in ("auto", "zero"))
    at = 0.04
    assert 2.5 < honest.sensor.log_slope(at) / naive.sensor.log_slope(at) < 24
    assert naive.r_squared > 0.9


def test_one_curve_is_read_by_its_labels():
    measured = read_calibration(FILE, select={"day": 5, "sensor": 7})
    assert measured.outputs.tolist() == [1020, 372, 256, 216, 200, 188, 184, 180, 176]
    assert measured.unit == "counts"


LOOP = """\
[sensor]
calibration = "{file}"
select = {{ day = 30, sensor = {sensor} }}
minimum_distance = "0 mm"
"""
LOOP += scenario_text.ENCOUNTER.replace("42.2 mm", "20 mm")
LOOP += """\
[chain]
rate = "100 Hz"
delay = "2 ms"
[controller]
rate = "1 kHz"
"""


@pytest.mark.slow
@pytest.mark.parametrize("sensor", [0, 2])
def test_a_real_sensor_comes_to_a_verdict_on_its_loop(tmp_path, sensor, short_rest):
    """The readings of the loop stand on the plateau, scatter and step as those of the calibration."""
    (tmp_path / "loop.toml").write_text(LOOP.format(file=FILE.as_posix(), sensor=sensor))
    problem = pt.load_scenario(tmp_path / "loop.toml")
    best, chain = problem.calibration.best, problem.loop.chain
    assert (chain.noise, chain.relative_noise, chain.offset) == (
        best.noise.output,
        best.noise.relative,
        best.offset.value,
    )
    run = pt.simulate(problem)
    assert set(np.mod(run.trace.reading, 4)) == {0.0}  # steps of 4 counts
    verdict = pt.verify(problem.replace(verify=pt.designs.VerifyOptions(runs=200)))
    assert verdict.gain == pt.design(problem).gain
    speed = verdict.comparison("relative_velocity")
    assert verdict.reached.simulated == 1
    assert speed.simulated.mean < 0.5 * speed.unmitigated.mean == pytest.approx(0.15, rel=1e-6)
    assert json.loads(as_json(verdict.to_dict()))["status"] == verdict.status.value
