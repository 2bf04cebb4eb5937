"""Values that pages, figures and messages show: each is one that a random change of the program left unnoticed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.blocks import Measured
from pretouch.cli.sweep import _present as present_sweep
from pretouch.cli.terminal import Presentation
from pretouch.designs.impact import impact_rows
from pretouch.motion.page_sections import scenario_rows
from pretouch.uncertainty.correlated import CorrelatedNormal
from refusals import refused
from verification_samples import SCENARIO, SENSOR

OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)


def test_both_masses_of_an_impact_are_shown() -> None:
    rows = dict(impact_rows(pt.SpringImpact(robot_mass=4.0, stiffness=1e4, obstacle_mass=7.0)))  # type: ignore[arg-type]
    assert rows == {
        "physical mass of the robot": Measured(4.0, "kg"),
        "mass of the obstacle": Measured(7.0, "kg"),
    }


def test_inputs_of_an_encounter_have_their_symbols() -> None:
    labels = [name for name, _ in scenario_rows(SCENARIO)]
    assert labels[:5] == [
        *("admittance: mass M_a", "admittance: damping D_a", "admittance: stiffness K_a"),
        *("natural frequency", "damping ratio"),
    ]


def test_a_swept_axis_is_drawn_in_the_unit_of_its_label() -> None:
    pytest.importorskip("xarray")
    task = pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=(-10.0, -0.01))
    swept = pt.sweep(task, {"obstacle.position": [0.05, 0.03, 0.04]}, results=["gain"])
    axes = pt.plots.sweep(swept).axes[0]
    assert axes.get_xlabel().endswith("[mm]")
    curve = axes.lines[0]  # from one value to the next larger one, in whatever order they were given
    assert np.asarray(curve.get_xdata()) == pytest.approx([30.0, 40.0, 50.0], rel=1e-12)
    assert curve.get_linestyle() == "-"
    nearest = swept.sel({"obstacle.position": [0.03, 0.04, 0.05]})["gain"].values
    shown = np.asarray(curve.get_ydata(), dtype=float)
    assert shown / shown[0] == pytest.approx(nearest / nearest[0], rel=1e-12)


def test_arrays_give_the_distribution_that_tuples_give() -> None:
    names, mean, covariance = (
        ("sensor.exponent", "sensor.distance_offset"),
        (3.32, 0.0419),
        ((1e-2, 2e-4), (2e-4, 5e-6)),
    )
    of_tuples = CorrelatedNormal(names=names, mean=mean, covariance=covariance)
    of_arrays = CorrelatedNormal(names=list(names), mean=np.array(mean), covariance=np.array(covariance))  # type: ignore[arg-type]
    assert of_arrays == of_tuples
    assert hash(of_arrays) == hash(of_tuples)
    assert of_arrays.mean == mean


@pytest.mark.parametrize("wrong", ["x", (1.0,), (1.0, 2.0, 3.0), ("a", "b"), 3.0])
def test_bounds_are_two_numbers(wrong: object) -> None:
    with refused("bounds", error=(TypeError, pt.errors.InvalidInputError)):
        pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=wrong)  # type: ignore[arg-type]


def test_a_robust_page_ranks_its_uncertain_inputs(tmp_path: Path) -> None:
    uniform = pt.uncertainty.Uniform
    task = pt.Task(
        SCENARIO,
        SENSOR,
        OBJECTIVE,
        bounds=(-10.0, -0.01),
        uncertainty={
            "obstacle.velocity": uniform(low=-0.35, high=-0.25),
            "obstacle.position": uniform(low=0.041, high=0.043),
        },
        robust=pt.designs.RobustOptions(samples=32, validation=32),
    )
    page = pt.write_report(pt.robust(task), tmp_path / "page.html").read_text(encoding="utf-8")
    _, _, section = page.partition("Importance of the uncertain inputs</")
    assert section.index("obstacle.velocity") < section.index("obstacle.position")  # the more important one first


def test_a_failure_of_a_sweep_without_a_file_is_no_damaged_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only with a file can the cause be the file."""
    pytest.importorskip("xarray")
    from pretouch.sweeps import results

    def fail(*_: object) -> None:
        raise RuntimeError("no memory")

    monkeypatch.setattr(results, "counts", fail)
    monkeypatch.setattr(results, "sweep_as_text", lambda *_: "")
    monkeypatch.setattr(results, "sweep_as_dict", lambda _: {})
    for output, error in ((None, RuntimeError), (Path("gains.nc"), pt.errors.InvalidInputError)):
        shown = Presentation(json=False, verbose=False, output=output, report=False, force=False)
        with pytest.raises(error):
            present_sweep(None, None, shown, None)  # type: ignore[arg-type]
