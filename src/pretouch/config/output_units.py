"""Check that all sensor outputs have the same unit.

The unit of a sensor output in a scenario file is V or counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from pretouch.simulation import SensorPart

from .quantities import KeyPath, Quantity, output_unit

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .reading import Reading


_COUNTS: Final = frozenset({"count", "counts", "raw counts", "raw", "adc counts", "lsb", "digits"})
"""Names of the dimensionless steps of a converter, in lower case."""


def is_same_output(one: str, other: str) -> bool:
    """Return True if two texts name the same unit of a sensor output.

    Examples:
        >>> is_same_output("raw counts", "counts"), is_same_output("mV", "V")
        (True, False)
    """
    return one == other or {one.lower(), other.lower()} <= _COUNTS


def refuse_mixed_units(file: Reading, part: SensorPart | None, calibration: CalibrationReport | None) -> None:
    """Report sensor outputs in different units.

    The sensor component and the sampled loop must have the output unit of the sensor curve.
    """
    path, unit = _unit_of_sensor(file, calibration)
    if part is not None and unit and part.unit and not is_same_output(part.unit, unit):
        file.refuse(
            ("chain", "part"),
            f"the sensor component reports readings in {part.unit}, but the outputs of the sensor curve "
            f"are in {unit} (see the key {_location(file, path)}). Use a sensor curve with outputs in {part.unit}, or "
            f"a component with readings in {unit}",
        )
        return
    if part is not None and not unit:
        path, unit = ("chain", "part"), part.unit
    for key, value, value_unit in _loop_outputs(file):
        if not unit:
            path, unit = key, value_unit
        elif not is_same_output(value_unit, unit):
            file.refuse(key, f'found "{value}", expected {unit}, the unit of {_location(file, path)}')


def _unit_of_sensor(file: Reading, calibration: CalibrationReport | None) -> tuple[KeyPath, str]:
    """Return the sensor's output unit and the key that sets this unit. The unit is empty for bare numbers."""
    if calibration is not None:
        return ("sensor", "calibration"), calibration.calibration.unit
    sensor = file.data["sensor"] if "sensor" in file.sections else {}
    if "outputs" in sensor:
        units = [output_unit(output) for output in sensor["outputs"]]
        return ("sensor", "outputs"), next(filter(None, units), "")
    return ("sensor", "scale"), output_unit(sensor.get("scale"))


def _loop_outputs(file: Reading) -> Iterator[tuple[KeyPath, str, str]]:
    """Yield key, text and unit (V or counts) of each sensor output in the sections of the loop."""
    for section in ("chain", "controller", "law"):
        keys = file.sections[section][0].keys if section in file.sections else {}
        for key, value in file.data[section].items() if keys else ():
            read = keys[key].read
            unit = output_unit(value) if isinstance(read, Quantity) and read.unit.startswith("output") else ""
            if unit:
                yield (section, key), value, unit


def _location(file: Reading, path: KeyPath) -> str:
    """Return a key and its line number as text."""
    line = file.source.lines.get(path)
    return f"{'.'.join(map(str, path))}" + (f", line {line}" if line else "")
