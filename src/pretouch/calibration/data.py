"""Store sensor readings at known distances and their source file."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import CalibrationDataError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import MAGNITUDES, WORKABLE
from pretouch._core.values import Value

_CLEAR: Final = 0.5  # rank correlation of position and output from which on the side of the contact is clear
_OFTEN: Final = 0.2  # share of the readings, from which on one negative distance is no code for "no object"


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance(Value):
    """Source file of a calibration and its interpretation.

    Args:
        file: name of the file.
        sha256: SHA-256 of its bytes, in hexadecimal digits.
        encoding: text encoding of the file.
        delimiter: delimiter between its columns.
        decimal_mark: `.` or `,`.
        distance_column: header of the distance column.
        output_column: header of the output column.
        label_columns: headers of the columns whose values distinguish the curves of the file.
        rows: number of rows that belong to this curve, including dropped ones.
        dropped: number of rows whose output was empty or NaN; they are not used.
        notes: assumptions, in sentences.
    """

    file: str
    sha256: str
    encoding: str
    delimiter: str
    decimal_mark: str
    distance_column: str
    output_column: str
    label_columns: tuple[str, ...] = ()
    rows: int
    dropped: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Calibration(Value):
    """Readings of a proximity sensor at known distances.

    All readings belong to one object.

    Args:
        distances: l of every reading [m], shape (N,), not negative, in any order; repeated readings have equal
            distances.
        outputs: y of every reading, shape (N,), in `unit`.
        unit: unit of the outputs, such as `V` or `counts`; may be empty.
        no_object: readings with no object in range, shape (M,), in `unit`; may be empty.
        label: the label of this curve among others of the same file, such as `day=30, sensor=1`.
        source: the file from which the readings were read; None for numbers from Python.

    Raises:
        CalibrationDataError: the columns differ in length or are empty, a number is not finite, too large or too small
            to compute with, or a distance is negative.

    Examples:
        >>> measured = Calibration(distances=[0.0, 0.01, 0.01], outputs=[2.0, 1.0, 1.2], unit="V")
        >>> measured.distinct_distances
        array([0.  , 0.01])
    """

    distances: FloatArray = field(metadata={"checked": False})  # checked by _column
    outputs: FloatArray = field(metadata={"checked": False})
    unit: str = ""
    no_object: FloatArray = field(default_factory=lambda: np.empty(0), metadata={"checked": False})
    label: str = ""
    source: Provenance | None = None

    def __post_init__(self) -> None:
        check_types(self)
        for name, unit in (("distances", "m"), ("outputs", self.unit), ("no_object", self.unit)):
            object.__setattr__(self, name, _column(getattr(self, name), name, unit))
        if len(self.distances) != len(self.outputs):
            raise CalibrationDataError(
                f"outputs: found {len(self.outputs)} values for {len(self.distances)} distances, expected one output "
                "for each distance"
            )
        if not len(self.distances):
            raise CalibrationDataError("distances: found none, expected at least one reading with an object in range")
        if self.distances.min() < 0:
            raise CalibrationDataError(
                f"distances: found {self.distances.min():g} m, but distances must not be negative; "
                f"{if_negative(self.distances, self.outputs)}"
            )

    @property
    def distinct_distances(self) -> FloatArray:
        """The different distances [m] at which readings were taken, in increasing order."""
        return np.unique(self.distances)

    @property
    def labels(self) -> dict[str, str]:
        """The labels of this curve by label column.

        Examples:
            >>> Calibration(distances=[0.0], outputs=[2.0], label="day=30, sensor=1").labels
            {'day': '30', 'sensor': '1'}
        """
        columns = () if self.source is None else self.source.label_columns
        pattern = ", ".join(f"{re.escape(column)}=(.*)" for column in columns)  # a label may contain a comma
        match = re.fullmatch(pattern, self.label, re.DOTALL) if columns else None
        if match is not None:
            return dict(zip(columns, match.groups(), strict=True))
        return dict(part.partition("=")[::2] for part in self.label.split(", ") if part)

    def __repr__(self) -> str:
        readings = f"{len(self.outputs)} readings at {len(self.distinct_distances)} distances"
        return f"<Calibration {self.name}: {readings}, {len(self.no_object)} without an object>"

    @property
    def name(self) -> str:
        """The file name and label of a calibration.

        Report titles show this name.
        """
        parts = [self.source.file if self.source else "", self.label]
        return ", ".join(part for part in parts if part) or "calibration"


def if_negative(distances: FloatArray, outputs: FloatArray) -> str:
    """Return what to do with negative distances, such as positions of a stage whose zero is not at contact.

    Args:
        distances: all distances of a calibration [m]; infinite without an object.
        outputs: the outputs; both may be empty if they are unknown.
    """
    code = "if the number means that no object was found, write inf instead; if it is wrong, remove the reading"
    stage = f"if these are positions, such as those of a stage, {if_positions(distances, outputs)}"
    negative = distances[distances < 0]
    is_code = 0 < len(negative) < _OFTEN * len(distances) and len(set(negative)) == 1
    return f"{code}; {stage}" if is_code else f"{stage}; {code}"


def if_positions(distances: FloatArray, outputs: FloatArray) -> str:
    """Return how positions of a stage become distances from contact.

    The output is larger near contact, so it shows on which side of the positions the contact is.

    Args:
        distances: the positions [m]; infinite without an object.
        outputs: the outputs; both may be empty if they are unknown.
    """
    near = np.isfinite(distances) & np.isfinite(outputs)
    position, output = distances[near], outputs[near]
    tendency = 0.0
    if len(set(position)) > 1 and len(set(output)) > 1:
        first, second = (np.unique(values, return_inverse=True)[1] for values in (position, output))
        tendency = float(np.corrcoef(first, second)[0, 1])
    minus, subtract = "replace each by P minus the position", "subtract P from each"
    contact = ", where P is the position at contact"
    if tendency > _CLEAR:
        signs = " (change the sign of all if P is 0)" if position.max() <= 0 else ""
        return f"{minus}{contact}{signs}, because the output rises with the position"
    if tendency < -_CLEAR:
        return f"{subtract}{contact}"
    return f"{minus} if they count backward, or else {subtract}{contact}"


def _column(values: ArrayLike, name: str, unit: str) -> FloatArray:
    try:
        column = np.atleast_1d(finite(values, name, unit))
    except ValueError as error:
        raise CalibrationDataError(str(error)) from None
    if column.ndim != 1:
        raise CalibrationDataError(f"{name}: found an array of shape {column.shape}, expected a one-dimensional array")
    column = np.array(column, dtype=np.float64)
    size = np.abs(column)
    beyond = column[(size != 0) & ~((size >= MAGNITUDES[0]) & (size <= MAGNITUDES[1]))]
    if beyond.size:
        raise CalibrationDataError(f"{name}: found {f'{beyond[0]:g} {unit}'.rstrip()}, expected numbers {WORKABLE}")
    column.setflags(write=False)
    return column
