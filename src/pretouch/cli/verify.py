"""`pretouch verify`: whether the gain of a scenario file holds on its sampled loop."""

from __future__ import annotations

from typing import Annotated

import typer

from .options import LoopFile, LoopGain, LoopSeed, read_gain
from .terminal import Presentation, load_loop, verb

__all__ = ["verify"]


@verb
def verify(
    shown: Presentation,
    *,
    file: LoopFile,
    gain: LoopGain = None,
    runs: Annotated[
        int | None, typer.Option(metavar="NUMBER", min=1, help="How many encounters; else as the file says.")
    ] = None,
    seed: LoopSeed = None,
    changes: Annotated[
        bool, typer.Option("--changes/--no-changes", help="Look for the one change that would help most.")
    ] = True,
) -> None:
    """Tell whether the gain holds on the loop as it will really run (TOML).

    Runs many encounters with the noise of the sensor and what [uncertainty] says of inputs; where the file names a
    calibration, also the sensors that its readings allow. Prints a verdict, contact
    predicted and simulated, with mitigation and without, the margin to every limit and to instability, and the one
    change that would help most; writes a page with figures, STEM-verify.html in this folder.

    Exit status: 0 the gain holds, or does so narrowly, 1 it does not, or there is none, 2 a mistake in the request.
    """
    from pretouch.verification import verify_gain  # noqa: PLC0415 - `pretouch --help` stays quick

    task = load_loop(file, "running encounters on the loop", gain=read_gain(gain), seed=seed)
    found = verify_gain(task if runs is None else task.replace(runs=runs), changes=changes)
    shown.show(found, f"{file.stem}-verify.html", task, good=found.status in {"holds", "holds-narrowly"})
