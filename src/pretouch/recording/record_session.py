"""Record a calibration at one distance after another.

The recording starts without an object, and ends when the calibration is good enough.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError, SourceError
from pretouch._core.files import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value

from .record_distances import DistancePlan, RecordDisplay
from .record_file import RecordFile
from .record_judgment import Judgment, RecordGoal, judge_recording
from .record_reader import RecordReader
from .record_settling import Stay
from .sources.source import ReadingSource

_POLL: Final = 0.05  # s between two updates of the display
_JUDGED: Final = 2.0  # s between two judgments if the distances come from the source


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordOptions(Value):
    """Options of a calibration recording.

    Args:
        readings: number of readings at each distance, and of the empty scene.
        dwell: time over which these are spread, at least [s].
        timeout: time without any reading after which the source counts as silent [s].
        empty: whether to record the empty scene.
        all_distances: whether to record all distances of a list even if the slope is known before.
    """

    readings: int = 20
    dwell: float = 1.0
    timeout: float = 5.0
    empty: bool = True
    all_distances: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RecordedCalibration(Described, Value):
    """Result of a calibration recording.

    Args:
        path: the calibration file.
        raw: the file with all readings.
        distances: the recorded distances [m].
        readings: number of readings with an object in the calibration file.
        empty: number of readings without an object in the calibration file.
        received: number of all readings that arrived in this session.
        judgment: whether the slope g is known well enough.
        interrupted: whether the user ended the recording with Ctrl-C.
        notes: sentences on lines that were skipped and on outputs that drifted.
    """

    path: str
    raw: str
    distances: tuple[float, ...]
    readings: int
    empty: int
    received: int
    judgment: Judgment
    interrupted: bool = False
    notes: tuple[str, ...] = ()

    @property
    def headline(self) -> str:
        """Summary of the calibration recording."""
        start = "Interrupted. " if self.interrupted else ""
        return f"{start}{kept(self.readings, len(self.distances), self.empty, self.path)}. {self.judgment.reason}"

    def to_dict(self) -> dict[str, Any]:
        """Return the recording result as a JSON object.

        All values are in SI units.
        """
        judgment, slope = self.judgment, None if self.judgment.report is None else self.judgment.report.best
        result: dict[str, Any] = plain(
            {
                "status": "interrupted" if self.interrupted else "enough" if judgment.is_enough else "not-enough",
                "headline": self.headline,
                "file": self.path,
                "raw_file": self.raw,
                "distances": self.distances,
                "readings": self.readings,
                "no_object_readings": self.empty,
                "received": self.received,
                "slope": None if slope is None else slope.middle_slope,
                "slope_uncertainty": judgment.uncertainty,
                "missing_distances": judgment.missing.all,
                "verdict": None if judgment.report is None else judgment.report.verdict,
                "notes": self.notes,
            }
        )
        return result

    def __repr__(self) -> str:
        count = len(self.distances)
        return f"<RecordedCalibration: {self.readings} readings at {count} distances in the file {self.path}>"


def kept(readings: int, distances: int, empty: int, path: object) -> str:
    """Return a clause on the number of readings in a calibration file."""
    where = f"{distances} distance{'' if distances == 1 else 's'}"
    return f"{path} has {readings} readings at {where} and {empty} readings without an object"


def record_calibration(
    source: ReadingSource,
    file: RecordFile,
    plan: DistancePlan | None,
    display: RecordDisplay,
    *,
    options: RecordOptions,
    goal: RecordGoal,
) -> RecordedCalibration:
    """Record a sensor calibration from a source of readings.

    Args:
        source: where the readings come from.
        file: where the readings go.
        plan: sets the distances; None if the source reports the distance of each reading.
        display: shows the live values, and asks for the next step.
        options: how readings are taken.
        goal: what the recording must achieve.

    Returns:
        The result, also if the user interrupts the recording with Ctrl-C. If the source fails or falls silent, a
        SourceError says which readings are kept.
    """
    session = _Session(source, file, display, options, goal)
    interrupted = False
    with session.explain_what_is_kept():
        try:
            session.run(plan)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            session.close()
        judgment = session.judgment
        if judgment is None or judgment.report is None:
            judgment = judge_recording(file.calibration, goal)
    return RecordedCalibration(
        path=str(file.path),
        raw=str(file.raw),
        distances=file.distances,
        readings=file.readings,
        empty=file.count(math.inf),
        received=session.reader.count,
        judgment=judgment,
        interrupted=interrupted,
        notes=(*file.notes, *session.notes, *source.notes),
    )


class _Session:
    """A calibration recording in progress."""

    def __init__(
        self, source: ReadingSource, file: RecordFile, display: RecordDisplay, options: RecordOptions, goal: RecordGoal
    ) -> None:
        self._source, self._file, self._display, self._options, self._goal = source, file, display, options, goal
        self.reader = RecordReader(source, file)
        self.judgment: Judgment | None = None
        self.notes: list[str] = []

    def run(self, plan: DistancePlan | None) -> None:
        """Record readings without an object, then readings at all distances."""
        self._wait_for_first()
        for place, outputs in self._file.outputs.items():  # of a recording that is continued
            self._display.show_distance(place, outputs)
        if self._options.empty and self._file.count(math.inf) < self._options.readings:
            if self._display.ask("Remove every object from the field of view, then press Enter: ") is None:
                return
            self._stay(math.inf)
            if plan is None:
                self._display.ask("Put the object in its place, then press Enter: ")
                self.reader.move_to(None)
        if plan is None:
            self._follow()
            return
        judgment = self._judge(plan.suggests)
        while self._options.all_distances or not judgment.is_enough:
            self.reader.move_to(None)
            distance = plan.move(judgment, self._display)
            if distance is None:
                return
            self._stay(distance)
            judgment = self._judge(plan.suggests)

    def close(self) -> None:
        """Close the sensor and the files of the recording."""
        self.reader.close()
        self._source.close()
        self._file.close()

    @contextmanager
    def explain_what_is_kept(self) -> Iterator[None]:
        """Add to sensor errors how the user can continue the recording."""
        try:
            yield
        except SourceError as error:
            file = self._file
            if not self.reader.count:
                raise
            what = kept(file.readings, len(file.distances), file.count(math.inf), file.path)
            raise SourceError(f"{error}; {what}, continue with --resume") from None

    def _judge(self, suggests: bool = False) -> Judgment:
        self.judgment = None  # an interrupted judgment is repeated
        judgment = judge_recording(self._file.calibration, self._goal, final=False)
        self.judgment = judgment
        if self._file.readings:
            missing = ", ".join(format_quantity(d, "m") for d in judgment.missing.all if suggests)
            self._display.say(f"{judgment.reason}{f' Missing distances: {missing}.' if missing else ''}")
        return judgment

    def _stay(self, distance: float) -> None:
        """Record the readings at one object distance [m]."""
        self.judgment = None
        wanted = self._options.readings - self._file.count(distance)
        stay = Stay(max(wanted, 1), self._options.dwell)
        self.reader.move_to(distance)
        last = time.monotonic()
        while not stay.is_done:
            arrived = self.reader.take(_POLL)
            now = time.monotonic()
            last = self._check_silence(last, now, bool(arrived))
            for reading in arrived:
                if reading.place == distance and stay.add(reading.time, reading.output):
                    self._file.add(distance, reading.output)
            if arrived:
                self._display.show(distance, list(stay.recent), len(stay.counted), wanted, stay.is_settling)
        self._display.show_distance(distance, stay.counted)
        place = "the empty scene" if math.isinf(distance) else format_quantity(distance, "m")
        if not stay.has_settled or stay.has_drifted:
            self.notes.append(f"{place}: the sensor output drifted during the recording; check sensor and object.")
            self._display.say(self.notes[-1])

    def _follow(self) -> None:
        """Record readings from a source that also reports distances."""
        last = time.monotonic()
        judged: float | None = None
        while True:
            arrived = self.reader.take(_POLL)
            now = time.monotonic()
            for reading in arrived:
                if reading.distance is None:
                    raise InvalidInputError(
                        "distances: the readings have no distance; choose it with --distance-column"
                    )
                self._file.add(reading.distance, reading.output)
            if arrived:
                self.judgment = None
                latest = [reading.output for reading in arrived if reading.distance == arrived[-1].distance]
                place = float(arrived[-1].distance or 0.0)
                self._display.show(place, latest, self._file.readings, 0, False)
            elif self.reader.has_ended:
                return
            last = self._check_silence(last, now, bool(arrived))
            # by the times of arrival, so that a file is read to its end
            judged = arrived[0].time if judged is None and arrived else judged
            is_due = judged is not None and bool(arrived) and arrived[-1].time - judged > _JUDGED
            if is_due and not self._options.all_distances:
                if self._judge().is_enough:
                    return
                judged = arrived[-1].time

    def _wait_for_first(self) -> None:
        """Wait for the first reading of the sensor."""
        if not self.reader.wait_for_first(self._options.timeout):
            raise self._silence()

    def _check_silence(self, last: float, now: float, has_arrived: bool) -> float:
        """Raise an error if readings are overdue. The result is the time of the last reading."""
        if has_arrived:
            return now
        if self.reader.has_ended:
            raise SourceError(f"{self._source.name}: the readings ended before the recording was complete")
        if now - last > self._options.timeout:
            raise self._silence()
        return last

    def _silence(self) -> SourceError:
        seconds = f"{self._options.timeout:g} s"
        return SourceError(f"{self._source.name}: no reading for {seconds}, because {self._source.why_silent()}")
