"""Check whether a calibration still holds, from a recording of today with known distances.

The signal at two distances shows how the curve has changed: S'(l) = k S(l + d) has two unknowns, the factor k and the
shift d. The offset must be measured without an object, because it is a third unknown. What decides is the contact: the
sampled loop runs with the gain of the calibration on the curve and offset of today.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.numbers import nonnegative, positive
from pretouch._core.units import format_percent, format_quantity
from pretouch._core.values import Value
from pretouch.designs import Task
from pretouch.designs.gain import designed_number
from pretouch.motion.laws import LawNumber
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SensorChain
from pretouch.verification.verdict import chosen_gain

from .curve_today import (
    CERTAIN,
    Doubt,
    curves_of,
    explanations_of,
    is_from_distances,
    offset_of,
    saturated,
    signal_of,
    signals_of,
)
from .known_distances import FEWEST, KnownDistance, known_distances
from .noise import quiet_floor
from .recording import Recording
from .result import Replay

Decision: TypeAlias = Literal["fine", "update-offset", "recalibrate", "not-decided"]

TOLERANCE: Final = 0.15
"""Change of the contact speed that ends a calibration."""

_NO_EMPTY_SCENE: Final = Doubt(
    "no part of the recording is named as one without an object, so the offset is unknown",
    "name the part without an object as none; if there is no such part, record again with the empty scene first",
)
_MISFIT: Final = Doubt(
    "the readings at the known distances do not fit the curve of the calibration, even with another offset, scale "
    "factor or distance",
    "check the named distances, whether the empty scene was empty, and whether the object is that of the calibration; "
    "if all are right, recalibrate",
)
_NO_CONTACT: Final = Doubt(
    "the encounter of the scenario ends without a contact, so there is no contact speed to compare",
    "check the gain, and position and velocity in [obstacle]; the recording needs no change",
)
_TAKEN_FOR_OBJECT: Final = "the controller takes the offset of today for an object"
_LARGE_OFFSET: Final = 0.5  # of the floor, from which a changed offset is updated in any case, like PT608
_RUNS: Final = 8  # runs with other phases of the sensor, of which the contact speed is the mean
_COVERED: Final = 0.4  # share of the change of ln xi between detection and contact that the distances must cover
_SLOWER: Final = 0.95  # of the rate of the scenario
_HALF: Final = 0.5  # of the allowed drift, after which the next check is due
_LIKELY: Final = 2 / 3  # of the range: two standard errors, which are enough to recalibrate


class Range(NamedTuple):
    """A contact speed [m/s] with the range within three standard errors, whose ends are NaN if they are unknown."""

    value: float
    low: float
    high: float

    def is_near(self, nominal: float) -> bool:
        """Return True if the whole range differs by at most 15 % from a speed."""
        return abs(self.low / nominal - 1) <= TOLERANCE and abs(self.high / nominal - 1) <= TOLERANCE

    def is_far_from(self, nominal: float) -> bool:
        """Return True if the range within two standard errors differs by more than 15 % from a speed."""
        low, high = (self.value + _LIKELY * (end - self.value) for end in (self.low, self.high))
        return bool(low / nominal - 1 > TOLERANCE or high / nominal - 1 < -TOLERANCE)

    @property
    def words(self) -> str:
        """The speed with its range, as text."""
        if math.isnan(self.low + self.high):
            return f"{format_quantity(self.value, 'm/s', 3)} (with an unknown range)"
        ends = " to ".join(format_quantity(end, "m/s", 3) for end in (self.low, self.high))
        return f"{format_quantity(self.value, 'm/s', 3)} ({ends})"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Recheck(Described, Value):
    """Answer to the question whether a calibration still holds.

    Args:
        decision: "fine", "update-offset", "recalibrate" or "not-decided".
        reasons: why nothing is decided, or why the calibration does not hold, in clauses.
        actions: what to do about these reasons, in clauses; empty if the decision says it.
        replay: the replay of the recording.
        distances: mean readings at the known distances.
        gain: the gain of the calibration, in the unit of the law's number.
        number: which number this gain is.
        offset_then: the offset of the calibration.
        offset_then_error: its standard error; None if it is unknown.
        offset: the offset today; None if it is unknown.
        offset_error: its standard error.
        ratios: logarithm of the signal today divided by that of the calibration, at each usable distance.
        ratio_errors: its standard errors.
        places: these distances [m].
        slope_then: mean slope of ln xi from the nearest to the farthest usable distance, of the calibration [1/m].
        slope: the same slope today [1/m].
        slope_error: its standard error.
        contact_then: contact speed of the calibration [m/s]; None without a contact.
        contact: contact speed with the curve and offset of today, and the controller as it is.
        contact_updated: the same after the offset of the controller was updated.
        optimal_gain_then: optimal gain of the ideal loop with the curve of the calibration; None if there is none, or
            if the task has no objective or no bounds.
        optimal_gain: the same with the best curve of today.
        updates_offset: whether the controller should subtract the offset of today, whatever the curve is.
        triggers: whether the controller takes the offset of today for an object.
        limits: limits that hold at the contact speed of the calibration, but not in the whole range of today.
        elapsed: time from the calibration to the recording [s]; None if unknown.
        interval: recommended time to the next check [s]; None if unknown.
    """

    decision: Decision
    reasons: tuple[str, ...]
    replay: Replay
    distances: tuple[KnownDistance, ...]
    gain: float
    number: LawNumber
    offset_then: float
    offset_then_error: float | None
    offset: float | None = None
    offset_error: float = math.nan
    ratios: tuple[float, ...] = ()
    ratio_errors: tuple[float, ...] = ()
    places: tuple[float, ...] = ()
    slope_then: float | None = None
    slope: float | None = None
    slope_error: float = math.nan
    contact_then: float | None = None
    contact: Range | None = None
    contact_updated: Range | None = None
    optimal_gain_then: float | None = None
    optimal_gain: float | None = None
    limits: tuple[str, ...] = ()
    elapsed: float | None = None
    interval: float | None = None
    actions: tuple[str, ...] = ()
    updates_offset: bool = False
    triggers: bool = False

    @property
    def is_good(self) -> bool:
        """True if nothing has to be done."""
        return self.decision == "fine"

    @property
    def headline(self) -> str:
        """The verdict with its evidence."""
        return " ".join(_headline(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as one JSON object in SI units."""
        names = (
            *(
                "decision",
                "headline",
                "reasons",
                "actions",
                "updates_offset",
                "triggers",
                "gain",
                "offset_then",
                "offset_then_error",
                "offset",
                "offset_error",
            ),
            *("places", "ratios", "ratio_errors", "slope_then", "slope", "slope_error", "contact_then"),
            *("optimal_gain_then", "optimal_gain", "distances", "limits", "elapsed", "interval"),
        )
        fields: dict[str, Any] = plain({name: getattr(self, name) for name in names})
        for name in ("contact", "contact_updated"):
            speed: Range | None = getattr(self, name)
            fields[name] = None if speed is None else plain(speed._asdict())
        timing, noise = self.replay.timing, self.replay.noise
        return {"status": self.decision, **fields, **plain({"timing": timing, "noise": noise})}

    def __repr__(self) -> str:
        return f"<Recheck: {self.decision}>"


