"""Provide the options, terminal output and exit codes that all subcommands share."""

from __future__ import annotations

import contextlib
import inspect
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn, TypeAlias

import typer

from pretouch._core.errors import OutputError, OutputExistsError, PretouchError, UnitError
from pretouch._core.files import as_json, is_own_unchanged, refuse_input
from pretouch._core.progress import listening
from pretouch._core.units import read_quantity
from pretouch._core.warning_codes import caution

if TYPE_CHECKING:
    from pretouch.designs import Task
    from pretouch.motion import ContinuousLaw
    from pretouch.uncertainty import Reservations


ScenarioFile: TypeAlias = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).")]
_OPTIONS: Final[dict[str, tuple[Any, Any]]] = {
    "json": (
        Annotated[
            bool,
            typer.Option("--json", help="Print only a JSON object, in SI; write a report only with --output."),
        ],
        False,
    ),
    "output": (
        Annotated[Path | None, typer.Option("--output", "-o", metavar="PATH", help="Path of the HTML report.")],
        None,
    ),
    "verbose": (
        Annotated[bool, typer.Option("--verbose", "-v", help="Print all tables instead of a summary.")],
        False,
    ),
    "report": (Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report.")], True),
    "force": (
        Annotated[
            bool,
            typer.Option(
                "--force",
                help="Overwrite any file at the path of the report; without it, only an unchanged report of pretouch.",
            ),
        ],
        False,
    ),
}
"""The options of all verbs on how a result is shown, each with its default."""

_NO_RESULT: Final = 1  # negative answer: infeasible, no contact, no usable signal, not reproduced
_MISTAKE: Final = 2  # mistake in a file or on the command line, or an output that exists
_NOT_WRITTEN: Final = 3  # standard output or a requested file cannot be written
_INTERRUPTED: Final = 130
_BROKEN_PIPE: Final = 141


def option(metavar: str, description: str, **more: Any) -> Any:
    """Return a command-line option with a help text.

    `metavar` is the placeholder for its value, such as PATH.
    """
    return typer.Option(metavar=metavar, help=description, **more)


def read_gain(text: str | None, law: ContinuousLaw) -> float | None:
    """Parse the option --gain in the control law's unit. The result is None if the option is missing."""
    try:
        return None if text is None else read_quantity(text, law.number.unit, name="--gain")
    except UnitError as error:
        raise UnitError(f"{error}, the unit of law kind {law.kind}", **error.fields) from None


def conclude(run: Callable[[], object], *, json_wanted: bool) -> NoReturn:
    """Run a command and exit with its status.

    Errors are printed as messages without traceback. With `json_wanted`, an error is also printed as a JSON object on
    stdout. Unexpected exceptions keep their traceback.

    Raises:
        Exit: always, with the exit code.
    """

    def run_or_explain() -> int:
        try:
            run()
        except typer.Exit as ended:
            return ended.exit_code
        except _StandardOutputError:
            raise
        except PretouchError as error:
            print_message(str(error))
            if json_wanted:
                print_text(as_json({"status": "error", "message": str(error)}))
            return _NOT_WRITTEN if isinstance(error, OutputError) else _MISTAKE
        return 0

    raise typer.Exit(guard_output(run_or_explain))


def guard_output(run: Callable[[], int]) -> int:
    """Run a command and return its exit status. The status differs if writing to standard output fails."""
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
        if isinstance(failure, BrokenPipeError):  # the reader has closed the pipe, so nobody reads a message
            return _BROKEN_PIPE
        print_message(f"standard output: cannot be written ({failure.strerror or failure})")
        return _NOT_WRITTEN
    return code


class _StandardOutputError(OutputError):
    """Error that is raised if standard output cannot be written. Examples are a full disk or a closed pipe."""


def _flush_output() -> None:
    if sys.stdout is not None:
        sys.stdout.flush()


def _output_failure(error: OSError) -> OSError | None:
    """Return the standard-output failure that caused an error. The result is None if the error has another cause."""
    if isinstance(error, _StandardOutputError):
        return error.__cause__ if isinstance(error.__cause__, OSError) else error
    frame = error.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    printed_by = "" if frame is None else str(frame.tb_frame.f_globals.get("__name__"))
    if printed_by.partition(".")[0] in {"typer", "click"} or isinstance(error, BrokenPipeError):
        return error  # help, version, or a mistake on the command line
    try:
        _flush_output()
    except OSError as failure:  # unwritten output is still in the buffer
        return failure
    return None


def _discard_output() -> None:
    """Discard the buffered standard output. Otherwise, flushing at exit would fail a second time."""
    if sys.stdout is not None:
        with contextlib.suppress(OSError, ValueError):  # a stream without a descriptor
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def end(*, good: bool) -> None:
    """Exit with status 1 if the result is negative. An example is that no gain was found."""
    if not good:
        raise typer.Exit(_NO_RESULT)


def print_text(text: str) -> None:
    """Print a text to standard output. Characters that standard output cannot encode are replaced."""
    if sys.stdout is None:
        raise _StandardOutputError("it is closed")
    try:
        _write(sys.stdout, text)
    except OSError as error:
        raise _StandardOutputError(str(error)) from error


def print_message(text: str) -> None:
    """Print a message of the program to standard error.

    Each line begins with the name of the program. Failures are ignored. The exit status reports the problem in any
    case.
    """
    with contextlib.suppress(OSError, AttributeError):  # full, or closed
        _write(sys.stderr, "\n".join(f"pretouch: {line}" for line in text.split("\n")))


def print_progress(text: str) -> None:
    """Print a progress message to standard error.

    Nothing is printed if standard error is not a terminal.
    """
    if sys.stderr is not None and sys.stderr.isatty():
        print_message(text)


def _write(stream: Any, text: str) -> None:
    encoding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(encoding, "replace").decode(encoding) + "\n")
    stream.flush()


