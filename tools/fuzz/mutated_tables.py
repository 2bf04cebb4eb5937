"""Read mutated tables and recordings, and look for what must never happen.

    PYTHONPATH=tests:tools python -m fuzz.mutated_tables --count 3000 --seed 1

Each table is one of tests/table_kinds.py with a few mutations: it is read as a calibration, as a recording, or line by
line as `pretouch record` does. A traceback, a Python warning, or readings that are lost without a note is a find. The
exit code is 1 if anything was found.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from pretouch._core.errors import PretouchError
from pretouch.calibration import read_calibrations
from pretouch.recording import read_recording
from pretouch.recording.sources.lines import LineFormat, LineParser
from table_kinds import KINDS, MORE_KINDS, RECORDINGS, TIMES, readings

_PIECES = (
    *(
        "",
        " ",
        "\t",
        ",",
        ";",
        "|",
        '"',
        "'",
        "#",
        "\r",
        "\n",
        "\n\n",
        "\0",
        "\ufeff",
        "µ",
        "−",
        "±",
        "∞",
        "\u202f",
        "[",
        "(",
        "{",
    ),
    *(
        "nan",
        "inf",
        "-1",
        "1e999",
        "1e-400",
        "0x1F",
        "1,5",
        "1.234,5",
        "1,234",
        "--",
        "OL",
        "> 500",
        "none",
        "12:00:00",
        "_",
    ),
    *("5 mm", "5 furlong", "distance [mm]", "time [ms]", "1_000", "٣", "9" * 40, "é", "->", "a:1", "=", "%"),
)


def mutated(text: str, rng: np.random.Generator) -> str:
    """Return a text with one to five random mutations."""
    for _ in range(int(rng.integers(1, 6))):
        lines = text.split("\n")
        kind, i = int(rng.integers(7)), int(rng.integers(len(lines)))
        piece = str(rng.choice(np.array(_PIECES, dtype=object)))
        if kind == 0:
            del lines[i]
        elif kind == 1:
            lines.insert(int(rng.integers(len(lines) + 1)), lines[i])
        elif kind == 2:
            lines.insert(i, piece)
        elif kind == 3:
            place = int(rng.integers(len(lines[i]) + 1))
            lines[i] = f"{lines[i][:place]}{piece}{lines[i][place:]}"
        elif kind == 4:
            lines[i] = re.sub(r"\d+\.?\d*", piece.replace("\\", ""), lines[i], count=1)
        elif kind == 5:
            lines[i] = lines[i][: int(rng.integers(len(lines[i]) + 1))]
        else:
            old, new = (str(each) for each in rng.choice(np.array([",", ";", "\t", " ", "."], dtype=object), 2))
            lines = [line.replace(old, new) for line in lines]
        text = "\n".join(lines) or "x"
    return text


def as_calibration(path: Path, text: str) -> str:
    """Read a table as a calibration; return what is wrong with the result, if anything."""
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    for curve in read_calibrations(path):
        source = curve.source
        kept = len(curve.distances) + len(curve.no_object)
        if not (np.isfinite(curve.distances).all() and np.isfinite(curve.outputs).all()):
            return "a calibration with a number that is not finite"
        if source is None or (kept < source.rows and not source.dropped and not source.notes):
            return "readings are lost without a note"
    return ""


def as_recording(path: Path, text: str) -> str:
    """Read a table as a recording; return what is wrong with the result, if anything."""
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    recording = read_recording(path)
    lines = [line for line in text.replace("\r", "\n").split("\n") if re.match(r"\s*[\d\"'\[-]", line)]
    if len(recording.values) < len(lines) - 1 and not any(
        re.search(r"not read|[Ll]eft out|above|missing", note) for note in (*recording.notes, *recording.read)
    ):
        return "readings are lost without a note"
    return ""


def as_lines(_: Path, text: str) -> str:
    """Read the lines of a table as they come from a sensor; return what is wrong with the result, if anything."""
    parser = LineParser("a sensor", LineFormat(column="2", distance_column="1"), from_middle=False)
    content = text.encode("utf-8", "surrogatepass")
    found = [reading for start in range(0, len(content), 17) for reading in parser.feed(content[start : start + 17])]
    parser.finish()
    if any(not np.isfinite(reading.output) for reading in found):
        return "a reading that is not finite"
    return ""


def table_of(index: int, rng: np.random.Generator) -> tuple[str, Callable[[Path, str], str]]:
    """Return a table, and how it is read."""
    made = readings(int(rng.integers(1000)))
    kinds = (*KINDS, *MORE_KINDS)
    kind = kinds[int(rng.integers(len(kinds)))]
    if index % 3 == 0:
        return kind.write(made), as_calibration
    if index % 3 == 1:
        return kind.write(made), as_lines
    place = int(rng.integers(len(TIMES) + len(RECORDINGS)))
    if place >= len(TIMES):
        above, _, write = list(RECORDINGS.values())[place - len(TIMES)]
        return above + "".join(write(i, 0.005 * i, 500 + i % 7) for i in range(60)), as_recording
    title = list(TIMES)[place]
    rows = [f"{TIMES[title](i, 0.005 * i)};{500 + i % 7}" for i in range(60)]
    return "\n".join([f"{title};prox", *rows]) + "\n", as_recording


def finds(count: int, seed: int, folder: Path) -> list[tuple[str, str]]:
    """Return the problems of mutated tables, each with the text that shows it."""
    found = []
    for index in range(count):
        rng = np.random.default_rng((seed, index))
        text, read = table_of(index, rng)
        text = mutated(text, rng)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                problem = read(folder / "table.csv", text)
            except PretouchError:
                continue
            except Exception as error:
                frame = traceback.extract_tb(error.__traceback__)[-1]
                problem = f"{type(error).__name__} at {Path(frame.filename).name}:{frame.lineno}"
        if problem:
            found.append((f"{problem} ({read.__name__}, case {index})", text))
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Read mutated tables, and say what was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=3000, help="how many tables")
    parser.add_argument("--seed", type=int, default=1, help="of all tables")
    asked = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        found = finds(asked.count, asked.seed, Path(folder))
    kinds = Counter(problem.partition(" (")[0] for problem, _ in found)
    for problem, text in {problem.partition(" (")[0]: (problem, text) for problem, text in reversed(found)}.values():
        sys.stdout.write(f"\n{problem}\n{text[:1500]}\n")
    sys.stdout.write(f"\n{asked.count} tables, seed {asked.seed}: {dict(kinds) or 'nothing found'}\n")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