@check_arguments
def recheck(
    task: Task,
    replay: Replay,
    *,
    distances: Recording | None = None,
    distance_error: float = 0.5e-3,
    elapsed: float | None = None,
) -> Recheck:
    """Check whether the calibration of a task still holds, from the replay of a recording of today.

    Args:
        task: the task with the calibrated curve, the sampled loop and the gain.
        replay: the replay of the recording with this task.
        distances: where the object was, in m as in the calibration; by default the reference of the replay. It must
            contain readings without an object (infinite), and at least two distances.
        distance_error: standard deviation of a known distance [m].
        elapsed: time from the calibration to the recording [s], for the recommended interval.

    Returns:
        The answer. It is "not-decided", with reasons, if the recording cannot decide.

    Raises:
        InvalidInputError: the recording contains distances instead of outputs of the sensor.
    """
    nonnegative(distance_error, "distance_error", "m")
    if elapsed is not None:
        positive(elapsed, "elapsed", "s")
    if replay.recording.kind == "distance":
        raise InvalidInputError(
            f"topic: {replay.recording.topic} contains distances, but a calibration is checked with the raw output of "
            "the sensor. Record the raw output; for a sensor of distances, compare it with --reference"
        )
    loop, gain = replay.loop, chosen_gain(task)
    conditioning = replay.controller.conditioning
    places = distances if distances is not None else replay.reference
    bare, recess = task.sensor.bare
    limit = min(
        conditioning.saturation or math.inf,
        loop.chain.highest,
        (replay.noise.largest or math.inf) if replay.noise.clipped else math.inf,
    )
    measured: tuple[KnownDistance, ...] = ()
    short: tuple[tuple[float, int], ...] = ()
    if places is not None and places.kind == "distance":
        latency = None if replay.latency is None else replay.latency.value
        shift = loop.chain.latency if latency is None else latency
        measured, short = known_distances(
            replay.recording,
            places,
            signal_of(bare),
            shift=shift,
            limit=limit,
            resolution=replay.noise.resolution,
        )
        replay = _with_noise(replay, measured)
    then = loop.chain.offset + loop.chain.crosstalk
    old = None if task.calibration is None else task.calibration.offset
    known = old is not None and math.isclose(old.value, then)
    base: dict[str, Any] = {
        "replay": replay,
        "distances": measured,
        "gain": gain,
        "number": task.law.number,
        "offset_then": then,
        "offset_then_error": old.standard_error if old is not None and known else None,
        "elapsed": elapsed,
    }
    unusable = tuple(_unusable(replay, places is not None))
    if unusable:
        return _undecided(base, unusable)
    offset = offset_of(measured, conditioning.floor)
    if offset is None:
        return _undecided(base, tuple(_too_short(short)) or (_NO_EMPTY_SCENE,))
    base |= {"offset": offset[0], "offset_error": offset[1]}
    if full := saturated(measured, offset, bare, distance_error, limit):
        return Recheck(decision="recalibrate", reasons=(full,), **base)
    signal, doubts = signals_of(measured, offset, bare, conditioning.floor, distance_error)
    if signal is None or doubts:
        return _undecided(base, (*doubts, *_too_short(short)) if signal is None else doubts)
    base |= {
        "places": tuple(signal.places.tolist()),
        "ratios": tuple(signal.ratios.tolist()),
        "ratio_errors": tuple(np.sqrt(np.diag(signal.covariance)).tolist()),
    }
    near, far = float(signal.places[0]), float(signal.places[-1])
    explanations = explanations_of(signal, bare)
    base["slope_then"] = float(np.diff(bare.log_output(np.array([near, far])))[0]) / (far - near)
    if explanations:
        ends, covariance = explanations[0].ends, explanations[0].covariance
        base["slope"] = base["slope_then"] + float(ends[1] - ends[0]) / (far - near)
        base["slope_error"] = math.sqrt(np.array([1, -1]) @ covariance @ np.array([1, -1])) / (far - near)
    speeds = _Speeds(task, loop, gain)
    nominal = speeds.at(task.sensor, then)
    doubts = (
        *(() if explanations else (_MISFIT,)),
        *_uncovered(task, loop, near, far),
        *((_NO_CONTACT,) if nominal is None else ()),
    )
    if doubts or nominal is None:
        return _undecided(base, doubts)
    base["contact_then"] = nominal
    main = distance_error if is_from_distances(signal, bare, distance_error) else 0.0
    return _decided(base, task, replay, speeds, [curves_of(each, recess) for each in explanations], distance_error=main)


