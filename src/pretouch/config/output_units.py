"""One file stays with one unit of sensor outputs: volts and counts have no common scale, and noise has that of xi."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from .quantities import KeyPath, Quantity, output_unit

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport
    from pretouch.simulation import SensorPart

    from .reading import Reading

__all__ = ["refuse_mixed_units"]


def refuse_mixed_units(file: Reading, part: SensorPart | None, calibration: CalibrationReport | None) -> None:
    """Refuse a part and outputs of the loop in another unit than the sensor's; bare numbers are in whichever it is."""
    path, unit = _of_sensor(file, calibration)
    if part is not None and unit and part.unit not in {"", unit}:
        file.refuse(
            ("chain", "part"),
            f"found a part that reports {part.unit} beside a sensor in {unit} ({_named(file, path)}), "
            f"expected one unit in the file: give the curve in {part.unit}, or choose a part that reports {unit}",
        )
        return
    if part is not None and not unit:
        path, unit = ("chain", "part"), part.unit
    for key, found, other in _given(file):
        if not unit:
            path, unit = key, other
        elif other != unit:
            file.refuse(key, f'found "{found}", expected {unit}, the unit of {_named(file, path)}')


def _of_sensor(file: Reading, calibration: CalibrationReport | None) -> tuple[KeyPath, str]:
    """Return where the unit of the sensor stands, and the unit; empty where its outputs are bare."""
    if calibration is not None:
        return ("sensor", "calibration"), calibration.calibration.unit
    sensor = file.data["sensor"] if "sensor" in file.sections else {}
    if "outputs" in sensor:
        units = [output_unit(output) for output in sensor["outputs"]]
        return ("sensor", "outputs"), next(filter(None, units), "")
    return ("sensor", "scale"), output_unit(sensor.get("scale"))


def _given(file: Reading) -> Iterator[tuple[KeyPath, str, str]]:
    """Return the outputs of the loop that name a unit, with their places and units."""
    for section in ("chain", "controller"):
        keys = file.sections[section][0].keys if section in file.sections else {}
        for key, value in file.data[section].items() if keys else ():
            read = keys[key].read
            unit = output_unit(value) if isinstance(read, Quantity) and read.unit.startswith("output") else ""
            if unit:
                yield (section, key), value, unit


def _named(file: Reading, path: KeyPath) -> str:
    line = file.source.lines.get(path)
    return f"{'.'.join(map(str, path))}" + (f", line {line}" if line else "")
