"""Define a peer: its name, whether it is installed, and its methods for each case."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

from .work import Column

__all__ = ["Job", "Peer", "Way", "missing", "one_by_one"]

Job: TypeAlias = Callable[[], Column]
"""What is timed: it solves all that it was made for, and returns contact times or gains."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """One method of a peer for some cases and one sensor.

    Args:
        name: what it does, in a few words.
        sensor: a name of `work.SENSORS`.
        cases: letters of the cases that it serves: B, E or F, or some of A, C and D.
        make: prepares a job, compilation included: from (v, D_p) in case B, (v, phi) in case F, and
            (v,) in the others.
        tolerance: the expected relative error of contact times or gains.
        size: the most that one call should be asked to solve, or a function that finds it out; the cost is reported
            per solve.
        grows: whether the figure follows it over batch sizes.
    """

    name: str
    sensor: str
    cases: str
    make: Callable[..., Job]
    tolerance: float
    size: int | Callable[[], int] = 10**9
    grows: bool = False

    @property
    def largest(self) -> int:
        """The most that one call should be asked to solve."""
        return self.size() if callable(self.size) else self.size


class Peer(Protocol):
    """One library, or two that work together."""

    name: str

    def available(self) -> str:
        """Return why it cannot run here; empty if it can."""

    def cases(self) -> Sequence[Way]:
        """Return its ways."""


def missing(*modules: str) -> str:
    """Return which modules are not installed, as a reason; empty if all are."""
    absent = [name for name in modules if importlib.util.find_spec(name) is None]
    return f"{', '.join(absent)} not installed" if absent else ""


def one_by_one(solve: Callable[..., float], *columns: Any) -> Job:
    """Make a job of a function that solves one at a time."""
    import numpy as np  # noqa: PLC0415

    rows = list(zip(*(np.asarray(column).tolist() for column in columns), strict=True))
    return lambda: np.array([solve(*row) for row in rows])