def _decided(
    base: dict[str, Any],
    task: Task,
    replay: Replay,
    speeds: _Speeds,
    curves: list[tuple[SensorModel | None, ...]],
    *,
    distance_error: float,
) -> Recheck:
    """Decide by the contact speeds with all curves that the readings of today allow."""
    nominal, offset, error = base["contact_then"], base["offset"], base["offset_error"]
    as_it_is = [_range_of(speeds, each, offset, error, None) for each in curves]
    with_update = [_range_of(speeds, each, offset, error, offset) for each in curves]
    now = base["contact"] = _union(as_it_is)
    updated = base["contact_updated"] = _union(with_update)
    if task.objective is not None and task.bounds is not None:
        base["optimal_gain_then"], base["optimal_gain"] = (
            _optimal_gain(task, each) for each in (task.sensor, curves[0][0])
        )
    conditioning = replay.controller.conditioning
    noise = replay.noise.noise if replay.noise.noise is not None else replay.loop.chain.noise
    quiet = quiet_floor(conditioning, replay.timing.rate, noise)
    rise = offset - conditioning.offset
    triggers = rise + CERTAIN * error + quiet >= conditioning.floor
    changes = _changes(as_it_is[0], with_update[0]) and abs(rise) > CERTAIN * error
    base |= {
        "updates_offset": triggers or changes or abs(rise) > _LARGE_OFFSET * conditioning.floor,
        "triggers": triggers,
    }
    if slower := _slower(task, replay, speeds, nominal):
        return _undecided(base, slower)
    reasons: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()
    if quiet >= conditioning.floor:
        decision: Decision = "recalibrate"
        reasons = (
            f"the noise without an object is {noise:.3g}, too much for the noise floor of {conditioning.floor:.4g}, "
            f"which must be at least {quiet:.3g}",
        )
        actions = (
            f"find the cause of the noise, or raise floor in [controller] to at least {quiet:.3g}; then run pretouch "
            "design and verify",
        )
    elif not triggers and now is not None and now.is_near(nominal):
        decision = "fine"
    elif updated is not None and updated.is_near(nominal):
        decision = "update-offset"
        reasons = (_TAKEN_FOR_OBJECT,) if triggers else ()
    elif updated is None or all(each is None or each.is_far_from(nominal) for each in with_update):
        decision = "recalibrate"
    elif _is_another_slope(base):
        then, today = (format_quantity(base[name], "1/m", 3) for name in ("slope_then", "slope"))
        decision = "recalibrate"
        reasons = (
            f"between the known distances, the mean slope g is {today} today and was {then}, and the recording does "
            f"not show that the contact speed stays within {format_percent(TOLERANCE)}",
        )
    else:
        shown, when = (now, "with the curve and offset of today") if now is not None else (updated, "")
        if base["updates_offset"] or now is None:
            shown, when = updated, f"after an update of the offset to {offset:.5g}"
        reason = (
            f"{when}, the contact speed is {shown.words}, and with the calibration it was "
            f"{format_quantity(nominal, 'm/s', 3)}, so the recording does not show whether it changes by more than "
            f"{format_percent(TOLERANCE)}"
        )
        return _undecided(base, (Doubt(reason, _more_exact(shown, nominal, distance_error)),))
    speed = updated if decision == "update-offset" else now
    if decision in {"fine", "update-offset"} and speed is not None:
        base["limits"] = tuple(_limits_at_risk(task, nominal, speed.high))
    base["updates_offset"] &= decision != "recalibrate"
    base["updates_offset"] |= decision == "update-offset"
    interval = _interval(base, rise, conditioning.floor - quiet)
    return Recheck(decision=decision, reasons=reasons, actions=actions, interval=interval, **base)


