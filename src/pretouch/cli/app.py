"""Define the command `pretouch` with its subcommands and its version option."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from typing import Annotated, Final

import typer

from .compare import compare
from .doctor import doctor
from .export import export
from .fit import fit
from .init import init
from .project import project
from .record import record
from .replay import replay
from .robot import robot
from .studio import studio
from .sweep import sweep
from .terminal import guard_output
from .verbs import design, pareto, reproduce, robust, simulate, verify

app = typer.Typer(
    name="pretouch",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
_EXAMPLES: Final[
    dict[Callable[..., None], tuple[str, str, str]]
] = {  # in the order of the help: two commands for each verb, and the page of the documentation
    init: ("init", 'init sensor.csv --speed "0.4 m/s" --output finger.toml', "start.md"),
    record: (
        "record sensor.csv --port /dev/ttyUSB0",
        'record fingertip.toml --i2c VCNL4040 --distances "0, 2, 5, 10, 20, 40 mm"',
        "how-to/record-a-calibration.md",
    ),
    fit: ("fit sensor.csv", 'fit sensor.csv --offset "61 counts" --model inverse-power', "explanation/calibration.md"),
    design: ("design approach.toml", "design approach.toml --json", "explanation/design.md"),
    sweep: (
        'sweep approach.toml --axis "obstacle.velocity=-1 m/s:-0.1 m/s:50"',
        "sweep approach.toml --axis gain=-1:-0.1:20 --output gains.nc",
        "how-to/sweeps.md",
    ),
    pareto: ("pareto tradeoff.toml", "pareto tradeoff.toml --verbose --no-report", "how-to/trade-offs.md"),
    robust: ("robust robust.toml", "robust robust.toml --samples 1024 --seed 1", "how-to/robust.md"),
    simulate: ("simulate loop.toml", 'simulate loop.toml --gain "-0.86 N*s" --seed 2', "explanation/simulation.md"),
    verify: ("verify loop.toml", 'verify loop.toml --gain "-0.86 N*s" --runs 2000', "explanation/verification.md"),
    compare: ("compare damper.toml drag.toml", "compare loop.toml --parts --runs 200", "how-to/which-part.md"),
    export: (
        'export c loop.toml --gain "-0.86 N*s" --output law',
        "export c loop.toml --unverified --output draft",
        "how-to/export.md",
    ),
    replay: (
        "replay loop.toml approaches.csv --topic reading --truth contact",
        'replay loop.toml approaches.csv --topic reading --reference "distance" --calibration pairs.csv',
        "how-to/what-did-my-sensor-see.md",
    ),
    studio: ("studio loop.toml", "studio --output try-it.html", "how-to/studio.md"),
    robot: ("robot arm.toml", 'robot arm.toml --gain "-0.7 N*s" --view', "how-to/robots.md"),
    project: ("project arm.xml", "project arm.xml --json", "how-to/robots.md"),
    doctor: ("doctor", "doctor --json", "start.md"),
    reproduce: ("reproduce", "reproduce table-2 figure-4", "explanation/letter.md"),
}


def _epilog(first: str, second: str, page: str) -> str:
    """Return the examples and the documentation path for a command's help. They are the end of the help text."""
    return f"\b\nExamples:\n  pretouch {first}\n  pretouch {second}\n\n\b\nDocumentation: docs/{page}"


for _verb, _example in _EXAMPLES.items():
    app.command(_verb.__name__, epilog=_epilog(*_example))(_verb)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version  # noqa: PLC0415 - only for this option

        typer.echo(f"pretouch {version('pretouch')}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Choose the gain of a controller that softens robot impacts by proximity sensing, without a single collision."""


def _run() -> int:
    """Run the command line and return its exit status."""
    try:
        app(prog_name="pretouch")
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return 0


def main() -> None:
    """Run the command line of this process.

    The process exits with the resulting status.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its idle threads would compete with ours for the cores
    gc.set_threshold(100_000)  # imported libraries leave no garbage, but collecting takes a tenth of the run
    try:
        sys.exit(guard_output(_run))
    finally:
        gc.freeze()  # a last garbage collection would take 0.13 s
