"""`pretouch robust`: the gain of a scenario file whose inputs are not known exactly."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .terminal import Presentation, load, verb

__all__ = ["robust"]


@verb
def robust(
    shown: Presentation,
    *,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with [uncertainty].")],
    samples: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER",
            min=2,
            help="Encounters that are sampled, and as many fresh ones; in the place of what the file says.",
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="NUMBER", min=0, help="Seed of all samples, likewise.")] = None,
) -> None:
    """Choose the gain where inputs are not known exactly (TOML).

    Prints the gain, what fresh samples say of it beside the gain that is optimal where nothing is uncertain, and how
    often every constraint holds; writes a report with figures, STEM-robust.html in this folder.

    Exit status: 0 optimal, 1 no gain meets the constraints or ends in contact as often as it must, 2 a mistake in the
    request.
    """
    from pretouch.design.robust import design_robust_gain  # noqa: PLC0415 - `pretouch --help` stays quick

    task = load(file, "sampling encounters")
    named = {"samples": samples, "validation": samples, "seed": seed}
    found = design_robust_gain(task.replace(**{name: value for name, value in named.items() if value is not None}))
    shown.show(found, f"{file.stem}-robust.html", task, good=found.status == "optimal")