def _undecided(base: dict[str, Any], doubts: Sequence[Doubt]) -> Recheck:
    """Return the answer of a recording that decides nothing, for reasons."""
    actions = dict.fromkeys(doubt.action for doubt in doubts)
    return Recheck(
        decision="not-decided", reasons=tuple(doubt.reason for doubt in doubts), actions=tuple(actions), **base
    )


def _changes(as_it_is: Range | None, with_update: Range | None) -> bool:
    """Return True if an update of the offset changes the contact speed by more than the tolerance."""
    if as_it_is is None or with_update is None:
        return as_it_is is not with_update
    return abs(as_it_is.value / with_update.value - 1) > TOLERANCE


def _more_exact(speed: Range, nominal: float, distance_error: float) -> str:
    """Return how a recording would decide.

    Args:
        speed: the contact speed with its range.
        nominal: that of the calibration [m/s].
        distance_error: standard deviation of a known distance [m]; 0 if other errors are larger.
    """
    low, high = nominal * (1 - TOLERANCE), nominal * (1 + TOLERANCE)
    share = min((speed.value - low) / (speed.value - speed.low), (high - speed.value) / (speed.high - speed.value))
    if 0 < share < 1 and distance_error > 0:
        step = 10.0 ** math.floor(math.log10(share * distance_error))
        needed = format_quantity(step * math.floor(share * distance_error / step), "m", 1)
        return (
            "record again, with distances that are exact to about "
            f'{needed} (set them with gauge blocks or a stage, and state it: --distance-error "{needed}"), or at more '
            "distances near the contact; or recalibrate"
        )
    return (
        "record again, with the object nearer to the contact, at more distances, and with more readings at each; or "
        "recalibrate"
    )


