"""What the verbs share: one object on stdout, one sentence on stderr, one exit code, one file that is never lost."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

import typer

from pretouch._core.errors import PretouchError
from pretouch._core.files import is_own_unchanged
from pretouch._core.json_text import as_json

if TYPE_CHECKING:
    from pretouch.uncertainty import Reservations

__all__ = ["MISTAKE", "NO_RESULT", "OK", "Presentation", "Result", "conclude", "print_progress", "print_text"]

OK = 0
"""The run came to what was asked for."""

NO_RESULT = 1
"""The run ended well and its answer is no: infeasible, no contact, no usable signal, not reproduced."""

MISTAKE = 2
"""The request makes no sense: a mistake in a file or on the command line, or an output that would be overwritten."""


class Result(Protocol):
    """What every verb comes to: text for a person, an object for a program."""

    def to_dict(self) -> dict[str, Any]:
        """Return the result as one JSON object, all SI."""


_INTERRUPTED = 130
_BROKEN_PIPE = 141


def conclude(run: Callable[[], int], *, json_wanted: bool) -> NoReturn:
    """Run a verb and end with its exit code; mistakes become one message, everything unexpected keeps its traceback.

    Args:
        run: the verb; it returns its exit code.
        json_wanted: whether a mistake is printed as an object on stdout, too.

    Raises:
        Exit: always, with the exit code.
    """
    try:
        try:
            code = run()
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
        self,
        result: Result,
        default: str,
        write: Callable[[Path, bool], object],
        reservations: Reservations | None = None,
    ) -> None:
        """Print a result and write its report.

        Args:
            result: what is printed.
            default: name of the report where none is given.
            write: writes the report, given its path and whether a file there may be replaced.
            reservations: what the calibration of the sensor leaves open of the result, where there is one.
        """
        target = self.output or Path(default)
        if self.json:
            found = result.to_dict()
            text = as_json(found if reservations is None else reservations.around_dict(found))
            if self.output is not None:
                self._write(target, write)
            print_text(text)
            return
        print_text(str(result) if reservations is None else reservations.around_text(str(result)))
        if self.report:
            self._write(target, write)
            print_text(f"\nReport with figures: {target}")

    def _write(self, target: Path, write: Callable[[Path, bool], object]) -> None:
        write(target, self.force or is_own_unchanged(target))
