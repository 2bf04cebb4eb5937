"""The command `pretouch`: its verbs, its version option, and the start and end of the process."""

from __future__ import annotations

import gc
import os
import sys
from typing import Annotated

import typer

from .fit import fit
from .sweep import sweep
from .terminal import guard_output
from .verbs import design, pareto, reproduce, robust, simulate, verify

app = typer.Typer(
    name="pretouch",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
for _verb in (fit, design, sweep, pareto, robust, simulate, verify, reproduce):  # in the order of the help
    app.command(_verb.__name__)(_verb)


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
    """Choose the gain of a proximity-sensor-based preemptive impact controller without one collision."""


def _run() -> int:
    """Run the command line, including help and usage errors; return the exit status."""
    try:
        app(prog_name="pretouch")
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return 0


def main() -> None:
    """Run the command line with the arguments of this process, and exit with its status."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its idle threads would compete with ours for the cores
    gc.set_threshold(100_000)  # imported libraries leave no garbage, but collecting takes a tenth of the run
    try:
        sys.exit(guard_output(_run))
    finally:
        gc.freeze()  # a last garbage collection would take 0.13 s
