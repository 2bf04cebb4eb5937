"""Tables of readings as people, instruments and loggers write them, with what they mean."""

from __future__ import annotations

import re
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

    `unit` is that of the outputs. `sensors` is the number of curves. A kind that is `refused` has a remedy, which is a
    function if it is none of the usual ones.
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
    remedy: Callable[[str], str] | None = None


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


def _stage(r: Readings, position: Callable[[float], float]) -> str:
    return table("stage position [mm],adc", [f"{position(d):g}" for d in r.distances], r.counts)


def _from_stage(text: str) -> str:
    """Follow the remedy for positions of a stage, whose position at contact is 120, 20.5, -20.5 or -200 mm."""
    rows = [row.split(",") for row in text.splitlines()[1:]]
    first, last = float(rows[0][0]), float(rows[-1][0])
    contact = next(p for p in (120, 20.5, -20.5, -200) if 0 <= abs(p - first) <= 80 and abs(p - first) % 2 == 0)
    sign = 1 if last > first else -1
    return "distance [mm],adc\n" + "".join(f"{sign * (float(x) - contact):g},{c}\n" for x, c in rows)


def _thousandths(r: Readings) -> list[str]:
    return [f"{1000 * d / 25.4:.1f}" for d in r.distances]


def _fractions(r: Readings, mark: str) -> list[str]:
    """Return the distances in 64ths of an inch, as on a ruler."""
    texts = []
    for d in r.distances:
        whole, part = divmod(round(64 * d / 25.4), 64)
        factor = next(f for f in (32, 16, 8, 4, 2, 1) if part % f == 0)
        fraction = f"{part // factor}/{64 // factor}"
        texts.append((f"{whole} {fraction}" if whole else fraction) if part else f"{whole}")
    return [text + mark for text in texts]


_MONTHS = {"Feb": 2, "Apr": 4, "Jun": 6, "Aug": 8}


def _dates(r: Readings) -> list[str]:
    """Return the distances [cm], of which a spreadsheet made dates if they may be a day and a month."""
    names = {month: name for name, month in _MONTHS.items()}
    texts = []
    for d in r.distances:
        whole, part = divmod(round(d), 10)
        texts.append(f"{whole:02d}. {names[part]}" if whole and part else f"{d / 10:g}")
    return texts


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


def _continued_side_by_side(r: Readings) -> str:
    h = (len(r.distances) + 1) // 2
    rows = list(zip(r.distances, r.volts, strict=True))
    left, right = rows[:h], rows[h:]
    out = ["d [mm],V [V],,d [mm],V [V]"]
    for i in range(h):
        a = f"{left[i][0]},{left[i][1]}"
        b = f"{right[i][0]},{right[i][1]}" if i < len(right) else ","
        out.append(f"{a},,{b}")
    return "\n".join(out) + "\n"


def _side_by_side(r: Readings) -> str:
    return "distance_mm,output_V,,distance_mm,output_V\n" + "".join(
        f"{d},{v},,{d},{v}\n" for d, v in zip(r.distances, r.volts, strict=True)
    )


def _documents(r: Readings) -> str:
    return "".join(f"distance: {d / 1000}\nvalue: {c}\n---\n" for d, c in zip(r.distances, r.counts, strict=True))


def _variables(r: Readings) -> str:
    rows = [
        f'"{name}";"01.05.2024 10:12:{33 + i:02d}";{value};1;45413425{i}'
        for i, row in enumerate(zip(r.distances, r.counts, strict=True))
        for name, value in zip(("Distance_mm", "Sensor_raw"), row, strict=True)
    ]
    return "\n".join(['"VarName";"TimeString";"VarValue";"Validity";"Time_ms"', *rows]) + "\n"


def _pivoted(text: str) -> str:
    """Return the values of two variables in turn as two columns."""
    header, *rows = [re.split("[;,]", line.replace('"', "")) for line in text.splitlines()]
    at = next(i for i, title in enumerate(header) if title in {"VarValue", "value"})
    columns = [[row[at] for row in rows if row[0] == name] for name in dict.fromkeys(row[0] for row in rows)]
    return table(",".join(dict.fromkeys(row[0] for row in rows)), *columns)


