"""Define every exception class that pretouch raises on purpose.

The tree:

    PretouchError
    ├── InvalidInputError (also a ValueError)    a request that is invalid
    │   ├── UnitError                            text that is not a quantity, or has another dimension
    │   ├── OutOfRangeError                      a distance outside a sensor's valid range
    │   ├── CalibrationDataError                 a calibration file or table that cannot be read
    │   ├── ScenarioFileError                    a scenario file with a mistake in it
    │   └── OutputExistsError                    an output file that exists and must not be overwritten
    ├── MissingExtraError                        a library of an optional extra that is not installed
    ├── BrokenCoreError (also an ImportError)    the compiled core is missing, damaged or of another version
    └── ResultUnavailableError                   a part of a result that does not exist, such as a missing contact

A run without the desired outcome (no contact, infeasible constraints) is not an error: it is a result with a status.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class PretouchError(Exception):
    """The base class of all errors that pretouch raises on purpose."""


class InvalidInputError(PretouchError, ValueError):
    """An invalid request: the message gives the value, what is allowed, and what to do."""


class UnitError(InvalidInputError):
    """Text that is not a quantity, or a quantity of another dimension than expected."""


class OutOfRangeError(InvalidInputError):
    """A distance outside the valid range of the sensor model."""


class CalibrationDataError(InvalidInputError):
    """A calibration file or table that cannot be read as distances and outputs.

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
        """Make an error whose message does not quote the file."""
        return cls(message, problem=message)


class ScenarioFileError(InvalidInputError):
    """A mistake in a scenario file: the message gives the line, the key, the value, and what is expected."""


class OutputExistsError(InvalidInputError):
    """An output file that exists already; pretouch overwrites it only on request."""


class MissingExtraError(PretouchError):
    """A library of an optional extra is needed but not installed; the message says how to install it."""


class BrokenCoreError(PretouchError, ImportError):
    """The compiled core is missing, damaged or of another version; the message says how to restore it."""


class ResultUnavailableError(PretouchError):
    """A part of a result that does not exist, such as the contact of a run without contact."""


def require(module: str, *, extra: str = "sweep") -> Any:
    """Load a library of an optional extra.

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
            f"{name}: this call needs a library that is not installed; install it with: pip install 'pretouch[{extra}]'"
        ) from None
