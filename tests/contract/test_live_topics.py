"""Live topics: messages of all ROS 2 distributions are received, or refused with the true reason.

The publishers use the DDS library `cyclonedds` with the message definitions of the distributions. It sends type
information, as Fast DDS of ROS 2 Kilted does.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pretouch._core.errors import InvalidInputError
from pretouch.recording.no_object import classify_distances, distance_meaning
from pretouch.recording.record_file import RecordFile
from pretouch.recording.sources.ros_discovery import Discovery, discovery_settings
from pretouch.recording.sources.source import is_usable

ROOT = Path(__file__).parents[2]
HERE = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
</General></Domain></CycloneDDS>"""
VARIABLES = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A DDS domain within this computer."""
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed (pip install pretouch[ros])")
    from cyclonedds.domain import DomainParticipant

    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("CYCLONEDDS_URI", HERE)
    return DomainParticipant(91)


def publisher(participant: Any, topic: str, kind: Any, *policies: Any) -> Any:
    """Return a writer of a topic."""
    from cyclonedds.core import Qos
    from cyclonedds.pub import DataWriter, Publisher
    from cyclonedds.topic import Topic

    quality = Qos(*policies)
    return DataWriter(Publisher(participant, qos=quality), Topic(participant, f"rt{topic}", kind), qos=quality)


def message(kind: Any, value: Any, limits: tuple[float, float] = (0.02, 2.0)) -> Any:
    """Return a message with a reading; members of later distributions are 0."""
    from pretouch.recording.sources.ros_messages import message_types

    types = message_types()
    header = types.Header(types.Time(1, 0), "sensor")
    known = {"header": header, "min_range": limits[0], "max_range": limits[1], "range": value, "data": value}
    return kind(**{name: known.get(name, 0) for name in kind.__annotations__})


def custom(name: str, **members: Any) -> Any:
    """Return a message type that has the name of a ROS type."""
    from cyclonedds.idl import make_idl_struct
    from cyclonedds.idl.annotations import autoid, final

    return autoid("sequential")(final(make_idl_struct(name.rsplit("::", maxsplit=1)[-1].rstrip("_"), name, members)))


def read(source: Any, count: int) -> list[float]:
    """Return the readings of a source, as soon as they are so many."""
    outputs: list[float] = []
    end = time.monotonic() + 20
    while len(outputs) < count and time.monotonic() < end:
        outputs += [reading.output for reading in source.read()]
    return outputs


DISTRIBUTIONS = {
    "Range of Humble": ("Range", 0.5),
    "Range of Jazzy and Kilted": ("RangeWithVariance", 0.5),
    "Float64": ("Float64", 0.1),
    "Float32": ("Float32", 0.5),
    "UInt16": ("UInt16", 60_000),
    "Int32": ("Int32", -70_000),
    "UInt8": ("UInt8", 200),
    "Int64": ("Int64", 2**40),
}


@pytest.mark.parametrize(("name", "value"), DISTRIBUTIONS.values(), ids=DISTRIBUTIONS)
def test_messages_of_all_distributions_are_received(name: str, value: float, network: Any) -> None:
    from pretouch.recording.sources.ros_messages import message_types
    from pretouch.recording.sources.topic import TopicSource

    kind = getattr(message_types(), name)
    writer = publisher(network, f"/types/{name}", kind)
    source = TopicSource(f"/types/{name}", 91)
    for _ in range(3):
        writer.write(message(kind, value))
    assert read(source, 3) == [value] * 3
    assert source.notes == ()
    source.close()


def test_a_range_of_a_later_distribution_is_read_by_the_definition_of_its_publisher(network: Any) -> None:
    from cyclonedds.idl.types import uint8

    from pretouch.recording.sources.ros_messages import dds_name, message_types
    from pretouch.recording.sources.topic import TopicSource

    known = message_types().RangeWithVariance
    kind = custom(dds_name(known), **known.__annotations__, quality=uint8)
    writer = publisher(network, "/later", kind)
    source = TopicSource("/later", 91)
    writer.write(message(kind, 0.5))
    assert read(source, 1) == [0.5]


def test_a_publisher_without_type_information_is_read_by_the_shortest_definition() -> None:
    """Fast DDS of ROS 2 Humble and Jazzy sends none; the shortest definition decodes the bytes of both."""
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed (pip install pretouch[ros])")
    from types import SimpleNamespace

    from pretouch.recording.sources.ros_messages import dds_name, message_types
    from pretouch.recording.sources.topic import _message_type

    types = message_types()
    publication = SimpleNamespace(type_name=dds_name(types.Range), type_id=None)
    assert _message_type(None, publication)[1][0] is types.Range


def profiles() -> dict[str, tuple[Any, ...]]:
    """Return policies of publishers; the first four are profiles of ROS 2."""
    from cyclonedds.core import Policy

    reliable = Policy.Reliability.Reliable(100_000_000)
    return {
        "default": (reliable, Policy.History.KeepLast(10)),
        "sensor data": (Policy.Reliability.BestEffort, Policy.History.KeepLast(5)),
        "latched": (reliable, Policy.Durability.TransientLocal),
        "deadline": (Policy.Deadline(10**9), Policy.Lifespan(10**9), Policy.Liveliness.ManualByTopic(10**9)),
        "exclusive": (Policy.Ownership.Exclusive, Policy.OwnershipStrength(3)),
        "partition": (Policy.Partition(["cell"]),),
        "source order": (Policy.DestinationOrder.BySourceTimestamp,),
    }


@pytest.mark.parametrize(
    "profile", ["default", "sensor data", "latched", "deadline", "exclusive", "partition", "source order"]
)
def test_publishers_of_all_profiles_are_received(profile: str, network: Any) -> None:
    from pretouch.recording.sources.ros_messages import message_types
    from pretouch.recording.sources.topic import TopicSource

    kind = message_types().RangeWithVariance
    topic = f"/profiles/{profile.replace(' ', '_')}"
    writer = publisher(network, topic, kind, *profiles()[profile])
    source = TopicSource(topic, 91)
    writer.write(message(kind, 0.5))
    assert read(source, 1) == [0.5]


def test_another_publisher_that_is_not_read_is_noted_with_its_policy(network: Any) -> None:
    from pretouch.recording.sources.ros_messages import message_types
    from pretouch.recording.sources.topic import TopicSource

    kind = message_types().Float64
    shared = publisher(network, "/two", kind)
    source = TopicSource("/two", 91)
    _other = publisher(network, "/two", kind, *profiles()["exclusive"])
    shared.write(message(kind, 1.5))
    assert read(source, 1) == [1.5]
    source.close()  # the result of a recording has the notes of a closed source
    assert [("/two" in note, "ownership" in note) for note in source.notes] == [(True, True)]


def test_a_type_with_other_members_is_refused_as_such(network: Any) -> None:
    from cyclonedds.idl.types import float32

    from pretouch.recording.sources.topic import TopicSource

    _writer = publisher(network, "/odd", custom("sensor_msgs::msg::dds_::Range_", distance=float32))
    with pytest.raises(InvalidInputError, match=r"sensor_msgs/Range has other members.*type consistency"):
        TopicSource("/odd", 91)


def test_a_type_without_a_reading_is_refused_with_those_that_have_one(network: Any) -> None:
    from pretouch.recording.sources.topic import TopicSource

    _writer = publisher(network, "/text", custom("std_msgs::msg::dds_::String_", data=str))
    with pytest.raises(
        InvalidInputError, match=r"std_msgs/String, expected one of sensor_msgs/Range, std_msgs/Float64"
    ):
        TopicSource("/text", 91)


def test_a_topic_of_another_domain_is_found_there(network: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from cyclonedds.domain import DomainParticipant

    from pretouch.recording.sources import topic
    from pretouch.recording.sources.ros_messages import message_types

    monkeypatch.setattr(topic, "_DISCOVERY", 0.05)
    monkeypatch.setattr(topic, "_DOMAINS", range(91, 95))
    elsewhere = DomainParticipant(93)
    _writer = publisher(elsewhere, "/moved", message_types().Float64)
    with pytest.raises(InvalidInputError, match=r"in the DDS domain 91 .* published in the domain 93: use --domain 93"):
        topic.TopicSource("/moved", 91)
    monkeypatch.setattr(topic, "_ELSEWHERE", 0.05)
    with pytest.raises(InvalidInputError, match="ROS_STATIC_PEERS") as missing:
        topic.TopicSource("/nowhere", 91)
    for word in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY", "ROS_DOMAIN_ID", "shared memory"):
        assert word in str(missing.value)


# --- readings that are none


@pytest.mark.parametrize(
    ("unit", "usable"),
    [(None, [0.5, 0.02]), ("m", [0.5, 0.02]), ("counts", [0.5, -1.0, 2.0, 0.01, 9000.0, 0.02])],
)
def test_readings_that_are_none_are_skipped_and_counted(unit: str | None, usable: list[float], network: Any) -> None:
    from pretouch.recording.sources.ros_messages import message_types
    from pretouch.recording.sources.topic import TopicSource

    kind = message_types().RangeWithVariance
    writer = publisher(network, f"/ranges/{unit}", kind)
    source = TopicSource(f"/ranges/{unit}", 91, unit)
    sent = [math.nan, 0.5, math.inf, -math.inf, -1.0, 2.0, 0.01, 9000.0, 0.02]
    for value in sent:
        writer.write(message(kind, value))
    assert read(source, len(usable)) == pytest.approx(usable, rel=1e-6)
    (note,) = source.notes
    assert f"skipped {len(sent) - len(usable)} messages" in note
    assert ("no object" in note) == (unit != "counts")
    assert "--unit counts" in source.why_silent() or unit == "counts"


@pytest.mark.parametrize("bounds", [(0.02, 2.0), (0.0, 0.0), (math.nan, math.nan), (-math.inf, math.inf)])
@pytest.mark.parametrize("value", [0.5, 0.02, 0.01, 1.9999999, 2.0, 2.5, math.inf, -math.inf, math.nan, 8190.0])
def test_a_live_reading_means_what_it_means_in_a_recording(value: float, bounds: tuple[float, float]) -> None:
    recorded = classify_distances(np.array([value]), bounds).values[0]
    meaning = distance_meaning(value, bounds)
    expected = {math.inf: "no object", -math.inf: "too near"}.get(recorded, "distance")
    assert meaning == ("no valid reading" if math.isnan(recorded) else expected)


def test_outputs_that_are_not_finite_are_no_readings() -> None:
    assert [is_usable(value) for value in (0.0, -1e300, math.nan, math.inf, -math.inf)] == [True, True, *[False] * 3]


def test_a_recording_with_readings_that_are_not_finite_is_continued_without_them(tmp_path: Path) -> None:
    path = tmp_path / "sensor.csv"
    path.write_text("distance [mm],output [V]\n0,1.5\n0,nan\n5,inf\n5,1.25\ninf,0.5\n")
    file = RecordFile(path, unit=None, origin="a test", resume=True)
    file.close()
    assert file.outputs == {0.0: [1.5], 0.005: [1.25], math.inf: [0.5]}
    assert file.calibration is not None
    assert len(file.notes) == 1


# --- discovery


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({}, Discovery()),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": ""}, Discovery()),
        ({"ROS_LOCALHOST_ONLY": "0"}, Discovery()),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, Discovery(reach="LOCALHOST")),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}, Discovery(reach="SYSTEM_DEFAULT")),
        ({"ROS_LOCALHOST_ONLY": "1"}, Discovery(reach="LOCALHOST", is_localhost_only=True)),
        (
            {"ROS_LOCALHOST_ONLY": "1", "ROS_STATIC_PEERS": "192.0.2.7", "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"},
            Discovery(reach="LOCALHOST", is_localhost_only=True),
        ),
        ({"ROS_STATIC_PEERS": "192.0.2.7; arm.local;"}, Discovery(peers=("192.0.2.7", "arm.local"))),
        ({"CYCLONEDDS_URI": "file:///etc/dds.xml"}, Discovery(cyclone="file:///etc/dds.xml")),
    ],
)
def test_the_variables_of_ros_are_read_as_ros_does(environment: dict[str, str], expected: Discovery) -> None:
    settings = discovery_settings(environment)
    chosen = ("reach", "is_localhost_only", "peers", "cyclone")
    assert [getattr(settings, name) for name in chosen] == [getattr(expected, name) for name in chosen]
    configuration = settings.configuration or ""
    assert ("AllowMulticast>false" in configuration) == (environment == {VARIABLES[0]: "LOCALHOST"})
    assert ("NetworkInterface" in configuration) == settings.is_localhost_only
    assert all(f'<Peer address="{peer}"/>' in configuration for peer in expected.peers)
    assert configuration.endswith(expected.cyclone)


@pytest.mark.parametrize("value", ["OFF", "localhost", "NONE"])
def test_a_range_that_finds_no_topic_is_refused(value: str) -> None:
    with pytest.raises(InvalidInputError, match="ROS_AUTOMATIC_DISCOVERY_RANGE"):
        discovery_settings({"ROS_AUTOMATIC_DISCOVERY_RANGE": value})


PUBLISHER = """
import sys, time
from pathlib import Path
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from pretouch.recording.sources.ros_discovery import discovery_settings
from pretouch.recording.sources.ros_messages import message_types

