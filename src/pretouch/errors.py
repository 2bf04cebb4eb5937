"""Provide the exception classes of pretouch, such as `InvalidInputError`.

The tree:

    PretouchError
    ├── InvalidInputError (also a ValueError)    a request that is invalid
    │   ├── UnitError                            text that is not a quantity, or has another dimension
    │   ├── OutOfRangeError                      a distance outside a sensor's valid range
    │   ├── CalibrationDataError                 a calibration file or table that cannot be read
    │   ├── ScenarioFileError                    a scenario file with a mistake in it
    │   └── OutputExistsError                    an output file that exists and must not be overwritten
    ├── OutputError (also an OSError)            an output file that cannot be written, such as on a full disk
    ├── MissingExtraError                        a library of an optional extra that is not installed
    ├── SourceError                              a sensor that cannot be read, or that stopped
    ├── BrokenCoreError (also an ImportError)    the compiled core is missing, damaged or of another version
    └── ResultUnavailableError                   a part of a result that does not exist, such as a missing contact

Every error has the attributes `argument` (the argument, option, file key or file that is wrong), `value` (what was
given), `limit` (what is allowed) and `remedy` (a name or an option that helps). A `ScenarioFileError` also has
`mistakes`, with line, key and sentence of each. Programs read these attributes instead of the message, whose words may
change.

A run without the desired outcome (no contact, infeasible constraints) is not an error: it is a result with a status.
"""

from ._core.errors import (
    BrokenCoreError,
    CalibrationDataError,
    FileMistake,
    InvalidInputError,
    MissingExtraError,
    OutOfRangeError,
    OutputError,
    OutputExistsError,
    PretouchError,
    ResultUnavailableError,
    ScenarioFileError,
    SourceError,
    UnitError,
)

__all__ = [
    "BrokenCoreError",
    "CalibrationDataError",
    "FileMistake",
    "InvalidInputError",
    "MissingExtraError",
    "OutOfRangeError",
    "OutputError",
    "OutputExistsError",
    "PretouchError",
    "ResultUnavailableError",
    "ScenarioFileError",
    "SourceError",
    "UnitError",
]
