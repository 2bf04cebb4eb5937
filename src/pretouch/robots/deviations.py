"""Explain why simulated encounters of a robot may deviate from their 1-D prediction."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution

from .causes import RobotEncounterRun, cause_of_force, causes_of
from .dynamics import Drivetrain
from .result import BodyContact, RobotTrace, SiteContact
from .site_law import SiteLaw

TURN: Final = math.radians(10.0)
"""Turn of the axis of a sensor [rad] that changes contact speeds with a plate by about 4 %."""

SIDEWAYS: Final = 0.01
"""Motion of a sensor site across its axis [m] that changes contact speeds with a ball of radius 35 mm by about 3 %."""

LARGE: Final = 0.05
"""Relative difference between simulated and predicted contact speed that is reported."""

DEVIATION: Final = 0.1
"""Relative difference of time, excursion and peak force that is reported."""

_FORCE: Final = "peak force"
_EQUAL: Final = 1e-9  # s, m, m/s or N: rounding
_SATURATED: Final = 0.1  # of the time until contact; deviations above 5 % were seen from 15 % on


def with_curved_paths_last(warnings: Iterable[str]) -> tuple[str, ...]:
    """Return warnings with those about curved paths of the sensor at the end.

    They are frequent and rarely the cause, and a terminal shows only the first warnings.
    """
    return tuple(sorted(warnings, key=lambda text: text.startswith("PT504")))


def explain_deviations(sites: Sequence[str], contacts: Sequence[Sequence[SiteContact]]) -> Iterator[str]:
    """Yield warnings about reasons why simulated contacts deviate from the prediction.

    The prediction is one-dimensional. Each reason at a sensor site is one warning.

    Args:
        sites: names of the sites.
        contacts: the contacts of each site in all runs.

    Yields:
        Sentences, for a warning.
    """
    for site, runs in zip(sites, contacts, strict=True):
        share = max((_saturated(c) for c in runs), default=0.0)
        if share > _SATURATED:
            yield caution(
                "PT505",
                f"At the site {site}, a drive is at its limit during up to {100 * share:.0f} % of the encounter: "
                "choose a weaker gain, or try another posture. With this gain, the robot cannot follow its reference.",
            )
        for reason in sorted({c.obstacle for c in runs} - {""}):
            yield caution(
                "PT506",
                f"The reference motion of the site {site} stops before contact, at a {reason}: choose a weaker gain, "
                "or a posture with a longer retreat.",
            )
        turn, sideways = (max(getattr(c, name) for c in runs) for name in ("axis_turn", "sideways"))
        if turn > TURN or sideways > SIDEWAYS:
            yield caution(
                "PT504",
                f"The sensor at the site {site} turns by up to {math.degrees(turn):.2g} deg and moves up to "
                f"{format_quantity(sideways, 'm', 2)} off its axis: rely on the simulation, not on the "
                "prediction. The prediction assumes that the sensor axis does not move until contact.",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedRuns:
    """The runs of a simulation with their predictions.

    Args:
        model: the model of the simulation.
        drivetrains: the degrees of freedom of each site.
        laws: the law of each site.
        contacts: the contacts of each site in all runs.
        predictions: their predictions.
        touches: all contacts of the robot in each run.
        robot_forces: the largest force on the robot in each run [N].
        stiffness: stiffness of the contact in the prediction [N/m]; None for no prediction of the force.
        trace_of: function that repeats a run and returns its time series.
    """

    model: Any
    drivetrains: Sequence[Drivetrain]
    laws: Sequence[SiteLaw]
    contacts: Sequence[Sequence[SiteContact]]
    predictions: Sequence[Sequence[SiteContact | None]]
    touches: Sequence[Sequence[BodyContact]]
    robot_forces: Sequence[float]
    stiffness: float | None
    trace_of: Callable[[int], RobotTrace]


def report_deviations(runs: ComparedRuns) -> Iterator[str]:
    """Yield warnings about encounters that deviate from their prediction, with the causes.

    There is one warning for each sensor site whose contact speed deviates by more than 5 %, or whose time from
    detection to contact, excursion or peak force deviates by more than 10 %. These are means over all runs. The causes
    are those of the run whose contact speed deviates most.

    Args:
        runs: the runs.

    Yields:
        Sentences, for a warning.
    """
    for i, law in enumerate(runs.laws):
        site = law.site.name
        yield from _report_unpredicted(runs, i)
        pairs = [
            (run, c, p)
            for run, (c, p) in enumerate(zip(runs.contacts[i], runs.predictions[i], strict=True))
            if p is not None and not math.isnan(c.time) and not math.isnan(p.time)
        ]
        changes = dict(_changes(runs, pairs))
        if not changes:
            continue
        run, contact, predicted = max(pairs, key=lambda pair: abs(_change(*_speeds(pair))))
        encounter = RobotEncounterRun(
            *(runs.model, runs.drivetrains[i], law, i, contact, predicted, runs.touches[run], runs.trace_of(run))
        )
        causes = causes_of(encounter) if set(changes) - {_FORCE} or runs.stiffness is None else ()
        if _FORCE in changes and runs.stiffness is not None:
            rest = (1 + changes[_FORCE]) / (1 + _change(*_speeds((run, contact, predicted)))) - 1
            if abs(rest) > DEVIATION or not causes:
                force = max(contact.peak_force, runs.robot_forces[run] if len(runs.laws) == 1 else 0.0)
                causes = (*causes, cause_of_force(encounter, force, runs.stiffness))
        described = ", ".join(f"{name} {_percent(change)}" for name, change in changes.items())
        because = "; ".join(causes)
        yield caution(
            "PT507",
            f"At the site {site}, the simulation differs from the prediction ({described}): rely on the simulation. "
            + (f"The reasons are, the largest first: {because}." if len(causes) > 1 else f"The reason is: {because}."),
        )


def _changes(runs: ComparedRuns, pairs: Sequence[tuple[int, SiteContact, SiteContact]]) -> Iterator[tuple[str, float]]:
    """Yield the quantities that deviate by too much, with the relative change of their means."""
    if not pairs:
        return
    alone = len(runs.laws) == 1
    quantities: tuple[tuple[str, float, Callable[[int, SiteContact], float]], ...] = (
        ("contact speed", LARGE, lambda _, c: abs(c.relative_velocity)),
        ("time to contact", DEVIATION, lambda _, c: c.time - (0.0 if c.detection is None else c.detection.time)),
        ("excursion", DEVIATION, lambda _, c: c.excursion),
        (_FORCE, DEVIATION, lambda _, c: c.peak_force),
        (_FORCE, DEVIATION, lambda run, c: max(c.peak_force, runs.robot_forces[run]) if alone else c.peak_force),
    )
    for name, limit, quantity in quantities:
        values = [(quantity(run, c), p) for run, c, p in pairs]
        simulated = math.fsum(value for value, _ in values)
        robot = name == _FORCE
        expected = math.fsum(p.peak_force if robot else quantity(-1, p) for _, p in values)
        if abs(_change(simulated, expected)) > limit:
            yield name, _change(simulated, expected)


def _remedy(runs: ComparedRuns, i: int, run: int) -> str:
    """Say what to do about an object that a site has not detected before its contact, and why it was not detected."""
    trace = runs.trace_of(run)
    before = trace.distance[trace.time < runs.contacts[i][run].time, i]
    if np.isfinite(before).any():
        return "lower the floor of the sensor, or start farther away. The reading stays below the floor until contact."
    return "move the sensor or widen its beam. The object comes from beside the axis, where no ray meets it."


def _speeds(pair: tuple[int, SiteContact, SiteContact]) -> tuple[float, float]:
    return abs(pair[1].relative_velocity), abs(pair[2].relative_velocity)


def _change(simulated: float, expected: float) -> float:
    """Return the relative change; 0 without a prediction, and infinite if 0 is predicted."""
    if math.isnan(simulated) or math.isnan(expected) or abs(simulated - expected) <= _EQUAL:
        return 0.0
    return simulated / expected - 1 if expected else math.inf


def _percent(change: float) -> str:
    percent = 100 * abs(change)
    shown = f"{percent:.2g}" if percent < 100 else f"{percent:.0f}"
    return f"{shown} % {'higher' if change > 0 else 'lower'}"


def _report_unpredicted(runs: ComparedRuns, i: int) -> Iterator[str]:
    """Yield warnings about contacts of a site without a prediction, and about predicted ones that do not happen."""
    site, contacts, predictions = runs.laws[i].site.name, runs.contacts[i], runs.predictions[i]
    touched = [c for c in contacts if not math.isnan(c.time)]
    unseen = [c for c in touched if c.detection is None]
    if unseen:
        yield caution(
            "PT559",
            f"In {len(unseen)} of {len(contacts)} runs, the site {site} touches an object that it did not detect "
            f"before: {_remedy(runs, i, contacts.index(unseen[0]))} The law did not act, and there is no prediction.",
        )
    both = list(zip(contacts, predictions, strict=True))
    surprises = [c for c, p in both if not math.isnan(c.time) and p is not None and math.isnan(p.time)]
    if surprises:
        yield caution(
            "PT560",
            f"In {len(surprises)} of {len(contacts)} runs, the site {site} touches an object although the prediction "
            "has no contact: rely on the simulation. The object or the robot moves otherwise than at the detection.",
        )
    missing = [c for c, p in both if math.isnan(c.time) and p is not None and not math.isnan(p.time)]
    if missing:
        hit = any(not touch.site for touch in (touch for run in runs.touches for touch in run))
        reason = (
            "The object touches another part of the robot, see above."
            if hit
            else "The object leaves the axis or stops, or the run has ended before."
        )
        yield caution(
            "PT560",
            f"In {len(missing)} of {len(contacts)} runs, the predicted contact of the site {site} does not happen: "
            f"rely on the simulation, or raise horizon. {reason}",
        )


def report_touches(touches: Sequence[BodyContact]) -> Iterator[str]:
    """Yield a warning about each contact of a robot that is not at the surface of a site."""
    for touch in touches:
        speed = format_quantity(abs(touch.relative_velocity), "m/s", 3)
        yield caution(
            "PT548",
            f"The body {touch.body} touches {touch.object} at {speed}, "
            f"with up to {format_quantity(touch.peak_force, 'N', 3)}: change the posture or the approach. The law and "
            "the prediction only know contacts at the surface of a site.",
        )


def report_rising_forces(passed: Sequence[bool]) -> Iterator[str]:
    """Yield a warning if the contact force has not passed its peak at the end of some runs."""
    rising = passed.count(False)
    if rising:
        yield caution(
            "PT549",
            f"In {rising} of {len(passed)} runs, the contact force was still growing when the run ended: raise "
            "follow_time and horizon. The peak forces are lower bounds.",
        )


_PROBLEMS: Final = {
    "BADQPOS": "unstable",
    "BADQVEL": "unstable",
    "BADQACC": "unstable",
    "INERTIA": "unstable",
    "CONTACTFULL": "memory",
    "CNSTRFULL": "memory",
}
_REMEDIES: Final = {
    "unstable": (
        "an unstable simulation: reduce the time step of the model, lower the bandwidth of the tracking, or give light "
        "joints an armature. Contacts and forces of these runs are wrong"
    ),
    "memory": (
        "too little memory for contacts: raise <size memory=.../> of the model. Contacts are missing in these runs"
    ),
}


def report_problems(problems: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield a warning for each kind of problem that MuJoCo has counted.

    Args:
        problems: the names of MuJoCo's warnings in each run.
    """
    for kind, text in _REMEDIES.items():
        count = sum(any(_PROBLEMS.get(name) == kind for name in run) for run in problems)
        if count:
            yield caution("PT550", f"In {count} of {len(problems)} runs, MuJoCo warned about {text}.")


def _saturated(contact: SiteContact) -> float:
    """Return the fraction of time with a drive at its limit. The time counts from detection to contact."""
    if contact.detection is None:
        return 0.0
    if math.isnan(contact.time):
        return float(contact.saturated > 0)
    return contact.saturated / max(contact.time - contact.detection.time, contact.saturated, 1e-12)
