"""Sweeps that are small, and cut into many blocks all the same."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.sweeps import plan, run, stores

SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
CURVED = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
CONSTANT = pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
AXES = {"obstacle.velocity": np.linspace(-1.0, -0.01, 24), "gain": np.linspace(-2.0, -0.05, 10)}
RESULTS = ("time", "relative_velocity", "largest_excursion")
BLOCKS = 24


def cut_small(setattr_: Callable[[Any, str, Any], None], *, encounters: int = 10, chunks: int = 1) -> None:
    """Make chunks of so many encounters and blocks of so many chunks; takes `monkeypatch.setattr` or `setattr`."""
    setattr_(plan, "_chunk_size", lambda *_: encounters)
    setattr_(run, "chunks_per_block", lambda *_, **__: chunks)


def note_chunks(setattr_: Callable[[Any, str, Any], None], log: Path) -> None:
    """Write the start of every region that is computed to a file, at once."""
    evaluate = plan.Plan.evaluate

    def noting(asked: Any, region: Any) -> Any:
        with log.open("a") as stream:
            stream.write(f"{region[0].start}\n")
        return evaluate(asked, region)

    setattr_(plan.Plan, "evaluate", noting)


def noted(log: Path) -> list[int]:
    """Return what `note_chunks` has written."""
    return [int(line) for line in log.read_text().split()] if log.exists() else []


def sweep_to(output: str | Path | None, *, method: str = "auto", **how: Any) -> Any:
    """The sweep of these samples."""
    return pt.sweep(pt.Task(SCENARIO, CURVED, method=method), AXES, results=RESULTS, output=output, **how)


def sweep_until_killed(output: str, log: str, moment: str, count: int) -> None:
    """Run the sweep in a process that is killed at a moment of its n-th block; called in a process of its own."""
    cut_small(setattr)
    note_chunks(setattr, Path(log))
    method = {"computing": "evaluate", "writing": "write", "before the ledger": "finish", "after the ledger": "finish"}
    seen = 0

    def end() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    owner: Any = plan.Plan if moment == "computing" else stores.ZarrStore
    original = getattr(owner, method[moment])

    def until_then(*arguments: Any) -> Any:
        nonlocal seen
        seen += 1
        if seen < count:
            return original(*arguments)
        if moment == "writing":  # one variable of the chunk, and no more
            store, region, columns = arguments
            original(store, region, {"time": columns["time"]})
        if moment in {"computing", "after the ledger"}:
            original(*arguments)
        return end()

    setattr(owner, method[moment], until_then)
    sweep_to(output)
