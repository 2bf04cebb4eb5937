"""Run the control law with the readings of a recording.

The replay also measures the sensor properties.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, IntArray
from pretouch.control import Controller, Status
from pretouch.designs import Task
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop
from pretouch.tables.names import is_output_unit, output_unit
from pretouch.verification.verdict import chosen_gain

from .chain_section import chain_section
from .clocks import ClockDifference, compare_clocks
from .detections import BEFORE, PAUSE, detections_in, events_in, judge
from .distance_pairs import pair_distances
from .drift import Drift, drift_at_equal_distances
from .latency import Latency, estimate_latency
from .measurements import measurements_of
from .no_object import ASSUMED
from .noise import noise_of, spread_of_course
from .recording import Recording
from .result import Replay
from .stepping import LawSteps, are_without_object, readings_of, run_steps
from .timing import stretches, timing_of

_REGULAR: Final = 1.5  # periods up to which a reading follows the one before
_AROUND: Final = 0.5  # s around a detection, in which an object may be near already
_APPROACH: Final = 3.0  # s before and after a detection: an object below the floor may be there
_PLAUSIBLE: Final = 1.0  # s: a longer transport means that the two clocks differ


@check_arguments
def replay(
    task: Task,
    recording: Recording,
    *,
    reference: Recording | None = None,
    truth: Recording | None = None,
    threshold: float = 0.5,
    contacts: Sequence[float] | None = None,
    before: float = BEFORE,
    start: float = 0.0,
    end: float = np.inf,
) -> Replay:
    """Run the control law of a task with recorded readings.

    The replay also compares the recorded sensor with its model in the task. The replay is open loop: the recorded
    readings do not respond to the motion that the law commands. The law is the compiled one that simulations run and
    exports contain.

    Args:
        task: the task with its sampled loop; the gain as for `verify`.
        recording: the readings of the sensor.
        reference: another topic of the same recording that shows the same motion, such as a distance; for the latency
            and a calibration.
        truth: a topic of the same recording that is above `threshold` while there is an object or a contact.
        threshold: threshold of `truth`.
        contacts: times of true contacts after the first reading [s], instead of `truth`.
        before: longest time from a detection to its event [s].
        start: start of the replayed part after the first reading [s].
        end: end of this part [s].

    Returns:
        The replay, with any result: also no detection, or no usable reading.
    """
    controller, loop, law = _controller(task)
    unit_notes = _notes_on_unit(task, recording)
    whole, notes = _one_clock(measurements_of(recording))
    left_out = len(recording.stamps) - len(whole.stamps)
    reference = None if reference is None else measurements_of(reference)
    used = _part_between(whole, start, end)
    time = used.time
    readings = readings_of(used, task.sensor, controller.conditioning.offset)
    steps = run_steps(controller, time, readings, are_without_object(used, task.sensor))
    timing = timing_of(time, used.values)
    pause = max(PAUSE, _REGULAR / timing.rate) if timing.rate > 0 else PAUSE
    intervals = detections_in(steps, controller.conditioning.floor, pause)
    detecting = _detecting_at(steps, time)
    regular = np.diff(time, prepend=-np.inf) <= _REGULAR / timing.rate if timing.rate > 0 else np.zeros(len(time), bool)
    regular &= np.diff(time, prepend=0.0) > 0
    near, approaches = (_around(time, intervals, margin) for margin in (_AROUND, _APPROACH))
    offset = controller.conditioning.offset
    codes = tuple(idle.value for idle in used.no_object) if used.kind == "reading" else ()
    new = _new_values(used.values, timing.held)  # a repeated value has no noise of its own
    index = np.arange(len(time))[new]
    steady = np.logical_and.reduce([regular[np.minimum(index + i, len(time) - 1)] for i in range(timing.held)])
    noise = noise_of(
        used.values[new],
        steady,
        detecting[new],
        near[new],
        offset,
        approaches=approaches[new],
        codes=codes,
        time=time[new],
    )
    distance_noise = spread_of_course(used.values[new], steady) if used.kind == "distance" else None
    origin = int(used.stamps[0])
    first = (origin - int(whole.stamps[0])) / 1e9
    last = float(time.max())
    events = _events(truth, threshold, contacts, origin=origin, first=first, last=last)
    known = (-np.inf, np.inf) if truth is None else _span_of(truth, origin, last)
    detections, judged = judge(intervals, events, _positive(before), known)
    latency = None if reference is None else _latency(task, used.part(new), readings[new], reference, controller)
    name = f"{used.source}, {used.topic}"
    chain = ""
    if timing.rate > 0 and len(time) > 2:
        chain = chain_section(
            timing,
            noise,
            loop.chain,
            kind=used.kind,
            distance_noise=distance_noise,
            delay=_delay(used, latency, reference, loop.chain.exposure),
            name=name,
            is_rate_stated=used.clock == "rate",
        )
    shift = 0.0 if latency is None else latency.value or 0.0
    drift = None if reference is None else _drift(used, readings, reference, shift, controller)
    return Replay(
        recording=used,
        law=law,
        controller=controller,
        loop=loop,
        readings=readings,
        steps=steps,
        timing=timing,
        noise=noise,
        distance_noise=distance_noise,
        detections=detections,
        events=None if events is None else judged,
        reference=reference,
        latency=latency,
        counts={**_counts(used, readings, steps, controller, task.sensor), "left out": left_out},
        chain=chain,
        drift=drift,
        clocks=tuple(_clock_differences(used, (reference, truth))),
        notes=(*used.notes, *unit_notes, *notes),
    )


def _notes_on_unit(task: Task, recording: Recording) -> tuple[str, ...]:
    """Return a remark if the unit of the sensor outputs is unknown.

    Raises:
        InvalidInputError: the readings have another unit than the sensor outputs of the task.
    """
    if recording.kind == "distance" or not recording.unit:
        return ()
    part, calibration = task.sensor_part, task.calibration
    declared = calibration.calibration.unit if calibration is not None else part.unit if part is not None else ""
    if not declared:
        return (f"The readings have the unit {recording.unit}; pretouch does not convert them.",)
    if output_unit(declared)[0] == recording.unit:
        return ()
    source = "calibration" if calibration is not None else f"sensor part {part.name}" if part is not None else ""
    remedy = f"Record the output in {declared}"
    if is_output_unit(recording.unit):
        remedy += (
            f", or write the sensor, noise and floor of the scenario in {recording.unit}. If the unit of the recording "
            f'is wrong, give the right one: --topic "{recording.topic} [{declared}]"'
        )
    raise InvalidInputError(
        f"topic: the readings of {recording.topic} are in {recording.unit}, but the {source} of the scenario has "
        f"outputs in {declared}. {remedy}",
        value=recording.unit,
        limit=declared,
        remedy=f"{recording.topic} [{declared}]",
    )


def _positive(value: float) -> float:
    if not 0 <= value < np.inf:
        raise InvalidInputError(f"before: found {value!r} s, expected a time of at least 0 s")
    return value


def _controller(task: Task) -> tuple[Controller, ClosedLoop, str]:
    """Return the controller, the sampled loop and the law's description."""
    loop = task.loop
    if not isinstance(loop, ClosedLoop) or not isinstance(loop.law, Controller):
        raise InvalidInputError(
            "loop: a replay needs the controller of a sampled loop, but this task has none; add [chain] and "
            "[controller] to the scenario file"
        )
    gain = chosen_gain(task)
    law = f"{task.law.kind.replace('-', ' ')}, {task.law.number.name} {task.law.number.equals(gain)}"
    controller: Any = loop.robot_law
    return controller.with_value(gain), loop, law


