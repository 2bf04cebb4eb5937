"""Define the exceptions that pretouch raises, and a function that imports optional libraries."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import Any, NamedTuple


class PretouchError(Exception):
    """Base class of all errors that pretouch raises on purpose.

    Programs read the attributes instead of the message, whose words may change.

    Args:
        message: what is wrong, what is allowed and what to do. It begins with the argument and a colon.
        argument: what is wrong; by default the text before the first colon of the message.
        value: the wrong value; None if the error has no single value.
        limit: what is allowed; None if this is not a number or a list.
        remedy: a name or an option that helps; empty if the remedy is not a single word.

    Attributes:
        value (Any): the wrong value, as given; after pickle only if it is a number, a text, or a tuple of these.
        limit (Any): a number, a pair of numbers, or the allowed names as a tuple.
        remedy (str): the correct name of a misspelled one, or an option such as --force.

    Examples:
        >>> import pretouch as pt
        >>> try:
        ...     pt.Admittance(mass=-1.0, damping=10.0, stiffness=25.0)
        ... except pt.errors.InvalidInputError as error:
        ...     print(error.argument, error.value, error.limit)
        mass -1.0 (0.0, inf)
    """

    def __init__(
        self, message: str = "", *, argument: str | None = None, value: Any = None, limit: Any = None, remedy: str = ""
    ) -> None:
        super().__init__(message)
        self._argument, self.value, self.limit, self.remedy = argument, value, limit, remedy

    def __reduce__(self) -> Any:
        """Return the state for pickle, without a value that may be impossible to pickle, such as a function."""
        items = self.value if isinstance(self.value, tuple | list) else (self.value,)
        plain = all(isinstance(item, bool | int | float | complex | str | bytes | None) for item in items)
        return type(self), self.args, vars(self) if plain else {**vars(self), "value": None}

    @property
    def fields(self) -> dict[str, Any]:
        """Value, limit and remedy, for an error that repeats this one with a place in a file."""
        return {"value": self.value, "limit": self.limit, "remedy": self.remedy}

    @property
    def argument(self) -> str:
        """The argument, option, key of a file, or file that is wrong.

        It is empty if the message does not begin with one.
        """
        if self._argument is not None:
            return self._argument
        subject, colon, _ = str(self).partition(": ")
        return subject if colon else ""


class InvalidInputError(PretouchError, ValueError):
    """Raised for an invalid input.

    The message gives the value, the allowed values and a remedy.
    """


class UnitError(InvalidInputError):
    """Raised for an invalid quantity or a wrong unit."""


class OutOfRangeError(InvalidInputError):
    """Raised for a distance outside the valid range of a sensor curve."""


class CalibrationDataError(InvalidInputError):
    """Raised for a calibration file without usable distances and sensor outputs.

    Args:
        message: what is wrong; it may quote the file.
        problem: the same without any content of the file, for readers who must not see it; empty if there is no such
            message.
        fields: argument, value, limit and remedy, as in PretouchError.
    """

    def __init__(self, message: str = "", *, problem: str = "", **fields: Any) -> None:
        super().__init__(message, **fields)
        self.problem = problem

    @classmethod
    def without_content(cls, message: str, **fields: Any) -> CalibrationDataError:
        """Create an error without any content of the calibration file."""
        return cls(message, problem=message, **fields)


class FileMistake(NamedTuple):
    """A mistake in a scenario file.

    Args:
        line: the line of the file.
        key: the key with its section, such as admittance.mass; empty if the mistake belongs to no key.
        sentence: what is wrong, what is allowed and what to do.
    """

    line: int
    key: str
    sentence: str


class ScenarioFileError(InvalidInputError):
    """Raised for a mistake in a scenario file.

    The message gives the line, the key, the value and the allowed values. The argument of the error is the key of the
    first mistake, without it the file.

    Args:
        message: the mistakes, each in a line.
        mistakes: the mistakes by line; empty if the file as a whole is wrong.
        fields: argument, value, limit and remedy, as in PretouchError.

    Attributes:
        mistakes (tuple[FileMistake, ...]): line, key and sentence of each mistake.
    """

    def __init__(self, message: str = "", *, mistakes: Iterable[FileMistake] = (), **fields: Any) -> None:
        super().__init__(message, **fields)
        self.mistakes = tuple(mistakes)


class OutputExistsError(InvalidInputError):
    """Raised if an output file already exists and must not be overwritten."""


class MissingExtraError(PretouchError):
    """Raised if a required optional library is not installed.

    The message says how to install the library.
    """


class OutputError(PretouchError, OSError):
    """Raised if an output file cannot be written, although the request is valid.

    Examples are a full disk and a missing permission. The message gives the path and the reason.
    """


class SourceError(PretouchError):
    """Raised if the source of the sensor readings fails.

    An example is an unplugged sensor. The message says what to do.
    """


class BrokenCoreError(PretouchError, ImportError):
    """Raised if the compiled library of pretouch cannot be used.

    The library is missing, damaged or of another version. The message gives the remedy.
    """


class ResultUnavailableError(PretouchError):
    """Raised if a requested part of a result does not exist.

    An example is the contact speed of a run without contact.
    """


def require(module: str, *, extra: str = "sweep") -> Any:
    """Import an optional library.

    Args:
        module: name of the module.
        extra: the extra of pretouch that installs it.

    Returns:
        The module.

    Raises:
        MissingExtraError: the library is not installed.
        ModuleNotFoundError: the library is installed, but one of its own dependencies is not.

    Examples:
        >>> require("json").__name__
        'json'
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise  # the original message is more specific
        name = module.partition(".")[0]
        raise MissingExtraError(
            f"{name}: this Python library is required, but it is not installed; install it with: pip "
            f"install 'pretouch[{extra}]'",
            remedy=f"pip install 'pretouch[{extra}]'",
        ) from None
