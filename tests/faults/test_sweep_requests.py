"""A sweep that makes no sense is refused in one sentence, before anything is computed."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.errors import InvalidInputError, MissingExtraError
from pretouch.cli import sweep as cli_sweep
from pretouch.sweeps import plan
from pretouch.sweeps.axes import read_axis
from pretouch.sweeps.executors import Progress
from refusals import refused
from sweep_samples import CONSTANT, CURVED, OBJECTIVE, SCENARIO

DESIGN: dict[str, Any] = {"objective": OBJECTIVE, "bounds": (-10.0, -0.01)}
FOLLOWING = pt.excursion_objective(position_scale=0.5, velocity_scale="obstacle speed")


@pytest.mark.parametrize(
    ("axes", "given", "fields"),
    [
        ({}, {"gain": -0.5}, {"argument": "axes"}),
        (
            {"velocity": [-0.3]},
            {"gain": -0.5},
            {"argument": "axes", "value": "velocity", "remedy": "obstacle.velocity"},
        ),
        (
            {"obstacle.velocty": [-0.3]},
            {"gain": -0.5},
            {"argument": "axes", "value": "obstacle.velocty", "remedy": "obstacle.velocity"},
        ),
        ({"nonsense": [1.0]}, {"gain": -0.5}, {"argument": "axes", "value": "nonsense"}),
        (
            {"sensor.rate": [-60.0]},
            {"gain": -0.5},
            {"argument": "axes", "value": "sensor.rate", "remedy": "sensor.scale"},
        ),
        ({"constraint.excursion": [0.1]}, DESIGN, {"argument": "axes", "value": "constraint.excursion"}),
        ({"obstacle.velocity": []}, {"gain": -0.5}, {"argument": "obstacle.velocity"}),
        ({"obstacle.velocity": [[-0.3]]}, {"gain": -0.5}, {"argument": "obstacle.velocity"}),
        (
            {"obstacle.velocity": [-0.3, np.nan]},
            {"gain": -0.5},
            {"argument": "obstacle.velocity"},
        ),
        ({"obstacle.velocity": "fast"}, {"gain": -0.5}, {"argument": "obstacle.velocity", "value": "fast"}),
        ({"admittance.mass": [1.0, -1.0]}, {"gain": -0.5}, {"argument": "mass", "value": -1.0}),
        ({"sensor.exponent": [3.0, -3.0]}, {"gain": -0.5}, {"argument": "exponent", "value": -3.0}),
        ({"obstacle.position": [0.04, -0.04]}, {"gain": -0.5}, {"argument": "obstacle position"}),
        (
            {"obstacle.position": [0.04], "plant.position": [0.0, 0.05]},
            {"gain": -0.5},
            {"argument": "obstacle position"},
        ),
        ({"obstacle.velocity": [-0.3]}, {}, {"argument": "gain"}),
        ({"gain": [-0.3]}, {"gain": -0.5}, {"argument": "gain"}),
        ({"obstacle.velocity": [-0.3]}, {"gain": [-0.5, -0.6]}, {"argument": "gain"}),
        (
            {"obstacle.velocity": [-0.3]},
            {"objective": OBJECTIVE},
            {"argument": "bounds"},
        ),
        (
            {"obstacle.velocity": [-0.3]},
            {**DESIGN, "bounds": (-0.1, -1.0)},
            {"argument": "bounds", "value": (-0.1, -1.0)},
        ),
        (
            {"obstacle.velocity": [-0.3, 0.0]},
            {**DESIGN, "objective": FOLLOWING},
            {"argument": "scale", "value": "obstacle speed"},
        ),
        (
            {"obstacle.velocity": [-0.3]},
            {"gain": -0.5, "results": ["speed"]},
            {"argument": "results", "value": "speed"},
        ),
        (
            {"obstacle.velocity": [-0.3]},
            {"gain": -0.5, "results": ["objective"]},
            {"argument": "results"},
        ),
        ({"obstacle.velocity": [-0.3]}, {"gain": -0.5, "results": ["impact_force"]}, {"argument": "results"}),
        (
            {"sample": {"obstacle.velocity": [-0.3, -0.2], "plant.velocity": [0.0]}},
            {"gain": -0.5},
            {"argument": "axes"},
        ),
        (
            {"obstacle.velocity": {"plant.velocity": [0.0]}},
            {"gain": -0.5},
            {"argument": "axes", "value": "obstacle.velocity"},
        ),
        ({"time": {"plant.velocity": [0.0]}}, {"gain": -0.5}, {"argument": "axes"}),
        (
            {"a": {"plant.velocity": [0.0]}, "plant.velocity": [0.1]},
            {"gain": -0.5},
            {"argument": "axes"},
        ),
        (
            {"admittance.natural_frequency": [5.0], "admittance.damping": [1.0]},
            {"gain": -0.5},
            {"argument": "inputs"},
        ),
    ],
)
def test_a_request_that_makes_no_sense_is_refused(axes: Any, given: Any, fields: dict[str, Any]) -> None:
    pytest.importorskip("xarray", reason="needs the extra 'sweep'")
    named = dict(given)
    results = named.pop("results", None)
    with refused(**fields):
        pt.sweep(pt.Task(SCENARIO, CURVED, **named), axes, results=results)


def test_a_distance_beyond_the_range_of_some_curve_of_the_sweep_is_found_beforehand(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def forbidden(*_: Any) -> None:
        raise AssertionError("nothing is computed")

    monkeypatch.setattr(plan.Plan, "evaluate", forbidden)
    short = pt.Recessed(sensor=replace(CURVED, maximum_distance=0.06), recess=0.0)
    axes = {"sensor.recess": [0.0, 0.01, 0.02], "obstacle.position": [0.03, 0.042]}
    with refused("obstacle position"):
        pt.sweep(pt.Task(SCENARIO, short, gain=-0.5), axes)


def test_arrays_in_the_scenario_are_sent_to_the_axes() -> None:
    many = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=np.array([-0.3, -0.2])))
    with refused("scenario"):
        pt.sweep(pt.Task(many, CURVED), {"gain": [-0.5]})


def test_a_stiffness_of_zero_has_no_damping_ratio_to_hold() -> None:
    free = replace(SCENARIO, admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=0.0))
    with refused("inputs"):
        pt.sweep(pt.Task(free, CONSTANT, gain=-0.5), {"admittance.natural_frequency": [5.0]})


@pytest.mark.parametrize("library", ["xarray", "zarr", "distributed"])
def test_a_library_that_is_not_installed_is_named_with_what_installs_it(
    library: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    if library != "xarray":
        pytest.importorskip("xarray", reason="needs the extra 'sweep'")
    if library == "distributed":
        pytest.importorskip("zarr", reason="needs the extra 'sweep'")
    for name in [n for n in sys.modules if n.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, name)

    class Hidden:
        def find_spec(self, name: str, *_: Any) -> None:
            if name.partition(".")[0] == library:
                raise ModuleNotFoundError(f"No module named {library!r}", name=library)

    monkeypatch.setattr(sys, "meta_path", [Hidden(), *sys.meta_path])
    extra = "dask" if library == "distributed" else "sweep"
    with refused(library, error=MissingExtraError, remedy=f"pip install 'pretouch[{extra}]'"):
        pt.sweep(
            pt.Task(SCENARIO, CURVED),
            {"gain": [-0.5]},
            output=tmp_path / "out.zarr",
            dask="tcp://127.0.0.1:9" if library == "distributed" else None,
        )
    assert not (tmp_path / "out.zarr").exists()


def test_results_beyond_memory_are_refused_before_anything_is_allocated() -> None:
    pytest.importorskip("xarray", reason="needs the extra 'sweep'")
    axes = {"gain": np.linspace(-2.0, -0.1, 100_000), "obstacle.velocity": np.linspace(-1.0, -0.1, 100_000)}
    with refused("axes", value=10000000000):
        pt.sweep(pt.Task(SCENARIO, CURVED), axes)


@pytest.mark.parametrize("count", ["0", "100000000", "9" * 5000, "x"])
def test_an_axis_has_as_many_values_as_make_sense(count: str) -> None:
    with refused("--axis"):
        read_axis(f"gain=-1:-0.1:{count}", {"gain": "N*s"})


@pytest.mark.parametrize("end", ["inf", "1e308", "-5e-324"])
def test_an_axis_ends_at_numbers_that_arithmetic_goes_with(end: str) -> None:
    with pytest.raises(InvalidInputError, match="expected"):
        read_axis(f"gain={end}:-0.1:3", {"gain": "N*s"})


def test_how_long_a_sweep_takes_is_said_when_it_is_known(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(cli_sweep, "_INTERVAL", -math.inf)
    tell = cli_sweep._progress_printer()
    for computed in (0, 500):
        tell(Progress(finished=1000, total=4000, seconds=2.0, computed=computed))
    first, second = capsys.readouterr().err.splitlines()
    assert first == "pretouch: 1,000 of 4,000 encounters (25 %)"
    assert second == "pretouch: 1,000 of 4,000 encounters (25 %), about 12 s left"
