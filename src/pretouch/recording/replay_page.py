"""Describe the replay of a recording, for the terminal and the report."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from pretouch._core.blocks import Cell, Code, Measured, Page, PageSection, PageTable, Paragraph, Picture
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution
from pretouch.control import Status
from pretouch.control.components import format_output

from .no_object import ASSUMED, NoObject
from .noise import quiet_floor
from .recording import CLOCKS, Recording

if TYPE_CHECKING:
    from .result import Replay

Row = tuple[Cell, ...]

_SLOWER: Final = 0.95  # of the rate of the scenario, below which the difference is a warning
_NOISIER: Final = 1.5  # times the noise of the scenario
_ALWAYS: Final = 0.9  # share of the recording: longer detections are suspicious
_LISTED: Final = 50  # detections in a table
_SAME_CLOCK: Final = 1e-3  # s between two clocks, above which the lag depends on the clock
_DRIFTED: Final = 0.5  # of the noise of a reading: a smaller drift is lost in it
_DRIFTED_SIGNAL: Final = 0.03  # change of ln xi that matters for a calibration
_IDLE: Final = 0.1  # share of NaN, above which it probably means that there is no object
_FEW: Final = 1e-3  # share of readings below which a fault is a remark, and not a warning
_OPEN_LOOP: Final = (
    "The replay is open loop: on a robot, the motion that the law commands changes later readings. Detections and the "
    "force at their start are those of the robot; the later course of force and motion is not."
)


def replay_page(replay: Replay) -> Page:
    """Return the report on the replay of a recording.

    Args:
        replay: the replay.
    """
    return Page(
        kind="Replay",
        headline=replay.headline,
        status="replayed" if replay.is_good else "not confirmed",
        good=replay.is_good,
        key_figures=tuple(_key_figures(replay)),
        warnings=tuple(replay_warnings(replay)),
        findings=tuple(_findings(replay)),
        next_step=_next_step(replay),
        lead="replay",
        blocks=(
            Picture(
                figure="replay",
                of=replay,
                name="Readings, sensor output, virtual force and commanded motion over time",
                caption="Each point of time shows the smallest and the largest value around it. Shaded: detections.",
            ),
            Paragraph(text=_OPEN_LOOP, quiet=True),
            _detections(replay),
            _events(replay),
            PageSection(title="Sensor", blocks=(PageTable(rows=tuple(_sensor_rows(replay)), brief=True),)),
            PageSection(
                title="Section [chain] from this recording",
                blocks=(
                    Paragraph(text="Replace the section `[chain]` of the scenario file by this one, and verify again."),
                    Code(text=replay.chain),
                ),
            )
            if replay.chain
            else None,
            PageSection(title="Controller", blocks=(PageTable(rows=tuple(replay.controller.rows())),)),
        ),
        source=replay.recording.source,
    )


def _key_figures(replay: Replay) -> Iterator[tuple[str, Cell]]:
    timing, noise, chain = replay.timing, replay.noise, replay.loop.chain
    if replay.recording.read:
        yield "times", replay.recording.read[0].removeprefix("The times are from ").rstrip(".")
    if timing.rate > 0:
        declared = f"{format_quantity(chain.rate, 'Hz', 4)}, jitter {format_quantity(chain.jitter, 's', 2)}"
        jitter = format_quantity(timing.jitter, "s", 2)
        yield f"rate without gaps; scenario {declared}", f"{format_quantity(timing.rate, 'Hz', 4)}, jitter {jitter}"
        if timing.held > 1:
            yield "rate of new values", f"about {format_quantity(timing.value_rate, 'Hz', 3)}"
    if replay.recording.kind == "distance":
        if replay.distance_noise is not None:
            declared = format_quantity(chain.distance_noise, "m", 3)
            yield f"noise of a distance; scenario {declared}", format_quantity(replay.distance_noise, "m", 3)
    elif noise.noise is not None:
        where = "with an object" if noise.limited else "without an object"
        yield f"noise {where}; scenario {chain.noise:.3g}", f"{noise.noise:.3g} (unit of the readings)"
    if replay.latency is not None and replay.latency.value is not None:
        low, high = (format_quantity(end, "s", 3) for end in (replay.latency.low or 0.0, replay.latency.high or 0.0))
        yield (
            f"lag, by {CLOCKS[replay.recording.clock]}",
            f"{format_quantity(replay.latency.value, 's', 3)} ({low} to {high})",
        )
    elif len(replay.recording.transport):
        median = float(np.median(replay.recording.transport))
        yield "header stamp to recorder, median", format_quantity(median, "s", 3)
    if replay.events:
        leads = [event.lead for event in replay.events if not event.is_missed]
        if leads:
            yield "shortest lead of a detection", format_quantity(min(leads), "s", 3)
    largest = float(np.abs(replay.steps.virtual_force).max())
    yield "largest virtual force", format_quantity(largest, "N", 3)


def _findings(replay: Replay) -> Iterator[str]:
    if replay.events is None and replay.detections:
        yield (
            "Whether these detections are right is unknown, because the recording has no true contacts; name them with "
            "--truth or --contacts."
        )
    if replay.recording.no_object:
        values = "; ".join(_describe_no_object(replay.recording, idle) for idle in replay.recording.no_object)
        if replay.recording.kind == "distance":
            yield f"Taken as no object: {values}."
        else:
            yield (
                f"Readings that seem to mean no object: {values}. The law takes them as outputs of the sensor, as on "
                "the robot: an object that vanishes acts like one that recedes."
            )
    if replay.noise.limited and replay.recording.kind == "reading":
        idle = (
            "the readings have only the values above: the offset is not measured, and the noise"
            if replay.noise.offset is None
            else f"the readings stay at exactly {replay.noise.offset:.6g}: the noise"
        )
        yield f"Without an object, {idle} was measured while an object was there."
    if replay.latency is not None and replay.latency.value is None:
        yield f"The latency cannot be determined: {replay.latency.reason}."
    elif replay.latency is not None and replay.latency.value is not None:
        yield from _basis_of_lag(replay, replay.latency.value)


def _describe_no_object(recording: Recording, idle: NoObject) -> str:
    """Say which readings were taken as "no object", and why."""
    count = f"{idle.count:,} {'readings' if idle.count > 1 else 'reading'}"
    match idle.reason:
        case "infinite":
            return f"{count} with the value infinity (REP 117)"
        case "range":
            return f"{count} at or beyond max_range ({format_quantity(idle.value, 'm', 4)})"
        case "part":
            return f"{count} of {recording.value_in_words(idle.value)}, by which a sensor part reports this"
        case "negative":
            return f"{count} of {recording.value_in_words(idle.value)}, because no distance is negative"
    value = recording.value_in_words(idle.value)
    return f"{count} of exactly {value}, because this value repeats, and the readings jump to it and back"


def _basis_of_lag(replay: Replay, lag: float) -> Iterator[str]:
    """Say which clocks the lag rests on, and how it changes with the other clock."""
    if replay.recording.clock == "header" and replay.clocks and abs(replay.clocks[0].offset) > _SAME_CLOCK:
        other = format_quantity(lag + replay.clocks[0].offset, "s", 3)
        yield (
            "The lag rests on header stamps: it is right if the stamps of both topics are from one clock. By the "
            f"receive times, it is {other}."
        )


def replay_warnings(replay: Replay) -> Iterator[str]:
    """Yield the warnings about a replay, the most important warnings first.

    Args:
        replay: the replay.
    """
    timing, noise, chain = replay.timing, replay.noise, replay.loop.chain
    yield from (
        caution(
            "PT611",
            f"{each.words}, and lag, leads and a calibration from both topics are wrong by this difference: use the "
            "receive times with --clock receive.",
        )
        for each in replay.clocks
        if each.is_large and replay.recording.clock == "header"
    )
    if replay.counts["detected without an object"]:
        assumed = [idle.value for idle in replay.recording.no_object if idle.reason in ASSUMED]
        values = ", ".join(map(replay.recording.value_in_words, assumed))
        yield caution(
            "PT610",
            f"The readings of {values} were taken as no object, but the exported ROS 2 controller takes them as a "
            f"near object ({replay.counts['detected without an object']:,} readings of the recording): let the driver "
            "of the sensor publish infinity instead (REP 117). Otherwise, the robot evades where there is no object.",
        )
    detected = sum(d.end - d.start for d in replay.detections) / max(float(np.ptp(replay.recording.time)), 1e-9)
    if detected > _ALWAYS:
        yield caution(
            "PT609",
            f"An object is detected in {100 * min(detected, 1.0):.0f} % of the recording: check offset, floor and sign "
            "of the readings, unless an object was near all the time. A detection that never ends shows nothing about "
            "contacts.",
        )
    if timing.rate > 0 and timing.mean_rate * timing.value_rate / timing.rate < _SLOWER * chain.rate:
        yield caution(
            "PT606",
            f"The sensor is slower than the scenario says{_new_values(replay)}, so the verification does not hold for "
            "it: copy its section [chain] (--chain FILE) into the scenario file, and run pretouch verify."
            + _lost_between(replay),
        )
    lag = None if replay.latency is None else replay.latency.low
    if lag is not None and lag > chain.latency + 1 / chain.rate:
        yield caution(
            "PT606",
            f"The readings lag at least {format_quantity(lag, 's', 3)} behind the reference, but the scenario has a "
            f"latency of {format_quantity(chain.latency, 's', 3)}: copy the section [chain] of this recording "
            "(--chain FILE) into the scenario file, and run pretouch verify.",
        )
    yield from (caution("PT601", note) for note in replay.notes)
    yield from _fault_warnings(replay)
    yield from _drift_warnings(replay)
    floor, xi = replay.controller.conditioning.floor, _largest_output(replay)
    if not replay.detections and replay.usable and xi is not None:
        yield caution(
            "PT605",
            f"No reading was above the noise floor (largest signal {xi:.4g}, noise floor {format_output(floor)}): "
            "check that the topic has the unit of the scenario, and that an object came near.",
        )
    if replay.distance_noise is not None and replay.distance_noise > _NOISIER * chain.distance_noise > 0:
        yield caution(
            "PT607",
            f"The recorded noise of a distance is {format_quantity(replay.distance_noise, 'm', 3)}, "
            f"{replay.distance_noise / chain.distance_noise:.2g} times that of the scenario, so the verification is "
            "too optimistic: copy the section [chain] of this recording (--chain FILE) into the scenario file.",
        )
    if replay.recording.kind == "reading" and noise.noise is not None:
        if noise.noise > _NOISIER * chain.noise and chain.noise > 0:
            yield caution(
                "PT607",
                f"The recorded noise of {noise.noise:.3g} is {noise.noise / chain.noise:.2g} times the noise in the "
                "scenario, so the verification is too optimistic: copy the section [chain] of this recording "
                "(--chain FILE) into the scenario file.",
            )
        needed = quiet_floor(replay.controller.conditioning, replay.timing.rate, noise.noise)
        if floor < needed:
            yield caution(
                "PT607",
                f"The noise floor of {floor:.4g} is only {floor / noise.noise:.2g} standard deviations of the noise: "
                f"raise the floor to at least {needed:.3g}. Otherwise, noise alone can be detected as an object more "
                "than once per hour.",
            )
        if noise.offset is not None and abs(noise.offset - replay.controller.conditioning.offset) > floor / 2:
            yield caution(
                "PT608",
                f"Without an object, the median reading is {noise.offset:.5g}, but the controller subtracts the offset "
                f"{replay.controller.conditioning.offset:.5g}: copy the section [chain] of this recording "
                "(--chain FILE) into the scenario file, and remove offset from [controller] if it has one. The "
                "controller then subtracts this "
                "median.",
            )


def _drift_warnings(replay: Replay) -> Iterator[str]:
    """Yield warnings about a drift of the offset and of the signal over the recording."""
    noise, floor = replay.noise, replay.controller.conditioning.floor
    offset = noise.drift if replay.recording.kind == "reading" else None
    if offset is not None and abs(offset.change) > max(_DRIFTED * (noise.noise or 0.0), noise.resolution):
        yield caution(
            "PT612",
            f"Without an object, the readings drift from {offset.start:.5g} to {offset.start + offset.change:.5g} over "
            f"the recording, but the controller subtracts a constant offset; its noise floor is {floor:.4g}: let the "
            "sensor warm up, and measure its offset again before each use.",
        )
    drift = replay.drift
    if drift is None:
        return
    if replay.recording.kind == "distance":
        if abs(drift.change) > _DRIFTED * (replay.distance_noise or 0.0):
            yield caution(
                "PT612",
                f"Compared with the reference, the measured distance drifts by {format_quantity(drift.change, 'm', 3)} "
                "over the recording: let the sensor warm up, and record again.",
            )
    elif abs(drift.change) > _DRIFTED_SIGNAL:
        change, low, high = (100 * math.expm1(value) for value in (drift.change, drift.low, drift.high))
        yield caution(
            "PT612",
            f"At equal distances, the signal drifts by {change:+.2g} % over the recording (linear trend, 95 %: "
            f"{low:+.2g} to {high:+.2g} %), so a calibration from it mixes different curves: let the sensor warm up, "
            "and record again.",
        )


def _new_values(replay: Replay) -> str:
    """Return the rate of a sensor whose values are repeated, in words; empty for others."""
    timing = replay.timing
    if timing.held == 1:
        return ""
    declared = format_quantity(replay.loop.chain.rate, "Hz", 4)
    return f" ({format_quantity(timing.value_rate, 'Hz', 3)} instead of {declared}, because each value is repeated)"


def _lost_between(replay: Replay) -> str:
    """Say that the law loses the sensor between two readings, if it does."""
    controller, interval = replay.controller, 1 / replay.timing.rate
    timeout = controller.conditioning.numbers(controller.period).timeout
    if interval <= timeout:
        return ""
    return (
        f" The time between two readings of {format_quantity(interval, 's', 3)} is longer than the timeout of "
        f"{format_quantity(timeout, 's', 3)}, after which the law counts the sensor as lost: the virtual force ends "
        "before each new reading."
    )


def _fault_warnings(replay: Replay) -> Iterator[str]:
    """Yield warnings about unusable readings and wrong time stamps."""
    counts, timing, total = replay.counts, replay.timing, len(replay.readings)
    texts = {
        "saturated": "are saturated, and the law ignores them; reduce the amplification",
        "invalid": "are not numbers (NaN), and the law ignores them",
        "too near": "say that the object is too near to be measured, and the law ignores them",
    }
    for name, text in texts.items():
        if counts[name]:
            if name == "invalid" and counts[name] > _IDLE * total:
                text += "; if NaN means that there is no object, let the driver publish infinity"  # noqa: PLW2901
            yield caution("PT603", f"{counts[name]:,} of {total:,} readings {text}.")
    if replay.noise.clipped and not counts["saturated"] and replay.recording.kind == "reading":
        yield caution(
            "PT603",
            f"The largest reading, {replay.noise.largest:.6g}, occurs several times in a row, probably because of "
            "saturation: set saturation in [controller] to this value.",
        )
    if timing.late:
        yield caution(
            "PT604",
            f"{timing.late:,} readings arrived too late, after readings with a later time stamp: the law ignores these "
            "late readings.",
        )
    if timing.repeated_stamps:
        yield caution(
            "PT604",
            f"{timing.repeated_stamps:,} readings have the same time stamp as the previous reading: the law uses only "
            "the last reading of each time stamp.",
        )
    replaced = counts["replaced"] - timing.repeated_stamps - timing.late
    if replaced > _FEW * total:
        yield caution(
            "PT604",
            f"The law did not use {replaced:,} readings: a newer reading arrived before the next control step.",
        )


def _largest_output(replay: Replay) -> float | None:
    finite = replay.readings[np.isfinite(replay.readings)]
    return float(finite.max()) - replay.controller.conditioning.offset if len(finite) else None


def _next_step(replay: Replay) -> str:
    if not replay.usable:
        return "check the topic, its unit and the amplification of the sensor, and record again"
    if replay.is_unused:
        return "check the times of the recording and their unit, and record again"
    if replay.is_incomplete:
        return "sort the recording by its times, or split it where the clock was set back, and replay each part"
    if replay.missed:
        return "look at the missed events in the report; a lower floor or a faster sensor detects earlier"
    if replay.false_triggers:
        return "look at the false triggers in the report: an object may have passed without an event, or it is noise"
    return "put the section [chain] of the report into the scenario file (--chain FILE), and run pretouch verify"


def _detections(replay: Replay) -> PageSection | None:
    if not replay.detections:
        return None
    rows = tuple(
        (
            str(number),
            format_quantity(d.start, "s", 5),
            format_quantity(d.end - d.start, "s", 3),
            f"{d.peak:.4g}",
            format_quantity(d.largest_force, "N", 3),
            {"right": "right", "false": "no object", "unknown": "unknown"}[d.judgment],
        )
        for number, d in enumerate(replay.detections[:_LISTED], 1)
    )
    head = ("", "start", "duration", "largest \u03be", "largest force", "judgment")
    hidden = len(replay.detections) - len(rows)
    note = f"{hidden:,} more detections are not listed." if hidden else ""
    table = PageTable(rows=rows, head=head, note=note, brief=True)
    return PageSection(title="Detections", blocks=(table,), opened=True)


def _events(replay: Replay) -> PageSection | None:
    if not replay.events:
        return None
    rows = tuple(
        (
            str(number),
            format_quantity(e.start, "s", 5),
            "missed" if e.is_missed else format_quantity(e.lead, "s", 3) + (" (too late)" if e.is_late else ""),
        )
        for number, e in enumerate(replay.events[:_LISTED], 1)
    )
    head = ("", "true event at", "detected before by")
    return PageSection(title="True events", blocks=(PageTable(rows=rows, head=head, brief=True),), opened=True)


def _sensor_rows(replay: Replay) -> Iterator[Row]:
    """Yield table rows that compare the sensor with the scenario."""
    timing, noise, chain = replay.timing, replay.noise, replay.loop.chain
    yield "topic", f"{replay.recording.topic} ({replay.recording.message_type})", ""
    yield "times", CLOCKS[replay.recording.clock], ""
    for sentence in replay.recording.read:
        yield "table", sentence, ""
    yield "property", "this recording", "[chain] of the scenario"
    yield "readings", f"{timing.count:,}", ""
    yield "rate without gaps", Measured(timing.rate, "Hz"), Measured(chain.rate, "Hz")
    yield "mean rate", Measured(timing.mean_rate, "Hz"), ""
    if timing.held > 1:
        yield "rate of new values", Measured(timing.value_rate, "Hz"), Measured(chain.rate, "Hz")
    yield "jitter", Measured(timing.jitter, "s"), Measured(chain.jitter, "s")
    yield "gaps", f"{timing.gaps:,}", ""
    yield "longest interval", Measured(timing.longest_gap, "s"), f"at {timing.longest_gap_at:.5g} s"
    yield "missing readings", f"{100 * timing.dropout:.3g} %", f"{100 * chain.dropout:.3g} %"
    if replay.recording.kind == "distance":
        yield "noise of a distance", Measured(replay.distance_noise, "m"), Measured(chain.distance_noise, "m")
        yield "resolution", Measured(noise.resolution, "m"), Measured(chain.distance_resolution, "m")
    else:
        rows = (
            ("median without an object", noise.offset, chain.offset + chain.crosstalk),
            (f"noise {'with' if noise.limited else 'without'} an object", noise.noise, chain.noise),
            ("spread without an object, with drift", noise.wander, math.nan),
            ("resolution", noise.resolution, chain.resolution),
            ("largest reading", noise.largest, chain.highest),
        )
        for label, measured, declared in rows:
            yield label, Measured(measured), Measured(declared if math.isfinite(declared) else None)
        yield "offset that the controller subtracts", "", Measured(replay.controller.conditioning.offset)
        share = "-" if noise.relative_noise is None else f"{100 * noise.relative_noise:.3g} %"
        yield "noise relative to \u03be", share, f"{100 * chain.relative_noise:.3g} %"
    flags = int(np.bitwise_or.reduce(replay.steps.status))
    for flag in Status:
        if flags & flag and flag is not Status.DETECTING:
            steps = int(((replay.steps.status & flag) != 0).sum())
            yield flag.meaning, f"{steps:,} steps", ""
