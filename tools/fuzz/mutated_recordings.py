"""Damage bytes of recordings, read and replay them, and look for what must never happen.

    PYTHONPATH=tests:tools python -m fuzz.mutated_recordings --count 3000 --seed 1

A traceback, a warning of Python, or messages that are lost without a remark. Each kind of traceback is printed once,
with the number of the first case, and counted. The exit code is 1 if anything was found. It needs the extra `ros`.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

import pretouch as pt
import recorded
from pretouch.errors import PretouchError
from pretouch.recording import replay
from pretouch.recording.reading import read_recordings

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
MESSAGES = 100  # of each topic
KINDS = (("MCAP", ""), ("SQLITE3", ""), ("SQLITE3", "MESSAGE"), ("SQLITE3", "FILE"))


def make_recordings(folder: Path) -> list[Path]:
    """Write bags of all storages and compressions, and an MCAP file with JSON messages."""
    types, time = recorded.store(), np.arange(MESSAGES) * 0.01
    ranges = recorded.range_messages(types, time, 0.3 + 0.1 * np.sin(time))
    numbers = [(10**18 + int(1e9 * t), recorded.float_message(types, float(t))) for t in time]
    topics = {"/range": (recorded.RANGE, ranges), "/truth": (recorded.FLOAT, numbers)}
    written = [
        recorded.write_bag(
            folder / f"{storage}-{compression}", topics, storage=storage, types=types, compression=compression
        )
        for storage, compression in KINDS
    ]
    stamps = [int(1e9 * t) for t in time]
    rows = {
        "/range": [(t, {"header": {"stamp": {"sec": 1, "nanosec": t}}, "range": 0.3}) for t in stamps],
        "/truth": [(t, {"data": 0.0}) for t in stamps],
    }
    return [*written, recorded.write_json_mcap(folder / "json.mcap", rows, use_chunking=False)]


def damage(content: bytearray, rng: np.random.Generator) -> bytes:
    """Change, remove or add bytes of a file."""
    for _ in range(rng.choice([1, 1, 2, 5, 30])):
        if not content:
            break
        place, kind = int(rng.integers(len(content))), rng.random()
        if kind < 0.6:
            content[place] = int(rng.choice([0, 1, 255, rng.integers(256)]))
        elif kind < 0.75:
            del content[place : place + int(rng.choice([1, 4, 20, 200]))]
        elif kind < 0.9:
            content[place:place] = rng.bytes(int(rng.choice([1, 4, 20])))
        else:
            del content[place:]
    return bytes(content)


def run(recording: Path, task: pt.Task) -> str:
    """Read and replay a recording, and return what is wrong; empty if nothing is."""
    try:
        sensor, truth = read_recordings(recording, ("/range", "/truth"))
        replay(task, sensor, truth=truth)
    except PretouchError:
        return ""
    except Exception as error:
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "pretouch" in frame.filename]
        return f"{type(error).__name__} at {Path(frames[-1].filename).name}:{frames[-1].lineno}: {str(error)[:100]}"
    lost = len(sensor.values) < MESSAGES or len(truth.values) < MESSAGES
    return "messages are lost without a remark" if lost and not (sensor.notes or truth.notes) else ""


def main() -> int:
    """Run the cases of a seed, and print what was found."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--count", type=int, default=3000, help="damaged recordings")
    options.add_argument("--seed", type=int, default=1, help="seed of the damage")
    given = options.parse_args()
    warnings.simplefilter("error")
    task = pt.load_scenario(EXAMPLES / "loop.toml").replace(gain=-0.86)
    finds: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        originals = make_recordings(Path(name))
        for case in range(given.count):
            rng = np.random.default_rng([given.seed, case])
            original = originals[rng.integers(len(originals))]
            copy = Path(name, "damaged", original.name)
            if original.is_dir():
                shutil.copytree(original, copy)
            else:
                copy.parent.mkdir()
                shutil.copy(original, copy)
            files = sorted(copy.iterdir()) if copy.is_dir() else [copy]
            file = files[rng.integers(len(files))]
            file.write_bytes(damage(bytearray(file.read_bytes()), rng))
            if found := run(copy, task):
                if not finds[found]:
                    sys.stdout.write(f"case {case}, {original.name}: {found}\n")
                finds[found] += 1
            shutil.rmtree(copy.parent)
    sys.stdout.write(f"{given.count} damaged recordings, seed {given.seed}: {sum(finds.values())} finds\n")
    return int(bool(finds))


if __name__ == "__main__":
    raise SystemExit(main())
