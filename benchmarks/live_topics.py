"""Record live topics of real ROS 2 publishers with `pretouch record`, in all combinations, and count what was received.

Five message types, four quality-of-service profiles and three discovery settings make 60 recordings for each
distribution. For publishers of Kilted and Jazzy, name Python interpreters that have `rclpy`: there are wheels of both
(names ros-*, for Python 3.11). Publishers of Humble are made with `cyclonedds`, because there are no wheels. What is
absent is skipped.
"""

# ruff: noqa: PLC0415 - each publisher imports only the libraries of its own interpreter
from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TYPES = ("Range", "Float64", "Float32", "UInt16", "Int32")
PROFILES = ("default", "sensor", "latched", "deadline")
SETTINGS = ("", "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST", "ROS_LOCALHOST_ONLY=1")
READINGS = 5
_PAUSE = 0.02  # s between two messages
_STARTUP = 6.0  # s until a publisher was discovered


def main() -> None:
    """Print a line for each recording without all readings, and the counts of each distribution."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--kilted", metavar="PYTHON", help="interpreter with rclpy of Kilted")
    options.add_argument("--jazzy", metavar="PYTHON", help="interpreter with rclpy of Jazzy")
    options.add_argument("--quick", action="store_true", help="one message type in one setting of each distribution")
    options.add_argument("--publish", choices=["rclpy", "cyclonedds"], help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.publish:
        publish(given.publish)
        return
    missed = 0
    for name, python, kind in (
        ("Kilted", given.kilted, "rclpy"),
        ("Jazzy", given.jazzy, "rclpy"),
        ("Humble", sys.executable, "cyclonedds"),
    ):
        why = reason_to_skip(python, kind)
        missed += print_skipped(name, why) if why else measure(name, python, kind, quick=given.quick)
    sys.exit(1 if missed else 0)


def print_skipped(name: str, why: str) -> int:
    """Say why a distribution is skipped; return 0 recordings that failed."""
    print(f"{name}: skipped, because {why}")
    return 0


def reason_to_skip(python: str | None, kind: str) -> str:
    """Return why there is no publisher of a distribution or no receiver, or an empty text."""
    if importlib.util.find_spec("cyclonedds") is None:
        return "cyclonedds is not installed here (pip install 'pretouch[ros]')"
    if python is None:
        return "no interpreter was given"
    found = subprocess.run([python, "-c", f"import {kind}"], capture_output=True, check=False)
    return "" if found.returncode == 0 else f"{python} has no {kind}"


def measure(name: str, python: str, kind: str, *, quick: bool) -> int:
    """Record all combinations of a distribution; return the number of those that were not received."""
    received = total = 0
    for setting in SETTINGS[: 1 if quick else None]:
        environment = {key: value for key, value in os.environ.items() if not key.startswith("ROS_")}
        environment |= dict([setting.split("=")]) if setting else {}
        with publisher(python, kind, environment):
            for topic in (f"/{t.lower()}/{profile}" for t in TYPES[: 1 if quick else None] for profile in PROFILES):
                count, said = record(topic, environment)
                total += 1
                received += count == READINGS
                if count != READINGS:
                    print(f"{name}, {setting or 'default'}, {topic}: {count} of {READINGS} readings. {said}")
    print(f"{name}: {received} of {total} recordings received all readings", flush=True)
    return total - received


@contextmanager
def publisher(python: str, kind: str, environment: dict[str, str]) -> Iterator[None]:
    """Run a process that publishes all topics."""
    process = subprocess.Popen([python, __file__, "--publish", kind], env=environment)
    try:
        time.sleep(_STARTUP)
        yield
    finally:
        process.terminate()
        process.wait()


def record(topic: str, environment: dict[str, str]) -> tuple[int, str]:
    """Return the number of readings that a recording of one distance has, and what was printed."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pretouch", "record", "made.csv", "--topic", topic, "--distances", "0 mm"]
        command += ["--no-empty-scene", "--readings", str(READINGS), "--dwell", "0.05 s"]
        done = subprocess.run(
            command, cwd=folder, env=environment, input="\n\n", capture_output=True, text=True, check=False
        )
        file = Path(folder) / "made.csv"
        rows = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return sum(row.startswith("0,") for row in rows), " ".join((done.stdout + done.stderr).split())


def values() -> Iterator[tuple[float, int]]:
    """Yield a noisy distance [m] and a noisy count, for ever, with a pause before each."""
    number = 0
    while True:
        number += 1
        time.sleep(_PAUSE)
        yield 0.5 + (7 * number % 11 - 5) * 1e-4, 5000 + 7 * number % 11


def publish(kind: str) -> None:
    """Publish every message type with every profile until the process is ended."""
    (publish_by_rclpy if kind == "rclpy" else publish_by_cyclonedds)()


def publish_by_rclpy() -> None:
    """Publish with ROS 2."""
    import rclpy
    from rclpy.duration import Duration
    from rclpy.node import Node
    from rclpy.qos import (
        DurabilityPolicy,
        LivelinessPolicy,
        QoSProfile,
        ReliabilityPolicy,
        qos_profile_sensor_data,
    )
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs import msg as sensors
    from std_msgs import msg as standard

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # the process simply ends
    node = Node("publisher")
    profiles = {
        "default": QoSProfile(depth=10),
        "sensor": qos_profile_sensor_data,
        "latched": QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        "deadline": QoSProfile(
            depth=5,
            reliability=ReliabilityPolicy.BEST_EFFORT,
            deadline=Duration(seconds=0.5),
            lifespan=Duration(seconds=0.2),
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
            liveliness_lease_duration=Duration(seconds=1),
        ),
    }
    kinds = {name: getattr(sensors if name == "Range" else standard, name) for name in TYPES}
    made = [
        (name, kind, node.create_publisher(kind, f"/{name.lower()}/{profile}", profiles[profile]))
        for name, kind in kinds.items()
        for profile in PROFILES
    ]
    for distance, count in values():
        for name, kind, one in made:
            message = kind()
            if name == "Range":
                message.min_range, message.max_range, message.range = 0.02, 2.0, distance
            else:
                message.data = distance if name.startswith("Float") else count
            one.publish(message)


def publish_by_cyclonedds() -> None:
    """Publish with the message types of Humble."""
    from cyclonedds.core import Policy, Qos
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from pretouch.recording.sources.ros_discovery import discovery_settings
    from pretouch.recording.sources.ros_messages import message_types

    types: Any = message_types()
    participant, *_domain = discovery_settings().join(0)
    reliable = Policy.Reliability.Reliable(100_000_000)
    profiles = {
        "default": Qos(reliable),
        "sensor": Qos(Policy.Reliability.BestEffort),
        "latched": Qos(reliable, Policy.Durability.TransientLocal),
        "deadline": Qos(
            Policy.Reliability.BestEffort,
            Policy.Deadline(500_000_000),
            Policy.Lifespan(200_000_000),
            Policy.Liveliness.ManualByTopic(10**9),
        ),
    }
    writers = [
        (
            name,
            DataWriter(
                participant, Topic(participant, f"rt/{name.lower()}/{p}", getattr(types, name)), qos=profiles[p]
            ),
        )
        for name in TYPES
        for p in PROFILES
    ]
    header = types.Header(types.Time(1, 0), "sensor")
    for distance, count in values():
        for name, writer in writers:
            kind = getattr(types, name)
            if name == "Range":
                writer.write(kind(header, 1, 0.1, 0.02, 2.0, distance))
            else:
                writer.write(kind(distance if name.startswith("Float") else count))


if __name__ == "__main__":
    main()
