"""Tables of readings as people, instruments and loggers write them, with what they mean."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np

Row = tuple[float, float]


@dataclass(frozen=True)
class Readings:
    """What was measured: distances [mm], outputs [V] and [counts], at times with equal steps [ms]."""

    distances: tuple[float, ...]
    volts: tuple[float, ...]
    counts: tuple[int, ...]
    step: float = 5.0


def readings(seed: int) -> Readings:
    """Return the readings of a sensor of its own for each seed."""
    rng = np.random.default_rng(seed)
    distances = np.sort(rng.choice(np.arange(1, 40), 9, replace=False)) * 2.0
    falling = (20 / (20 + distances)) ** (1.5 + rng.random())
    volts = np.round(3.2 * falling + 0.1, 3)
    return Readings(tuple(map(float, distances)), tuple(map(float, volts)), tuple(int(v) for v in 4000 * falling + 57))


def table(header: str, *columns: Sequence[object], mark: str = ",") -> str:
    """Return a table with one row for each reading."""
    return "\n".join([header, *(mark.join(map(str, row)) for row in zip(*columns, strict=True))]) + "\n"


def commas(text: str) -> str:
    """Return a text with decimal commas."""
    return text.replace(".", ",")


@dataclass(frozen=True)
class Kind:
    """A kind of table: how it is written, and what its columns are.

    `unit` is that of the outputs. `sensors` is the number of curves. A kind that is `refused` has a remedy.
    """

    name: str
    write: Callable[[Readings], str]
    unit: str = "counts"
    sensors: int = 1
    refused: str = ""
    distance_unit: str = "mm"
    per_distance: int = 1
    tolerance: float = 1e-9
    output: Callable[[Readings], Sequence[float]] = field(default=lambda r: r.counts)


def _volts(r: Readings) -> Sequence[float]:
    return r.volts


def _inches(r: Readings) -> list[str]:
    return [f"{d / 25.4:.5f}" for d in r.distances]


def _centimeters(r: Readings) -> list[str]:
    return [f"{d / 10:g}" for d in r.distances]


def _lines(form: str, r: Readings) -> str:
    return "".join(
        form.format(i=i, d=d, cm=d / 10, v=v, c=c, s=33 + 0.005 * i, ms=1000 + 5 * i)
        for i, (d, v, c) in enumerate(zip(r.distances, r.volts, r.counts, strict=True))
    )


def _json_array(r: Readings) -> str:
    return "[\n" + _lines('{{"distance_mm": {d}, "prox": {c}}},\n', r).rstrip(",\n") + "\n]\n"


KINDS = (
    Kind("inches in words", lambda r: table("inches,V", _inches(r), r.volts), "V", output=_volts, tolerance=1e-3),
    Kind("name and inches", lambda r: table("distance_inches,adc", _inches(r), r.counts), tolerance=1e-3),
    Kind("in inches", lambda r: table("Distance in inches,A0", _inches(r), r.counts), tolerance=1e-3),
    Kind("inches, abbreviated", lambda r: table("in.,counts", _inches(r), r.counts), tolerance=1e-3),
    Kind("unit alone", lambda r: table("cm,V", _centimeters(r), r.volts), "V", output=_volts),
    Kind(
        "phrases", lambda r: table("distance in cm volts in V", _centimeters(r), r.volts, mark=" "), "V", output=_volts
    ),
    Kind("volts in V", lambda r: table("Distance in cm,volts in V", _centimeters(r), r.volts), "V", output=_volts),
    Kind("one word", lambda r: table("distanceCm,adcValue", _centimeters(r), r.counts)),
    Kind("capital units", lambda r: table("Distance (MM),Sensor Value", r.distances, r.counts)),
    Kind("half capital units", lambda r: table("Distance (Mm),Output", r.distances, r.counts)),
    Kind("a word for the unit", lambda r: table("Centimeters,Volts", _centimeters(r), r.volts), "V", output=_volts),
    Kind("units as in physics", lambda r: table("d / mm;U / V", r.distances, r.volts, mark=";"), "V", output=_volts),
    Kind(
        "German",
        lambda r: commas(table("Abstand in cm;Spannung in V", _centimeters(r), r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind("index in brackets", lambda r: table("distance_mm,prox[3]", r.distances, r.counts)),
    Kind("true and sensor", lambda r: table("reference_mm,sensor_raw", r.distances, r.counts)),
    Kind(
        "sep= of a spreadsheet",
        lambda r: commas("sep=;\n" + table("distance [mm];output [V]", r.distances, r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind("units in cells", lambda r: "distance,output\n" + _lines("{d} mm,{v} V\n", r), "V", output=_volts),
    Kind("units glued to cells", lambda r: "distance;adc\n" + _lines("{cm:g}cm;{c}\n", r)),
    Kind("thousands in quotes", lambda r: "distance [mm],adc\n" + _lines('{d},"{c:,}"\n', r), refused="two readings"),
    Kind("thousands by blanks", lambda r: ("distance [mm];adc\n" + _lines("{d};{c:,}\n", r)).replace(",", " ")),
    Kind("thousands by apostrophes", lambda r: ("distance [mm];adc\n" + _lines("{d};{c:,}\n", r)).replace(",", "'")),
    Kind(
        "quoted decimal commas",
        lambda r: '"distance (mm)","voltage (V)"\n' + commas(_lines('"{d};{v}"\n', r)).replace(";", '","'),
        "V",
        output=_volts,
    ),
    Kind("hexadecimal", lambda r: "distance [mm],raw\n" + _lines("{d},0x{c:04X}\n", r)),
    Kind("uncertainties", lambda r: "distance [mm],output [V]\n" + _lines("{d},{v} ± 0.01\n", r), "V", output=_volts),
    Kind(
        "mean and deviation",
        lambda r: "distance [mm],mean [V],std [V],n\n" + _lines("{d},{v},0.0{i},1{i}\n", r),
        "V",
        output=_volts,
    ),
    Kind("Markdown", lambda r: "| distance (mm) | adc |\n|---|---|\n" + _lines("| {d} | {c} |\n", r)),
    Kind("LaTeX", lambda r: "distance (mm) & adc \\\\\n\\hline\n" + _lines("{d} & {c} \\\\\n", r)),
    Kind("labels and units", lambda r: _lines("Distance: {d} mm, ADC: {c}\n", r)),
    Kind("short labels", lambda r: _lines("d={d}mm v={c}\n", r)),
    Kind("serial plotter", lambda r: _lines("distance_mm:{d},prox:{c}\n", r)),
    Kind("JSON lines", lambda r: _lines('{{"distance_mm": {d}, "prox": {c}}}\n', r)),
    Kind("JSON array", _json_array),
    Kind("YAML", lambda r: _lines("- {{distance_mm: {d}, value: {c}}}\n", r)),
    Kind(
        "monitor with header",
        lambda r: "10:12:32.000 -> distance_mm,prox\n" + _lines("10:12:{s:06.3f} -> {d},{c}\n", r),
    ),
    Kind("monitor", lambda r: _lines("10:12:{s:06.3f} -> {d},{c}\n", r), refused="columns"),
    Kind("tuples", lambda r: _lines("({d}, {c})\n", r), refused="columns"),
    Kind("no header", lambda r: _lines("{d},{c}\n", r), refused="columns"),
    Kind(
        "name without unit",
        lambda r: table("Distance,Sensor", _centimeters(r), r.counts),
        refused="columns",
        distance_unit="cm",
    ),
    Kind("blocks", lambda r: _lines("Distance: {d} mm\n{c}\n{c}\n\n", r), per_distance=2),
    Kind("readings behind a distance", lambda r: _lines("{d} mm: {c} {c} {c}\n", r), per_distance=3),
    Kind(
        "turned",
        lambda r: (
            "distance [mm],"
            + ",".join(map(str, r.distances))
            + "\noutput [counts],"
            + ",".join(map(str, r.counts))
            + "\n"
        ),
    ),
    Kind("data frame with index", lambda r: ",distance_mm,adc\n" + _lines("{i},{d},{c}\n", r)),
    Kind(
        "time of each reading",
        lambda r: "timestamp,distance_mm,prox\n" + _lines("2024-05-01T10:12:{s:06.3f}Z,{d},{c}\n", r),
    ),
    Kind("milliseconds of each reading", lambda r: "millis,distance_mm,prox\n" + _lines("{ms},{d},{c}\n", r)),
    Kind(
        "measurement file",
        lambda r: (
            "LabVIEW Measurement\t\nSeparator\tTab\nSamples\t9\t9\n***End_of_Header***\t\n\n"
            "X_Value\tdistance [mm]\tcounts\tComment\n" + _lines("0.{i}\t{d}\t{c}\n", r)
        ),
    ),
    Kind(
        "no target",
        lambda r: table("distance [mm],output", r.distances, r.counts) + "no target,60\nout of range,61\n> 500,59\n",
    ),
    Kind("overload", lambda r: table("distance [mm],output [V]", r.distances, r.volts) + "90,OL\n", "V", output=_volts),
    Kind(
        "units below the names",
        lambda r: table("Distance,Sensor\n(inches),(volts)", _inches(r), r.volts),
        "V",
        output=_volts,
        tolerance=1e-3,
    ),
    Kind("an empty column", lambda r: "distance [mm],,output\n" + _lines("{d},,{c}\n", r)),
    Kind("two outputs", lambda r: "distance_mm,adc,voltage\n" + _lines("{d},{c},{v}\n", r), refused="columns"),
    Kind("several sensors", lambda r: "distance [mm];prox0;prox1;prox2\n" + _lines("{d};{c};{c};{c}\n", r), sensors=3),
    Kind("left and right", lambda r: "pos_mm,ir_left,ir_right\n" + _lines("{d},{c},{c}\n", r), sensors=2),
    Kind("tabs and a remark", lambda r: "// bench 4\ndistance [mm]\tadc\n" + _lines("{d}\t{c}\n", r)),
)

TIMES: dict[str, Callable[[int, float], str]] = {
    "time": lambda i, _: f"{5 * i}",
    "Time [s]": lambda _, t: f"{t:.3f}",
    "Zeit in s": lambda _, t: f"{t:.3f}",
    "time_ms": lambda i, _: f"{5 * i}",
    "timestamp_ms": lambda i, _: f"{1000 + 5 * i}",
    "millis": lambda i, _: f"{1000 + 5 * i}",
    "micros": lambda i, _: f"{5000 * i}",
    "Time (msec)": lambda i, _: f"{5 * i}.0",
    "t": lambda i, _: f"{5000 * i}",
    "timer": lambda i, _: f"{1_200_000_000 + 5000 * i}",
    "timestamp": lambda i, _: f"{1_700_000_000_000 + 5 * i}",
    "%time": lambda i, _: f"{1_700_000_000_123_456_789 + 5_000_000 * i}",
    "stamp": lambda _, t: f"{1_700_000_000 + t:.3f}",
    "date time": lambda _, t: _moment(t).isoformat(sep=" ", timespec="milliseconds"),
    "datetime": lambda _, t: _moment(t).isoformat(timespec="microseconds") + "Z",
    "Timestamp": lambda _, t: _moment(t).strftime("%m/%d/%Y %I:%M:%S.%f %p"),
    "clock": lambda _, t: _moment(t).strftime("%H:%M:%S.%f")[:-3],
    "elapsed": lambda _, t: f"{int(12 + t // 60)}:{t % 60:06.3f}",
}
"""Columns of times with steps of 5 ms: the header, and the cell at the time t [s] of the i-th reading."""


def _moment(time: float) -> datetime:
    return datetime(2024, 5, 1, 23, 59, 59, 500000) + timedelta(seconds=round(time, 6))