def _with_noise(replay: Replay, measured: Sequence[KnownDistance]) -> Replay:
    """Return a replay with the noise of the named empty scene, if the controller detected an object all the time."""
    empty = [each for each in measured if math.isinf(each.distance)]
    if replay.noise.noise is not None or not empty:
        return replay
    return replace(replay, noise=replace(replay.noise, noise=empty[0].spread))


def _optimal_gain(task: Task, curve: SensorModel | None) -> float | None:
    """Return the optimal gain of the ideal loop with a curve; None if there is none."""
    if curve is None:
        return None
    return designed_number(
        task.replace(sensor=curve, gain=None, evaluate=None, stability_margin=None, calibration=None)
    )


def _is_another_slope(base: dict[str, Any]) -> bool:
    """Return True if the slope has certainly changed by more than the tolerance."""
    change = abs(base["slope"] - base["slope_then"]) - CERTAIN * base["slope_error"]
    return bool(change > TOLERANCE * abs(base["slope_then"]))


def _limits_at_risk(task: Task, nominal: float, high: float) -> Iterator[str]:
    """Yield the limits of the contact that hold at a nominal speed, but not at a higher one [m/s]."""
    for limit in task.limits:
        if limit.name == "relative_velocity":
            then, now = nominal, high
        elif limit.name == "impact_force" and task.impact is not None:
            then, now = (float(np.asarray(task.impact.peak_force(speed))) for speed in (nominal, high))
        else:
            continue
        if then <= float(np.asarray(limit.limit)) < now:
            yield limit.name


def _unusable(replay: Replay, named: bool) -> Iterator[Doubt]:
    """Yield why the recording cannot decide anything."""
    finite = replay.recording.values[np.isfinite(replay.recording.values)]
    if not len(finite):
        yield Doubt(
            "the recording has no reading that is a number",
            "check the topic (--topic), then the sensor and its cable, and record again",
        )
    elif finite.min() == finite.max():
        yield Doubt(f"all readings are {finite[0]:.6g}", "check the sensor and its cable, and record again")
    elif not named:
        yield Doubt(
            "the slope was not checked, because no distance is known",
            "name the distances of this recording with --reference or --distances, such as "
            '--distances "0-5 s: none, 8-12 s: 5 mm, 15-19 s: 40 mm"; if the object was not held at two of them, '
            "record again",
        )


def _too_short(short: Sequence[tuple[float, int]]) -> Iterator[Doubt]:
    """Yield which named parts of the recording have too few readings."""
    for distance, count in short:
        where = "without an object" if math.isinf(distance) else f"at {format_quantity(distance, 'm')}"
        yield Doubt(
            f"the part {where} has only {count} {'reading' if count == 1 else 'readings'}, and at least "
            f"{FEWEST} are needed",
            "name longer parts of the recording; if there are none, record again with two seconds for each",
        )


