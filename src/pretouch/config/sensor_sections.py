"""The section [sensor] of a scenario file, in its variants."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Field, create_model

from pretouch.sensors import SensorModel, known_curves

from .quantities import Quantity, UnfitValueError
from .section import LENGTH, Section, list_of, one_of, section_of, text

__all__ = ["SENSOR_SECTIONS", "CalibratedSensor", "SensorSection", "SensorSections"]

CALIBRATION: Final = "calibration"
_OUTPUT: Final = Quantity(unit="output", example="0.12")
_SEARCHED: Final = ("auto", "none")


def _model(value: Any) -> str:
    if not isinstance(value, str) or value not in known_curves(foreign=True):
        raise UnfitValueError(one_of(value, tuple(known_curves())))
    return value


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


@cache
def section_of_curve(curve: type[SensorModel]) -> type[SensorSection]:
    """Make the section of a curve, `model = "..."` with its parameters and its points as keys.

    Args:
        curve: the class.

    Returns:
        The section.
    """
    own = section_of(curve, base=SensorSection)
    points = {f.name: (_points(f.metadata["points"]), ...) for f in fields(curve) if "points" in f.metadata}
    keys: dict[str, Any] = {"model": (str, ...), **points}
    return create_model(own.__name__, __base__=own, **keys)


def _points(unit: str) -> Any:
    """Return the type of a list of distances or of outputs."""
    if unit == "output":
        output = Quantity(unit=unit, example="", sign="positive")
        what = list_of(2, None, "a list of two or more sensor outputs")
        return Annotated[list[Annotated[float, output]], what, BeforeValidator(_one_unit)]
    what = list_of(2, None, f"a list of two or more quantities in {unit}")
    return Annotated[list[Annotated[float, Quantity(unit=unit, example="")]], what]


class CalibratedSensor(SensorSection):
    """`calibration = "sensor.csv"`, fitted when the file is read."""

    calibration: Annotated[str, text('"sensor.csv"')]
    model: Annotated[str | None, BeforeValidator(_model)] = None
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


class SensorSections(Mapping[str, type[SensorSection]]):
    """The variants of [sensor]: one for each curve, those of a program's own included, and one for a calibration."""

    def __getitem__(self, name: str) -> type[SensorSection]:
        return CalibratedSensor if name == CALIBRATION else section_of_curve(known_curves(foreign=True)[name])

    def __iter__(self) -> Iterator[str]:
        return iter((*known_curves(), CALIBRATION))

    def __len__(self) -> int:
        return len(known_curves()) + 1


SENSOR_SECTIONS: Final = SensorSections()
