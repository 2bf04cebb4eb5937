"""A replayed recording: its numbers are those of rosbags, and the law's steps are those of the simulation."""

from __future__ import annotations

import math
import sqlite3
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.control import Conditioning, Status, VirtualDrag
from pretouch.control.structures import RawSample
from pretouch.recording import Recording, read_recording, replay
from pretouch.recording.containers import read_contents
from pretouch.recording.decoding import decode
from pretouch.recording.layout import UnsupportedLayoutError, layout_of
from pretouch.recording.measurements import measurements_of
from pretouch.recording.reading import read_recordings
from pretouch.recording.stepping import readings_of, run_samples, run_steps

pytest.importorskip("rosbags", reason="needs the extra ros")
pytest.importorskip("mcap", reason="needs the extra ros")
import recorded

LOOP = Path(__file__).parents[2] / "examples/loop.toml"


def simulated(controller: Any, task: Any, phase: float = 0.0) -> list[Any]:
    """Return the samples of a controller in one simulated encounter, whose readings come at whole microseconds."""
    from pretouch.exports.vectors import _approach

    loop = replace(task.loop, chain=replace(task.loop.chain, random_phase=False, phase=phase), contact=None)
    return list(_approach(loop, controller, (task.scenario, task.sensor)))


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3", "CSV"])
@pytest.mark.parametrize("median", [1, 5])
def test_the_steps_of_a_simulated_recording_are_those_of_the_simulation(
    storage: str, median: int, tmp_path: Path
) -> None:
    """Bit for bit: the damper's outputs do not depend on the age of a reading, which the bag rounds to nanoseconds."""
    task = pt.load_scenario(LOOP).replace(gain=-0.86)
    law = task.loop.law
    law = replace(law, conditioning=replace(law.conditioning, median_window=median), contact_threshold=1e6)
    task = task.replace(loop=replace(task.loop, law=law))
    controller = law.with_value(-0.86)
    samples = simulated(controller, task)
    run = controller.begin()
    expected = [run.step(s.reading, s.fresh, s.age) for s in samples]
    fresh = [k for k, s in enumerate(samples) if s.fresh]
    time, values = np.array(fresh) * controller.period, [samples[k].reading for k in fresh]
    if storage == "CSV":
        rows = "\n".join(f"{t!r},{v!r}" for t, v in zip(time.tolist(), values, strict=True))
        (tmp_path / "run.csv").write_text(f"time [s],reading\n{rows}\n")
        recording = read_recording(tmp_path / "run.csv")
    else:
        recording = read_recording(recorded.float_bag(tmp_path / "run", time, values, storage=storage), "/reading")
    steps = replay(task, recording).steps
    count = min(len(expected) - fresh[0], len(steps.time) - 1)
    assert count > 400
    assert np.abs(steps.virtual_force).max() > 5
    for name in ("virtual_force", "log_level", "position", "velocity", "status"):
        own = getattr(steps, name)[:count]
        assert np.array_equal(own, [getattr(o, name) for o in expected[fresh[0] : fresh[0] + count]]), name


def test_the_steps_of_a_drag_agree_to_the_rounding_of_stamps(tmp_path: Path) -> None:
    """The drag divides by the time between two readings, 4 ms, which two stamps of 1 ns change by at most 5e-7."""
    task = pt.load_scenario(LOOP)
    law = replace(
        task.loop.law,
        law=VirtualDrag(drag=0.05, noise=20.0),
        conditioning=Conditioning(floor=100.0, sensor_period=4e-3),
    )
    samples = simulated(law, task)
    fresh = [k for k, s in enumerate(samples) if s.fresh]
    newest = np.array(fresh)[np.searchsorted(fresh, np.arange(fresh[0], len(samples)), side="right") - 1]
    ages = law.period * (np.arange(fresh[0], len(samples)) - newest)  # since the reading arrived
    run = law.begin()
    expected = [run.step(s.reading, s.fresh, age) for s, age in zip(samples[fresh[0] :], ages, strict=True)]
    bag = recorded.float_bag(tmp_path / "run", np.array(fresh) * law.period, [samples[k].reading for k in fresh])
    recording = read_recording(bag, "/reading")
    steps = run_steps(law, recording.time, recording.values)
    count = min(len(expected), len(steps.time) - 1)
    forces = np.array([o.virtual_force for o in expected[:count]])
    assert np.abs(forces).max() > 0.05
    assert steps.virtual_force[:count] == pytest.approx(forces, rel=0, abs=1e-6 * np.abs(forces).max())


