"""What both verbs share: one object on stdout, one sentence on stderr, one exit code, one file that is never lost."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NoReturn, Protocol

import typer

from pretouch._core.errors import PretouchError
from pretouch._core.files import is_own_unchanged

__all__ = ["MISTAKE", "NO_RESULT", "OK", "Presentation", "Result", "as_json", "conclude", "plain", "print_text"]

OK = 0
"""The run came to what was asked for."""

NO_RESULT = 1
"""The run ended well and its answer is no: infeasible, no contact, no usable signal."""

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


def _write(stream: Any, text: str) -> None:
    encoding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(encoding, "replace").decode(encoding) + "\n")
    stream.flush()


def as_json(value: Mapping[str, Any]) -> str:
    """Write an object as JSON that every reader accepts.

    Args:
        value: the object.

    Returns:
        JSON in ASCII, indented.

    Examples:
        >>> print(as_json({"gain": -0.75, "horizon": float("inf")}))
        {
          "gain": -0.75,
          "horizon": null
        }
    """
    return json.dumps(plain(value), indent=2, allow_nan=False)


def plain(value: Any) -> Any:
    """Turn a value into what JSON can hold; a number that is not finite becomes null.

    Args:
        value: anything a result may hold: numbers and arrays of NumPy, tuples, enumerations, paths.

    Returns:
        The same in dicts, lists, text, numbers, truth values and None.

    Examples:
        >>> plain({"low": float("-inf"), "pair": (1, 2.5)})
        {'low': None, 'pair': [1, 2.5]}
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, Enum):
        return plain(value.value)
    if hasattr(value, "tolist"):  # scalars and arrays of NumPy
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)


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

    def show(self, result: Result, default: str, write: Callable[[Path, bool], object]) -> None:
        """Print a result and write its report.

        Args:
            result: what is printed.
            default: name of the report where none is given.
            write: writes the report, given its path and whether a file there may be replaced.
        """
        target = self.output or Path(default)
        if self.json:
            text = as_json(result.to_dict())
            if self.output is not None:
                self._write(target, write)
            print_text(text)
            return
        print_text(str(result))
        if self.report:
            self._write(target, write)
            print_text(f"\nReport with figures: {target}")

    def _write(self, target: Path, write: Callable[[Path, bool], object]) -> None:
        write(target, self.force or is_own_unchanged(target))