def _one_clock(recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Return the longest part of a recording with increasing time."""
    if not len(recording.stamps):
        raise InvalidInputError(f"{recording.source}: the topic {recording.topic} has no messages")
    parts = stretches(recording.time)
    if len(parts) == 1:
        return recording, ()
    longest = max(parts, key=lambda part: part.stop - part.start)
    total = len(recording.stamps)
    lost = total - (longest.stop - longest.start)
    other = {"header": "receive", "receive": "header" if len(recording.transport) else ""}.get(recording.clock)
    advice = f"; try --clock {other}" if other else ""
    jumps = "once" if len(parts) == 2 else f"{len(parts) - 1} times"
    return recording.part(longest), (
        f"The clock of the recording was set back {jumps}: pretouch replayed only the longest part without a jump"
        f"{advice}. The replay ignores {lost:,} of {total:,} readings.",
    )


def _new_values(values: FloatArray, held: int) -> slice | IntArray:
    """Return the indices of the readings, without those that only repeat the value before."""
    if held == 1:
        return slice(None)
    return np.flatnonzero(np.diff(values, prepend=np.nan) != 0)


def _around(time: FloatArray, intervals: list[tuple[float, float, float, float]], margin: float) -> BoolArray:
    """Return which times are during a detection, or shortly before or after it."""
    if not intervals:
        return np.zeros(len(time), dtype=bool)
    begins, ends = np.array([interval[:2] for interval in intervals]).T
    last = np.searchsorted(begins - margin, time, side="left") - 1  # the last detection that began before
    return np.asarray((last >= 0) & (time < ends[last] + margin))


def _part_between(recording: Recording, start: float, end: float) -> Recording:
    """Return the readings between two times after the first reading [s]."""
    if start <= 0 and end == np.inf:
        return recording
    time = recording.time
    chosen = np.flatnonzero((time >= start) & (time <= end))
    if not len(chosen):
        raise InvalidInputError(
            f"from, to: there is no reading from {start:g} s to {end:g} s; the recording lasts {time.max():.4g} s"
        )
    return recording.part(chosen)


def _detecting_at(steps: LawSteps, time: FloatArray) -> BoolArray:
    """Return for each reading whether the law detected an object."""
    flags = (steps.status & Status.DETECTING) != 0
    period = float(steps.time[1] - steps.time[0])
    index = np.minimum(np.ceil(np.maximum.accumulate(time) / period - 1e-9).astype(int), len(flags) - 1)
    around = [flags[np.clip(index + shift, 0, len(flags) - 1)] for shift in (-1, 0, 1)]
    return np.asarray(around[0] | around[1] | around[2])


def _events(
    truth: Recording | None,
    threshold: float,
    contacts: Sequence[float] | None,
    *,
    origin: int,
    first: float,
    last: float,
) -> list[tuple[float, float]] | None:
    """Return start and end of each true event [s], or None."""
    if truth is not None and contacts is not None:
        raise InvalidInputError("truth, contacts: found both, expected only one: a topic (truth) or times (contacts)")
    if truth is not None:
        if not len(truth.stamps):
            raise InvalidInputError(f"truth: the topic {truth.topic} has no messages")
        events = events_in(truth.seconds_after(origin), truth.values, threshold)
        return [(max(a, 0.0), b) for a, b in events if b >= 0 and a <= last]
    if contacts is None:
        return None
    times = [float(t) - first for t in contacts]
    if outside := [t for t in times if not 0 <= t <= last]:
        raise InvalidInputError(
            f"contacts: found a contact at {outside[0] + first:g} s, but the replayed part lasts from {first:.4g} s to "
            f"{first + last:.4g} s. All three times count from the first reading"
        )
    return [(t, t) for t in sorted(times)]


def _span_of(truth: Recording, origin: int, last: float) -> tuple[float, float]:
    """Return the first and the last time of the true events' topic [s].

    Raises:
        InvalidInputError: the topic has no message during the replayed part.
    """
    time = truth.seconds_after(origin)
    if not ((time >= 0) & (time <= last)).any():
        raise InvalidInputError(
            f"truth: the topic {truth.topic} has no message in the replayed part from 0 s to {last:.6g} s; its "
            f"messages are from {time.min():.6g} s to {time.max():.6g} s. Use the receive times of both topics with "
            "--clock receive, or choose a topic that was recorded at the same time"
        )
    return float(time.min()), float(time.max())


def _clock_differences(used: Recording, others: Sequence[Recording | None]) -> Iterator[ClockDifference]:
    """Yield how the clocks of the sensor and of each other topic differ, if both clocks were recorded."""
    own = used.transports
    for other in others:
        transports = None if other is None else other.transports
        if own is not None and transports is not None and len(own.stamps) and len(transports.stamps):
            yield compare_clocks(own, transports)


def _latency(
    task: Task, used: Recording, readings: FloatArray, reference: Recording, controller: Controller
) -> Latency:
    """Return the latency of the sensor relative to the reference."""
    conditioning = controller.conditioning
    saturation = np.inf if conditioning.saturation is None else conditioning.saturation

    def log_level(values: FloatArray, raw: bool) -> FloatArray:
        kept = np.where(raw & (values >= saturation), np.nan, values)
        return np.log(np.maximum(kept - conditioning.offset, conditioning.floor) / conditioning.floor)

    origin = int(used.stamps[0])
    other = reference.values
    if reference.kind == "distance":  # on the curve, both are the same quantity
        other = log_level(readings_of(reference, task.sensor, conditioning.offset), False)
    with np.errstate(invalid="ignore"):
        own = log_level(readings, used.kind == "reading")
    return estimate_latency(used.seconds_after(origin), own, reference.seconds_after(origin), other)


def _drift(
    used: Recording, readings: FloatArray, reference: Recording, shift: float, controller: Controller
) -> Drift | None:
    """Return how ln xi at equal distances, or the measured distance, changes over the recording."""
    if reference.kind != "distance":
        return None
    origin = int(used.stamps[0])
    own, other = used.seconds_after(origin), reference.seconds_after(origin)
    values = used.values if used.kind == "distance" else readings
    try:
        pairs = pair_distances(own, values, other, reference.values, shift)
    except InvalidInputError:
        return None
    conditioning = controller.conditioning
    near = np.isfinite(pairs.distance) & np.isfinite(pairs.reading)
    if used.kind == "distance":
        return drift_at_equal_distances(pairs.time[near], pairs.reading[near], pairs.distance[near])
    saturation = np.inf if conditioning.saturation is None else conditioning.saturation
    above = pairs.reading - conditioning.offset
    near &= (above >= conditioning.floor) & (pairs.reading < saturation)
    return drift_at_equal_distances(pairs.time[near], np.log(above[near]), pairs.distance[near])


def _delay(
    used: Recording, latency: Latency | None, reference: Recording | None, exposure: float
) -> tuple[float, str] | None:
    """Return the sensor delay [s] and how it was measured."""
    if latency is not None and latency.value is not None and reference is not None and latency.value > 0:
        # a latency counts from the middle of an exposure, and a delay from its end
        return (
            latency.value - exposure / 2,
            f"measured relative to the topic {reference.topic}, whose latency is assumed to be 0",
        )
    if used.clock == "header" and len(used.transport):
        transport = float(np.median(used.transport))
        if 0 <= transport <= _PLAUSIBLE:
            return transport, "from the header stamp to the recorder, if their clocks agree"
    return None


def _counts(
    used: Recording, readings: FloatArray, steps: LawSteps, controller: Controller, sensor: SensorModel
) -> dict[str, int]:
    conditioning = controller.conditioning
    saturation = conditioning.saturation
    saturated = 0 if saturation is None or used.kind == "distance" else int((readings >= saturation).sum())
    too_near = int(np.isneginf(used.values).sum()) if used.kind == "distance" else 0
    unusable = ~np.isfinite(readings)
    idle = [
        each
        for each in used.no_object
        # an exported controller knows negative ranges, and those outside of the limits of the message
        if each.reason in ASSUMED and used.kind == "distance" and each.value >= 0 and not each.value < used.bounds[0]
    ]
    raw = replace(
        used,
        stamps=np.zeros(len(idle), dtype=np.int64),
        values=np.array([each.value for each in idle]),
        transport=np.zeros(0),
    )
    detected = readings_of(raw, sensor, conditioning.offset) >= conditioning.offset + conditioning.floor
    return {
        "invalid": int(unusable.sum()) - too_near,
        "too near": too_near,
        "no object": int(np.isposinf(used.values).sum()) if used.kind == "distance" else 0,
        "detected without an object": sum(each.count for each, is_seen in zip(idle, detected, strict=True) if is_seen),
        "saturated": saturated if saturation is None else saturated - int(np.isposinf(readings).sum()),
        "replaced": len(readings) - int(steps.fresh.sum()),
    }
