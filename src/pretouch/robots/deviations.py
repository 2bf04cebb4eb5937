"""Explain why simulated encounters of a robot may deviate from their 1-D prediction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution

from .result import BodyContact, SiteContact

TURN: Final = math.radians(10.0)
"""Turn of the axis of a sensor [rad] that changes contact speeds with a plate by about 4 %."""

SIDEWAYS: Final = 0.01
"""Motion of a sensor site across its axis [m] that changes contact speeds with a ball of radius 35 mm by about 3 %."""

LARGE: Final = 0.05
"""Relative difference between simulated and predicted contact speed that is reported."""

_SATURATED: Final = 0.1  # of the time until contact; deviations above 5 % were seen from 15 % on


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


def report_deviations(
    sites: Sequence[str],
    contacts: Sequence[Sequence[SiteContact]],
    predictions: Sequence[Sequence[SiteContact | None]],
) -> Iterator[str]:
    """Yield warnings about contact speeds that deviate from the prediction.

    There is one warning for each sensor site whose mean contact speed deviates by more than 5 %.

    Args:
        sites: names of the sites.
        contacts: the contacts of each site in all runs.
        predictions: their predictions.

    Yields:
        Sentences, for a warning.
    """
    for site, runs, predicted in zip(sites, contacts, predictions, strict=True):
        pairs = [(c.relative_velocity, p.relative_velocity) for c, p in zip(runs, predicted, strict=True) if p]
        finite = [(a, b) for a, b in pairs if not math.isnan(a) and not math.isnan(b)]
        if not finite:
            continue
        simulated, expected = (abs(math.fsum(column)) for column in zip(*finite, strict=True))
        change = simulated / expected - 1 if expected else math.inf
        if abs(change) > LARGE:
            percent, more = 100 * abs(change), "higher" if change > 0 else "lower"
            shown = f"{percent:.2g}" if percent < 100 else f"{percent:.0f}"
            yield caution(
                "PT507",
                f"At the site {site}, the simulated contact speed is {shown} % {more} than the predicted contact "
                "speed: rely on the simulation. If the reason is known, another warning names it.",
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
