"""Describe what to do next so that a verdict holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pretouch._core.values import Value

from .effect import VerdictStatus
from .settings import Setting


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice(Value):
    """What to do next, and the verdict that results from it.

    Args:
        kind: `start` (the encounter starts elsewhere than the controller detects the object), `change` (another gain or
            loop), `limit` (no change within reach keeps the limits, so one is relaxed),
            `runs` (more runs, whose result is open), `horizon` (a longer one), `readings` (repeated readings, because
            the noise of the sensor is a guess) or `none` (no change within reach helps).
        sentence: what to do, with numbers and with the verdict that results from it.
        settings: the same as keys of a scenario file and their new values, such as
            `{"controller.gain": "-0.86 N*s"}`; None removes a key.
        status: the status of the verdict with these settings, which was simulated; None if it was not.
        fresh_runs: number of fresh runs that confirm this status: their encounters and noise were not used to find
            the settings.
    """

    kind: str
    sentence: str
    settings: Mapping[str, Setting] = field(default_factory=dict)
    status: VerdictStatus | None = None
    fresh_runs: int = 0
