"""Rank sensors, control laws or robots by verifying their gains."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pretouch._core.arguments import check_arguments
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.designs import Task

from .effect import VerdictStatus
from .result import Verdict
from .verdict import verify


@dataclass(frozen=True, kw_only=True, repr=False)
class Candidate(Value):
    """One candidate of a comparison and its verification result.

    Args:
        name: name of the candidate.
        verdict: verdict on its gain; None if it was refused.
        problem: why it was refused, in words; empty if it has a verdict.
    """

    name: str
    verdict: Verdict | None = None
    problem: str = ""

    @property
    def status(self) -> VerdictStatus:
        """Status of the candidate's gain, such as `holds`.

        `no-gain` if the candidate could not be verified.
        """
        return VerdictStatus.NO_GAIN if self.verdict is None else self.verdict.status

    @property
    def contact_speed(self) -> float:
        """Mean contact speed over the simulated runs [m/s].

        NaN if no run ends in contact.
        """
        return self.mean_of("relative_velocity")

    @property
    def high_contact_speed(self) -> float:
        """The 95 % quantile of the simulated contact speed [m/s].

        NaN if no run ends in contact.
        """
        compared = None if self.verdict is None else self.verdict.comparison("relative_velocity")
        return math.nan if compared is None or compared.simulated is None else compared.simulated.high

    @property
    def gain_margin(self) -> float:
        """Gain margin of the control loop.

        The gain may grow by this factor before the loop is unstable. NaN if the margin is not known.
        """
        stability = None if self.verdict is None else self.verdict.stability
        return math.nan if stability is None else stability.margin

    def mean_of(self, quantity: str) -> float:
        """Return the mean magnitude of a quantity over the runs.

        An example is `largest_excursion`. NaN if the mean is unknown.
        """
        compared = None if self.verdict is None else self.verdict.comparison(quantity)
        return math.nan if compared is None or compared.simulated is None else compared.simulated.mean

    @property
    def reason(self) -> str:
        """The main reason why the gain fails or passes only narrowly.

        It is empty if the status is `holds`. If the candidate could not be verified, it says why.
        """
        if self.verdict is None:
            return self.problem
        return "; ".join(self.verdict.reasons[:1]) or ("" if self.verdict.gain is not None else self.verdict.headline)

    def to_dict(self) -> dict[str, Any]:
        """Return the candidate as one JSON object, in SI units."""
        v = self.verdict
        return {
            "name": self.name,
            "status": self.status,
            "gain": None if v is None else v.gain,
            "contact_speed": self.contact_speed,
            "high_contact_speed": self.high_contact_speed,
            "largest_excursion": self.mean_of("largest_excursion"),
            "gain_margin": self.gain_margin,
            "rate": None if v is None else v.loop.chain.rate,
            "latency": None if v is None else v.loop.chain.latency,
            "reason": self.reason,
        }

    def __repr__(self) -> str:
        speed = self.contact_speed
        contact = "no contact" if math.isnan(speed) else f"contact at {format_quantity(speed, 'm/s', 3)}"
        return f"<Candidate: {self.name}, {self.status.value}, {contact}>"


@dataclass(frozen=True, kw_only=True, repr=False)
class CandidateComparison(Described, Value):
    """Result of `compare`: the candidates from best to worst.

    A gain that holds is better than one that does not. Among equals, the lower mean contact speed is better.

    Args:
        candidates: the candidates, best first.
        warnings: why the results of the candidates may not be comparable.
        notes: what was assumed about the candidates.
    """

    candidates: tuple[Candidate, ...]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def best(self) -> Candidate | None:
        """The best candidate whose gain passes the verification.

        None if no gain passes, not even narrowly.
        """
        first = self.candidates[0]
        return first if first.status.is_passed else None

    @property
    def headline(self) -> str:
        """A sentence that names the best candidate."""
        first, count = self.candidates[0], len(self.candidates)
        speed = f"contact at {format_quantity(first.contact_speed, 'm/s', 3)} on average"
        if math.isnan(first.contact_speed):
            if self.best is None:
                return f"None of the {count} candidates meets its requirements, and no simulated run ends in contact."
            speed = "no simulated run ends in contact"
        elif self.best is None:
            return (
                f"None of the {count} candidates meets its requirements. Candidate {first.name} has the lowest contact "
                f"speed: {speed}."
            )
        holding = sum(c.status.is_passed for c in self.candidates)
        holds = "holds narrowly" if first.status is VerdictStatus.HOLDS_NARROWLY else "holds"
        best = f"Candidate {first.name} is best of {count} and {holds}: {speed}."
        return f"{best} {holding} candidate{'s hold' if holding > 1 else ' holds'}."

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as one JSON object, in SI units."""
        best = None if self.best is None else self.best.name
        document: dict[str, Any] = plain(
            {
                "status": "found" if best else "none-holds",
                "headline": self.headline,
                "best": best,
                "candidates": [c.to_dict() for c in self.candidates],
                "warnings": self.warnings,
                "notes": self.notes,
            }
        )
        return document

    def __repr__(self) -> str:
        return f"<CandidateComparison: {self.headline}>"


