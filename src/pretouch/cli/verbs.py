"""The verbs that show one result: of a scenario file, or of the letter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from .terminal import Presentation, ScenarioFile, option, print_progress, read_gain, verb

if TYPE_CHECKING:
    from pretouch.design import Task


UncertainFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with [uncertainty].")
]
LoopFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with [chain] and [controller].")
]
LoopGain: TypeAlias = Annotated[
    str | None,
    option("GAIN", 'The gain to run, such as "-0.7 N*s"; else that of the file, or the designed one.'),
]
LoopSeed: TypeAlias = Annotated[int | None, option("NUMBER", "Seed of the noise, in the place of the file's.", min=0)]


def _load(file: Path, doing: str) -> Task:
    """Load a scenario file, and tell what a person waits for."""
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick

    task = load_scenario(file)
    print_progress(f"{file}: {doing}")
    return task


def _load_loop(file: Path, doing: str, gain: str | None, seed: int | None) -> Task:
    """Load a scenario file with a loop; gain and seed replace those of the file where they are given."""
    task = _load(file, doing)
    asked = read_gain(gain, task.law)
    loop = task.loop if seed is None or task.loop is None else replace(task.loop, seed=seed)
    return task.replace(loop=loop, gain=task.gain if asked is None else asked)


@verb
def design(shown: Presentation, *, file: ScenarioFile) -> None:
    """Choose the gain for a scenario file (TOML), and the admittance where the file leaves it open.

    Where its law is a virtual drag with an effect, chooses the drag by that effect.

    Prints the optimal gain, the contact it leads to, every constraint with its margin, what no mitigation would have
    given, and what the gain is most sensitive to; writes a report with figures, STEM-design.html in this folder.

    Exit status: 0 optimal, or a drag that keeps every limit, 1 no gain meets the constraints or ends in contact, or the
    drag does not, 2 a mistake in the request.
    """
    from pretouch.design import design_admittance, design_drag, design_gain  # noqa: PLC0415 - `--help` stays quick

    task = _load(file, "searching gains")
    if task.effect is not None:
        drag = design_drag(task)
        shown.show(drag, f"{file.stem}-design.html", task, good=drag.holds)
        return
    found = design_admittance(task) if task.is_admittance_free else design_gain(task)
    shown.show(found, f"{file.stem}-design.html", task, good=found.status == "optimal")


@verb
def pareto(shown: Presentation, *, file: ScenarioFile) -> None:
    """Find what a scenario file (TOML) can trade: the Pareto front of contact quantities.

    Prints the knee of the front, its ends, where the designed gain or the choice of the file lies, and how far all of
    them are from what any controller could reach; writes a report with figures, STEM-pareto.html in this folder.

    Exit status: 0 a front was found, 1 no choice meets the constraints or ends in contact, 2 a mistake in the request.
    """
    from pretouch.design import pareto_front  # noqa: PLC0415

    task = _load(file, "tracing what can be traded")
    found = pareto_front(task)
    shown.show(found, f"{file.stem}-pareto.html", task, good=found.status == "found")


@verb
def robust(
    shown: Presentation,
    *,
    file: UncertainFile,
    samples: Annotated[
        int | None,
        option(
            "NUMBER", "Encounters that are sampled, and as many fresh ones; in the place of what the file says.", min=2
        ),
    ] = None,
    seed: Annotated[int | None, option("NUMBER", "Seed of all samples, likewise.", min=0)] = None,
) -> None:
    """Choose the gain where inputs are not known exactly (TOML).

    Prints the gain, what fresh samples say of it beside the gain that is optimal where nothing is uncertain, and how
    often every constraint holds; writes a report with figures, STEM-robust.html in this folder.

    Exit status: 0 optimal, 1 no gain meets the constraints or ends in contact as often as it must, 2 a mistake in the
    request.
    """
    from pretouch.design.robust import design_robust_gain  # noqa: PLC0415

    task = _load(file, "sampling encounters")
    named = {"samples": samples, "validation": samples, "seed": seed}
    found = design_robust_gain(task.replace(**{name: value for name, value in named.items() if value is not None}))
    shown.show(found, f"{file.stem}-robust.html", task, good=found.status == "optimal")


@verb
def simulate(shown: Presentation, *, file: LoopFile, gain: LoopGain = None, seed: LoopSeed = None) -> None:
    """Run one encounter on the loop as it will really run (TOML).

    Prints the contact on the loop beside the predicted one and beside no mitigation, when the object was first seen,
    every contact with its force, and what the controller reported; writes a report with the course of the run,
    STEM-simulate.html in this folder.

    Exit status: 0 the run ended in contact, 1 it did not, 2 a mistake in the request.
    """
    from pretouch.verification import simulate_encounter  # noqa: PLC0415

    task = _load_loop(file, "running the loop", gain, seed)
    found = simulate_encounter(task)
    shown.show(found, f"{file.stem}-simulate.html", task, good=bool(found.run.touched.all()))


@verb
def verify(
    shown: Presentation,
    *,
    file: LoopFile,
    gain: LoopGain = None,
    runs: Annotated[int | None, option("NUMBER", "How many encounters; else as the file says.", min=1)] = None,
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
    from pretouch.verification import verify_gain  # noqa: PLC0415

    task = _load_loop(file, "running encounters on the loop", gain, seed)
    found = verify_gain(task if runs is None else task.replace(runs=runs), changes=changes)
    shown.show(found, f"{file.stem}-verify.html", task, good=found.status in {"holds", "holds-narrowly"})


@verb
def reproduce(
    shown: Presentation,
    *,
    ids: Annotated[
        list[str] | None, typer.Argument(metavar="ID", help="What to reproduce; all of it where none is named.")
    ] = None,
) -> None:
    """Compute the letter's tables and figures again.

    Sets every printed number beside ours. Prints how many agree, what disagrees and why, and where the letter's text
    contradicts its own equations; writes letter-reproduction.html in this folder, a report with figures, the code of
    each, and all numbers.

    \b
    ID is one of:
      table-1  figure-3  figure-4  figure-5  table-2  figure-6  one-gain  table-3
      attraction  constraints  impact-force

    Exit status: 0 every difference is explained, 1 not everything comes out, 2 a mistake in the request.
    """  # noqa: D301 - the escape keeps the lines of the list together
    from pretouch.letter import reproduce as compute  # noqa: PLC0415

    found = compute(ids or (), progress=lambda name: print_progress(f"computing {name}"))
    shown.show(found, "letter-reproduction.html", good=found.holds)
