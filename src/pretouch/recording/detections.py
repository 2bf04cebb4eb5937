"""Compare the detections of the control law with true events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.control import Status

from .stepping import LawSteps

PAUSE: Final = 0.1
"""Time [s] without detection up to which two detections count as one."""

BEFORE: Final = 1.0
"""Default of the longest time [s] from a detection to the contact or the presence that it announces."""

Judgment: TypeAlias = Literal["right", "false", "unknown"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedDetection(Value):
    """A period in which the control law detected an object.

    Args:
        start: its start after the first reading [s].
        end: its end [s].
        peak: largest sensor output xi [unit of the readings].
        largest_force: largest magnitude of the virtual force [N].
        judgment: "right" or "false" according to the true events; "unknown" without them.
    """

    start: float
    end: float
    peak: float
    largest_force: float
    judgment: Judgment = "unknown"


@dataclass(frozen=True, slots=True, kw_only=True)
class Event(Value):
    """An object or contact that the law should detect.

    Args:
        start: its start after the first reading [s].
        end: its end [s]; that of a contact without a duration is its start.
        lead: time from the start of the detection to the start of the event [s]; negative if the detection was late,
            NaN if there was none.
    """

    start: float
    end: float
    lead: float

    @property
    def is_missed(self) -> bool:
        """True if the law detected nothing before the event or during it."""
        return bool(np.isnan(self.lead))

    @property
    def is_late(self) -> bool:
        """True if the detection began later than the event."""
        return self.lead < 0


def detections_in(steps: LawSteps, floor: float, pause: float = PAUSE) -> list[tuple[float, float, float, float]]:
    """Find the detections of the control law in a replay.

    Args:
        steps: the replay.
        floor: detection threshold of the controller [unit of the readings].
        pause: time [s] without detection up to which two detections count as one.

    Returns:
        Start and end [s], peak output xi and largest force [N] of each detection.
    """
    period = float(steps.time[1] - steps.time[0])
    spans = _merged(_spans((steps.status & Status.DETECTING) != 0), round(pause / period))
    detections = []
    for a, b in spans:
        peak = floor * float(np.exp(steps.log_level[a:b].max()))
        force = float(np.abs(steps.virtual_force[a:b]).max())
        detections.append((float(steps.time[a]), float(steps.time[b - 1]) + period, peak, force))
    return detections


def _spans(flags: BoolArray) -> list[tuple[int, int]]:
    """Return start and end index of each run of True values."""
    edges = np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def _merged(spans: list[tuple[int, int]], pause: int) -> list[tuple[int, int]]:
    merged: list[tuple[int, int]] = []
    for a, b in spans:
        if merged and a - merged[-1][1] <= pause:
            merged[-1] = (merged[-1][0], b)
        else:
            merged.append((a, b))
    return merged


def events_in(time: FloatArray, values: FloatArray, threshold: float) -> list[tuple[float, float]]:
    """Find the periods in which values are above a threshold.

    Args:
        time: times of its messages [s].
        values: their values.
        threshold: value above which there is an object or a contact.

    Returns:
        Start and end [s] of each period, which is a true event.
    """
    order = np.argsort(time, kind="stable")
    time, above = time[order], values[order] > threshold
    ends = np.append(time[1:], time[-1:])
    return [(float(time[a]), float(ends[b - 1])) for a, b in _spans(above)]


def judge(
    rows: list[tuple[float, float, float, float]],
    events: list[tuple[float, float]] | None,
    before: float,
    known: tuple[float, float] = (-np.inf, np.inf),
) -> tuple[tuple[RecordedDetection, ...], tuple[Event, ...]]:
    """Compare detections with true events.

    A detection is right if it overlaps an event, or ends at most `before` ahead of its start. It is unknown if the true
    events are not known while it lasts.

    Args:
        rows: start, end, peak and largest force of each detection.
        events: start and end of each true event; None if they are unknown.
        before: longest time from a detection to its event [s].
        known: start and end of the time in which the true events are known [s].

    Returns:
        The detections with a judgment, and the events with the lead of their detection.
    """
    if events is None:
        return tuple(_detection(row, "unknown") for row in rows), ()
    right: set[int] = set()
    judged = []
    for start, end in events:
        matching = [i for i, row in enumerate(rows) if row[0] <= end and row[1] >= start - before]
        right.update(matching)
        # the detection that acts at the start of the event, or the last one before it
        announcing = [i for i in matching if rows[i][0] <= start]
        acting = announcing[-1] if announcing else matching[0] if matching else None
        judged.append(Event(start=start, end=end, lead=np.nan if acting is None else start - rows[acting][0]))
    covered = [row[1] >= known[0] and row[0] <= known[1] for row in rows]
    judgments: list[Judgment] = [
        "right" if i in right else "false" if is_covered else "unknown" for i, is_covered in enumerate(covered)
    ]
    return tuple(map(_detection, rows, judgments)), tuple(judged)


def _detection(row: tuple[float, float, float, float], judgment: Judgment) -> RecordedDetection:
    start, end, peak, force = row
    return RecordedDetection(start=start, end=end, peak=peak, largest_force=force, judgment=judgment)
