"""Implement the commands `pretouch design`, `pareto`, `robust`, `simulate`, `verify` and `reproduce`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from pretouch._core.errors import InvalidInputError, OutputExistsError
from pretouch._core.files import is_stream

from .terminal import Presentation, ScenarioFile, option, print_progress, read_gain, verb

if TYPE_CHECKING:
    from pretouch.designs import Task
    from pretouch.recording.mcap_output import Series
    from pretouch.verification import Verdict


UncertainFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with [uncertainty].")
]
LoopFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="FILE", help="Scenario file (TOML) with [chain] and [controller].")
]
LoopGain: TypeAlias = Annotated[
    str | None,
    option(
        "GAIN", 'The gain of the controller, such as "-0.7 N*s"; by default that of the file, or the designed gain.'
    ),
]
McapFile: TypeAlias = Annotated[
    Path | None, option("PATH", "Write the time series as an MCAP file, with a Foxglove layout next to it.")
]
LoopSeed: TypeAlias = Annotated[int | None, option("NUMBER", "Seed of the noise; by default that of the file.", min=0)]


def _load(file: Path, activity: str) -> Task:
    """Load a scenario file, and print a progress message."""
    from pretouch.config import load_scenario  # noqa: PLC0415 - keeps `pretouch --help` quick

    task = load_scenario(file)
    print_progress(f"{file}: {activity}")
    return task


def load_loop(file: Path, activity: str, gain: str | None, seed: int | None) -> Task:
    """Return the task of a scenario file, with --gain and --seed applied.

    The options --gain and --seed override the values in the file.
    """
    task = _load(file, activity)
    number = read_gain(gain, task.law)
    loop = task.loop if seed is None or task.loop is None else replace(task.loop, seed=seed)
    return task.replace(loop=loop, gain=task.gain if number is None else number)


def refuse_existing(path: Path | None, *, force: bool) -> None:
    """Refuse to replace an existing output file without --force. This check runs before anything is computed."""
    if path is not None and path.exists() and not is_stream(path) and not force:
        raise OutputExistsError(
            f"{path}: this file already exists; choose another name, or replace it with --force", remedy="--force"
        )


def write_series(path: Path, series: tuple[Series, ...], *, force: bool) -> str:
    """Write time series as an MCAP file with a layout for Foxglove, and return a line of text that names both."""
    from pretouch.recording.mcap_output import write_mcap  # noqa: PLC0415

    written, layout = write_mcap(path, series, overwrite=force)
    return f"Time series for Foxglove: {written}, layout {layout.name}"


@verb
def design(shown: Presentation, *, file: ScenarioFile) -> None:
    """Choose the optimal gain for a scenario file (TOML).

    If the file gives bounds for the admittance, also chooses the optimal admittance. If the law is a virtual drag with
    an effect, chooses the drag by that effect.

    Prints the optimal gain, the contact with it and without mitigation, every constraint with its margin, and the most
    influential inputs. Writes a report with figures, STEM-design.html in this folder.

    Exit status: 0 optimal, or a drag that meets all limits, 1 no gain meets the constraints or ends in contact, or the
    drag misses a limit, 2 a mistake in the request.
    """
    from pretouch.designs import DragDesign, design  # noqa: PLC0415 - keeps `--help` quick

    task = _load(file, "searching gains")
    result = design(task)
    good = result.holds if isinstance(result, DragDesign) else result.status == "optimal"
    lines = 20 if task.is_admittance_free else 15  # the section [admittance] to copy takes four
    shown.show(result, f"{file.stem}-design.html", task, good=good, lines=lines)


@verb
def pareto(shown: Presentation, *, file: ScenarioFile) -> None:
    """Compute the Pareto front for a scenario file (TOML).

    Its quantities are, for example, excursion and contact speed. Prints the knee of the front, its ends, the designed
    gain or the choice of the file, and their distances from the physical limit of any controller. Writes a report with
    figures, STEM-pareto.html in this folder.

    Exit status: 0 a front was found, 1 no gain meets the constraints or ends in contact, 2 a mistake in the request.
    """
    from pretouch.designs import pareto  # noqa: PLC0415

    task = _load(file, "computing the Pareto front")
    front = pareto(task)
    shown.show(front, f"{file.stem}-pareto.html", task, good=front.status == "found")


@verb
def robust(
    shown: Presentation,
    *,
    file: UncertainFile,
    samples: Annotated[
        int | None,
        option(
            "NUMBER",
            "Number of sampled encounters, and of fresh ones for validation; by default as in the file.",
            min=2,
        ),
    ] = None,
    seed: Annotated[int | None, option("NUMBER", "Seed of all samples; by default that of the file.", min=0)] = None,
) -> None:
    """Choose the optimal gain for the uncertain inputs of a scenario file (TOML).

    Prints the robust gain, compares it with the nominal gain on fresh samples, and prints how often each constraint is
    met. Writes a report with figures, STEM-robust.html in this folder.

    Exit status: 0 optimal, 1 no gain meets the constraints or ends in contact with the required probability, 2 a
    mistake in the request.
    """
    from pretouch.designs.robust import robust  # noqa: PLC0415

    task = _load(file, "sampling encounters")
    options = task.robust if seed is None else replace(task.robust, seed=seed)
    if samples is not None:
        options = replace(options, samples=samples, validation=samples)
    result = robust(task.replace(robust=options))
    shown.show(result, f"{file.stem}-robust.html", task, good=result.status == "optimal")


@verb
def simulate(
    shown: Presentation, *, file: LoopFile, gain: LoopGain = None, seed: LoopSeed = None, mcap: McapFile = None
) -> None:
    """Simulate one encounter of a scenario file on the sampled loop.

    The loop consists of sampled sensor, controller, robot and contact. Prints the simulated contact compared with the
    prediction and with no mitigation, the moment of detection, every contact with its force, and the status of the
    controller. Writes a report with the time series of the run, STEM-simulate.html in this folder.

    Exit status: 0 the run ended in contact, 1 it did not, or contact is harder than without mitigation, 2 a mistake in
    the request.
    """
    from pretouch.verification import simulate  # noqa: PLC0415

    refuse_existing(mcap, force=shown.force)
    task = load_loop(file, "simulating the loop", gain, seed)
    encounter = simulate(task)
    files: tuple[str, ...] = ()
    if mcap is not None:
        from pretouch.recording.mcap_output import series_of_trace  # noqa: PLC0415

        files = (write_series(mcap, series_of_trace(encounter.trace, floor_of(task)), force=shown.force),)
    shown.show(encounter, f"{file.stem}-simulate.html", task, good=encounter.is_mitigated, files=files)


@verb
def verify(
    shown: Presentation,
    *,
    file: LoopFile,
    gain: LoopGain = None,
    runs: Annotated[
        int | None, option("NUMBER", "Number of simulated encounters; by default as in the file.", min=1)
    ] = None,
    seed: LoopSeed = None,
    changes: Annotated[
        bool, typer.Option("--changes/--no-changes", help="Search for the single change that would help most.")
    ] = True,
    mcap: McapFile = None,
) -> None:
    """Verify by simulation that a gain meets its limits.

    The encounters are those of a scenario file (TOML) with a sampled control loop.

    Simulates many encounters with sensor noise and the uncertain inputs of [uncertainty]; if the file names a
    calibration, also with all sensor curves that its readings allow. Prints a verdict, the predicted and the simulated
    contact with and without mitigation, the margin to every limit and to instability, and the single change that would
    help most. Writes a report with figures, STEM-verify.html in this folder.

    Exit status: 0 the gain holds, or holds narrowly, 1 it does not hold, or there is no gain, 2 a mistake in the
    request.
    """
    from pretouch.verification import verify  # noqa: PLC0415

    refuse_existing(mcap, force=shown.force)
    task = load_loop(file, "simulating encounters on the loop", gain, seed)
    if runs is not None:
        task = task.replace(verify=replace(task.verify, runs=runs))
    verdict = verify(task, changes=changes)
    files: tuple[str, ...] = ()
    if mcap is not None:
        files = (write_series(mcap, _series_of_verdict(verdict, task), force=shown.force),)
    shown.show(verdict, f"{file.stem}-verify.html", task, good=verdict.status.is_passed, lines=20, files=files)


def _series_of_verdict(verdict: Verdict, task: Task) -> tuple[Series, ...]:
    """Return the time series of the run with the highest contact speed; without contact, of the first run."""
    import numpy as np  # noqa: PLC0415

    from pretouch.recording.mcap_output import series_of_trace  # noqa: PLC0415

    runs = verdict.mitigated
    if runs is None:
        raise InvalidInputError("--mcap: there is no gain, so nothing was simulated")
    speeds = np.where(runs.touched, np.abs(runs.relative_velocity), -1.0)
    return series_of_trace(runs.trace(int(np.argmax(speeds))), floor_of(task))


def floor_of(task: Task) -> float:
    """Return the detection threshold of a task's controller.

    The result is NaN if the control law has no threshold.
    """
    law = None if task.loop is None else task.loop.law
    return float(getattr(getattr(law, "conditioning", None), "floor", float("nan")))


@verb
def reproduce(
    shown: Presentation,
    *,
    ids: Annotated[
        list[str] | None, typer.Argument(metavar="ID", help="What to reproduce; by default everything.")
    ] = None,
) -> None:
    """Reproduce the tables and figures of the published letter (short paper).

    Compares every printed number with the computed one. Prints how many agree, the differences with their reasons, and
    contradictions between the letter's text and its equations. Writes letter-reproduction.html in this folder, a report
    with figures, the code of each, and all numbers.

    \b
    ID is one of:
      table-1  figure-3  figure-4  figure-5  table-2  figure-6  one-gain  table-3
      attraction  constraints  impact-force

    Exit status: 0 every difference is explained, 1 some differences are not explained, 2 a mistake in the request.
    """  # noqa: D301 - the escape keeps the lines of the list together
    from pretouch.letter import reproduce as compute  # noqa: PLC0415

    experiment = compute(ids or (), progress=lambda name: print_progress(f"computing {name}"))
    shown.show(experiment, "letter-reproduction.html", good=experiment.holds, lines=None)
