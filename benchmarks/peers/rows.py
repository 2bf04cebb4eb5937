"""Measure, print and export one row per case, sensor and method."""

from __future__ import annotations

import statistics
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass

from .builds import ROOT, EarlierBuild, commands
from .measuring import Pair, Problem, fresh, in_turn, job_for, problem_for, relative_error
from .protocol import Peer, Way
from .registry import OURS
from .work import ACCURACY, SENSORS

__all__ = ["HEADER", "Row", "measure", "measure_commands"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """Measurements of one method.

    Args:
        case: a letter of `work.CASES`.
        sensor: a name of `work.SENSORS`; empty in case G.
        peer: the library, or an earlier build.
        way: what it does.
        solves: how many encounters or designs one call solved.
        seconds: time per solve [s], the shortest of all rounds.
        ours: that of pretouch in the same rounds [s].
        ratio: time of the peer over that of pretouch per solve, the median over the rounds.
        rounds: number of rounds.
        error: the largest relative error of its contact times or gains; None in case G.
        exact: whether the error is within the required accuracy.
    """

    case: str
    sensor: str
    peer: str
    way: str
    solves: int
    seconds: float
    ours: float
    ratio: float
    rounds: int
    error: float | None
    exact: bool

    def __str__(self) -> str:
        """Return a row of the table in Markdown."""
        error = "" if self.error is None else f"{self.error:.0e}{'' if self.exact else ' !'}"
        return (
            f"| {self.case} | {self.sensor} | {self.peer} | {self.way} | {time_text(self.seconds)} | {error} "
            f"| {_ratio_text(self.ratio)} |"
        )


HEADER = "| case | sensor | peer | way | per solve | error | ratio to ours |\n|---|---|---|---|---|---|---|"


def time_text(seconds: float) -> str:
    """Write a time in the unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _ratio_text(ratio: float) -> str:
    return f"{ratio:.3g}x" if ratio < 1000 else f"{ratio:,.0f}x"


def measure(case: str, size: int, peers: dict[str, Peer], budget: float, least: int = 3) -> Iterator[Row | str]:
    """Measure each method of each peer, compared with pretouch, on one case.

    Args:
        case: a letter of `work.CASES`.
        size: how many solves the case asks for.
        peers: by short name, ours among them.
        budget: seconds per pair.
        least: rounds per pair at least.

    Yields:
        A row per way, ours first, or a line that says why there is none.
    """
    for sensor in SENSORS:
        problem = problem_for(case, sensor, size)
        mine = next(way for way in peers[OURS].cases() if way.sensor == sensor and case in way.cases)
        for name, peer in peers.items():
            for way in peer.cases():
                if way.sensor != sensor or case not in way.cases:
                    continue
                try:
                    yield _row(case, problem, (name, peer, way), mine, (budget, least))
                except (
                    ArithmeticError,
                    RuntimeError,
                    ValueError,
                    LookupError,
                    EOFError,
                    subprocess.SubprocessError,
                ) as error:
                    reason = str(error).partition("\n")[0]
                    yield f"| {case} | {sensor} | {peer.name} | {way.name} | failed: {reason} | | |"


def _row(case: str, problem: Problem, entry: tuple[str, Peer, Way], mine: Way, effort: tuple[float, int]) -> Row:
    name, peer, way = entry
    if case == "D":
        (ours, our_count), answers = (fresh(OURS, way.sensor), 1), problem.answers
        theirs = peer.fresh(way.sensor) if isinstance(peer, EarlierBuild) else fresh(name, way.sensor)
        count = 1
    else:
        ours, our_count, _ = job_for(mine, problem)
        theirs, count, answers = job_for(way, problem)
    ours()
    error = relative_error(theirs(), answers)
    pair: Pair = in_turn(ours, theirs, *effort)
    scale = our_count / count
    return Row(
        case=case,
        sensor=way.sensor,
        peer=peer.name,
        way=way.name,
        solves=count,
        seconds=pair.second / count,
        ours=pair.first / our_count,
        ratio=pair.ratio * scale,
        rounds=pair.rounds,
        error=error,
        exact=error <= ACCURACY[case],
    )


def measure_commands(points: int, old: EarlierBuild | None, least: int) -> Iterator[Row]:
    """Measure whole commands of this build and of an earlier one, in turn.

    Args:
        points: about how many points the sweep has.
        old: the earlier build; None for this build alone.
        least: number of rounds.

    Yields:
        A row for each command and build.
    """
    builds = [("pretouch", ROOT)] if old is None else [("pretouch", ROOT), (old.name, old.tree)]
    with tempfile.TemporaryDirectory() as folder:
        for command in commands(points):
            for _, tree in builds:  # warm the caches of the file system
                command.seconds(tree, folder)
            rounds = [[command.seconds(tree, folder) for _, tree in builds] for _ in range(least)]
            for k, (name, _) in enumerate(builds):
                yield Row(
                    case="G",
                    sensor="",
                    peer=name,
                    way=command.name,
                    solves=1,
                    seconds=statistics.median(times[k] for times in rounds),
                    ours=statistics.median(times[0] for times in rounds),
                    ratio=statistics.median(times[k] / times[0] for times in rounds),
                    rounds=least,
                    error=None,
                    exact=True,
                )