participant, *domain = discovery_settings().join(92)
types = message_types()
writer = DataWriter(participant, Topic(participant, "rt/reach", types.RangeWithVariance))
header = types.Header(types.Time(1, 0), "sensor")
number = 0
while not Path(sys.argv[1]).exists():
    number += 1
    value = float("nan") if number % 3 == 0 else 0.5 + (number % 7) * 1e-3
    writer.write(types.RangeWithVariance(header, 1, 0.1, 0.02, 2.0, value, 0.0))
    time.sleep(0.005)
"""
REACHES = {
    "localhost": ("ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST", "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"),
    "localhost only": ("ROS_LOCALHOST_ONLY=1", "ROS_LOCALHOST_ONLY=1"),
}


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("sender", "receiver"), REACHES.values(), ids=REACHES)
def test_a_publisher_on_this_computer_is_found_without_multicast(sender: str, receiver: str, tmp_path: Path) -> None:
    """A third of the messages is NaN: they are counted, and are in no file."""
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed (pip install pretouch[ros])")
    kept = {name: value for name, value in os.environ.items() if name not in {*VARIABLES, "CYCLONEDDS_URI"}}
    environment = {**kept, "PYTHONPATH": str(ROOT / "src"), "ROS_DOMAIN_ID": "92"}
    stop = tmp_path / "stop"
    node = subprocess.Popen([sys.executable, "-c", PUBLISHER, str(stop)], env=environment | dict([sender.split("=")]))
    words = ["record", "sensor.csv", "--topic", "/reach", "--distances", "0 mm", "--no-empty-scene"]
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pretouch", *words, "--readings", "5", "--dwell", "0.1 s", "--json"],
            input="\n",
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env=environment | dict([receiver.split("=")]),
        )
    finally:
        stop.touch()
        node.wait(timeout=30)
    assert done.returncode == 1, done.stderr
    assert "messages without a usable reading" in done.stdout
    for name in ("sensor.csv", "sensor-raw.csv"):
        text = (tmp_path / name).read_text()
        assert "nan" not in text
        assert text.count(",0.5") >= 5
