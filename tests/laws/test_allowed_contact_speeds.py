"""A design says first which contact speeds the readings allow, if they allow more than the predicted one."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.calibration import CalibrationReport, fit
from pretouch.calibration.page import calibration_page
from pretouch.cli import main
from pretouch.uncertainty import reservations_of
from wrong_reading import OFFSET, TRUTH, readings, write_task

SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.08, velocity=-0.3),
)
TASK = pt.Task(SCENARIO, TRUTH, pt.excursion_objective(position_scale=0.5, velocity_scale=0.3), bounds=(-20.0, -1e-3))


@cache
def fitted(error: float, repeats: int = 0) -> CalibrationReport:
    return fit(readings(error, repeats=repeats))


def limits(report: CalibrationReport) -> tuple[Any, float, float]:
    """Return the limits of a design on the fit, its predicted contact speed, and the true one."""
    assert report.best is not None
    assert report.offset is not None
    design = pt.design(TASK.replace(sensor=report.best.sensor))
    shift = OFFSET - report.offset.value
    places = np.linspace(0.0, 0.08, 801)
    seen = pt.Table(distances=tuple(places), outputs=tuple(np.asarray(TRUTH.output(places)) + shift))
    true = pt.find_contact(SCENARIO, seen, design.gain).contact.relative_velocity
    return reservations_of(report, design), -design.result.contact.relative_velocity, -true


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.27, 0.2])
def test_a_wrong_nearest_reading_is_said_first_with_the_range_and_its_repetition_helps(error: float) -> None:
    found, predicted, true = limits(fitted(error))
    assert abs(true / predicted - 1) > 0.15
    assert found.headline is not None or found.spread is not None
    assert found.witness.allowed_low <= 1.02 * true
    assert 0.98 * true <= found.witness.allowed_high
    assert ("not accurate enough" in found.verdict) == (found.headline is not None)
    said = found.to_dict()["contact_speed"]
    assert said == {
        "predicted": found.witness.predicted,
        "low": found.witness.allowed_low,
        "high": found.witness.allowed_high,
        "unit": "m/s",
    }
    better, predicted, true = limits(fitted(error, repeats=9))
    assert better.headline is None
    assert better.spread is None
    assert true == pytest.approx(predicted, rel=0.15)


def test_the_remedy_is_the_repetition_of_the_wrong_reading() -> None:
    found, *_ = limits(fitted(0.27))
    assert found.witness.suspect == 0.0
    assert "Repeat the reading at the distance 0 mm" in (found.headline or found.spread)
    assert any(reason.startswith("PT117: ") for reason in fitted(0.27).reasons)
    assert fitted(0.27).verdict == "usable with reservations"


def test_right_readings_are_not_cautioned() -> None:
    found, predicted, true = limits(fitted(0.0))
    assert found.headline is None
    assert found.spread is None
    assert true == pytest.approx(predicted, rel=0.05)
    assert found.witness.is_precise
    assert "not accurate enough" not in found.verdict
    assert fitted(0.0).verdict == "usable"


@pytest.mark.parametrize("verb", ["design", "robust"])
def test_the_command_line_says_the_range_first(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_task(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["pretouch", verb, "task.toml", "--json"])
    with pytest.raises(SystemExit):
        main()
    said = json.loads(capsys.readouterr().out)
    assert next(iter(said)) == "headline"
    assert "PT201: " in said["headline"] or " m/s. Repeat the reading at the distance 0 mm" in said["headline"]
    speed = said["calibration"]["contact_speed"]
    assert speed["unit"] == "m/s"
    assert speed["low"] < speed["high"]
    assert speed["high"] > 1.15 * speed["predicted"]


def test_a_wide_range_alone_follows_the_answer_with_both_ends() -> None:
    """The witness of a good calibration, with some of the weighted curves moved away."""
    found, *_ = limits(fitted(0.0))
    wide = replace(found, witness=replace(found.witness, allowed_low=0.0762, allowed_high=0.121, share_outside=0.02))
    assert wide.headline is None
    assert not wide.is_refuted
    assert wide.spread is not None
    assert "contact occurs at 0.0762 to 0.121 m/s." in wide.spread
    told = wide.around_dict({"headline": "Optimal gain.", "status": "optimal"})
    assert told["status"] == "optimal"
    assert told["headline"] == f"Optimal gain. {wide.spread}"
    assert wide.around_text("Optimal gain.\n  numbers").startswith(f"Optimal gain. {wide.spread}\n  numbers")
    contradicted = replace(wide, witness=replace(wide.witness, share_outside=0.5))
    assert contradicted.spread is None
    assert contradicted.headline is not None


def test_the_error_of_the_middle_slope_includes_other_families_that_fit_as_well() -> None:
    """Without readings of the empty scene, families fit with other offsets and other slopes."""
    report = fit(readings(0.0, empty=[]))
    assert report.best is not None
    middle = report.best.middle_slope
    true = float(TRUTH.log_slope((report.window.l_min + report.window.l_max) / 2))
    assert middle.low <= true <= middle.high
    others = [fit.middle_slope.value for fit in report.fits if fit.rmse_log_output < 2 * report.best.rmse_log_output]
    assert len(others) > 1
    assert all(middle.low <= value <= middle.high for value in others)
    assert f"{middle.low:.4g} to {middle.high:.4g} 1/m" in calibration_page(report).headline


def test_the_uncertainty_of_g_covers_the_usable_range_with_the_effect_of_the_offset() -> None:
    report = fitted(0.0)
    slope, offset = report.slope, report.offset
    assert slope is not None
    assert offset is not None
    assert (slope.distances[0], slope.distances[-1]) == (report.window.l_min, report.window.l_max)
    assert slope.decisive < report.window.l_max
    signal = float(TRUTH.output(report.window.l_max))
    of_offset = (offset.high - offset.low) / 2 / signal  # relative change of g at a fixed slope of the output
    assert slope.uncertainty[-1] > 0.7 * of_offset
    assert slope.largest_anywhere >= slope.largest
    names = [name for name, _ in calibration_page(report).key_figures]
    assert any("95 %, 0 mm to 80 mm, worst at" in name for name in names)