def _uncovered(task: Task, loop: ClosedLoop, near: float, far: float) -> Iterator[Doubt]:
    """Yield that two distances contain too little of the change of ln xi between detection and contact."""
    bare, recess = task.sensor.bare
    low, high = bare.valid_range
    seen = min(float(task.scenario.distance), float(loop.farthest_start(task.scenario, task.sensor))) + recess
    contact, start = max(recess, low), min(max(seen, recess), high)
    ends = np.array([contact, start, np.clip(near, contact, start), np.clip(far, contact, start)])
    first, last, inner, outer = np.asarray(bare.log_output(ends)).tolist()
    share = (inner - outer) / (first - last) if first > last else 0.0
    if share < _COVERED:
        yield Doubt(
            f"the distances from {format_quantity(near, 'm')} to {format_quantity(far, 'm')} contain only "
            f"{format_percent(share)} of the change of ln \u03be between detection and contact",
            f"record again, with the object close to {format_quantity(contact, 'm', 2)}, where it touches, and close "
            f"to {format_quantity(start, 'm', 2)}, where the law begins to act",
        )


class _Speeds:
    """Contact speeds of the encounter on the sampled loop without noise, as means over the phase of the sensor."""

    def __init__(self, task: Task, loop: ClosedLoop, gain: float) -> None:
        self._scenario, self._gain = task.scenario, gain
        quiet: dict[str, Any] = {
            "noise": 0.0,
            "relative_noise": 0.0,
            "misfit": 0.0,
            "misfit_length": 0.0,
            "dropout": 0.0,
        }
        chain = replace(loop.chain, **quiet, jitter=0.0, drift=0.0, crosstalk=0.0, phase=0.0, random_phase=True)
        self._loop = replace(loop, chain=chain, contact=None, follow_time=0.0)

    def at(
        self, sensor: SensorModel | None, offset: float, subtracted: float | None = None, **chain: Any
    ) -> float | None:
        """Return the contact speed [m/s] with an offset of the sensor; None without a contact in all runs."""
        if sensor is None:
            return None
        law = self._loop.law
        if subtracted is not None:
            try:
                law = replace(law, conditioning=replace(law.conditioning, offset=subtracted))  # type: ignore[type-var,attr-defined]
            except InvalidInputError:  # the offset reaches the saturation
                return None
        loop = replace(self._loop, law=law, chain=replace(self._loop.chain, offset=offset, **chain))
        run = loop.run(self._scenario, sensor, self._gain, runs=_RUNS)
        if not np.all(run.touched):
            return None
        return float(np.mean(np.abs(run.relative_velocity)))


def _range_of(
    speeds: _Speeds, curves: tuple[SensorModel | None, ...], offset: float, error: float, subtracted: float | None
) -> Range | None:
    """Return the contact speed with the curves of one explanation.

    Args:
        speeds: the contact speeds.
        curves: the best curve, and those three standard errors from it.
        offset: the offset of today.
        error: its standard error.
        subtracted: the offset that the controller subtracts; None: as in the scenario.

    Returns:
        The range; None if the best curve has no contact speed. Its ends are NaN if another one has none.
    """
    best, *moved = curves
    value = speeds.at(best, offset, subtracted)
    if value is None:
        return None
    pairs = [speeds.at(curve, offset, subtracted) for curve in moved]
    pairs += [speeds.at(best, offset + side * CERTAIN * error, subtracted) for side in (-1, 1)]
    changes = np.array(pairs, dtype=np.float64) - value  # None becomes NaN
    # independent errors add in squares; each pair has a step to both sides
    below, above = (
        float(np.hypot.reduce(np.clip(side * changes, 0, None).reshape(-1, 2).max(axis=1))) for side in (-1, 1)
    )
    return Range(value, value - below, value + above)


def _union(ranges: list[Range | None]) -> Range | None:
    """Return the range that contains those of all explanations, with the value of the first one that has one."""
    known = [each for each in ranges if each is not None]
    if not known:
        return None
    if len(known) < len(ranges):
        return Range(known[0].value, math.nan, math.nan)
    low, high = np.min([each.low for each in known]), np.max([each.high for each in known])
    return Range(known[0].value, float(low), float(high))


