"""Every error that pretouch raises on purpose.

The tree:

    PretouchError
    ├── InvalidInputError (also a ValueError)    a request that makes no sense
    │   ├── UnitError                            a text that is no quantity, or one of another dimension
    │   ├── OutOfRangeError                      a distance outside a sensor's valid range
    │   ├── CalibrationDataError                 a calibration file or table that cannot be read
    │   ├── ScenarioFileError                    a scenario file with a mistake in it
    │   └── OutputExistsError                    a file that would have to be overwritten unasked
    ├── MissingExtraError                        a library of an optional extra that is not installed
    ├── BrokenCoreError (also an ImportError)    the compiled core is missing, damaged or of another version
    └── ResultUnavailableError                   reading a result that the run did not reach

A run that ends badly (no contact, infeasible constraint) is no error: it is a result with a status.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class PretouchError(Exception):
    """The root of the tree: catch this to catch everything that pretouch raises on purpose."""


class InvalidInputError(PretouchError, ValueError):
    """A request that makes no sense: the message says what was got, what must hold and what to try."""


class UnitError(InvalidInputError):
    """A text that is no quantity, or a quantity of another dimension than the one expected."""


class OutOfRangeError(InvalidInputError):
    """A distance at which the sensor model says nothing."""


class CalibrationDataError(InvalidInputError):
    """A calibration file or table that cannot be read as distances and outputs.

    Args:
        message: what is wrong, with what stands there.
        problem: the same without any content of the file, for readers who did not choose the file; empty for none.
    """

    def __init__(self, message: str, *, problem: str = "") -> None:
        super().__init__(message)
        self.problem = problem

    @classmethod
    def without_content(cls, message: str) -> CalibrationDataError:
        """Make an error whose message quotes nothing of the file."""
        return cls(message, problem=message)


class ScenarioFileError(InvalidInputError):
    """A mistake in a scenario file: the message names the line, the key, what was found, what is expected."""


class OutputExistsError(InvalidInputError):
    """A file that stands where an output should go and that pretouch will not overwrite unasked."""


class MissingExtraError(PretouchError):
    """A library of an optional extra that this call needs and that is not installed: the message says how to."""


class BrokenCoreError(PretouchError, ImportError):
    """The compiled core is missing, damaged or of another version: the message says how to get it back."""


class ResultUnavailableError(PretouchError):
    """A part of a result that this run did not reach, such as the contact of a run without contact."""


def require(module: str, *, extra: str = "sweep") -> Any:
    """Load a library of an optional extra.

    Args:
        module: its name.
        extra: the extra of pretouch that installs it.

    Returns:
        The module.

    Raises:
        MissingExtraError: it is not installed.
        ModuleNotFoundError: it is, but something that it needs is not.

    Examples:
        >>> require("json").__name__
        'json'
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise  # its own message says more
        name = module.partition(".")[0]
        raise MissingExtraError(
            f"{name}: found no such library, which this call needs; install it with: pip install 'pretouch[{extra}]'"
        ) from None
