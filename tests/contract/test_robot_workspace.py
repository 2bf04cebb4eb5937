"""A map over postures and directions of a robot: one sweep with one gain, and the limits of the robot at each place."""

from __future__ import annotations

import numpy as np
import pytest

import pretouch as pt
from pretouch.report import plots
from pretouch.robots import SensorSite, load_model, make_data, project_site, project_workspace, random_postures
from refusals import refused
from robot_scenes import ARM, CURVE, SLIDE

pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
pytest.importorskip("xarray", reason="needs the extra 'sweep'")

SITE = SensorSite("fingertip", CURVE)
RESULTS = ("relative_velocity", "largest_excursion", "largest_acceleration", "impact_force")


@pytest.mark.slow
def test_a_sweep_over_postures_says_where_one_gain_holds(tmp_path) -> None:
    model = load_model(ARM)
    postures = random_postures(model, SITE, 4, seed=1)
    found = project_workspace(model, SITE, postures, ("+x", "+z"))
    assert len(found.projections) + found.omitted == 8
    task = pt.Task(
        pt.Scenario(
            admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
            obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
        ),
        CURVE,
        gain=-0.7463,
        impact=pt.SpringImpact(robot_mass=1.0, obstacle_mass=0.5, stiffness=1e4),
    )
    speeds = np.random.default_rng(0).uniform(-0.4, -0.1, len(found.projections))
    axes = found.axes(task, obstacle_velocity=speeds)
    progress: list[object] = []
    stored = pt.sweep(task, axes, results=RESULTS, output=tmp_path / "map.zarr", progress=progress.append)
    dataset = found.describe(stored)
    place = 1
    projection = project_site(model, make_data(model, postures[0]), SensorSite("fingertip", CURVE, axis="+z"))
    assert float(dataset["reflected_mass"][place]) == pytest.approx(projection.reflected_mass, rel=1e-12)
    single = pt.find_contact(
        pt.Scenario(
            admittance=task.scenario.admittance, obstacle=pt.Obstacle(position=0.0422, velocity=float(speeds[place]))
        ),
        CURVE,
        -0.7463,
    ).contact
    # the speeds differ in the last bits that series of several encounters share
    assert float(dataset["relative_velocity"][place]) == pytest.approx(float(single.relative_velocity), rel=1e-8)
    remaining = projection.retreat - abs(float(single.largest_excursion))
    assert float(dataset["remaining_excursion"][place]) == pytest.approx(remaining, rel=1e-6)
    assert bool(dataset["holds"][place]) == (remaining > 0)
    assert len(progress) > 1
    resumed = pt.sweep(task, axes, results=RESULTS, output=tmp_path / "map.zarr")
    assert resumed.attrs["digest"] == stored.attrs["digest"]
    figure = plots.workspace(dataset)
    assert "kg" in figure.axes[0].get_title(loc="left")


@pytest.mark.slow
def test_the_example_takes_any_model_by_its_path(monkeypatch: pytest.MonkeyPatch, capsys, tmp_path) -> None:
    monkeypatch.syspath_prepend(str(ARM.parent))
    example = __import__("any_model")
    assert len(example.main(str(ARM), "fingertip", "+x", 3).projections) == 3
    assert "3 postures" in capsys.readouterr().out
    leg = example.main(str(ARM.with_name("leg.xml")), "sole", "+x", 3)  # the sole faces the ground along its own x
    assert all(0 < projection.recoil_share < 1 for projection in leg.projections)
    assert f"{len(leg.projections)} postures" in capsys.readouterr().out
    free = tmp_path / "free.xml"  # a body in free space with one slide
    free.write_text(SLIDE.format(base="<freejoint/>", mass=2.0, gravity="0 0 -9.81"))
    floating = example.main(str(free), "tip", "+x", 2)
    # of a slide along its axis through both masses, kappa is the share of the slide's mass
    assert [p.recoil_share for p in floating.projections] == pytest.approx([0.25 / 2.25] * 2, rel=1e-6)
    capsys.readouterr()
    assert example.main(str(ARM.with_name("gripper.xml"))) is None
    assert "left" in capsys.readouterr().out


def test_random_postures_are_inside_the_joint_ranges() -> None:
    model = load_model(ARM)
    postures = random_postures(model, SITE, 200, seed=3)
    assert postures == random_postures(model, SITE, 200, seed=3)
    wrist = np.degrees([posture["wrist"] for posture in postures])
    assert np.abs(wrist).max() <= 120 * 0.8
    assert np.abs(wrist).max() > 80
    model.jnt_range[2] = np.radians([100.0, 120.0])  # without the posture in which the model is defined
    assert min(posture["wrist"] for posture in random_postures(model, SITE, 9)) > np.radians(100.0)
    model.jnt_limited[2] = False
    turns = [posture["wrist"] for posture in random_postures(model, SITE, 200)]
    assert 2.3 < max(np.abs(turns)) <= 0.8 * np.pi
    with refused("margin", value=0.5):
        random_postures(model, SITE, 2, margin=0.5)
    with refused("postures"):
        project_workspace(model, SITE, postures[:1], ("+y",))
