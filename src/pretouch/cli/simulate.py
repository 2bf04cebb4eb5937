"""`pretouch simulate`: one encounter on the sampled loop of a scenario file."""

from __future__ import annotations

from .options import LoopFile, LoopGain, LoopSeed, read_gain
from .terminal import Presentation, load_loop, verb

__all__ = ["simulate"]


@verb
def simulate(shown: Presentation, *, file: LoopFile, gain: LoopGain = None, seed: LoopSeed = None) -> None:
    """Run one encounter on the loop as it will really run (TOML).

    Prints the contact on the loop beside the predicted one and beside no mitigation, when the object was first seen,
    every contact with its force, and what the controller reported; writes a report with the course of the run,
    STEM-simulate.html in this folder.

    Exit status: 0 the run ended in contact, 1 it did not, 2 a mistake in the request.
    """
    from pretouch.verification import simulate_encounter  # noqa: PLC0415 - `pretouch --help` stays quick

    task = load_loop(file, "running the loop", gain=read_gain(gain), seed=seed)
    found = simulate_encounter(task)
    shown.show(found, f"{file.stem}-simulate.html", task, good=bool(found.run.touched.all()))
