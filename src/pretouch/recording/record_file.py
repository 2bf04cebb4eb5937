"""Write sensor readings to a calibration file during a recording.

All readings are also written to a raw file. Interrupted recordings can be continued.
"""

from __future__ import annotations

import itertools
import math
import os
import re
from collections import Counter
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError, OutputError, OutputExistsError
from pretouch._core.files import is_stream
from pretouch.calibration import Calibration

from .columns import LINE

_HEADER: Final = re.compile(r"distance \[mm\],output(?: \[(?P<unit>[^\]]*)\])?")
_FIRST_LINES: Final = 10
_PICOMETERS: Final = 12  # decimal digits of a distance in m that are compared


def raw_path(path: Path) -> Path:
    """Return the path of the raw file with all readings.

    The raw file is in the folder of the calibration file.
    """
    return path.with_name(f"{path.stem}-raw.csv")


def check_free(path: Path) -> None:
    """Raise an error if a recording would overwrite a file."""
    for each in (path, raw_path(path)):
        if each.exists():
            raise OutputExistsError(
                f"{each}: this file already exists, and pretouch does not overwrite it; continue the recording with "
                "--resume, or choose another name",
                remedy="--resume",
            )


class RecordFile:
    """The calibration file and the raw file of a recording.

    The raw file `STEM-raw.csv` contains all readings. Every reading is handed to the operating system at once, so that
    nothing is lost if the program ends.

    Args:
        path: the calibration file (CSV).
        unit: unit of the readings; None if unknown, or as in the file that is continued.
        origin: name of the source, for a comment in the file.
        resume: whether to continue the file; otherwise it must not exist.
    """

    def __init__(self, path: Path, *, unit: str | None, origin: str, resume: bool) -> None:
        self.path, self.raw = path, raw_path(path)
        self._rows: list[tuple[float, float]] = []
        self._count: Counter[float] = Counter()
        self.notes: tuple[str, ...] = ()
        self.unit = unit or ""
        exists = path.exists()
        if exists and resume:
            self._load(unit)
        elif resume:
            raise InvalidInputError(f"--resume: the file {path} does not exist; start without --resume")
        else:
            check_free(path)
        title = f"output [{self.unit}]" if self.unit else "output"
        now = datetime.now(UTC).isoformat(timespec="seconds")
        made = f"# recorded with pretouch {version('pretouch')} from {origin}, {now}\n"
        self._new, self._received = (() if exists else (path, self.raw)), 0
        self._file, self._all = _append(path), -1
        try:
            self._all = _append(self.raw)
        except BaseException:
            self.close()
            raise
        self._write(self._file, made if exists else f"{made}distance [mm],{title}\n")
        is_new = not os.fstat(self._all).st_size
        self._has_lines = is_new or _has_lines(self.raw)
        self._write(self._all, f"{made}time [s],distance [mm],{title},{LINE}\n" if is_new else made)

    def add(self, distance: float, output: float) -> None:
        """Write a reading and its distance to the calibration file.

        The distance [m] is infinite without an object.
        """
        self._write(self._file, f"{_mm(distance)},{output:.15g}\n")
        self._rows.append((distance, output))
        self._count[round(distance, _PICOMETERS)] += 1

    def add_raw(self, time: float, distance: float | None, output: float, line: bytes | None = None) -> None:
        """Write a reading with its time to the raw file.

        The time is in s, and the distance in m. The distance is None while the object moves. The line of text from
        which the reading comes follows as it arrived; bytes that are no text are escaped.
        """
        self._received += 1
        text = "" if line is None else line.decode("utf-8", "backslashreplace").replace('"', '""')
        cells = f"{time:.6f},{'' if distance is None else _mm(distance)},{output:.15g}"
        self._write(self._all, f'{cells},"{text}"\n' if self._has_lines else f"{cells}\n")

    def count(self, distance: float) -> int:
        """Return the number of calibration readings at a distance [m]."""
        return self._count[round(distance, _PICOMETERS)]

    def complete(self, wanted: int) -> tuple[float, ...]:
        """Return the distances [m] with at least `wanted` readings."""
        return tuple(distance for distance in self.distances if self.count(distance) >= wanted)

    @property
    def outputs(self) -> dict[float, list[float]]:
        """The readings at each distance.

        The distance [m] is infinite without an object.
        """
        outputs: dict[float, list[float]] = {}
        for distance, output in self._rows:
            outputs.setdefault(distance, []).append(output)
        return outputs

    @property
    def readings(self) -> int:
        """The number of calibration readings with an object."""
        return len(self._rows) - self.count(math.inf)

    @property
    def distances(self) -> tuple[float, ...]:
        """The recorded distances of the object [m], each once, in increasing order."""
        return tuple(sorted(d for d in self._count if math.isfinite(d)))

    @property
    def calibration(self) -> Calibration | None:
        """The calibration from the readings so far.

        It is None before the first reading with an object.
        """
        rows = np.array(self._rows).reshape(-1, 2)
        is_near = np.isfinite(rows[:, 0])
        if not is_near.any():
            return None
        return Calibration(
            distances=rows[is_near, 0], outputs=rows[is_near, 1], no_object=rows[~is_near, 1], unit=self.unit
        )

    def close(self) -> None:
        """Close both files of the recording.

        If no reading arrived, the new files are removed.
        """
        for descriptor in (self._file, self._all):
            if descriptor >= 0:
                os.close(descriptor)
        self._file = self._all = -1
        if not self._received:
            for path in self._new:
                path.unlink(missing_ok=True)

    def _load(self, unit: str | None) -> None:
        """Read an existing calibration file to continue the recording."""
        if is_stream(self.path):
            raise InvalidInputError(f"--resume: {self.path} is a pipe or a device; choose a regular file")
        text = self.path.read_text(encoding="utf-8", errors="replace")
        if not text.endswith("\n"):
            text = text[: text.rfind("\n") + 1]
            os.truncate(self.path, len(text.encode()))
            self.notes = (f"{self.path}: the incomplete last line was removed.",)
        lines = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line and not line.startswith("#")]
        header = _HEADER.fullmatch(lines[0][1]) if lines else None
        if header is None:
            raise InvalidInputError(
                f"{self.path}: this file was not written by pretouch record; choose another name. The header of a "
                "recorded file is 'distance [mm],output [UNIT]'"
            )
        self.unit = header["unit"] or ""
        if unit is not None and unit != self.unit:
            expected = f"the unit {self.unit}" if self.unit else "no unit"
            raise InvalidInputError(f"--unit: found the unit {unit}, expected {expected} as in the file {self.path}")
        unusable = 0
        for i, line in lines[1:]:
            cells = line.split(",")
            try:
                millimeters, output = map(float, cells)
            except ValueError:
                raise InvalidInputError(
                    f"{self.path}, line {i}: found {line[:40]!r}, expected a distance and a sensor output; correct the "
                    "line"
                ) from None
            if not math.isfinite(output):
                unusable += 1
                continue
            distance = millimeters / 1000
            self._rows.append((distance, output))
            self._count[round(distance, _PICOMETERS)] += 1
        if unusable:
            self.notes += (f"{self.path}: {unusable:,} readings that are not finite were ignored; delete their lines.",)

    def _write(self, descriptor: int, line: str) -> None:
        try:
            os.write(descriptor, line.encode())
        except OSError as error:
            path = self.path if descriptor == self._file else self.raw
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from None


def _has_lines(raw: Path) -> bool:
    """Return True if a raw file that is continued has a column for the lines as they were received."""
    with open(raw, encoding="utf-8", errors="replace") as stream:
        return any(line.rstrip("\n").endswith(f",{LINE}") for line in itertools.islice(stream, _FIRST_LINES))


def _append(path: Path) -> int:
    """Open or create a file for appending."""
    binary = getattr(os, "O_BINARY", 0)  # exists on Windows only
    try:
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | binary, 0o666)
    except OSError as error:
        if not path.absolute().parent.is_dir():
            raise InvalidInputError(f"{path}: the folder {path.parent} does not exist; create it first") from None
        raise OutputError(f"{path}: this file cannot be written ({error.strerror}); choose another folder") from None


def _mm(distance: float) -> str:
    return f"{1000 * distance:.12g}"
