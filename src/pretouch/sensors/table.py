"""A measured curve as it is: shape-preserving interpolation of ln xi."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive

from .model import SensorModel, _limit

__all__ = ["Table"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table(SensorModel):
    """Monotone table: ln xi interpolated between measured points by a piecewise cubic that keeps their shape.

    The interpolant (Fritsch & Carlson's, SciPy's `PchipInterpolator`) has a continuous slope g and never rises
    where the table falls. It is valid between its first and its last distance.

    Args:
        distances: l of the points [m], at least two, strictly increasing.
        outputs: xi of the points > 0, strictly decreasing, in the unit of the calibration.
        minimum_distance: smallest valid l [m]; the first distance, where that is larger.
        maximum_distance: largest valid l [m]; the last distance, where that is smaller.

    Examples:
        >>> sensor = Table(distances=(0.0, 0.01, 0.02), outputs=(4.0, 2.0, 1.0))
        >>> round(sensor.output(0.01), 12)
        2.0
    """

    distances: tuple[float, ...] = field(metadata={"points": "m"})
    outputs: tuple[float, ...] = field(metadata={"points": "output"})
    minimum_distance: float = -np.inf

    name: ClassVar[str] = "table"

    def __post_init__(self) -> None:
        distances = _column(finite(self.distances, "distances", "m"), "distances")
        outputs = _column(positive(self.outputs, "outputs"), "outputs")
        if len(distances) != len(outputs):
            raise InvalidInputError(f"outputs: found {len(outputs)} values for {len(distances)} distances")
        for name, column, sign in (("distances", distances, 1), ("outputs", outputs, -1)):
            wrong = np.flatnonzero(sign * np.diff(column) <= 0)
            if len(wrong):
                i = int(wrong[0])
                raise InvalidInputError(
                    f"{name}: found {column[i]:g} followed by {column[i + 1]:g}; a table must be strictly "
                    f"{'increasing in distance' if sign > 0 else 'decreasing in output: smooth or fit it first'}"
                )
        low, high = (_limit(getattr(self, end), end) for end in ("minimum_distance", "maximum_distance"))
        object.__setattr__(self, "distances", tuple(map(float, distances)))
        object.__setattr__(self, "outputs", tuple(map(float, outputs)))
        object.__setattr__(self, "minimum_distance", max(low, self.distances[0]))
        object.__setattr__(self, "maximum_distance", min(high, self.distances[-1]))
        SensorModel.__post_init__(self)

    def _knots(self) -> Iterable[float]:
        return self.distances  # where the second derivative of ln xi jumps

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(_interpolant(self.distances, self.outputs)(distance))

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        # where the slope vanishes, at an end of the table, the polynomial may round to just above zero
        return np.asarray(np.minimum(_interpolant(self.distances, self.outputs)(distance, 1), 0.0))


def _column(values: ArrayLike, name: str) -> FloatArray:
    column = np.asarray(values, dtype=np.float64)
    if column.ndim != 1 or len(column) < 2:
        raise InvalidInputError(f"{name}: found {values!r}, expected a list of two or more numbers")
    return column


@lru_cache(maxsize=64)
def _interpolant(distances: tuple[float, ...], outputs: tuple[float, ...]) -> Any:
    from scipy.interpolate import PchipInterpolator  # noqa: PLC0415 - SciPy is loaded only for tables

    return PchipInterpolator(np.array(distances), np.log(outputs), extrapolate=True)
