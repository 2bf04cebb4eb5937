"""How long a recording of 10 minutes at 1 kHz takes to read and to replay, next to rosbags' reader and deserializer.

It needs the extra `ros`. Times are CPU times of this process; the bags have 600,000 messages. With `--readers`, it
compares the readers of messages of pretouch, rosbags and mcap: their time per message, and how many messages they find
in damaged files.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import pretouch as pt
from pretouch.recording import read_recording, replay
from pretouch.recording.containers import read_contents

MESSAGES, RATE, START = 600_000, 1000, 1_700_000_000_000_000_000
RANGE = "sensor_msgs/msg/Range"


def write(folder: Path, storage: StoragePlugin, count: int) -> Path:
    """Write a bag with ranges of an object that comes and goes; one message is serialized, and its numbers changed."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    clock = types["builtin_interfaces/msg/Time"](sec=START // 10**9, nanosec=0)
    header = types["std_msgs/msg/Header"](stamp=clock, frame_id="sensor")
    limits = {"radiation_type": 1, "field_of_view": 0.1, "min_range": 0.0, "max_range": 1.0, "variance": 0.0}
    raw = bytearray(store.serialize_cdr(types[RANGE](header=header, range=0.0, **limits), RANGE))
    moment = np.arange(count) / RATE
    ranges = (0.25 * (1 + np.cos(moment * 2 + np.sin(moment / 3)))).astype("<f4")
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/range", RANGE, typestore=store)
        for i, value in enumerate(ranges):
            stamp = START + i * 10**9 // RATE
            raw[4:12] = np.array([stamp // 10**9, stamp % 10**9], dtype="<u4").tobytes()
            raw[36:40] = value.tobytes()  # after encoding, stamp, frame "sensor", kind, field of view and limits
            writer.write(connection, stamp, bytes(raw))
    return folder


def by_rosbags(bag: Path) -> np.ndarray:
    """Read stamps and ranges with rosbags alone."""
    store = get_typestore(Stores.ROS2_JAZZY)
    rows = []
    with Reader(bag) as reader:
        for connection, _, raw in reader.messages():
            message: Any = store.deserialize_cdr(raw, connection.msgtype)
            rows.append((message.header.stamp.sec * 10**9 + message.header.stamp.nanosec, message.range))
    return np.array(rows)


def timed(call: Callable[[], Any], repeats: int = 1) -> tuple[float, Any]:
    """Return the shortest CPU time of a call [s], and its result."""
    best, result = float("inf"), None
    for _ in range(repeats):
        start = time.process_time()
        result = call()
        best = min(best, time.process_time() - start)
    return best, result


def main(count: int = MESSAGES) -> None:
    """Print the times for an MCAP file and for sqlite3."""
    task = pt.load_scenario(Path(__file__).parents[1] / "examples" / "loop.toml").replace(gain=-0.86)
    replay(task, read_recording(Path(__file__).parents[1] / "examples" / "approaches.csv", "reading"))  # loads the core
    print(f"{count:,} messages of {RANGE}, {count / RATE:g} s at {RATE} Hz; CPU time")
    with tempfile.TemporaryDirectory() as folder:
        for storage in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
            bag = write(Path(folder, storage.name), storage, count)
            reading, recording = timed(lambda bag=bag: read_recording(bag, "/range"), 3)
            running, result = timed(lambda recording=recording: replay(task, recording), 3)
            peer, rows = timed(lambda bag=bag: by_rosbags(bag))
            if not np.array_equal(recording.values, rows[:, 1]):
                raise SystemExit("pretouch and rosbags have read different ranges")
            steps = len(result.steps.time)
            print(f"{storage.name.lower()}: reading {reading:.2f} s, replay of {steps:,} steps {running:.2f} s,")
            total = reading + running
            print(f"  together {total:.2f} s; rosbags reads in {peer:.2f} s, {peer / reading:.1f} times as long")


def of_pretouch(bag: Path) -> Iterable[bytes]:
    """Return the messages that the reader of pretouch finds."""
    messages = read_contents(bag, ("/range",)).messages
    return messages["/range"].data if "/range" in messages else []


def of_rosbags(bag: Path) -> Iterable[bytes]:
    """Yield the messages that the reader of rosbags finds."""
    with Reader(bag) as reader:
        yield from (raw for connection, _, raw in reader.messages() if connection.topic == "/range")


def of_mcap(bag: Path) -> Iterable[bytes]:
    """Yield the messages that the reader of mcap finds."""
    for file in bag.glob("*.mcap"):
        with file.open("rb") as stream:
            yield from (message.data for _, _, message in make_reader(stream).iter_messages(topics=["/range"]))


DAMAGED = 30_000  # messages of a damaged bag
READERS = {"pretouch": of_pretouch, "rosbags": of_rosbags, "mcap": of_mcap}


def count_of(messages: Iterable[bytes]) -> int:
    """Count messages until the end, or until a reader gives up."""
    count = 0
    try:
        for _ in messages:
            count += 1
    except Exception:  # each reader has errors of its own
        return count
    return count


def damage(file: Path, kind: str, rng: np.random.Generator) -> None:
    """Cut off the end of a file, or change single bytes of it."""
    content = bytearray(file.read_bytes())
    if kind == "cut off":
        del content[rng.integers(len(content) // 10, len(content)) :]
    else:
        for place, bit in zip(rng.integers(0, len(content), 3), rng.integers(0, 8, 3), strict=True):
            content[place] ^= 1 << int(bit)
    file.write_bytes(bytes(content))


def compare_readers(count: int, files: int, seed: int) -> dict[tuple[str, str], dict[str, float]]:
    """Print the time per message of each reader, and the share of the messages that it finds in damaged bags.

    Returns:
        The shares, by the storage and the kind of damage, and by the reader.
    """
    shares: dict[tuple[str, str], dict[str, float]] = {}
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for storage in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
            label = storage.name.lower()
            readers = {key: read for key, read in READERS.items() if key != "mcap" or label == "mcap"}
            large, small = write(folder / f"{label}-large", storage, count), write(folder / label, storage, DAMAGED)
            times = {key: timed(lambda read=read, bag=large: count_of(read(bag)))[0] for key, read in readers.items()}
            print(f"{label}: us per message:", ", ".join(f"{key} {1e6 * t / count:.2f}" for key, t in times.items()))
            for kind in ("cut off", "changed bytes", "no metadata.yaml"):
                found = dict.fromkeys(readers, 0)
                for _ in range(files):
                    bag = Path(shutil.copytree(small, folder / "damaged"))
                    if kind == "no metadata.yaml":
                        (bag / "metadata.yaml").unlink()
                    else:
                        damage(next(file for file in bag.iterdir() if file.suffix != ".yaml"), kind, rng)
                    for key, read in readers.items():
                        try:
                            found[key] += count_of(read(bag))
                        except pt.errors.PretouchError:
                            continue
                    shutil.rmtree(bag)
                shares[label, kind] = {key: number / (DAMAGED * files) for key, number in found.items()}
                text = ", ".join(f"{key} {100 * share:.0f} %" for key, share in shares[label, kind].items())
                print(f"  messages found in {files} bags, {kind}: {text}")
    return shares


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=MESSAGES, help="messages of a bag")
    options.add_argument("--readers", action="store_true", help="compare the readers of messages")
    options.add_argument("--files", type=int, default=50, help="damaged bags of each kind")
    options.add_argument("--seed", type=int, default=1, help="seed of the damage")
    given = options.parse_args()
    if given.readers:
        compare_readers(given.count, given.files, given.seed)
    else:
        main(given.count)