MORE_KINDS = (
    Kind("alternating lines", lambda r: _lines("Distance: {d} mm\nADC: {c}\n", r)),
    Kind("alternating with blank", lambda r: _lines("Distance: {d} mm\nADC: {c}\n\n", r)),
    Kind(
        "alternating, time in front",
        lambda r: _lines("10:12:{s:06.3f} -> Distance: {d} mm\n10:12:{s:06.3f} -> ADC: {c}\n", r),
    ),
    Kind("alternating ADC first", lambda r: _lines("ADC: {c}\nDistance = {cm:g} cm\n", r)),
    Kind(
        "three lines alternate", lambda r: _lines("Distance: {d} mm\nADC: {c}\nVoltage: {v} V\n", r), refused="columns"
    ),
    Kind("four lines with separator", lambda r: _lines("-----\nDistance: {d} mm\nADC: {c}\n", r)),
    Kind(
        "alternating without unit",
        lambda r: _lines("Distance: {cm:g}\nADC: {c}\n", r),
        refused="columns",
        distance_unit="cm",
    ),
    Kind("yaml documents", _documents, refused="columns", distance_unit="m"),
    Kind(
        "sections",
        lambda r: (
            "[Header]\nDevice=Logger 3\nSerial=12\nRate=100\n[Data]\ndistance [mm],adc\n" + _lines("{d},{c}\n", r)
        ),
    ),
    Kind(
        "sections tab",
        lambda r: "[CHANNEL INFO]\nName\tCH1\nRange=10V\n\n[DATA]\nDistance (mm)\tCH1 (V)\n" + _lines("{d}\t{v}\n", r),
        "V",
        output=_volts,
    ),
    Kind(
        "key value then table",
        lambda r: (
            "Model = GP2Y0A21\nDate = 2024-05-01\nOperator = Jo\ndistance [mm];output [V]\n" + _lines("{d};{v}\n", r)
        ),
        "V",
        output=_volts,
    ),
    Kind("side by side continuing", _continued_side_by_side, "V", output=_volts),
    Kind("bare |", lambda r: "distance [mm]|adc\n" + _lines("{d}|{c}\n", r)),
    Kind("bare | with blanks", lambda r: "distance [mm] | adc\n" + _lines("{d} | {c}\n", r)),
    Kind("bare ¦", lambda r: "distance [mm]¦adc\n" + _lines("{d}¦{c}\n", r)),
    Kind("psql", lambda r: " distance_mm | adc \n-------------+-----\n" + _lines("  {d} | {c}\n", r) + "(9 rows)\n"),
    Kind(
        "grid table",
        lambda r: "+------+-----+\n| d [mm] | adc |\n+======+=====+\n" + _lines("| {d} | {c} |\n+---+---+\n", r),
    ),
    Kind("colon separated", lambda r: "distance [mm]:adc\n" + _lines("{d}:{c}\n", r)),
    Kind("arrow", lambda r: _lines("{d} mm -> {c}\n", r)),
    Kind("equals pairs", lambda r: _lines("{d} mm = {v} V\n", r), "V", output=_volts),
    Kind("at signs", lambda r: _lines("{d}mm @ {c}\n", r)),
    Kind("dots between", lambda r: _lines("{cm:g} cm ........ {v} V\n", r), "V", output=_volts),
    Kind("notebook bullets", lambda r: _lines("- {cm:g} cm: {v} V\n", r), "V", output=_volts),
    Kind("numbered list", lambda r: _lines("{i}. {cm:g} cm - {v} V\n", r), "V", output=_volts),
    Kind(
        "French",
        lambda r: commas(table("Distance (mm);Tension (V)", r.distances, r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind("Spanish", lambda r: commas(table("Distancia (cm);Lectura", _centimeters(r), r.counts, mark=";"))),
    Kind(
        "Italian",
        lambda r: commas(table("Distanza [mm];Tensione [V]", r.distances, r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind(
        "Portuguese",
        lambda r: commas(table("Distância (mm);Tensão (V)", r.distances, r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind("Dutch", lambda r: table("Afstand (mm);Meetwaarde", r.distances, r.counts, mark=";")),
    Kind(
        "Polish",
        lambda r: commas(table("Odległość [mm];Napięcie [V]", r.distances, r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind("Chinese", lambda r: table("距离(mm),电压(V)", r.distances, r.volts), "V", output=_volts),
    Kind("Chinese full width", lambda r: table("距离（mm），输出（V）", r.distances, r.volts), "V", output=_volts),
    Kind("Japanese", lambda r: table("距離[mm],出力[V]", r.distances, r.volts), "V", output=_volts),
    Kind("Japanese no unit out", lambda r: table("距離[cm],センサ値", _centimeters(r), r.counts)),
    Kind("Korean", lambda r: table("거리(mm),전압(V)", r.distances, r.volts), "V", output=_volts),
    Kind(
        "Russian",
        lambda r: commas(table("Расстояние, мм;Напряжение, В", r.distances, r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind("comma unit", lambda r: table("Distance, mm;Voltage, V", r.distances, r.volts, mark=";"), "V", output=_volts),
    Kind("unit dash", lambda r: table("Distance - mm;Voltage - V", r.distances, r.volts, mark=";"), "V", output=_volts),
    Kind(
        "german units word", lambda r: table("Abstand (Millimeter);Messwert (Digits)", r.distances, r.counts, mark=";")
    ),
    Kind("variables of a PLC", _variables, refused="pivot", remedy=_pivoted),
    Kind(
        "variable and value",
        lambda r: "variable,value\n" + _lines("distance_mm,{d}\nadc,{c}\n", r),
        refused="pivot",
        remedy=_pivoted,
    ),
    Kind(
        "oscilloscope measurements",
        lambda r: "Position [mm],CH1 Mean [V],CH1 Std Dev [V]\n" + _lines("{d},{v},0.01{i}\n", r),
        "V",
        output=_volts,
    ),
    Kind(
        "statistics of a channel",
        lambda r: "Position [mm],Mean(CH1) [V],Vpp(CH1) [V]\n" + _lines("{d},{v},0.0{i}1\n", r),
        "V",
        output=_volts,
    ),
    Kind(
        "scientific",
        lambda r: (
            "distance [m],output [V]\n"
            + "".join(f"{d / 1000:.4E},{v:.6E}\n" for d, v in zip(r.distances, r.volts, strict=True))
        ),
        "V",
        output=_volts,
    ),
    Kind(
        "fortran D",
        lambda r: (
            "distance [m] output [V]\n"
            + "".join(f"{d / 1000:.4E} {v:.6E}\n".replace("E", "D") for d, v in zip(r.distances, r.volts, strict=True))
        ),
        "V",
        output=_volts,
    ),
    Kind(
        "matlab diary",
        lambda r: "A =\n\n" + "".join(f"    {d:.4f}    {v:.4f}\n" for d, v in zip(r.distances, r.volts, strict=True)),
        "",
        output=_volts,
        refused="columns",
    ),
    Kind(
        "matlab matrix",
        lambda r: "d = [" + " ".join(map(str, r.distances)) + "];\nv = [" + " ".join(map(str, r.volts)) + "];\n",
        "",
        refused="columns",
        output=_volts,
    ),
    Kind("python lists", lambda r: "distance_mm = " + str(list(r.distances)) + "\nadc = " + str(list(r.counts)) + "\n"),
    Kind(
        "C array", lambda r: "const int table[][2] = {\n" + _lines("  {{{d}, {c}}},\n", r) + "};\n", refused="columns"
    ),
    Kind(
        "dictionary",
        lambda r: "{" + ", ".join(f"{d}: {c}" for d, c in zip(r.distances, r.counts, strict=True)) + "}\n",
        refused="columns",
    ),
    Kind(
        "datasheet pdf",
        lambda r: (
            "Distance L (mm)\nOutput voltage VO (V)\n"
            + "".join(f"{d:g} {v}\n" for d, v in zip(r.distances, r.volts, strict=True))
        ),
        "V",
        output=_volts,
        refused="columns",
    ),
    Kind(
        "digitized plot",
        lambda r: "x, y\n" + _lines("{cm:g}, {v}\n", r),
        "",
        refused="columns",
        output=_volts,
        distance_unit="cm",
    ),
    Kind(
        "digitizer with a title",
        lambda r: "GP2Y0A21,\nX,Y\n" + _lines("{cm:g},{v}\n", r),
        unit="",
        refused="columns",
        distance_unit="cm",
        output=_volts,
    ),
    Kind(
        "distance in header lines",
        lambda r: "".join(f"# {d} mm\n{c}\n{c}\n{c}\n" for d, c in zip(r.distances, r.counts, strict=True)),
        per_distance=3,
    ),
    Kind(
        "trial cols",
        lambda r: (
            "Distance (mm),Trial 1,Trial 2,Trial 3,Average\n"
            + "".join(f"{d},{c},{c},{c},{c}\n" for d, c in zip(r.distances, r.counts, strict=True))
        ),
        per_distance=3,
    ),
    Kind(
        "average only last",
        lambda r: (
            "Distance (cm);Try 1;Try 2;Mittelwert\n"
            + "".join(f"{d / 10:g};{c};{c};{c}\n" for d, c in zip(r.distances, r.counts, strict=True))
        ),
        per_distance=2,
    ),
    Kind(
        "fahrenheit extra",
        lambda r: (
            "distance_mm,adc,temp_C\n"
            + "".join(
                f"{d},{c},{20 + i * 0.1:.1f}\n" for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True))
            )
        ),
    ),
    Kind(
        "total row",
        lambda r: table("distance [mm],output [V]", r.distances, r.volts) + "Mean,1.2\n",
        "V",
        output=_volts,
        refused="#",
    ),
    Kind(
        "footer",
        lambda r: table("distance [mm],output [V]", r.distances, r.volts) + "End of file\n",
        "V",
        output=_volts,
        refused="#",
    ),
    Kind(
        "excel title row",
        lambda r: (
            "Sharp GP2Y0A21 calibration,,\n,,\nDistance (cm),Voltage (V),Comment\n"
            + "".join(f"{d / 10:g},{v},\n" for d, v in zip(r.distances, r.volts, strict=True))
        ),
        "V",
        output=_volts,
    ),
    Kind(
        "excel indented",
        lambda r: (
            ",,,\n,Distance (cm),Voltage (V),\n"
            + "".join(f",{d / 10:g},{v},\n" for d, v in zip(r.distances, r.volts, strict=True))
        ),
        "V",
        output=_volts,
    ),
    Kind(
        "logging prefix",
        lambda r: "".join(
            f"[INFO] [1700000000.{i}00000000] [ir_node]: distance_mm={d} adc={c}\n"
            for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True))
        ),
    ),
    Kind(
        "ESP prefix",
        lambda r: "".join(
            f"I (1{i}23) sensor: distance_mm: {d}, adc: {c}\n"
            for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True))
        ),
    ),
    Kind(
        "python logging",
        lambda r: "".join(
            f"2024-05-01 10:12:{33 + i:02d},123 - INFO - distance_mm={d}, adc={c}\n"
            for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True))
        ),
    ),
    Kind(
        "teraterm",
        lambda r: "".join(
            f"[Wed May 01 10:12:{33 + i:02d}.123 2024] {d} mm, {c}\n"
            for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True))
        ),
        refused="columns",
    ),
    Kind(
        "negative travel",
        lambda r: table("stage position [mm],output [V]", [-d for d in r.distances], r.volts),
        unit="V",
        output=_volts,
        refused="sign",
        remedy=lambda text: text.replace("\n-", "\n"),
    ),
    Kind("stage with a zero inside", lambda r: _stage(r, lambda d: 20.5 - d), refused="P minus", remedy=_from_stage),
    Kind(
        "stage that starts below zero", lambda r: _stage(r, lambda d: d - 20.5), refused="subtract", remedy=_from_stage
    ),
    Kind("stage below zero", lambda r: _stage(r, lambda d: -200 - d), refused="P minus", remedy=_from_stage),
    Kind("text before the distance", lambda r: _lines("at {d} millimeters: {c}, {c}, {c}\n", r), per_distance=3),
    Kind("a name before the distance", lambda r: _lines("distance {d} mm -> {c} {c}\n", r), per_distance=2),
    Kind("an object at a distance", lambda r: _lines("wall at {d} mm = {c} counts\n", r)),
    Kind(
        "titles above labels with times",
        lambda r: _lines("--- {d} mm ---\n00:01.020 -> prox={c}\n00:01.040 -> prox={c}\n", r),
        per_distance=2,
    ),
    Kind(
        "titles above labels with times of day",
        lambda r: _lines("--- {d} mm ---\n" + 9 * "10:12:33.020 -> prox={c}\n", r),
        per_distance=9,
    ),
    Kind("distances above labels", lambda r: _lines("{d} mm:\nprox={c}\nprox={c}\n", r), per_distance=2),
    Kind("distances above labels, many", lambda r: _lines("at {d} mm\n" + 9 * "prox={c}\n", r), per_distance=9),
    Kind("distances in comments above labels", lambda r: _lines("# {d} mm\nprox: {c}\nprox: {c}\n", r), per_distance=2),
    Kind("a number before labels", lambda r: _lines("{d} L:{c} R:{c}\n", r), sensors=2, refused="columns"),
    Kind("a distance before labels", lambda r: _lines("{d} mm L={c} R={c}\n", r), sensors=2),
    Kind("mil", lambda r: table("distance [mil],adc", _thousandths(r), r.counts), tolerance=1e-3),
    Kind("thou", lambda r: table("Distance (thou),adc", _thousandths(r), r.counts), tolerance=1e-3),
    Kind("fractions of an inch", lambda r: table("distance,adc", _fractions(r, '"'), r.counts), tolerance=0.1),
    Kind("fractions below a unit", lambda r: table("distance [in],adc", _fractions(r, ""), r.counts), tolerance=0.1),
    Kind(
        "thousands as k",
        lambda r: table("distance [mm],adc", r.distances, [f"{c / 1000:.3f}k" for c in r.counts]),
    ),
    Kind(
        "dates of a spreadsheet",
        lambda r: commas(table("Abstand [cm];ADC", _dates(r), r.counts, mark=";")),
        refused="found the date",
        remedy=lambda text: re.sub(r"(?m)^0(\d). (Feb|Apr|Jun|Aug)", lambda m: f"{m[1]},{_MONTHS[m[2]]}", text),
    ),
    Kind(
        "remarks on single readings",
        lambda r: "distance [mm],adc,comment\n" + _lines("{d},{c},\n", r).replace(",\n", ",moved the lamp\n", 1),
    ),
    Kind("percent", lambda r: table("distance [mm],reflectance [%]", r.distances, r.volts), "%", output=_volts),
    Kind("mA loop", lambda r: table("distance [mm],current [mA]", r.distances, r.volts), "mA", output=_volts),
    Kind(
        "JSON with meta",
        lambda r: (
            '{"sensor": "GP2", "data": [\n'
            + _lines('{{"distance_mm": {d}, "adc": {c}}},\n', r).rstrip(",\n")
            + "\n]}\n"
        ),
    ),
    Kind(
        "several tables with headers",
        lambda r: (
            "Sensor A\ndistance [mm],output [V]\n"
            + _lines("{d},{v}\n", r)
            + "\nSensor B\ndistance [mm],output [V]\n"
            + _lines("{d},{v}\n", r)
        ),
        "V",
        output=_volts,
        sensors=2,
    ),
    Kind("two tables side", _side_by_side, "V", output=_volts, sensors=2),
    Kind(
        "feet inches",
        lambda r: table("distance (in),ADC", [f"{d / 25.4:.4f}" for d in r.distances], r.counts),
        tolerance=1e-3,
    ),
    Kind("units only in first row", lambda r: "distance,output\nmm,V\n" + _lines("{d},{v}\n", r), "V", output=_volts),
    Kind("rst simple", lambda r: "===== =====\nd[mm] adc\n===== =====\n" + _lines("{d} {c}\n", r) + "===== =====\n"),
    Kind(
        "wiki",
        lambda r: "{| class='wikitable'\n! distance [mm] !! adc\n|-\n" + _lines("| {d} || {c}\n|-\n", r) + "|}\n",
    ),
    Kind("org", lambda r: "| distance [mm] | adc |\n|---------------+-----|\n" + _lines("| {d} | {c} |\n", r)),
    Kind(
        "R print",
        lambda r: (
            "  distance_mm adc\n"
            + "".join(f"{i + 1}  {d}  {c}\n" for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True)))
        ),
    ),
    Kind(
        "pandas print",
        lambda r: (
            "   distance_mm   adc\n"
            + "".join(f"{i}     {d}  {c}\n" for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True)))
        ),
    ),
    Kind(
        "gnuplot",
        lambda r: (
            "#d(mm)\tU(V)\tdU(V)\n"
            + "".join(f"{d}\t{v}\t0.01{i}\n" for i, (d, v) in enumerate(zip(r.distances, r.volts, strict=True)))
        ),
        "V",
        output=_volts,
    ),
    Kind("readings between rules", lambda r: _lines("---\nDistance: {d} mm\nADC: {c}\nADC: {c}\n", r), per_distance=2),
    Kind("a label in words", lambda r: table("media,distance [mm],adc", ["air"] * 9, r.distances, r.counts)),
    Kind("times of day and blanks", lambda r: "time distance_mm adc\n" + _lines("10:12:{s:06.3f} {d} {c}\n", r)),
    Kind(
        "quoted decimal commas and units",
        lambda r: '"Distance";"Output"\n"mm";"V"\n' + commas(_lines('"{d}";"{v}"\n', r)),
        "V",
        output=_volts,
    ),
    Kind(
        "uncertainty of its own column",
        lambda r: "d/mm\tU/V\tsigma_U/V\n" + _lines("{d}\t{v}\t0.01\n", r),
        "V",
        output=_volts,
    ),
    Kind(
        "LaTeX with units in macros",
        lambda r: (
            "\\begin{tabular}{SS}\n\\toprule\n{d / \\si{mm}} & {U / \\si{V}} \\\\\n\\midrule\n"
            + _lines("{d} & {v} \\\\\n", r)
            + "\\bottomrule\n\\end{tabular}\n"
        ),
        "V",
        output=_volts,
    ),
    Kind(
        "unit in a column",
        lambda r: '"distance (mm)","Reading","Unit"\n' + _lines('{d},{v},"V"\n', r),
        "V",
        output=_volts,
    ),
    Kind(
        "unit in a column, semicolons",
        lambda r: "distance_mm;value;unit\n" + _lines("{d};{v};V\n", r),
        "V",
        output=_volts,
    ),
    Kind(
        "cells in V and mV",
        lambda r: (
            "distance_mm;value\n"
            + "".join(
                f"{d};{v * 1000:.0f} mV\n" if v < 1 else f"{d};{v} V\n"
                for d, v in zip(r.distances, r.volts, strict=True)
            )
        ),
        "V",
        output=_volts,
    ),
    Kind("equal signs", lambda r: "".join(f"{d:g}mm={c}\n" for d, c in zip(r.distances, r.counts, strict=True))),
    Kind(
        "split data frame",
        lambda r: (
            '{"columns": ["distance_mm", "adc"], "data": '
            + str([[d, c] for d, c in zip(r.distances, r.counts, strict=True)])
            + "}\n"
        ),
    ),
    Kind("objects of JavaScript", lambda r: "[\n" + _lines("  {{ distance_mm: {d}, adc: {c} }},\n", r) + "]\n"),
    Kind("quoted numbers", lambda r: _lines('"{d}","{c}"\n', r), refused="columns"),
    Kind(
        "plus signs and zeros",
        lambda r: (
            "distance [mm] output [V]\n"
            + "".join(f"+{d:08.3f} +{v:.4e}\n" for d, v in zip(r.distances, r.volts, strict=True))
        ),
        "V",
        output=_volts,
    ),
    Kind(
        "wide without unit",
        lambda r: (
            "trial,"
            + ",".join(f"{d:g}" for d in r.distances)
            + "\n1,"
            + ",".join(map(str, r.counts))
            + "\n2,"
            + ",".join(map(str, r.counts))
            + "\n"
        ),
        refused="columns",
        per_distance=2,
    ),
    Kind(
        "distances as sections",
        lambda r: "".join(f"[{d} mm]\n{c}\n{c}\n" for d, c in zip(r.distances, r.counts, strict=True)),
        per_distance=2,
    ),
    Kind(
        "distances as headings",
        lambda r: "".join(f"=== {d} mm ===\n{c}\n{c}\n" for d, c in zip(r.distances, r.counts, strict=True)),
        per_distance=2,
    ),
    Kind(
        "distances with a name",
        lambda r: "".join(f"d = {d} mm\n{c}\n{c}\n" for d, c in zip(r.distances, r.counts, strict=True)),
        per_distance=2,
    ),
    Kind(
        "distances as Markdown headings",
        lambda r: "".join(f"## {d} mm\n{c}\n{c}\n" for d, c in zip(r.distances, r.counts, strict=True)),
        per_distance=2,
    ),
    Kind(
        "tabs and an index",
        lambda r: (
            "\n\n\tdistance (mm)\tadc\n"
            + "".join(f"{i}\t{d}\t{c}\n" for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True)))
        ),
    ),
    Kind("labels separated by blanks", lambda r: _lines("Range: {d} mm Lux: 12 ADC: {c}\n", r)),
    Kind(
        "Swedish",
        lambda r: commas(table("Avstånd (mm);Spänning (V)", r.distances, r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind(
        "Turkish",
        lambda r: commas(table("Mesafe (cm);Gerilim (V)", [f"{d / 10:g}" for d in r.distances], r.volts, mark=";")),
        "V",
        output=_volts,
    ),
    Kind(
        "French 3",
        lambda r: (
            "N°;Distance (mm);Mesure\n"
            + "".join(f"{i + 1};{d};{c}\n" for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True)))
        ),
    ),
    Kind(
        "Spanish 3",
        lambda r: (
            "Nº;Distancia (mm);Valor ADC\n"
            + "".join(f"{i + 1};{d};{c}\n" for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True)))
        ),
    ),
    Kind(
        "German 3",
        lambda r: (
            "Nr.;Abstand [mm];Messwert;Bemerkung\n"
            + "".join(f"{i + 1};{d};{c};\n" for i, (d, c) in enumerate(zip(r.distances, r.counts, strict=True)))
        ),
    ),
)
"""Kinds that notebooks, test benches, PLCs, data sheets and colleagues in other languages write."""

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