def test_a_law_in_python_runs_as_well() -> None:
    """The same steps by calls of the compiled one, one by one."""
    controller = pt.load_scenario(LOOP).loop.law.with_value(-0.86)
    samples = np.zeros(300, dtype=np.dtype(RawSample))
    samples["reading"] = 300 * np.exp(np.arange(300) / 100)
    samples["fresh"] = np.arange(300) % 4 == 0
    in_python = SimpleNamespace(step=lambda *_: None, begin=controller.begin)
    own, compiled = run_samples(in_python, samples), run_samples(controller, samples)
    assert np.abs(compiled["virtual_force"]).max() > 1
    for name in compiled.dtype.names:
        assert np.array_equal(own[name], compiled[name])


def test_distances_are_converted_as_in_the_simulation() -> None:
    """xi of the curve plus the offset; no reading when too near to be measured, and nothing beyond the curve's end."""
    sensor = pt.InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32, maximum_distance=0.3)
    values = np.array([0.05, 0.0, -0.01, -np.inf, np.inf, np.nan, 0.31])
    bag = Recording(source="", topic="", message_type="", stamps=np.arange(7), values=values, kind="distance")
    own = readings_of(bag, sensor, 0.5)
    start = 1.3e-5 * 0.0419**-3.32
    expected = [1.3e-5 * (0.05 + 0.0419) ** -3.32, start, start, np.nan, 0.0, np.nan, 0.0]
    assert own == pytest.approx(np.array(expected) + 0.5, rel=1e-12, nan_ok=True)


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("compression", ["", "FILE", "MESSAGE", "STORAGE"])
def test_a_bag_is_read_as_rosbags_reads_it(storage: str, compression: str, tmp_path: Path) -> None:
    if (storage, compression) == ("SQLITE3", "STORAGE"):
        pytest.skip("sqlite3 has no compression of its own")
    from rosbags.rosbag2 import Reader

    time = np.cumsum(np.random.default_rng(1).uniform(0.005, 0.02, 300))
    values = np.sin(time)
    bag = recorded.range_bag(tmp_path / "bag", time, values, storage=storage, compression=compression, delay_ns=2500)
    types = recorded.store()
    with Reader(bag) as reader:
        rows = [(t, types.deserialize_cdr(raw, c.msgtype)) for c, t, raw in reader.messages()]
    header, receive = (read_recording(bag, "/range", clock=clock) for clock in ("header", "receive"))
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for _, m in rows]
    assert header.stamps.tolist() == stamps
    assert receive.stamps.tolist() == [t for t, _ in rows]
    assert np.array_equal(header.values, [m.range for _, m in rows])
    assert header.bounds == (0.0, 1.0)  # below min_range: too near, which the replay decides
    assert np.array_equal(np.isneginf(measurements_of(header).values), header.values < 0)
    assert header.transport == pytest.approx(2.5e-6, abs=1e-12)
    assert (header.kind, header.clock, receive.clock) == ("distance", "header", "receive")


