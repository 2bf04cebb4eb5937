"""Export a verified control law as an Arduino library.

The library has an example that is a whole loop: it reads a sensor, runs the law and writes a reference for a drive.
"""

from __future__ import annotations

import re
from importlib.metadata import version
from typing import Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity
from pretouch.designs import Task
from pretouch.designs.task import with_file_location
from pretouch.simulation import ClosedLoop
from pretouch.tables.names import output_unit

from .c import c_files, filled
from .curve_table import curve_table
from .law_design import LawDesign
from .law_source import HEADER, SOURCE

DRIVERS: Final = {
    "VCNL4040": "pretouch_vcnl4040.h",
    "VCNL4010": "pretouch_vcnl4010.h",
    "APDS-9960": "pretouch_apds9960.h",
    "VL53L0X": "pretouch_vl53l0x.h",
}
"""The sensor parts for which the library has a driver, with the header of each driver."""

_OTHERS: Final = ("analog_pin", "loop", "reference", "sensor")  # headers that are the same for every design
_CURVE_STEPS: Final = 256
_SINGLE: Final = """/* Libraries for Arduino have no compiler options: this line selects single precision. */
#ifndef PRETOUCH_FLOAT
#define PRETOUCH_FLOAT
#endif

"""
_UNFUSED: Final = """/* Libraries for Arduino have no compiler options: GCC must not fuse products and sums. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#endif

"""


def arduino_files(design: LawDesign) -> dict[str, str]:
    """Return the path and content of each file of an Arduino library."""
    law, name = c_files(design), design.identifier
    headers = {f"src/{each}": filled(f"arduino/src/{each}") for each in DRIVERS.values()}
    headers |= {f"src/pretouch_{each}.h": filled(f"arduino/src/pretouch_{each}.h") for each in _OTHERS}
    values = _values(design)
    if design.task.loop.chain.measures_distance:
        headers["src/pretouch_curve.h"] = filled("arduino/src/pretouch_curve.h", design, **_curve(design))
    return {
        "library.properties": filled("arduino/library.properties", design, library=name, number_version=_version()),
        "README.md": filled("arduino/README.md", design, library=name, **values),
        "src/pretouch_design.h": law["pretouch_design.h"],
        f"src/{HEADER}": _SINGLE + law[HEADER],
        f"src/{SOURCE}": _UNFUSED + law[SOURCE],
        "src/pretouch_settings.h": filled("arduino/src/pretouch_settings.h", design, **values),
        **headers,
        f"examples/{name}/{name}.ino": filled("arduino/examples/loop.ino", design, **values),
        "extras/vectors.csv": law["vectors.csv"],
        "extras/test_law.c": law["test_law.c"],
        "extras/Makefile": filled("arduino/extras/Makefile"),
    }


def measuring_period(part: str) -> float:
    """Return the shortest time between two readings of a driver [s].

    Args:
        part: a key of DRIVERS.
    """
    found = re.search(r"PRETOUCH_MEASURING_US (\d+)UL", filled(f"arduino/src/{DRIVERS[part]}"))
    assert found is not None  # noqa: S101 - our own file
    return int(found[1]) * 1e-6


def _part(task: Task) -> str | None:
    """Return the sensor part of the scenario if there is a driver for it."""
    part = task.sensor_part
    return part.name if part is not None and part.name in DRIVERS else None


@with_file_location
def check_arduino(task: Task) -> None:
    """Refuse a sensor rate that the driver of the scenario's part does not reach.

    Args:
        task: the task; without a sampled loop, nothing is checked.

    Raises:
        InvalidInputError: the loop reads its sensor more often than this driver does.
    """
    if not isinstance(task.loop, ClosedLoop):
        return
    part, rate = _part(task), task.loop.chain.rate
    if part is not None and rate * measuring_period(part) > 1 + 1e-6:
        most = format_quantity(round(1 / measuring_period(part), 6), "Hz")
        raise InvalidInputError(
            f"chain.rate: found {format_quantity(rate, 'Hz')}, but the exported driver of the {part} takes at most "
            f'{most}. Set rate = "{most}" in [chain], verify and export again',
            value=rate,
            limit=1 / measuring_period(part),
        )


def _values(design: LawDesign) -> dict[str, str]:
    """Return the texts that stand for numbers and names in the template files."""
    chain, task = design.task.loop.chain, design.task
    part = _part(task)
    sensor = part or ("own sensor" if chain.measures_distance else "analog pin")
    nanoseconds = round(design.controller.period * 1e9)
    calibration = task.calibration
    unit = (
        calibration.calibration.unit if calibration is not None else task.sensor_part.unit if task.sensor_part else ""
    )
    is_in_counts = output_unit(unit)[0] == "counts"
    return {
        "sensor": sensor,
        "part": re.sub(r"[^A-Z0-9]", "", part) if part else sensor.upper().replace(" ", "_"),
        "period_us": str(nanoseconds // 1000),
        "period_ns": str(nanoseconds % 1000),
        "sensor_period_us": str(round(1e6 / chain.rate)),
        "latency": repr(float(chain.latency)),
        "measures_distance": str(int(chain.measures_distance)),
        "is_in_counts": str(int(is_in_counts)),
        "reading_digits": "0" if is_in_counts or chain.measures_distance else "5",
        "reading_header": "distance_mm" if chain.measures_distance else "reading",
    }


def _curve(design: LawDesign) -> dict[str, str]:
    """Return the sensor curve as text of C++."""
    table = curve_table(design, _CURVE_STEPS)
    return {
        "curve": table.curve,
        "curve_error": f"{table.error:.2g}",
        "curve_start": repr(table.start),
        "curve_step": repr(table.step),
        "curve_steps": str(_CURVE_STEPS),
        "curve_reach": table.reach_text("f", "INFINITY"),
        "curve_values": table.rows("f"),
    }


def _version() -> str:
    """Return the version of pretouch as Arduino expects it: three numbers."""
    found = re.match(r"\d+\.\d+\.\d+", version("pretouch"))
    return found[0] if found else "0.0.0"
