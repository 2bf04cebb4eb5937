"""The section [sensor] of a scenario file, in its variants."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any, Final

from pretouch.sensors import SensorModel, known_curves

from .quantities import Quantity, UnfitValueError, output_unit
from .section import LENGTH, REQUIRED, TAG, Key, Section, checked, declared_keys, list_of, one_of, text

__all__ = ["CALIBRATION", "FROM_SURFACE", "section_of_curve", "sensor_variants"]

CALIBRATION: Final = "calibration"
FROM_SURFACE: Final = ("minimum_distance", "maximum_distance")
_OUTPUT: Final = Quantity("output", "0.12")
_SEARCHED: Final = ("auto", "none")
_PLACED: Final = {
    "recess": Key(LENGTH),
    "minimum_distance": Key(LENGTH),
    "maximum_distance": Key(Quantity("m", '"0.1 m"', infinite=True)),
}
"""The keys that every sensor takes; all distances are measured from the contact surface, except `recess`."""


def section_of_curve(curve: type[SensorModel]) -> Section:
    """Make the section of a curve, `model = "..."` with its parameters and its points as keys."""
    points = {f.name: _points(f.metadata["points"]) for f in fields(curve) if "points" in f.metadata}
    return Section({**_PLACED, **declared_keys(curve), "model": TAG, **points}, make=curve)


def sensor_variants(*, foreign: bool = False) -> dict[str, Section]:
    """Return the variants of [sensor]: one for each curve, `foreign` ones of the program included, or a calibration."""
    return {name: section_of_curve(curve) for name, curve in known_curves(foreign=foreign).items()} | {
        CALIBRATION: _CALIBRATED
    }


def _points(unit: str) -> Key:
    """Return what takes a list of distances or of outputs."""
    if unit != "output":
        one = list_of(Quantity(unit), 2, None, f"a list of two or more quantities in {unit}")
        return Key(one, REQUIRED, '["0 mm", "10 mm", "20 mm"]')
    outputs = list_of(Quantity(unit, sign="positive"), 2, None, "a list of two or more sensor outputs")

    def read(value: Any) -> Any:
        """Refuse a list of outputs that mixes units: volts and counts have no common scale."""
        if isinstance(value, list) and len({output_unit(v) for v in value if isinstance(v, str)}) > 1:
            raise UnfitValueError("expected outputs of one unit, all in V or all in counts")
        return outputs(value)

    return Key(read, REQUIRED, '["4 V", "2 V", "1 V"]')


def _are(values: Iterable[Any], *types: type) -> bool:
    return all(type(value) in types for value in values)


def _model(value: Any) -> str:
    if not isinstance(value, str) or value not in known_curves(foreign=True):
        raise UnfitValueError(one_of(value, tuple(known_curves())))
    return value


def _level_or_file(value: Any) -> float | str:
    """Read a no-object level; text that ends like a file name is the path of a file."""
    if isinstance(value, str) and re.search(r"\.[A-Za-z]\w*$", value):
        return value
    try:
        return _OUTPUT(value)
    except UnfitValueError:
        raise UnfitValueError(f'expected {_OUTPUT.expected}, or a file such as "dark.csv"') from None


_SELECT: Final = checked(
    lambda v: isinstance(v, Mapping) and _are(v.values(), str, int, float),
    "a table of label columns, for example { day = 30, sensor = 4 }",
)
_COLUMNS: Final = checked(
    lambda v: isinstance(v, Mapping) and {*v} <= {"distance", "output"} and _are(v.values(), str, int),
    'a table of distance and output, each a header, a number or a unit, for example { distance = 1, output = "3 [V]" }',
)
_LABELS: Final = checked(
    lambda v: isinstance(v, list) and _are(v, str, int),
    'a list of headers or numbers of columns, for example ["day", "sensor"]',
)
_CALIBRATED: Final = Section(
    {
        **_PLACED,
        CALIBRATION: Key(text('"sensor.csv"'), REQUIRED),
        "model": Key(_model),
        "select": Key(_SELECT),
        "columns": Key(_COLUMNS),
        "labels": Key(_LABELS),
        "no_object": Key(_level_or_file),
        "offset": Key(Quantity("output", '"auto"', words=("auto", "fit", "zero")), "auto"),
        "saturation": Key(Quantity("output", '"auto"', words=_SEARCHED), "auto"),
        "near_field_peak": Key(Quantity("m", '"auto"', "nonnegative", words=_SEARCHED), "auto"),
        "floor_sigmas": Key(Quantity("", "3.0", "positive"), 3.0),
    }
)
"""`calibration = "sensor.csv"`, fitted when the file is read."""
