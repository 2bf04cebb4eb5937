"""Print examples/approaches.csv, or write it as a ROS 2 bag: a sensor that an object touches three times.

The sensor is that of examples/loop.toml with errors that a real one has: it reads at 217 Hz instead of 250 Hz, with
missing readings, a gap of 80 ms and a jitter. Its noise is 27 counts instead of 20, and it lags a laser by 6 ms.
Between the second and the third contact, the object passes at 30 mm without a contact.

    python make_recording.py           prints the CSV file
    python make_recording.py FOLDER    writes the bag FOLDER with the topics /proximity, /laser and /contact (rosbags)
"""

import sys

import numpy as np

RATE, NOISE, OFFSET, LAG = 217.0, 27.0, 152.0, 0.006  # Hz, counts, counts, s
REST, END = 0.5, 16.0  # m, s
VISITS = ((1.0, 0.30, 0.0), (4.6, 0.35, 0.0), (8.1, 0.40, 0.03), (11.9, 0.25, 0.0))  # start [s], speed [m/s], end [m]
START = 1_700_000_000_000_000_000  # ns


def distance_at(time: np.ndarray) -> np.ndarray:
    """Return the distance of the object [m]: it comes, stays for 0.2 s, and leaves at 0.5 m/s."""
    distance = np.full(len(time), REST)
    for start, speed, end in VISITS:
        coming = REST - speed * (time - start)
        leaving = end + 0.5 * (time - start - (REST - end) / speed - 0.2)
        distance = np.minimum(distance, np.maximum(np.maximum(coming, leaving), end))
    return distance


def make_readings() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return times [s], readings [counts], distances of the laser [m], and whether there is a contact."""
    rng = np.random.default_rng(20261123)
    time = np.arange(0.02, END, 1 / RATE)
    kept = (rng.random(len(time)) > 0.02) & ~((time > 7.0) & (time < 7.076))
    time = np.round(time + rng.normal(0, 0.1e-3, len(time)), 5)[kept]
    signal = 0.533 * (distance_at(time - LAG) + 0.0419) ** -3.32
    noise = np.hypot(NOISE, 0.002 * signal) * rng.standard_normal(len(time))
    laser = distance_at(time) + 0.2e-3 * rng.standard_normal(len(time))
    return time, np.round(OFFSET + signal + noise), laser, distance_at(time) <= 0


def print_table() -> None:
    """Print the recording as a CSV file."""
    print("# an object touches a sensor three times; made by examples/make_recording.py")
    print("time [s],reading,distance [mm],contact")
    for time, reading, laser, contact in zip(*make_readings(), strict=True):
        print(f"{time:.5f},{reading:.0f},{1e3 * laser:.1f},{contact:d}")


def write_bag(folder: str) -> None:
    """Write the recording as a ROS 2 bag with three topics."""
    from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415 - an extra
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    time, readings, lasers, contacts = make_readings()
    kinds = {"/proximity": "std_msgs/msg/Float64", "/laser": "sensor_msgs/msg/Range", "/contact": "std_msgs/msg/Bool"}
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for second, reading, laser, contact in zip(time, readings, lasers, contacts, strict=True):
            stamp = START + round(1e9 * float(second))
            clock = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
            header = types["std_msgs/msg/Header"](stamp=clock, frame_id="laser")
            limits = {"radiation_type": 1, "field_of_view": 0.01, "min_range": 0.0, "max_range": 0.45}
            beam = types[kinds["/laser"]](header=header, **limits, range=max(float(laser), 0.0), variance=0.0)
            messages = {"/laser": beam, "/proximity": types[kinds["/proximity"]](data=float(reading))}
            messages["/contact"] = types[kinds["/contact"]](data=bool(contact))
            for topic, message in messages.items():
                writer.write(connections[topic], stamp, store.serialize_cdr(message, kinds[topic]))


if __name__ == "__main__":
    print_table() if len(sys.argv) == 1 else write_bag(sys.argv[1])
