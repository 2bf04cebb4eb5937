"""What a session or a notebook shows of a result is short; printing it tells all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from page_checks import as_written
from pretouch.designs.robust.outcomes import RobustTradeOff
from verification_samples import NOISY, velocity_limit, verdict

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.slow
def test_results_show_one_line_and_print_a_report() -> None:
    report = pt.fit(pt.read_calibration(EXAMPLES / "sensor.csv"))
    problem = pt.load_scenario(EXAMPLES / "approach.toml")
    design = pt.design(problem)
    motion = pt.solve_motion(problem.scenario, problem.sensor, [-0.5, -0.7], samples=5)
    shown = {
        report: "<CalibrationReport sensor.csv: usable, best inverse-power>",
        report.calibration: "<Calibration sensor.csv: 111 readings at 37 distances, 10 without an object>",
    }
    for value, text in shown.items():
        assert repr(value) == text
    assert repr(report.best).startswith("<SensorFit inverse-power: g = -38")
    assert repr(design).startswith("<GainDesign: Optimal gain D_p = -0.7463 N s: contact at 0.07906 m/s")
    assert repr(design.trade_off).startswith("<TradeOff: ")
    assert repr(motion) == f"<Motion: 2 motions, 5 samples to {motion.time.max():.4g} s>"
    assert all("\n" not in repr(v) for v in (report, report.best, design, motion))
    assert str(design).count("\n") > 15
    assert str(report).count("\n") > 10
    assert "<table" in report._repr_html_()
    assert "<table" in design._repr_html_()


def test_a_scan_shows_how_many_values_it_has_and_between_which() -> None:
    robust = RobustTradeOff(gain=np.array([-3.0, -1.0, -0.25]), value=np.ones(3), feasible=np.ones(3, dtype=bool))
    assert repr(robust) == "<RobustTradeOff: 3 gains from -3 to -0.25>"
    scan = pt.design(pt.load_scenario(EXAMPLES / "approach.toml")).trade_off
    assert repr(scan) == f"<TradeOff: {len(scan.gain)} gains from -10 to -0.01>"


@pytest.mark.slow
def test_a_verdict_shows_one_line_and_prints_a_report() -> None:
    found = verdict(NOISY, constraints=[velocity_limit(0.1)])
    assert repr(found).startswith("<Verdict: holds, D_p = -0.7463 N s, 60 runs, gain margin ")
    assert found.loss is not None
    assert repr(found.loss.curve).startswith("<LoopCurve: ")
    assert all("\n" not in repr(v) for v in (found, found.loss.curve))
    text = str(found)
    assert text.startswith(found.headline)
    for part in (
        "relative velocity at contact",
        "Best gain on the simulated loop"
        if found.loss.loop_gain is None
        else f"best gain with a gain margin of {found.loss.sought_margin:g} on the simulated loop",
        "tried changes",
        "assumptions",
    ):
        assert part in text
    assert text.count("\n") > 25
    assert "<table" in found._repr_html_()


def test_notebooks_show_a_table_of_inputs_and_results_and_the_figure_of_what_has_one() -> None:
    task = pt.load_scenario(EXAMPLES / "loop.toml")
    contact = pt.find_contact(task.scenario, task.sensor, -0.7)
    motion = pt.solve_motion(task.scenario, task.sensor, -0.7)
    for value, words, has_figure in (
        (task, ("virtual-damper", "excursion", "200 mm", "exponent"), False),
        (task.scenario, ("approaches at a speed of 0.3 m/s", "42.2 mm", "25 N/m"), False),
        (contact, (f"{contact.end.relative_velocity:.4g} m/s", "largest virtual force"), False),
        (motion, (f"{1e3 * motion.time[-1]:.4g} ms",), True),
        (pt.design(task), ("-0.7463 N s",), True),
    ):
        html = as_written(value._repr_html_())
        assert "<table>" in html
        assert all(word in html for word in words), (type(value), words)
        assert ("<img alt=" in html) == has_figure
        assert "<script" not in html
        assert "http" not in html
    several = pt.find_contact(task.scenario, task.sensor, [-0.7, -0.8])
    assert "2 of 2 encounters end in contact" in several._repr_html_()
