"""Define the result of replaying a recording, and the sentences that summarize this result."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.control import Controller
from pretouch.simulation import ClosedLoop

from .clocks import ClockDifference
from .detections import Event, RecordedDetection
from .distance_pairs import DistancePairs, pair_distances
from .drift import Drift
from .latency import Latency
from .noise import Noise
from .recording import CLOCKS, Recording
from .stepping import LawSteps
from .timing import Timing

_FEW: Final = 0.01  # share of used readings, below which a replay shows nothing
_SAME_RATE: Final = 0.01  # relative difference of two rates that are called equal


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Replay(Described, Value):
    """Result of replaying a recording.

    Args:
        recording: the part of the recording that was replayed.
        law: the law and its number in words.
        controller: the controller with its gain.
        loop: the sampled loop of the scenario, whose sensor chain is compared with the recording.
        readings: the readings that the law got, in the unit of the sensor output; one for each recorded reading.
        steps: inputs and outputs of the law in each control period.
        timing: when the readings came.
        noise: noise, offset, resolution and limit of the readings.
        distance_noise: standard deviation of a recorded distance [m]; None for other readings, or if unknown.
        detections: what the law detected.
        events: true events; None if they are unknown.
        reference: the other topic of the same motion; None if there is none.
        latency: by how much the sensor lags the reference; None without a reference.
        counts: number of readings that are "invalid" (NaN), "too near" (minus infinity), "no object" (infinity),
            "detected without an object" (values that were taken as no object, but that an exported controller detects),
            "saturated", "replaced" by a newer one before the law's next step, and "left out" because the clock was set
            back.
        chain: section [chain] of a scenario file, estimated from the recording; empty if there are too few readings.
        drift: significant change over the recording, compared with a reference that is a distance: of ln xi at equal
            distances, or of a measured distance [m].
        clocks: how the header stamps of the sensor differ from those of the reference and of the true events.
        notes: remarks on the file and on the clock.
    """

    recording: Recording
    law: str
    controller: Controller
    loop: ClosedLoop
    readings: FloatArray
    steps: LawSteps
    timing: Timing
    noise: Noise
    distance_noise: float | None
    detections: tuple[RecordedDetection, ...]
    events: tuple[Event, ...] | None
    reference: Recording | None
    latency: Latency | None
    counts: dict[str, int]
    chain: str
    drift: Drift | None
    clocks: tuple[ClockDifference, ...]
    notes: tuple[str, ...]

    @property
    def false_triggers(self) -> tuple[RecordedDetection, ...]:
        """Detections without a true event.

        Empty if the true events are unknown.
        """
        return tuple(d for d in self.detections if d.judgment == "false")

    @property
    def missed(self) -> tuple[Event, ...]:
        """True events that the law detected late or never."""
        return tuple(e for e in self.events or () if e.is_missed or e.is_late)

    @property
    def usable(self) -> int:
        """Number of readings that the law could use."""
        return len(self.readings) - sum(self.counts[name] for name in ("invalid", "saturated"))

    @property
    def used(self) -> int:
        """Number of readings that the law used: usable ones that no newer one replaced."""
        return max(self.usable - self.counts["replaced"], 0)

    @property
    def is_unused(self) -> bool:
        """True if the law used no reading, or fewer than 1 %."""
        return not self.usable or self.used < _FEW * len(self.readings)

    @property
    def is_incomplete(self) -> bool:
        """True if less than half of the recording was replayed, because its clock was set back."""
        return self.counts["left out"] > len(self.readings)

    @property
    def is_good(self) -> bool:
        """True if the law detected all true events and nothing else.

        At least half of the recording must have one clock, the law must have used readings, and no detection is late.
        """
        return not (self.is_unused or self.is_incomplete or self.false_triggers or self.missed)

    @property
    def status(self) -> str:
        """The result in one word, as in the JSON object."""
        if self.is_unused:
            return "no-usable-reading"
        return "incomplete" if self.is_incomplete else "replayed" if self.is_good else "contradicted"

    @property
    def headline(self) -> str:
        """Summary of the detections and the sensor rate."""
        return _headline(self)

    def pairs(self) -> DistancePairs:
        """Return the sensor readings, paired with the distances of the reference topic.

        A known latency of the sensor is removed.

        Raises:
            InvalidInputError: there is no reference that is a distance, or the recorded readings are distances.
        """
        if self.reference is None or self.reference.kind != "distance":
            raise InvalidInputError(
                'reference: a calibration needs a topic with distances, such as --reference "/laser.data [mm]"'
            )
        if self.recording.kind == "distance":
            raise InvalidInputError(
                f"topic: the topic {self.recording.topic} contains distances, but a calibration needs the raw output "
                "of a sensor"
            )
        origin = int(self.recording.stamps[0])
        shift = 0.0 if self.latency is None else self.latency.value or 0.0
        other = self.reference
        return pair_distances(
            self.recording.seconds_after(origin), self.readings, other.seconds_after(origin), other.values, shift
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result of the replay as one JSON object."""
        fields: dict[str, Any] = plain(
            {
                "status": self.status,
                "headline": self.headline,
                "recording": self.recording.source,
                "topic": self.recording.topic,
                "type": self.recording.message_type,
                "kind": self.recording.kind,
                "clock": self.recording.clock,
                "read": self.recording.read,
                "clock_differences": self.clocks,
                "no_object": self.recording.no_object,
                "law": self.law,
                "timing": self.timing,
                "noise": self.noise,
                "distance_noise": self.distance_noise,
                "counts": self.counts,
                "detections": self.detections,
                "events": self.events,
                "false_triggers": None if self.events is None else len(self.false_triggers),
                "missed": None if self.events is None else len(self.missed),
                "latency": self.latency,
                "drift": self.drift,
                "chain": self.chain,
                "notes": self.notes,
            }
        )
        return fields

    def __repr__(self) -> str:
        return f"<Replay of {self.recording.topic}: {len(self.detections)} detections>"