def _slower(task: Task, replay: Replay, speeds: _Speeds, nominal: float) -> tuple[Doubt, ...]:
    """Return why the rate of the recording prevents a decision; empty if it does not."""
    rate, declared = replay.timing.value_rate, replay.loop.chain.rate
    if not 0 < rate < _SLOWER * declared:
        return ()
    chain: SensorChain = replay.loop.chain
    period = 1 / rate
    changed = speeds.at(task.sensor, chain.offset + chain.crosstalk, rate=rate, exposure=min(chain.exposure, period))
    if changed is not None and abs(changed / nominal - 1) <= TOLERANCE:
        return ()
    effect = "no contact" if changed is None else f"a contact speed of {format_quantity(changed, 'm/s', 3)}"
    return (
        Doubt(
            f"the recording has {format_quantity(rate, 'Hz', 3)} instead of the {format_quantity(declared, 'Hz', 4)} "
            f"of the scenario, which would mean {effect} instead of {format_quantity(nominal, 'm/s', 3)}",
            "record at the rate of the robot; if this is its rate, write the measured section [chain] with --chain "
            "PATH, copy it into the scenario file, and run pretouch verify",
        ),
    )


def _interval(base: dict[str, Any], rise: float, room: float) -> float | None:
    """Return the time after which half of the allowed drift is used up, at most the elapsed time [s].

    One interval of drift supports no longer time: a drift that wanders is not proportional to the time.
    """
    elapsed, speed, nominal = base["elapsed"], base["contact"], base["contact_then"]
    if elapsed is None or speed is None:
        return None
    used = max(abs(end / nominal - 1) / TOLERANCE for end in (speed.low, speed.high))
    if rise > 0:
        used = max(used, rise / room if room > 0 else math.inf)
    return float(elapsed * min(1.0, _HALF / used)) if 0 < used < math.inf else None


def _headline(check: Recheck) -> Iterator[str]:
    """Yield the verdict, and the numbers for the next step."""
    reasons, nominal = "; ".join(check.reasons), format_quantity(check.contact_then or math.nan, "m/s", 3)
    now, updated = (
        f"{'unknown' if speed is None else speed.words}" for speed in (check.contact, check.contact_updated)
    )
    match check.decision:
        case "fine":
            yield f"Fine: the calibration still holds within {format_percent(TOLERANCE)} of the contact speed."
            yield f"With the curve and offset of today, this speed is {now}; with the calibration, it is {nominal}."
        case "update-offset":
            yield f"Update the offset from {check.offset_then:.5g} to {check.offset:.5g}."
            yield f"The contact speed is then {updated}; with the calibration, it was {nominal}."
            yield f"Without the update, {reasons}." if reasons else f"Without the update, it is {now}."
        case "recalibrate" if reasons:
            yield f"Recalibrate: {reasons}."
        case "recalibrate":
            yield "Recalibrate: the curve has changed, and no offset makes up for it."
            yield f"With the old gain, the contact speed is {updated}; with the calibration, it was {nominal}."
        case _:
            yield f"Not decided: {reasons}."
            if check.updates_offset:
                yield f"Without an update of the offset, {_without_update(check)}."
            yield from _offset_in_words(check)


def _without_update(check: Recheck) -> str:
    if check.triggers:
        return _TAKEN_FOR_OBJECT
    return f"it is {'unknown' if check.contact is None else check.contact.words}"


def _offset_in_words(check: Recheck) -> Iterator[str]:
    """Yield what an undecided recording says on the offset."""
    seen = check.replay.noise.offset
    if check.offset is not None:
        yield f"The offset is {check.offset:.5g}; that of the calibration is {check.offset_then:.5g}."
    elif seen is not None:
        yield (
            f"The median reading without a detection is {seen:.5g}; the offset of the calibration is "
            f"{check.offset_then:.5g}. They can be compared only if the scene was empty meanwhile."
        )
