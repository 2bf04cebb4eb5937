"""What the verbs share: one object on stdout, one sentence on stderr, one exit code, one file that is never lost."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from pretouch._core.errors import PretouchError
from pretouch._core.files import is_own_unchanged
from pretouch._core.json_text import as_json

from .options import Force, Json, Output, Report

if TYPE_CHECKING:
    from pretouch.design import Task
    from pretouch.uncertainty import Reservations

__all__ = [
    "MISTAKE",
    "NO_RESULT",
    "OK",
    "Presentation",
    "conclude",
    "end",
    "load",
    "print_message",
    "print_progress",
    "print_text",
    "verb",
]

OK = 0
"""The run came to what was asked for."""

NO_RESULT = 1
"""The run ended well and its answer is no: infeasible, no contact, no usable signal, not reproduced."""

MISTAKE = 2
"""The request makes no sense: a mistake in a file or on the command line, or an output that would be overwritten."""

_INTERRUPTED = 130
_BROKEN_PIPE = 141


def conclude(run: Callable[[], object], *, json_wanted: bool) -> NoReturn:
    """Run a verb and end with its exit code; mistakes become one message, everything unexpected keeps its traceback.

    Args:
        run: the verb; one whose answer is no ends by `end`.
        json_wanted: whether a mistake is printed as an object on stdout, too.

    Raises:
        Exit: always, with the exit code.
    """
    try:
        code = OK
        try:
            run()
        except typer.Exit as ended:
            code = ended.exit_code
        except PretouchError as error:
            print_message(str(error))
            code = MISTAKE
            if json_wanted:
                print_text(as_json({"status": "error", "message": str(error)}))
        sys.stdout.flush()
    except KeyboardInterrupt:
        code = _INTERRUPTED
    except BrokenPipeError:
        # whoever read our output has gone; what is still in the buffer must not fail again at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = _BROKEN_PIPE
    raise typer.Exit(code)


def end(*, good: bool) -> None:
    """End a verb with the exit code of its answer.

    Args:
        good: whether the run came to what was asked for.

    Raises:
        Exit: where it did not.
    """
    if not good:
        raise typer.Exit(NO_RESULT)


def print_text(text: str) -> None:
    """Print to stdout, also where it cannot show every character, and at once."""
    _write(sys.stdout, text)


def print_message(text: str) -> None:
    """Print a message to stderr, each of its lines under our name."""
    _write(sys.stderr, "\n".join(f"pretouch: {line}" for line in text.split("\n")))


def print_progress(text: str) -> None:
    """Tell a person who waits at a terminal what is under way, on stderr; where nobody watches, nothing is told."""
    if sys.stderr.isatty():
        print_message(text)


def _write(stream: Any, text: str) -> None:
    encoding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(encoding, "replace").decode(encoding) + "\n")
    stream.flush()


def load(file: Path, doing: str) -> Task:
    """Load a scenario file, and tell what will be done with it.

    Args:
        file: the file.
        doing: what a person waits for, such as `searching gains`.

    Returns:
        What the file asks for.
    """
    from pretouch.config import load_scenario  # noqa: PLC0415 - `pretouch --help` stays quick

    task = load_scenario(file)
    print_progress(f"{file}: {doing}")
    return task


def load_loop(file: Path, doing: str, *, gain: float | None, seed: int | None) -> Task:
    """Load a scenario file with a loop, as `load` does.

    Args:
        file: the file.
        doing: what a person waits for.
        gain: D_p [N s] in the place of that of the file; None for that.
        seed: of the noise, likewise.

    Returns:
        The task.
    """
    task = load(file, doing)
    loop = task.loop if seed is None or task.loop is None else replace(task.loop, seed=seed)
    return task.replace(loop=loop, gain=task.gain if gain is None else gain)


def reservations_about(task: Task, answer: Any) -> Reservations | None:
    """Tell what the calibration of a sensor leaves open of an answer; None where the sensor is given by parameters."""
    if task.calibration is None:
        return None
    from pretouch.uncertainty import reservations_of  # noqa: PLC0415 - the compiled kernels, only when needed

    return reservations_of(task.calibration, answer)


def verb(run: Callable[..., None]) -> Callable[..., None]:
    """Make a verb of the command line of a function that shows one result.

    Args:
        run: takes a `Presentation` and its own options, by name. Its docstring is the help.

    Returns:
        The command: it has the options of `run`, and those of how a result is shown.
    """

    @wraps(run)
    def command(*, json: bool, output: Path | None, report: bool, force: bool, **own: Any) -> None:
        shown = Presentation(json=json, output=output, report=report, force=force)
        conclude(lambda: run(shown, **own), json_wanted=json)

    own = list(inspect.signature(run, eval_str=True).parameters.values())[1:]
    ways = {"json": (Json, False), "output": (Output, None), "report": (Report, True), "force": (Force, False)}
    keyword = inspect.Parameter.KEYWORD_ONLY
    common = [inspect.Parameter(name, keyword, annotation=a, default=default) for name, (a, default) in ways.items()]
    parameters = [*own, *common]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return command


@dataclass(frozen=True, slots=True, kw_only=True)
class Presentation:
    """How a result is shown.

    Args:
        json: as one object on stdout, and nothing else there.
        output: where the report goes; None for the default place.
        report: whether a report is written where no object is printed.
        force: whether any file may be replaced; unasked, only an own report that nobody has changed is.
    """

    json: bool
    output: Path | None
    report: bool
    force: bool

    def show(self, result: Any, default: str, task: Task | None = None, *, good: bool) -> None:
        """Print a result, write its report, and end with the exit code of its answer.

        Args:
            result: what one of the verbs returned: text for a person, an object (`to_dict`) for a program, and a page.
            default: name of the report where none is given.
            task: what it was computed from, with the calibration of its sensor.
            good: whether the result is what was asked for.
        """
        target = self.output or Path(default)
        reservations = None if task is None else reservations_about(task, result)
        if self.json:
            found = result.to_dict()
            text = as_json(found if reservations is None else reservations.around_dict(found))
            if self.output is not None:
                self._write(result, target, task)
            print_text(text)
        else:
            print_text(str(result) if reservations is None else reservations.around_text(str(result)))
            if self.report:
                self._write(result, target, task)
                print_text(f"\nReport with figures: {target}")
        end(good=good)

    def _write(self, result: Any, target: Path, task: Task | None) -> None:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        known: dict[str, Any] = {}
        if task is not None:
            known = {"calibration": task.calibration, "source": task.source}
        print_progress(f"{target}: drawing the report")
        write_report(result, target, overwrite=self.force or is_own_unchanged(target), **known)