def _each(form: str) -> Callable[[int, float, int], str]:
    """Return what writes one reading: its number, its time [s] and its value."""

    def write(i: int, t: float, v: int) -> str:
        seconds, rest = divmod(round(t * 1e9), 10**9)
        words = {"i": i, "t": t, "v": v, "clock": f"10:12:{33 + t:06.3f}", "ms": 1000 + 5 * i, "us": 5000 * i}
        words |= {"sec": 1_700_000_000 + seconds, "nanosec": rest, "mm": f"{300 - 0.5 * i:.1f}", "date": "2024-05-01"}
        words |= {"early": f"2000-01-01 00:00:{12 + t:06.3f}", "set": f"2024-05-01 10:12:{33 + t:06.3f}"}
        words["day"] = f"{45413e6 + (0.4 + t / 86400) * 1e6:.6f}"
        words["jumping"] = words["early"] if i < 150 else words["set"]
        words["jumping_ms"] = 12_000 + 5 * i if i < 150 else 1_700_000_000_000 + 5 * i
        return form.format(**words)

    return write


RECORDINGS: dict[str, tuple[str, str, Callable[[int, float, int], str]]] = {
    "alternating lines with times": ("", "ADC", _each("{clock} -> Distance: {mm} mm\n{clock} -> ADC: {v}\n")),
    "alternating lines, one a time": ("", "prox", _each("t: {ms}\nprox: {v}\n")),
    "echoed range": (
        "",
        "range [counts]",
        _each(
            "header:\n  stamp:\n    sec: {sec}\n    nanosec: {nanosec}\n  frame_id: ir\nradiation_type: 1\n"
            "field_of_view: 0.1\nmin_range: 0.02\nmax_range: 4000.0\nrange: {v}\nvariance: 0.0\n---\n"
        ),
    ),
    "echoed range as CSV": ("", "range [counts]", _each("{sec},{nanosec},ir,1,0.1,0.02,4000.0,{v}\n")),
    "echoed range with variance as CSV": (
        "",
        "range [counts]",
        _each("{sec},{nanosec},ir,1,0.1,0.02,4000.0,{v},0.0\n"),
    ),
    "echoed stamped number as CSV": ("", "", _each("{sec},{nanosec},ir,{v}\n")),
    "a clock that is set": ("time,prox\n", "prox", _each("{jumping},{v}\n")),
    "a clock that is set, in a log": ("", "prox", _each("[{jumping}] prox={v}\n")),
    "a clock that is set, in ms since 1970": ("timestamp,prox\n", "prox", _each("{jumping_ms},{v}\n")),
    "sections": ("[Header]\nDevice=Logger\nRate=200\n[Data]\ntime [s];prox\n", "prox", _each("{t:.3f};{v}\n")),
    "bars": ("time [s]|prox\n", "prox", _each("{t:.3f}|{v}\n")),
    "bars and blanks": ("time [s] | prox\n", "prox", _each("{t:.3f} | {v}\n")),
    "log of a node": ("", "prox", _each("[INFO] [{sec}.{nanosec:09d}] [ir]: prox: {v}\n")),
    "log of a microcontroller": ("", "", _each("I ({ms}) ir: {v}\n")),
    "log of Python": ("", "prox", _each("{date} {clock} - ir - INFO - prox={v}\n")),
    "log of a terminal": ("", "", _each("[Wed May 01 {clock} 2024] {v}\n")),
    "variables of a PLC": (
        '"VarName";"TimeString";"VarValue";"Validity";"Time_ms"\n',
        "VarValue",
        _each('"Sensor";"01.05.2024 10:12:33";{v};1;{day}\n'),
    ),
    "scope of a PLC": (
        "Name;Scope\nFile;x.svd\n\nName;GVL.Sensor\nSampleTime[ms];5\n\nTime;GVL.Sensor\n",
        "",
        _each("{ms};{v}\n"),
    ),
    "logic analyzer": ("; Samplerate: 200 Hz\nTime,A0\n", "", _each("{us},{v}\n")),
    "French": ("Heure;Mesure\n", "", _each("{clock};{v}\n")),
    "Chinese": ("时间(ms),输出\n", "", _each("{ms},{v}\n")),
    "date and time apart": ("Date,Time,Value\n", "Value", _each("05/01/2024,{clock},{v}\n")),
    "tables side by side": ("time [s],prox,,time [s],als\n", "prox", _each("{t:.3f},{v},,{t:.3f},7\n")),
    "nested JSON": ("", "data.prox", _each('{{"t": {t:.3f}, "data": {{"prox": {v}}}}}\n')),
    "a header after a restart": ("millis,prox\n", "prox", _each("{ms},{v}\n")),
}
"""Recordings at 200 Hz: what stands above the readings, the column, and how a reading is written."""
