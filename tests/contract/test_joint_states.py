"""Distances from recorded joint states and a robot model, and the calibration that follows from them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_text import in_this_process

import pretouch as pt
from pretouch.robots import SensorSite
from refusals import refused

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
pytest.importorskip("rosbags", reason="needs the extra 'ros'")

import recorded  # noqa: E402
from pretouch.recording.joint_states import distances_from_joints  # noqa: E402

ROOT = Path(__file__).parents[2]
WALL = 0.55  # m, in the world frame
LENGTHS = np.array([0.3, 0.25, 0.12])
JOINTS = ("shoulder", "elbow", "wrist")
SITE = SensorSite("fingertip", axis="+x")
CURVE = pt.InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)  # that of examples/loop.toml


def arm_with_wall(folder: Path) -> Path:
    """Write the arm of the examples with a wall at x = 0.55 m, whose surface faces the arm."""
    text = (ROOT / "examples/robots/arm.xml").read_text()
    wall = f'<geom name="wall" type="box" size="0.01 1 1" pos="{WALL + 0.01!r} 0 0"/></worldbody>'
    path = folder / "cell.xml"
    path.write_text(text.replace("</worldbody>", wall, 1))
    return path


def postures(count: int, sweep: float = 0.4) -> np.ndarray:
    """Return joint positions that move the fingertip toward the wall and back twice, and turn it by up to 0.2 rad."""
    phase = np.linspace(0.0, 2.0, count)
    shoulder = 1.2 - sweep * 0.5 * (1 - np.cos(2 * np.pi * phase))
    elbow = -1.9 + 1.3 * sweep * 0.5 * (1 - np.cos(2 * np.pi * phase))
    return np.column_stack([shoulder, elbow, -shoulder - elbow + 0.2 * np.sin(2 * np.pi * phase)])


def true_distances(angles: np.ndarray) -> np.ndarray:
    """Return the distance along the axis of the fingertip to the wall; positive angles turn the arm upward."""
    sums = np.cumsum(angles, axis=1)
    return (WALL - np.cos(sums) @ LENGTHS) / np.cos(sums[:, 2])


def joint_state(types: Any, nanoseconds: int, names: tuple[str, ...], values: Any) -> Any:
    header, numbers = recorded.stamp(types, nanoseconds), np.asarray(values, dtype=np.float64)
    empty = np.zeros(0)
    return types.types[recorded.JOINTS](header=header, name=list(names), position=numbers, velocity=empty, effort=empty)


def write(folder: Path, angles: np.ndarray, names: tuple[str, ...] = JOINTS, **options: Any) -> Path:
    """Write a bag with joint states at 100 Hz in the order `names`, and readings that lag by 20 ms at 250 Hz."""
    types = recorded.store()
    clock = np.arange(len(angles)) * 10_000_000 + 10**18
    columns = {**dict(zip(JOINTS, angles.T, strict=True)), "gripper": np.zeros(len(angles))}
    rows = np.column_stack([columns[name] for name in names])
    states = [(int(t), joint_state(types, int(t), names, row)) for t, row in zip(clock, rows, strict=True)]
    fast = np.arange(clock[0], clock[-1], 4_000_000)
    seen = np.interp((fast - 20_000_000 - clock[0]) / 1e9, (clock - clock[0]) / 1e9, true_distances(angles))
    output = np.exp(CURVE.log_output(np.maximum(seen, 0.0))) + 152.0 + np.random.default_rng(4).normal(0, 5, len(seen))
    readings = [(int(t), recorded.float_message(types, float(v))) for t, v in zip(fast, output, strict=True)]
    topics = {"/joint_states": (recorded.JOINTS, states), "/proximity": (recorded.FLOAT, readings)}
    return recorded.write_bag(folder / "bag", topics, types=types, **options)


@pytest.mark.parametrize("names", [JOINTS, ("gripper", "wrist", "shoulder", "elbow")])
@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_distances_are_those_of_the_geometry(tmp_path: Path, names: tuple[str, ...], storage: str) -> None:
    angles = postures(200)
    bag, model = write(tmp_path, angles, names, storage=storage), pt.robots.load_model(arm_with_wall(tmp_path))
    distances = distances_from_joints(bag, "/joint_states", model, SITE)
    assert distances.kind == "distance"
    assert distances.values == pytest.approx(true_distances(angles), abs=1e-9)
    assert distances.time == pytest.approx(np.arange(200) / 100)


def test_json_messages_are_read(tmp_path: Path) -> None:
    angles = postures(50)
    rows = [(int(1e7) * i, {"name": JOINTS, "position": row.tolist()}) for i, row in enumerate(angles)]
    file = recorded.write_json_mcap(tmp_path / "joints.mcap", {"/joints": rows})
    distances = distances_from_joints(file, "/joints", pt.robots.load_model(arm_with_wall(tmp_path)), SITE)
    assert distances.values == pytest.approx(true_distances(angles), abs=1e-9)


@pytest.mark.slow
def test_a_calibration_follows_from_joint_states(tmp_path: Path) -> None:
    bag, model = write(tmp_path, postures(1000)), arm_with_wall(tmp_path)
    words = ["--topic", "/proximity", "--joints", "/joint_states", "--model", str(model), "--site", "fingertip"]
    options = ["--calibration", "pairs.csv", "--no-report", "--gain", "-0.86 N*s", "--axis", "+x"]
    answer = in_this_process("replay", ROOT / "examples/loop.toml", bag, *words, *options, folder=tmp_path)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    distance, reading = np.loadtxt(tmp_path / "pairs.csv", delimiter=",", skiprows=1).T
    expected = np.exp(CURVE.log_output(distance / 1e3)) + 152.0
    # The lag of 20 ms is estimated and removed. An error of 1 ms moves the reading by its slope times the speed.
    slope = expected * np.abs(CURVE.log_slope(distance / 1e3))
    assert (np.abs(reading - expected) <= 4 * 5 + 1e-3 * slope * 0.12).mean() > 0.99
    assert np.ptp(distance) > 100  # mm


@pytest.mark.parametrize(
    ("names", "change", "fields"),
    [
        (("shoulder", "elbow", "gripper"), {}, {"argument": "joint 'wrist'"}),  # a joint is missing
        (JOINTS, {"angles": np.degrees(postures(20))}, {"argument": "joint 'shoulder'"}),  # degrees
        (
            JOINTS,
            {"site": SensorSite("fingertip", axis="+y")},
            {"argument": "site 'fingertip'"},
        ),  # nothing is on that axis
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, names: tuple[str, ...], change: dict, fields: dict[str, Any]
) -> None:
    bag = write(tmp_path, change.get("angles", postures(20)), names)
    model = pt.robots.load_model(arm_with_wall(tmp_path))
    with refused(**fields):
        distances_from_joints(bag, "/joint_states", model, change.get("site", SITE))


def test_two_publishers_with_different_joints_are_refused(tmp_path: Path) -> None:
    types = recorded.store()
    messages = [
        (10**7 * i, joint_state(types, 10**7 * i, JOINTS if i % 2 else ("left", "right", "wrist"), np.zeros(3)))
        for i in range(10)
    ]
    bag = recorded.write_bag(tmp_path / "bag", {"/joint_states": (recorded.JOINTS, messages)}, types=types)
    with refused("/joint_states"):
        distances_from_joints(bag, "/joint_states", pt.robots.load_model(arm_with_wall(tmp_path)), SITE)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--joints", "/joint_states"], "--model"),
        (["--joints", "/joint_states", "--reference", "/other"], "--reference"),
    ],
)
def test_options_that_do_not_fit_are_refused(tmp_path: Path, options: list[str], words: str) -> None:
    recording = str(write(tmp_path, postures(20)))
    given = ["--topic", "/proximity", "--gain", "-0.86 N*s", *options]
    answer = in_this_process("replay", ROOT / "examples/loop.toml", recording, *given, folder=tmp_path)
    assert answer.returncode == 2
    assert words in answer.stderr
    assert "Traceback" not in answer.stderr
