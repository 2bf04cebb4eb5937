"""What the verbs share: one object on stdout, one sentence on stderr, one exit code, one file that is never lost."""

from __future__ import annotations

import contextlib
import inspect
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn, TypeAlias

import typer

from pretouch._core.errors import PretouchError, UnitError
from pretouch._core.files import as_json, is_own_unchanged, refuse_input
from pretouch._core.progress import listening
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

    def run_or_explain() -> int:
        try:
            run()
        except typer.Exit as ended:
            return ended.exit_code
        except _OutputError:
            raise
        except PretouchError as error:
            print_message(str(error))
            if json_wanted:
                print_text(as_json({"status": "error", "message": str(error)}))
            return _MISTAKE
        return 0

    raise typer.Exit(guard_output(run_or_explain))


def guard_output(run: Callable[[], int]) -> int:
    """Return the exit code of a command, or the one that says why its output did not arrive."""
    try:
        code = run()
        _flush_output()
    except KeyboardInterrupt:
        return _INTERRUPTED
    except OSError as error:
        failure = _output_failure(error)
        if failure is None:
            raise
        _discard_output()
        if isinstance(failure, BrokenPipeError):  # the reader has gone: nothing to explain
            return _BROKEN_PIPE
        print_message(f"standard output: cannot be written ({failure.strerror or failure})")
        return _MISTAKE
    return code


class _OutputError(PretouchError, OSError):
    """Standard output that does not take what is printed: its disk is full, its reader has gone, or it is closed."""


def _flush_output() -> None:
    if sys.stdout is not None:
        sys.stdout.flush()


def _output_failure(error: OSError) -> OSError | None:
    """Return why standard output fails; None where the error is another one."""
    if isinstance(error, _OutputError):
        return error.__cause__ if isinstance(error.__cause__, OSError) else error
    frame = error.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    printed_by = "" if frame is None else str(frame.tb_frame.f_globals.get("__name__"))
    if printed_by.partition(".")[0] in {"typer", "click"} or isinstance(error, BrokenPipeError):
        return error  # help, version, or a mistake on the command line
    try:
        _flush_output()
    except OSError as failure:  # what standard output did not take is still in its buffer
        return failure
    return None


def _discard_output() -> None:
    """Let what is still in the buffer go nowhere, so that it does not fail again when the process ends."""
    if sys.stdout is not None:
        with contextlib.suppress(OSError, ValueError):  # a stream without a descriptor
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def end(*, good: bool) -> None:
    """End a verb whose run did not come to what was asked for with the exit code of that."""
    if not good:
        raise typer.Exit(_NO_RESULT)


def print_text(text: str) -> None:
    """Print to stdout, also where it cannot show every character, and at once."""
    if sys.stdout is None:
        raise _OutputError("it is closed")
    try:
        _write(sys.stdout, text)
    except OSError as error:
        raise _OutputError(str(error)) from error


def print_message(text: str) -> None:
    """Print a message to stderr, each of its lines under our name; where it takes none, the exit code has to do."""
    with contextlib.suppress(OSError, AttributeError):  # full, or closed
        _write(sys.stderr, "\n".join(f"pretouch: {line}" for line in text.split("\n")))


def print_progress(text: str) -> None:
    """Tell a person who waits at a terminal what is under way, on stderr; where nobody watches, nothing is told."""
    if sys.stderr is not None and sys.stderr.isatty():
        print_message(text)


def print_count(solved: int, seconds: float) -> None:
    """Tell a person who waits that work goes on."""
    print_progress(f"{solved:,} encounters solved in {seconds:.0f} s, going on")


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

        def checked() -> None:
            if shown.output is not None and "file" in given:
                refuse_input(shown.output, [given["file"]])  # before anything is computed
            with listening(print_count):
                run(shown, **given)

        conclude(checked, json_wanted=shown.json)

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

    def show(
        self, result: Any, default: str, task: Task | None = None, *, good: bool, inputs: Sequence[Path] = ()
    ) -> None:
        """Print a result of a task, write its report, by default so named, and end with the exit code of its answer.

        No file that was read, which are those of the task and `inputs`, is written over.
        """
        target = self.output or Path(default)
        inputs = (*inputs, *getattr(None if task is None else task.source, "inputs", ()))
        reservations = None if task is None else reservations_about(task, result)
        text = self.told(reservations, result.to_dict, result.__str__)
        if self.json and self.output is not None:
            self._write(result, target, task, inputs)
        try:
            print_text(text)
        finally:  # an output that takes nothing does not cost the report
            if self.report and not self.json:
                self._write(result, target, task, inputs)
        if self.report and not self.json:
            print_text(f"\nReport with figures: {target}")
        end(good=good and not (reservations is not None and reservations.is_refuted))

    def told(
        self, reservations: Reservations | None, as_dict: Callable[[], dict[str, Any]], as_text: Callable[[], str]
    ) -> str:
        """Return a result as it is asked for, an object or text, amid what its calibration leaves open."""
        if self.json:
            return as_json(as_dict() if reservations is None else reservations.around_dict(as_dict()))
        return as_text() if reservations is None else reservations.around_text(as_text())

    def _write(self, result: Any, target: Path, task: Task | None, inputs: Sequence[Path]) -> None:
        refuse_input(target, inputs)
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        known: dict[str, Any] = {} if task is None else {"calibration": task.calibration, "source": task.source}
        print_progress(f"{target}: drawing the report")
        write_report(result, target, overwrite=self.force or is_own_unchanged(target), **known)