@check_arguments
def compare(tasks: Mapping[str, Task], *, runs: int | None = None, notes: Sequence[str] = ()) -> CandidateComparison:
    """Verify and rank several tasks, such as different sensors.

    Each task gets the gain that it names, or else its own designed gain, which has the required gain margin.

    Args:
        tasks: the tasks by the names of the candidates; all of them need a sampled loop.
        runs: simulated encounters of each candidate; None for the number of each task.
        notes: sentences on what was assumed about the candidates, which the report repeats.

    Returns:
        The candidates from best to worst, each with its verdict.

    Raises:
        InvalidInputError: there are fewer than two tasks, or one of them has no sampled loop.
    """
    if len(tasks) < 2:
        raise InvalidInputError(f"tasks: found {len(tasks)}, expected at least two candidates to compare")
    for name, task in tasks.items():
        if task.loop is None:
            raise InvalidInputError(
                f"{name}: found no sampled loop, expected a sampled loop for each candidate; add the sections [chain] "
                "and [controller] to the scenario file (the command pretouch init writes both sections)"
            )
    results = [_verified(name, task, runs) for name, task in tasks.items()]
    return CandidateComparison(
        candidates=tuple(sorted(results, key=_rank)),
        warnings=tuple(_differences(list(tasks.values()))),
        notes=tuple(notes),
    )


def _differences(tasks: Sequence[Task]) -> Iterator[str]:
    """Yield a warning if the tasks have different encounters or limits."""
    limits = [task.limits for task in tasks]
    motions = [replace(task.scenario.obstacle, position=1.0) for task in tasks]  # each sensor has its own range
    moved = any(motion != motions[0] for motion in motions[1:])
    limited = any(len(some) != len(limits[0]) or any(limit not in limits[0] for limit in some) for some in limits)
    names = [name for name, differs in (("motion of the object", moved), ("limits", limited)) if differs]
    if names:
        yield caution(
            "PT417",
            f"The candidates differ in the {' and in the '.join(names)}: use the same values in all files to compare "
            "sensors, laws or robots.",
        )


def _verified(name: str, task: Task, runs: int | None) -> Candidate:
    """Return the candidate of a task with its verification result.

    If the task is refused, the candidate contains the reason.
    """
    if runs is not None:
        task = task.replace(verify=replace(task.verify, runs=runs))
    try:
        return Candidate(name=name, verdict=verify(task, changes=False))
    except InvalidInputError as error:
        return Candidate(name=name, problem=str(error))


def _rank(candidate: Candidate) -> tuple[int, float]:
    """Return the sort key of a candidate. It is the status of the gain, then the mean contact speed."""
    place, speed = candidate.status.place, candidate.contact_speed
    if not math.isnan(speed):
        return place, speed
    return place, 0.0 if candidate.status.is_passed else math.inf