def _headline(replay: Replay) -> str:
    span = f"{format_quantity(replay.timing.duration, 's', 3)} ({CLOCKS[replay.recording.clock]})"
    rates = " ".join(_describe_rates(replay))
    if not replay.usable:
        return f"The law could use none of the {len(replay.readings):,} readings: {_why_unusable(replay)}."
    if replay.is_unused:
        return (
            f"The law used only {replay.used:,} of {len(replay.readings):,} readings, so the replay shows nothing: "
            f"{_why_unused(replay)}. {rates}"
        )
    if replay.is_incomplete:
        total = len(replay.readings) + replay.counts["left out"]
        return (
            f"Only {len(replay.readings):,} of {total:,} readings were replayed, because the clock of the recording "
            f"was set back, so the replay shows little. {_detected(replay, span)}. {rates}"
        )
    count = len(replay.detections)
    detected = _detected(replay, span)
    if replay.events is None:
        return f"{detected}. {rates}"
    false, missed, events = len(replay.false_triggers), len(replay.missed), len(replay.events)
    late = sum(event.is_late for event in replay.missed)
    if not events:
        before = "there is no true event"
    elif missed:
        too_late = f" or detected too late ({late})" if late else ""
        before = f"{missed} of {events} true events {'was' if missed == 1 else 'were'} missed{too_late}"
    else:
        before = f"all {events} true events were detected before they began"
    triggers = f", {false} of them false" if count else ""
    return f"{detected}{triggers}; {before}. {rates}"


def _detected(replay: Replay, span: str) -> str:
    count = len(replay.detections)
    return f"{count} detection{'s' if count != 1 else ''} in {span}" if count else f"No object was detected in {span}"


def _why_unused(replay: Replay) -> str:
    why = _why_unusable(replay)
    replaced = f"{replay.counts['replaced']:,} were replaced by a newer one before the next control step"
    return " and ".join(filter(None, (why, replaced if replay.counts["replaced"] else "")))


def _why_unusable(replay: Replay) -> str:
    counts = replay.counts
    reasons = []
    if counts["saturated"]:
        reasons.append(f"{counts['saturated']:,} are saturated")
    if counts["invalid"]:
        reasons.append(f"{counts['invalid']:,} are not numbers (NaN)")
    return " and ".join(reasons)


def _describe_rates(replay: Replay) -> Iterator[str]:
    """Yield sentences that compare the recorded rate with the scenario."""
    timing, declared = replay.timing, replay.loop.chain.rate
    if not timing.rate > 0:
        yield f"All readings ({timing.count}) have the same time stamp, so the sensor rate is unknown."
        return
    gaps = ""
    if timing.gaps:
        several = f"{timing.gaps:,} gaps of up to" if timing.gaps > 1 else "one gap of"
        gaps = f", with {several} {format_quantity(timing.longest_gap, 's', 3)}"
    if timing.held > 1:
        yield (
            f"The sensor delivers about {format_quantity(timing.value_rate, 'Hz', 3)} of new values, because each "
            f"value occurs {timing.held} times in a row at a rate of {format_quantity(timing.mean_rate, 'Hz', 4)}"
            f"{gaps}. The scenario says {format_quantity(declared, 'Hz', 4)}."
        )
        return
    if not gaps and abs(timing.mean_rate / declared - 1) < _SAME_RATE:
        yield f"The sensor read at {format_quantity(timing.mean_rate, 'Hz', 4)}, as the scenario says."
        return
    yield (
        f"The sensor rate is {format_quantity(declared, 'Hz', 4)} in the scenario and "
        f"{format_quantity(timing.mean_rate, 'Hz', 4)} in the recording{gaps}."
    )
