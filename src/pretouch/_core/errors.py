"""Define the exceptions that pretouch raises, and a function that imports optional libraries."""

from __future__ import annotations

from importlib import import_module
from typing import Any


class PretouchError(Exception):
    """Base class of all errors that pretouch raises on purpose."""


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
    """

    def __init__(self, message: str, *, problem: str = "") -> None:
        super().__init__(message)
        self.problem = problem

    @classmethod
    def without_content(cls, message: str) -> CalibrationDataError:
        """Create an error without any content of the calibration file."""
        return cls(message, problem=message)


class ScenarioFileError(InvalidInputError):
    """Raised for a mistake in a scenario file.

    The message gives the line, the key, the value and the allowed values.
    """


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
            f"install 'pretouch[{extra}]'"
        ) from None