def reservations_about(task: Task, answer: Any) -> Reservations | None:
    """Return the calibration warnings for a design or simulation result.

    The result is None without a calibration, and for results without a predicted encounter, such as a replay.
    """
    if task.calibration is None:
        return None
    from pretouch.uncertainty import reservations_apply, reservations_of  # noqa: PLC0415 - the compiled kernels, only when needed

    if not reservations_apply(answer):
        return None
    return reservations_of(task.calibration, answer, subtracted=task.subtracted_offset)


def verb(run: Callable[..., None]) -> Callable[..., None]:
    """Create a pretouch command from a function that prints one result.

    The output options that all commands share are added.

    Args:
        run: function of a `Presentation` and of its own options, by name. Its docstring is the help text.

    Returns:
        The command.
    """

    @wraps(run)
    def command(**options: Any) -> None:
        shown = Presentation(**{name: options.pop(name) for name in _OPTIONS})

        def checked() -> None:
            if shown.output is not None and "file" in options:
                refuse_input(shown.output, [options["file"]])  # before anything is computed
            with listening(print_progress):
                run(shown, **options)

        conclude(checked, json_wanted=shown.json)

    specific = list(inspect.signature(run, eval_str=True).parameters.values())[1:]
    keyword = inspect.Parameter.KEYWORD_ONLY
    shared = [
        inspect.Parameter(name, keyword, annotation=a, default=default) for name, (a, default) in _OPTIONS.items()
    ]
    parameters = [*specific, *shared]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return command


