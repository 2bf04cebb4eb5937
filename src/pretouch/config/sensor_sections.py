"""The section [sensor] of a scenario file, in its variants."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Field

from .quantities import Quantity, UnfitValueError
from .section import LENGTH, Section, list_of, name_of, text

__all__ = [
    "SENSOR_SECTIONS",
    "CalibratedSensor",
    "ExponentialFirstOrderSensor",
    "ExponentialSecondOrderSensor",
    "InversePowerSensor",
    "MittagLefflerSensor",
    "SensorSection",
    "TableSensor",
]

_SCALE: Final = Quantity(unit="output", example="1.0", sign="positive")
_RATE: Final = Quantity(unit="1/m", example='"-61 1/m"', sign="negative")
_OUTPUT: Final = Quantity(unit="output", example="0.12")
_SEARCHED: Final = ("auto", "none")
_MODELS: Final = ("inverse-power", "exponential-1", "exponential-2", "mittag-leffler", "table")


def _labels(value: Any) -> dict[str, str | int | float]:
    if not isinstance(value, Mapping) or not all(type(label) in {str, int, float} for label in value.values()):
        raise UnfitValueError("expected a table of label columns, for example { day = 30, sensor = 4 }")
    return dict(value)


def _columns(value: Any) -> dict[str, str | int]:
    if (
        not isinstance(value, Mapping)
        or not set(value) <= {"distance", "output"}
        or not all(type(column) in {str, int} for column in value.values())
    ):
        raise UnfitValueError(
            "expected a table of distance and output, each a header, a number or a unit, for example "
            '{ distance = 1, output = "3 [V]" }'
        )
    return dict(value)


def _names(value: Any) -> list[str | int]:
    if not isinstance(value, list) or not all(type(name) in {str, int} for name in value):
        raise UnfitValueError('expected a list of headers or numbers of columns, for example ["day", "sensor"]')
    return list(value)


def _one_unit(value: Any) -> Any:
    """Refuse a list of outputs that mixes units: volts and counts have no common scale."""
    texts = [v for v in value if isinstance(v, str)] if isinstance(value, list) else []
    if len({"count" if "count" in t else "V" if "V" in t or "volt" in t else "" for t in texts}) > 1:
        raise UnfitValueError("expected outputs of one unit, all in V or all in counts")
    return value


def _level_or_file(value: Any) -> float | str:
    """Read a no-object level; text that ends like a file name is the path of a file."""
    if isinstance(value, str) and re.search(r"\.[A-Za-z]\w*$", value):
        return value
    try:
        return _OUTPUT.read(value)
    except UnfitValueError:
        raise UnfitValueError(f'expected {_OUTPUT.expected}, or a file such as "dark.csv"') from None


class SensorSection(Section):
    """The keys that every sensor takes; all distances are measured from the contact surface, except `recess`."""

    recess: Annotated[float | None, LENGTH] = None
    minimum_distance: Annotated[float | None, LENGTH] = None
    maximum_distance: Annotated[float | None, Quantity(unit="m", example='"0.1 m"', infinite=True)] = None


class InversePowerSensor(SensorSection):
    """`model = "inverse-power"`, L(3)."""

    model: str
    scale: Annotated[float, _SCALE]
    distance_offset: Annotated[float, Quantity(unit="m", example='"41.9 mm"')]
    exponent: Annotated[float, Quantity(unit="", example="3.32", sign="positive")]


class ExponentialFirstOrderSensor(SensorSection):
    """`model = "exponential-1"`, L(5)."""

    model: str
    scale: Annotated[float, _SCALE]
    rate: Annotated[float, _RATE]


class ExponentialSecondOrderSensor(SensorSection):
    """`model = "exponential-2"`, L(6)."""

    model: str
    scale: Annotated[float, _SCALE]
    rate: Annotated[float, _RATE]
    curvature: Annotated[float, Quantity(unit="1/m^2", example='"474 1/m^2"')]


class MittagLefflerSensor(SensorSection):
    """`model = "mittag-leffler"`."""

    model: str
    scale: Annotated[float, _SCALE]
    rate: Annotated[float, _RATE]
    order: Annotated[float, Quantity(unit="", example="0.9", sign="positive")]


class TableSensor(SensorSection):
    """`model = "table"`."""

    model: str
    distances: Annotated[
        list[Annotated[float, Quantity(unit="m", example='["0 mm", "10 mm"]')]],
        list_of(2, None, "a list of two or more quantities in m"),
    ]
    outputs: Annotated[
        list[Annotated[float, Quantity(unit="output", example='["2 V", "1 V"]', sign="positive")]],
        list_of(2, None, "a list of two or more sensor outputs"),
        BeforeValidator(_one_unit),
    ]


class CalibratedSensor(SensorSection):
    """`calibration = "sensor.csv"`, fitted when the file is read."""

    calibration: Annotated[str, text('"sensor.csv"')]
    model: Annotated[str | None, name_of(*_MODELS)] = None
    select: Annotated[dict[str, str | int | float], BeforeValidator(_labels)] = Field(default_factory=dict)
    columns: Annotated[dict[str, str | int], BeforeValidator(_columns)] = Field(default_factory=dict)
    labels: Annotated[list[str | int] | None, BeforeValidator(_names)] = None
    no_object: Annotated[float | str | None, BeforeValidator(_level_or_file)] = None
    offset: Annotated[float | str, Quantity(unit="output", example='"auto"', words=("auto", "fit", "zero"))] = "auto"
    saturation: Annotated[float | str, Quantity(unit="output", example='"auto"', words=_SEARCHED)] = "auto"
    near_field_peak: Annotated[
        float | str, Quantity(unit="m", example='"auto"', sign="nonnegative", words=_SEARCHED)
    ] = "auto"
    floor_sigmas: Annotated[float, Quantity(unit="", example="3.0", sign="positive")] = 3.0


SENSOR_SECTIONS: Final[dict[str, type[SensorSection]]] = dict(
    zip(
        _MODELS,
        (
            InversePowerSensor,
            ExponentialFirstOrderSensor,
            ExponentialSecondOrderSensor,
            MittagLefflerSensor,
            TableSensor,
        ),
        strict=True,
    )
)
"""The variant that each `model` takes."""
