"""What the verbs share: one object on stdout, one sentence on stderr, one exit code, one file that is never lost."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn, TypeAlias

import typer

from pretouch._core.errors import PretouchError, UnitError
from pretouch._core.files import as_json, is_own_unchanged
from pretouch._core.units import read_quantity

if TYPE_CHECKING:
    from pretouch.design import Task
    from pretouch.motion import ContinuousLaw
    from pretouch.uncertainty import Reservations


ScenarioFile: TypeAlias = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).")]
_OPTIONS: Final[dict[str, tuple[Any, Any]]] = {
    "json": (
        Annotated[
            bool,
            typer.Option(
                "--json", help="Print one JSON object, all SI, and nothing else; write a report only with --output."
            ),
        ],
        False,
    ),
    "output": (
        Annotated[Path | None, typer.Option("--output", "-o", metavar="PATH", help="Where the HTML report goes.")],
        None,
    ),
    "report": (Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report.")], True),
    "force": (
        Annotated[
            bool,
            typer.Option(
                "--force",
                help="Overwrite whatever stands where the report goes; unasked, only an own, unchanged report is.",
            ),
        ],
        False,
    ),
}
"""How a result is shown: the options that all verbs share, each with its default."""

_NO_RESULT: Final = 1  # the answer is no: infeasible, no contact, no usable signal, not reproduced
_MISTAKE: Final = 2  # in a file or on the command line, or an output that would be overwritten
_INTERRUPTED: Final = 130
_BROKEN_PIPE: Final = 141


def option(metavar: str, told: str, **more: Any) -> Any:
    """Return an option of a verb with what it takes and what it does; its name is that of the argument."""
    return typer.Option(metavar=metavar, help=told, **more)


def read_gain(text: str | None, law: ContinuousLaw) -> float | None:
    """Read the gain of an option, where it is given, in the unit of its law."""
    try:
        return None if text is None else read_quantity(text, law.number.unit, name="--gain")
    except UnitError as error:
        raise UnitError(f"{error}, as law kind {law.kind} has it") from None


def conclude(run: Callable[[], object], *, json_wanted: bool) -> NoReturn:
    """Run a verb and end with its exit code; a mistake becomes one message, and with `json_wanted` an object on stdout.

    Everything unexpected keeps its traceback.

    Raises:
        Exit: always, with the exit code.
    """
    try:
        code = 0
        try:
            run()
        except typer.Exit as ended:
            code = ended.exit_code
        except PretouchError as error:
            print_message(str(error))
            code = _MISTAKE
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
    """End a verb whose run did not come to what was asked for with the exit code of that."""
    if not good:
        raise typer.Exit(_NO_RESULT)


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


def reservations_about(task: Task, answer: Any) -> Reservations | None:
    """Tell what the calibration of a sensor leaves open of an answer; None where the sensor is given by parameters."""
    if task.calibration is None:
        return None
    from pretouch.uncertainty import reservations_of  # noqa: PLC0415 - the compiled kernels, only when needed

    return reservations_of(task.calibration, answer)


def verb(run: Callable[..., None]) -> Callable[..., None]:
    """Make a verb of a function that shows one result: with its own options, which follow, those of how it is shown.

    Args:
        run: takes a `Presentation` and its own options, by name. Its docstring is the help.

    Returns:
        The command.
    """

    @wraps(run)
    def command(**given: Any) -> None:
        shown = Presentation(**{name: given.pop(name) for name in _OPTIONS})
        conclude(lambda: run(shown, **given), json_wanted=shown.json)

    own = list(inspect.signature(run, eval_str=True).parameters.values())[1:]
    keyword = inspect.Parameter.KEYWORD_ONLY
    shared = [
        inspect.Parameter(name, keyword, annotation=a, default=default) for name, (a, default) in _OPTIONS.items()
    ]
    parameters = [*own, *shared]
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
        """Print a result of a task, write its report, by default so named, and end with the exit code of its answer."""
        target = self.output or Path(default)
        reservations = None if task is None else reservations_about(task, result)
        text = self.told(reservations, result.to_dict, result.__str__)
        if self.json and self.output is not None:
            self._write(result, target, task)
        print_text(text)
        if self.report and not self.json:
            self._write(result, target, task)
            print_text(f"\nReport with figures: {target}")
        end(good=good and not (reservations is not None and reservations.is_refuted))

    def told(
        self, reservations: Reservations | None, as_dict: Callable[[], dict[str, Any]], as_text: Callable[[], str]
    ) -> str:
        """Return a result as it is asked for, an object or text, amid what its calibration leaves open."""
        if self.json:
            return as_json(as_dict() if reservations is None else reservations.around_dict(as_dict()))
        return as_text() if reservations is None else reservations.around_text(as_text())

    def _write(self, result: Any, target: Path, task: Task | None) -> None:
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        known: dict[str, Any] = {} if task is None else {"calibration": task.calibration, "source": task.source}
        print_progress(f"{target}: drawing the report")
        write_report(result, target, overwrite=self.force or is_own_unchanged(target), **known)