@dataclass(frozen=True, slots=True, kw_only=True)
class Presentation:
    """The options of a command that determine how its result is shown.

    Args:
        json: whether to print only a JSON object on stdout.
        verbose: whether to print all tables instead of a summary.
        output: path of the report; None for the default path.
        report: whether to write a report, unless `json` is set.
        force: whether any file may be replaced; otherwise only an unchanged report of pretouch.
    """

    json: bool
    verbose: bool
    output: Path | None
    report: bool
    force: bool

    def show(
        self,
        result: Any,
        default: str,
        task: Task | None = None,
        *,
        good: bool,
        inputs: Sequence[Path] = (),
        lines: int | None = 15,
        files: Sequence[str] = (),
    ) -> None:
        """Print a result, write its report and exit.

        The exit status is that of the result. The text has at most `lines` lines, unless that is None or the option
        --verbose is given. The files that were read, those of the task and `inputs`, are never overwritten. `files` are
        lines about other files that were written, which follow the text.
        """
        target = self.output or Path(default)
        inputs = (*inputs, *getattr(None if task is None else task.source, "inputs", ()))
        reservations = None if task is None else reservations_about(task, result)
        if lines is None or self.json or self.verbose:
            text = self.formatted(reservations, result.to_dict, result.__str__)
        else:
            text = self._summary(result, reservations, lines - self.report - len(files))
        written = self._write(result, target, task, inputs) if self.json and self.output is not None else False
        try:
            print_text(text)
        finally:  # the report is written even if standard output fails
            if self.report and not self.json:
                written = self._write(result, target, task, inputs)
        if written and not self.json:
            files = (*files, f"Report with figures: {target}")
        if files and not self.json:
            gap = "\n" if lines is None or self.verbose else ""
            print_text(gap + "\n".join(files))
        end(good=good and not (reservations is not None and reservations.is_refuted))

    def formatted(
        self, reservations: Reservations | None, as_dict: Callable[[], dict[str, Any]], as_text: Callable[[], str]
    ) -> str:
        """Return a result as JSON or text.

        The warnings about the sensor's calibration are included.
        """
        if self.json:
            return as_json(as_dict() if reservations is None else reservations.around_dict(as_dict()))
        return as_text() if reservations is None else reservations.around_text(as_text())

    def _summary(self, result: Any, reservations: Reservations | None, lines: int) -> str:
        """Return the terminal's summary of a result. The verdict on the sensor calibration is included."""
        from pretouch.report.pages import page_of  # noqa: PLC0415 - `pretouch --help` stays fast

        from .summary import summary_of, wrapped  # noqa: PLC0415

        opening = () if reservations is None or reservations.headline is None else (reservations.headline,)
        calibration = () if reservations is None else tuple(wrapped(reservations.verdict, indent="  "))
        ending = (*calibration, "All numbers: --verbose")
        page = page_of(result)
        if reservations is not None:
            page = replace(page, headline=reservations.with_spread(page.headline))
        return summary_of(page, lines=lines, opening=opening, ending=ending)

    def _write(self, result: Any, target: Path, task: Task | None, inputs: Sequence[Path]) -> bool:
        """Write the report of a result.

        A problem of the report does not change the exit status of the result, unless the report was requested with
        --output: then a missing report is an error.

        Returns:
            Whether the report was written.

        Raises:
            OutputError: the requested report cannot be written.
        """
        refuse_input(target, inputs)
        from pretouch.report import write_report  # noqa: PLC0415 - Matplotlib, only when needed

        origin: dict[str, Any] = {} if task is None else {"calibration": task.calibration, "source": task.source}
        origin |= {} if task is None else {"subtracted_offset": task.subtracted_offset}
        print_progress(f"{target}: drawing the report")
        overwrite = self.force or is_own_unchanged(target)
        try:
            write_report(result, target, overwrite=overwrite, warn=print_message, **origin)
        except Exception as error:
            if isinstance(error, OutputExistsError) or not target.absolute().parent.is_dir():
                raise  # a mistake in the request
            reason = str(error) if isinstance(error, PretouchError) else f"{type(error).__name__}: {error}"
            advice = "Choose another path with --output, or use --no-report"
            text = caution("PT423", f"The report was not written. The reason is: {reason}. {advice}")
            if self.output is not None:
                raise OutputError(text) from error
            print_message(text)
            return False
        return True