def messages() -> dict[str, list[Any]]:
    """Return messages of several types: of the same layout, and with texts and lists of different lengths."""
    types = recorded.store()
    t, rng = types.types, np.random.default_rng(7)
    joint, point, wrench = t["sensor_msgs/msg/JointState"], t["geometry_msgs/msg/Point"], t["geometry_msgs/msg/Vector3"]
    quaternion = t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.5, z=0.0, w=1.0)
    pose = t["geometry_msgs/msg/PoseStamped"]
    made: dict[str, list[Any]] = {
        "sensor_msgs/msg/Range": [
            recorded.range_message(types, 10**9 + i, rng.random(), "a" * (i % 9)) for i in range(40)
        ],
        "sensor_msgs/msg/JointState": [
            joint(
                header=recorded.stamp(types, 5 * 10**9 + i),
                name=["a", "joint_2", "b" * (1 + i % 3)],
                position=rng.random(3),
                velocity=rng.random(i % 2 * 3),
                effort=np.zeros(0),
            )
            for i in range(40)
        ],
        "geometry_msgs/msg/PoseStamped": [
            pose(
                header=recorded.stamp(types, 10**9 * i),
                pose=t["geometry_msgs/msg/Pose"](
                    position=point(x=1.0 * i, y=2.0, z=rng.random()), orientation=quaternion
                ),
            )
            for i in range(20)
        ],
        "geometry_msgs/msg/WrenchStamped": [
            t["geometry_msgs/msg/WrenchStamped"](
                header=recorded.stamp(types, i + 1),
                wrench=t["geometry_msgs/msg/Wrench"](
                    force=wrench(x=1.0, y=2.0, z=float(i)), torque=wrench(x=0.0, y=0.0, z=0.0)
                ),
            )
            for i in range(20)
        ],
    }
    numbers = ("Bool", "Float32", "Float64", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")
    for name in numbers:
        kind = f"std_msgs/msg/{name}"
        values = [bool(i % 2) if name == "Bool" else float(i) / 3 if name.startswith("F") else i for i in range(20)]
        made[kind] = [t[kind](data=value) for value in values]
    return made


FIELDS = {
    "sensor_msgs/msg/Range": "range",
    "sensor_msgs/msg/JointState": "position[1]",
    "geometry_msgs/msg/PoseStamped": "pose.position.z",
    "geometry_msgs/msg/WrenchStamped": "wrench.force.z",
}


@pytest.mark.parametrize("message_type", list(messages()))
def test_decoded_columns_are_those_of_the_deserializer(message_type: str, tmp_path: Path) -> None:
    made = messages()[message_type]
    bag = recorded.write_bag(tmp_path / "bag", {"/t": (message_type, [(10 * i, m) for i, m in enumerate(made)])})
    topic = read_contents(bag, ["/t"]).messages["/t"]
    field = FIELDS.get(message_type, "data")
    decoded = decode(topic, field)
    types = recorded.store()
    expected, stamps = [], []
    for raw in topic.data:
        message = part = types.deserialize_cdr(raw, message_type)
        for name in field.replace("]", "").replace("[", ".").split("."):
            part = part[int(name)] if name.isdigit() else getattr(part, name)
        expected.append(float(part))
        header = getattr(message, "header", None)
        stamps.append(0 if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec)
    assert decoded.values.tolist() == expected
    assert decoded.stamps.tolist() == stamps


def test_the_layout_is_that_of_every_type_that_rosbags_knows() -> None:  # noqa: C901
    """All numbers of a message of every ROS type whose fields have a default, compared one by one."""
    types = recorded.store("ROS2_JAZZY")
    rng = np.random.default_rng(3)

    def made(kind: str) -> Any:
        return types.types[kind](**{name: value(part) for name, part in types.fielddefs[kind][1]})

    def value(part: Any) -> Any:
        node, detail = int(part[0]), part[1]
        if node == 2:
            return made(detail)
        if node == 1:
            name = detail[0]
            if name == "string":
                return "x" * int(rng.integers(6))
            if name == "bool":
                return bool(rng.integers(2))
            return float(np.float32(rng.random())) if name.startswith("float") else int(rng.integers(100))
        element, count = detail
        size = count if node == 3 else int(rng.integers(4))
        if int(element[0]) == 1 and element[1][0] not in {"string", "wstring"}:
            return np.array([value(element) for _ in range(size)], dtype=_numpy_name(element[1][0]))
        return [value(element) for _ in range(size)]

    def _numpy_name(name: str) -> str:
        return {"byte": "uint8", "char": "uint8"}.get(name, name)

    def numbers(part: Any, content: Any, path: str) -> Any:
        node, detail = int(part[0]), part[1]
        if node == 2:
            for name, inner in types.fielddefs[detail][1]:
                yield from numbers(inner, getattr(content, name), f"{path}.{name}" if path else name)
        elif node == 1:
            yield from () if isinstance(content, str) else [(path, content)]
        else:
            for i, element in enumerate(content):
                yield from numbers(detail[0], element, f"{path}[{i}]")

    checked = 0
    for kind in sorted(types.fielddefs):
        if "/msg/" not in kind:
            continue
        try:
            message = made(kind)
            raw = bytes(types.serialize_cdr(message, kind))
            layout = layout_of(raw, kind, types.fielddefs)
        except (UnsupportedLayoutError, KeyError, TypeError):
            continue
        own = {
            name: np.frombuffer(raw, dtype=place.kind, count=1, offset=place.offset)[0]
            for name, place in layout.fields.items()
        }
        assert own == dict(numbers((2, kind), message, "")), kind
        checked += 1
    assert checked > 100


def test_types_of_older_bags_without_definitions_are_known(tmp_path: Path) -> None:
    bag = recorded.range_bag(
        tmp_path / "old",
        np.arange(5) * 0.01,
        np.arange(5) * 0.1,
        storage="SQLITE3",
        types=recorded.store("ROS2_HUMBLE"),
    )
    with sqlite3.connect(next(bag.glob("*.db3"))) as database:
        database.execute("DROP TABLE message_definitions")
    assert read_recording(bag, "/range").values.tolist() == np.float32(np.arange(5) * 0.1).astype(float).tolist()


@pytest.mark.parametrize("chunks", [True, False])
def test_json_messages_of_a_plain_mcap_file(chunks: bool, tmp_path: Path) -> None:
    rows = [(1000 * i, {"a": {"b": [i, 2 * i]}, "timestamp": {"sec": 3, "nsec": i}}) for i in range(50)]
    file = recorded.write_json_mcap(tmp_path / "x.mcap", {"/j": rows, "/n": [(7, 5)]}, use_chunking=chunks)
    recording = read_recording(file, "/j.a.b[1]")
    assert recording.values.tolist() == [2.0 * i for i in range(50)]
    assert recording.stamps.tolist() == [3 * 10**9 + i for i in range(50)]
    plain, other = read_recordings(file, ("/n", "/j.a.b[0]"), clock="receive")
    assert (plain.values.tolist(), plain.stamps.tolist()) == ([5.0], [7])
    assert other.stamps[1] == 1000


def test_a_bag_of_several_files_is_read_in_their_order(tmp_path: Path) -> None:
    folder = tmp_path / "parts"
    folder.mkdir()
    for number in (10, 9, 0):
        part = recorded.float_bag(tmp_path / f"b{number}", [number, number + 0.5], [number, number + 0.5])
        next(part.glob("*.mcap")).rename(folder / f"bag_{number}.mcap")
    assert read_recording(folder, "/reading").values.tolist() == [0, 0.5, 9, 9.5, 10, 10.5]


def test_a_reading_that_is_not_usable_has_the_status_of_the_law() -> None:
    task = pt.load_scenario(LOOP).replace(gain=-0.86)
    values = np.full(100, 200.0)
    values[50] = math.nan
    bag = Recording(source="", topic="t", message_type="", stamps=4_000_000 * np.arange(100), values=values)
    steps = replay(task, bag).steps
    flagged = np.flatnonzero(steps.status & Status.INVALID)
    assert flagged.tolist() == [200]  # 50 readings of 4 ms later, in steps of 1 ms
