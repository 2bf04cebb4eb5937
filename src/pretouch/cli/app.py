"""The command line: verbs, version, and what happens around them."""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from typing import Annotated, Final

import typer

__all__ = ["VERBS", "app", "main"]

VERBS: Final = ("fit", "design", "sweep", "pareto", "robust", "simulate", "verify", "reproduce")
"""In the order of the help; each is the function of its name in the file of its name."""

app = typer.Typer(
    name="pretouch",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
for _name in VERBS:
    app.command(_name)(getattr(import_module(f".{_name}", __package__), _name))


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


def main() -> None:
    """Run the command line with the arguments of this process, and end the process with the exit status."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads wait for small matrices at full speed, beside ours
    gc.set_threshold(100_000)  # loading libraries makes objects that stay: looking for garbage takes a tenth of the run
    try:
        app(prog_name="pretouch")
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        gc.freeze()  # looking through all that is loaded for garbage, once more, would take 0.13 s of the end
