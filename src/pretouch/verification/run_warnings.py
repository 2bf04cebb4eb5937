"""Warn of what simulated runs show: a single run, or many."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution
from pretouch.control import Controller, Status
from pretouch.designs import GainDesign
from pretouch.motion import ContinuousLaw, LawNumber, Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.simulation.stability import passage
from pretouch.uncertainty.ensemble import share_in_words

from .appraisal import USUAL_MARGIN, Draws
from .at_rest import RestMotion, rest_in_words
from .breakage import Breakage, breakage_in_words
from .effect import EFFECT, SIGNIFICANT, chase_in_words, contact_speeds, is_harder, mean_and_error
from .encounter_parts import LoopContact, QuantityComparison, ReportedFlag, missed_share
from .result import Comparison
from .stability import limit_of, stability_margin

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport


_LATE: Final = 0.1  # a detection is late if more than this share of the change of ln xi until contact has happened
_SHARE: Final = 0.1  # a cause is named if it explains at least this share of the time to detection
_HIDDEN: Final = "at larger distances the reading is below the floor"
_ROUNDING: Final = 1e-9  # relative rounding error of a force
_FORCE_APART: Final = 1.25  # smallest ratio of simulated to predicted impact force that causes a warning
_STRONG: Final = 1.5  # smallest ratio of simulated to predicted virtual force that causes a warning
_PASSING: Final = 0.01  # gaps of the readings are reported if they last longer than this share of the steps
_TRACED: Final = 8  # runs that are examined step by step
_TROUBLE: Final = (
    *(Status.SATURATED, Status.INVALID, Status.IMPLAUSIBLE, Status.LOST),
    *(Status.FORCE_LIMITED, Status.MOTION_LIMITED, Status.INPUT_FAULT),
)
_REMEDIES: Final = {
    Status.FORCE_LIMITED: ": raise largest_force in [controller] if the robot allows it, or use a weaker gain",
    Status.MOTION_LIMITED: ": widen the limits in [controller], or use a weaker gain",
}
_BROKEN_CABLE: Final = (
    "With a broken cable, the reading falls to 0. For the controller, the object suddenly recedes, and the robot "
    "follows. With this largest_rate, the controller rejects a change of ln xi that exceeds largest_rate times one "
    "sensor period. The sensor is lost if this lasts. A smaller change, from a weak signal to 0, is believed. "
    "The recommended value is twice the largest rate |d ln xi / dt| of the sensor signal xi in an approach, plus noise."
)


def cautions_of(
    draws: Draws,
    runs: tuple[SimulationResult, SimulationResult],
    comparisons: tuple[Comparison, ...],
    design: GainDesign,
    *,
    at_rest: RestMotion | None,
    starts: tuple[str, ...],
    largest_rate: float,
    breakage: Breakage | None,
) -> tuple[str, ...]:
    """Return the warnings of a verification.

    Args:
        draws: the encounters.
        runs: the runs with the gain and without mitigation.
        comparisons: the quantities, predicted and simulated.
        design: the ideal design.
        at_rest: how far noise moves a robot at rest.
        starts: a warning if the controller detects the object elsewhere than the encounter starts.
        largest_rate: a largest plausible rate of ln xi for the controller [1/s].
        breakage: what the robot does if the sensor fails.

    Returns:
        The warnings, each with its code.
    """
    loop, task = draws.task.loop, draws.task
    return (
        *_no_ideal_gain(design),
        *starts,
        *_other_admittance(loop, task.scenario),
        *_failing_sensor(loop, largest_rate, breakage),
        *never_detected(loop, runs[0]),
        *_late_detections(draws, runs[0]),
        *rest_in_words(at_rest, loop.law),
        *push_in_words(loop, *runs),
        *_impact(comparisons),
        *_flags_of_runs(loop, runs[0]),
        *_unknown_calibration(task.calibration),
        *task.warnings,
    )


def _no_ideal_gain(design: GainDesign) -> Iterator[str]:
    if design.gain is None:
        headline = design.headline.removesuffix(".")
        yield caution("PT401", f"The ideal design has no gain ({headline[:1].lower()}{headline[1:]}).")


def _other_admittance(loop: ClosedLoop, scenario: Scenario) -> Iterator[str]:
    virtual: Any = getattr(loop.law, "admittance", None)
    a, names = scenario.admittance, ("mass", "damping", "stiffness")
    if virtual is None or all(np.allclose(getattr(virtual, n), getattr(a, n), rtol=1e-9, atol=1e-12) for n in names):
        return
    own, other = (
        f"virtual mass {one.mass:g} kg, damping {one.damping:g} N s/m, stiffness {one.stiffness:g} N/m"
        for one in (virtual, a)
    )
    text = "The controller and the prediction use different admittances: use the same admittance in both."
    yield caution("PT402", f"{text} Controller: {own}. Prediction: {other}.")


def _failing_sensor(loop: ClosedLoop, largest_rate: float, breakage: Breakage | None) -> Iterator[str]:
    """Yield a warning if a sensor that fails moves the robot toward the object."""
    jumps = tuple(_recession(loop, largest_rate))
    if breakage is not None and breakage.harder and not (jumps and breakage.is_prevented_by_rate):
        jumps = tuple(breakage_in_words(breakage))
    yield from jumps


def _recession(loop: ClosedLoop, largest_rate: float) -> Iterator[str]:
    law, chain = loop.law, loop.chain
    if not isinstance(law, Controller) or law.conditioning.largest_rate is not None:
        return
    if loop.continuous is not None and loop.continuous.damping(1.0, -1.0, 1.0) == 0:  # no force if the object recedes
        return
    if getattr(law.law, "approach_only", False):  # the same
        return
    if chain.dropout > 0 or chain.lowest <= law.conditioning.offset + law.conditioning.floor:
        remedy = f"set largest_rate of the controller to {format_quantity(largest_rate, '1/s', 3)}"
        text = f"A broken sensor cable makes the robot jump toward the object: {remedy}."
        yield caution("PT404", f"{text} {_BROKEN_CABLE}")


def detection_step(loop: ClosedLoop) -> str:
    """Recommend what to change if the controller never detects the object."""
    law, latency = loop.law, loop.chain.latency
    timeout = law.conditioning.numbers(law.period).timeout if isinstance(law, Controller) else math.inf
    if latency <= timeout:
        return "check floor, offset and sensor range"
    late, limit = format_quantity(latency, "s"), format_quantity(timeout, "s")
    return (
        f"set timeout of the controller well above {late}, because it ignores readings older than {limit}, and each "
        f"reading arrives {late} after its measurement"
    )


def never_detected(loop: ClosedLoop, result: SimulationResult) -> Iterator[str]:
    """Yield a warning if the controller does not detect the object in a run."""
    seen = np.isfinite(result.detection_time)
    if not np.all(seen):
        where = f" in {_percent(1 - float(seen.mean()))} of the runs" if result.shape else ""
        text = f"The object was never detected{where}, so there was no virtual force: {detection_step(loop)}."
        yield caution("PT405", text)


def _late_detections(draws: Draws, result: SimulationResult) -> Iterator[str]:
    """Yield a warning if the controller detects the object late in many runs.

    Until detection there is no virtual force, so the robot follows its reference. Robots that start elsewhere are left
    out.
    """
    s, task, t = draws.scenarios, draws.task, np.asarray(result.detection_time)
    seen = np.isfinite(t)
    if not (
        seen.any()
        and np.all(s.plant.position == s.reference.position)
        and np.all(s.plant.velocity == s.reference.velocity)
    ):
        return
    obstacle = np.asarray(s.obstacle.position_at(t)) - s.obstacle.position
    reference = (np.asarray(s.reference.velocity) + 0.5 * s.reference.acceleration * t) * t
    distance = (draws.distance + obstacle - reference)[seen]
    at = task.loop.detection(task.scenario, task.sensor)
    explained = at is not None and at.is_late
    yield from late_detection(task.loop, task.sensor, draws.distance[seen], distance, t[seen], is_floor_late=explained)


def late_detection(
    loop: ClosedLoop,
    sensor: SensorModel,
    start: FloatArray,
    distance: FloatArray,
    time: FloatArray,
    *,
    is_floor_late: bool,
) -> Iterator[str]:
    """Yield a warning if the object is detected late.

    Args:
        loop: the loop.
        sensor: the nominal curve.
        start: distance at the start of each run [m].
        distance: distance at the first detection [m].
        time: time of the first detection [s].
        is_floor_late: whether another warning, PT421, says that the floor is too high.
    """
    missed = float(np.mean(missed_share(sensor, start, distance)))
    why, remedy = _why_late(loop, float(time.mean()))
    if not missed > _LATE or (why == _HIDDEN and is_floor_late):
        return
    near, far = (format_quantity(float(d.mean()), "m") for d in (distance, start))
    mean = "mean " if distance.size > 1 else ""
    yield caution(
        "PT405",
        f"The object is detected late, at a {mean}distance of {near}, so the first {100 * missed:.2g} % of the signal "
        f"change had no effect: {remedy}. The cause: {why}. The signal change is the change of the sensor signal ln xi "
        f"from the start to contact. The prediction assumes detection at the {mean}start distance of {far}. The {mean}"
        f"time until detection is {format_quantity(float(time.mean()), 's')}.",
    )


def _why_late(loop: ClosedLoop, late: float) -> tuple[str, str]:
    """Return the cause of a late detection, as a clause, and what helps."""
    chain = loop.chain
    phase = chain.period / 2 if chain.random_phase else chain.phase
    wait = phase + chain.exposure + chain.delay + loop.law.period / 2
    if late - wait < _SHARE * late:
        return "the sensor is too slow for an earlier reading", "use a faster sensor"
    if wait < _SHARE * late:
        return _HIDDEN, "lower the floor"
    return (
        f"a first reading takes {format_quantity(wait, 's')}, and {_HIDDEN}",
        "lower the floor or use a faster sensor",
    )


def push_in_words(loop: ClosedLoop, result: SimulationResult, unmitigated: SimulationResult) -> Iterator[str]:
    """Yield a warning if the force after the impact exceeds that of the impact, and that without mitigation."""
    contact, both = loop.contact, np.asarray(result.touched) & np.asarray(unmitigated.touched)
    if contact is None or not both.any():
        return
    names = ("peak_force", "impact_force")
    (peak, impact), (free, free_impact) = (
        tuple(np.asarray(getattr(r, name))[both] for name in names) for r in (result, unmitigated)
    )
    more, error = mean_and_error(peak - free)
    chance = max(SIGNIFICANT * error if np.isfinite(error) else 0.0, _ROUNDING * float(free.mean()))
    if more <= chance or not np.any(peak > (1 + _ROUNDING) * impact):
        return
    driven = contact.obstacle_mass == np.inf
    pushing = "the robot's drive and the driven obstacle push" if driven else "the robot's drive pushes"
    newton = [format_quantity(float(values.mean()), "N") for values in (peak, free, impact, free_impact)]
    mean = "mean " if result.shape else ""
    after = f"{pushing} with a {mean}peak force of {newton[0]}, compared with {newton[1]} without mitigation"
    impact_itself = f"a {mean}force of {newton[2]}, compared with {newton[3]} without mitigation"
    yield caution("PT407", f"After the impact, {after}. The impact itself has {impact_itself}.")


def _impact(comparisons: tuple[Comparison, ...]) -> Iterator[str]:
    force = next((c for c in comparisons if c.name == "impact_force"), None)
    if force is None or not force.predicted or force.simulated is None:
        return
    times = force.simulated.mean / force.predicted
    if 1 / _FORCE_APART < times < _FORCE_APART:
        return
    pushed = "the robot's drive and the obstacle push while the bodies are in contact"
    why = pushed if times > 1 else "the contact loses energy, or the robot yields during it"
    yield caution(
        "PT408",
        f"The simulated impact force is {times:.3g} times the predicted force of an elastic impact, because {why}.",
    )


def _flags_of_runs(loop: ClosedLoop, result: SimulationResult) -> Iterator[str]:
    """Yield warnings for what the controller reported in some of the runs."""
    if not isinstance(loop.law, Controller):  # the flags of custom laws are unknown
        return
    for flag in _TROUBLE:
        share = float(np.mean((np.asarray(result.flags) & int(flag)) != 0))
        if share > 0:
            yield _reported(flag, f"in {_percent(share)} of the runs")
    yield from missing_readings(result)


def flags_of_run(flags: tuple[ReportedFlag, ...]) -> Iterator[str]:
    """Yield warnings for what the controller reported in a single run before contact."""
    for flag in flags:
        if flag.status in _TROUBLE and flag.approach_duration > 0:
            since, lasts = (format_quantity(t, "s", 3) for t in (flag.since, flag.approach_duration))
            yield _reported(flag.status, f"before contact, from {since} on, for {lasts} in total")


def _reported(flag: Status, when: str) -> str:
    return caution("PT409", f"The controller reported {when}: {flag.meaning}{_REMEDIES.get(flag, '')}.")


def missing_readings(result: SimulationResult) -> Iterator[str]:
    """Yield a warning if expected readings are missing after detection."""
    share = _stale(result)
    if share > _PASSING:
        yield caution(
            "PT410",
            f"After detection of the object, the expected sensor reading was missing in {_percent(share)} of the "
            "controller steps.",
        )


def _stale(result: SimulationResult) -> float:
    """Return the share of controller steps whose expected reading is missing. Only steps after detection count."""
    late = count = 0
    for i in range(min(result.shape[0], _TRACED)) if result.shape else [()]:
        flags = result.trace(i).flags.astype(np.int64)
        flags = flags[np.maximum.accumulate((flags & int(Status.DETECTING)) != 0)]
        late, count = late + int(((flags & int(Status.STALE)) != 0).sum()), count + len(flags)
    return late / count if count else 0.0


def _percent(share: float) -> str:
    return share_in_words(share) if share >= 1e-4 else "less than 0.01 %"


def _unknown_calibration(report: CalibrationReport | None) -> Iterator[str]:
    """Yield a warning if the calibration has too few readings."""
    if report is None or report.best is None or report.curves is not None:
        return
    yield caution(
        "PT411",
        f"The calibration has only {len(report.window.distances)} usable distances, too few to check whether "
        "the calibration is good enough: record readings at more distances.",
    )


def harm_in_words(number: LawNumber, gain: float, run: SimulationResult, free: SimulationResult) -> Iterator[str]:
    """Yield warnings if a gain is harmful in a single run.

    A harmful gain makes the robot chase the object, or makes contact harder.
    """
    yield from (caution("PT403", f"{text}.") for text in chase_in_words(number, gain))
    if is_harder(run, free):
        yield caution(
            "PT403",
            f"With this gain, contact is harder than without mitigation: the contact speed is {_speed_of(run)} "
            f"instead of {_speed_of(free) if free.touched else 'no contact'}.",
        )


def idleness_in_words(number: LawNumber, gain: float, run: SimulationResult, free: SimulationResult) -> Iterator[str]:
    """Yield a warning if a gain has no effect in a single run.

    A gain of 0 causes no warning.
    """
    if gain and contact_speeds(free) * (1 - EFFECT) < contact_speeds(run) and not is_harder(run, free):
        yield caution(
            "PT415",
            f"The {number.name} has no effect in this run: the contact speed is {_speed_of(run)} with this "
            f"{number.name} and {_speed_of(free)} without mitigation.",
        )


def _speed_of(run: SimulationResult) -> str:
    """Return the contact speed of a run as text. The speed is 0 without contact."""
    return format_quantity(float(contact_speeds(run)), "m/s", 3)


def contacts_in_words(count: int, contacts: tuple[LoopContact, ...]) -> Iterator[str]:
    """Yield a warning if robot and object touch more than once in a single run."""
    if count <= 1:
        return
    hardest = max(contacts, key=lambda contact: -contact.relative_velocity)
    after, speed = format_quantity(hardest.time, "s", 3), format_quantity(abs(hardest.relative_velocity), "m/s", 3)
    which = "the first" if hardest is contacts[0] else f"the one after {after}, at {speed},"
    beyond = f"; only the first {len(contacts)} are listed" if count > len(contacts) else ""
    yield caution("PT413", f"There are {count} contacts; {which} is the fastest{beyond}.")


def force_in_words(force: QuantityComparison) -> Iterator[str]:
    """Yield a warning if the virtual force of a single run far exceeds its prediction."""
    if force.relative_difference is not None and force.relative_difference > _STRONG - 1:
        loop, predicted = (format_quantity(abs(value or 0.0), "N", 3) for value in (force.loop, force.predicted))
        yield caution(
            "PT414",
            f"The virtual force reaches {loop} on the simulated loop, but only {predicted} is predicted: check the "
            "noise and the gain margin. Noise, slow readings or a loop close to instability cause such peaks.",
        )


def instability_in_words(
    loop: ClosedLoop, law: ContinuousLaw, sensor: SensorModel, scenario: Scenario, gain: float
) -> Iterator[str]:
    """Yield a warning if the gain margin of a single encounter is too small."""
    number, passed = law.number, passage(law, scenario, sensor, gain, float(scenario.distance))
    limit = limit_of(loop, sensor, passed)
    margin = stability_margin(limit, gain)
    if limit is None or margin is None or margin >= USUAL_MARGIN:
        return
    place = format_quantity(limit.critical_distance, "m", 3)
    if limit.strongest == 0:
        yield caution("PT412", "The loop is unstable with any gain, however weak.")
    elif margin < 1:
        text = (
            f"The sampled loop is unstable at a distance of {place}: the strongest stable {number.name} there is "
            f"{number.text(limit.strongest, 3)}."
        )
        yield caution("PT412", text)
    else:
        text = (
            f"The gain margin of the sampled loop is only {margin:.3g} at a distance of {place}; a gain margin of 2 is "
            "usual."
        )
        yield caution("PT412", text)
