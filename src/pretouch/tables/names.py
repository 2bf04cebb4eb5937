"""Interpret the headers of a table: which quantity a column has, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final, NamedTuple

from pretouch._core.units import parse_unit

from .cells import is_no_object, is_number
from .number_forms import UNSIGNED
from .unit_words import COUNTS, LENGTH, TIME, VOLTAGE, dimension, is_certain, unit_in_words

_DISTANCES = {
    *("distance", "dist", "range", "l", "x", "d", "z", "gap", "position", "pos", "height", "abstand", "entfernung"),
    *("separation", "clearance", "standoff", "displacement", "ground truth"),
    *("distancia", "distanza", "distância", "afstand", "avstånd", "odległość", "vzdálenost", "etäisyys"),
    *("mesafe", "távolság", "расстояние", "дистанция", "距离", "距離", "거리"),
}
_AVERAGES: Final = frozenset({"mean", "average", "avg", "mittelwert", "moyenne", "média"})
_OUTPUTS = {
    *("output", "out", "voltage", "value", "reading", "readings", "signal", "xi", "y", "counts", "count", "adc"),
    *("intensity", "response", "u", "v", "level", "raw", "proximity", "prox", "photocurrent", "photo current"),
    *("amplitude", *_AVERAGES, "spannung", "messwert", "wert", "tension", "tensión", "tensione", "tensão"),
    *("valeur", "mesure", "valor", "medida", "lectura", "lettura", "leitura", "valore", "meetwaarde", "waarde"),
    *("napięcie", "wartość", "напряжение", "значение", "电压", "電圧", "電壓", "输出", "出力", "전압", "출력"),
}
_LAST_WORDS: Final = {
    "distance": {"distance", "dist", "range", "gap", "position", "abstand", "entfernung", "height"},
    "output": {"output", "voltage", "value", "reading", "readings", "signal", "counts", "adc", "intensity", "raw"}
    | {"response", "mean", "average", "avg", "spannung", "messwert"},
}
"""Words that end a longer name, such as `true distance` and `sensor value`."""
_SOURCE = r"(?:led|ir led|ir|drive|driving|driver|forward|supply|bias|pulse|emitter|emission|laser|source|tx|transmit)"
_SETTING = re.compile(
    _SOURCE + r" (?:current|voltage|power|level|intensity|frequency|count)|current|power|frequency|supply|vcc|vdd|bias"
    r"|(?:pga|amplifier|analog|adc|sensor)? ?gain|(?:\w+ )?temperature|temp|humidity|wavelength|duty|duty cycle"
    r"|(?:integration|exposure|measurement|measuring|shutter|conversion|settling) time|integration|exposure"
    r"|(?:sample|sampling|data|frame) rate|pulse (?:width|length|count)|pulses|averages|averaging"
    r"|(?:min|max|minimum|maximum|minimal|maximal) (?:range|distance|value|reading)|field of view|radiation type"
)
_NAMES: dict[str, set[str] | re.Pattern[str]] = {
    "distance": _DISTANCES,
    "output": _OUTPUTS,
    "setting": _SETTING,
    "setting or output": {
        "current",
        "power",
        "frequency",
    },  # counts as a setting if another column is the output, else as the output
    "average": set(_AVERAGES),
    "count": {
        *("", "#", "no", "nr", "n", "i", "index", "idx", "row", "unnamed: 0", "trial", "repeat", "repetition", "rep"),
        *("run", "sample", "measurement", "messung", "record", "seq", "№", "n°", "nº", "序号", "番号", "номер"),
    },
    "repeat": re.compile(
        r"(?:(?:trial|try|repeat|repetition|rep|run|measurement|messung|reading|versuch|mesure|essai|lectura|prova|#)"
        r" ?)?\d{1,6}"
    ),
    "time": re.compile(
        r"%?(?:__)?(?:time|times|date|timestamp|time stamp|stamp|datetime|clock|zeit|datum|uhrzeit|t|sec|seconds|millis"
        r"|micros|nanosec|date time|time of day|elapsed|elapsed time|time elapsed|sample time|host time"
        r"|ros time|timer|time of the line|x value|x axis|zeitstempel|zeitpunkt"
        r"|temps|heure|tiempo|hora|tempo|tijd|czas|время|时间|時間|時刻|시간|ts|epoch|epoch time|unix|datenum"
        r"|(?:created|updated|recorded|received|logged|measured) at|(?:time ?stamp|date|time) (?:utc|local)"
        r"|(?:unix|utc|gps|local|system|device|pc|mcu|server|log|logged|receive|received|recorded) (?:time|time ?stamp)"
        r"|serial date|(?:datum|date)[ /]+(?:zeit|time|uhrzeit))"
    ),
    "remark": re.compile(
        r"(?:user |my )?(?:remarks?|comments?|notes?|annotations?|observations?|description|info|bemerkung(?:en)?"
        r"|kommentare?|anmerkung(?:en)?|notiz(?:en)?|remarque|commentaire|observaci[oó]n(?:es)?|comentarios?|commento"
        r"|opmerking(?:en)?|uwagi|备注|備考|примечание)"
    ),
    "statistic": re.compile(
        r"(?:.* )?(?:std|stdev|std dev|stddev|standard deviation|sd|sigma|sem|standard error|variance|var|uncertainty"
        r"|error|err|rmse|vpp|pk pk|peak to peak|ptp)"
        r"|(?:min|max|minimum|maximum|samples|n samples|number of (?:samples|readings))|std .*"
    ),
}
_TITLE = re.compile(r"\s*(.*?)\s*[\[(]\s*([^\[\]()]*(?:\([^()]*\))?[^\[\]()]*)\s*[\])][\s:.]*")
_INNER = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]")
_INDEX = re.compile(r"[-+]?\d+")
_IN_UNIT = re.compile(r"(.*\S)\s+in\s+(\S.*)", re.IGNORECASE)
_PER_UNIT = re.compile(r"(.*\S)\s+/\s+(\S+)|([^\W\d_]+)/(\S+)")
_LAST_WORD = re.compile(r"(.*[^\s_,:.-])[\s_,:.-]+([^\s_,:.-]+\.?)")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_PATH = re.compile(r"(?=.*[^\W\d_])[\w ./%\[\]]*[./][\w ]+")  # a field of an exported topic, such as field.header.stamp
_LOGARITHM = re.compile(r"dB\w{0,3}|Np|(?:ln|log|log10|log2|lg)\b.*", re.IGNORECASE)
_OF_LOGARITHM = re.compile(r"(?:.*\W)?(?:ln|log|log10|log2|lg)", re.IGNORECASE)
_OF_CHANNEL = re.compile(r"\s*\([^()]{0,20}\)")  # the channel behind a name, such as mean(CH1)
_LONGEST = 200  # characters of a header
_OUTPUT_UNITS: dict[tuple[int, ...], str] = {VOLTAGE: "V", COUNTS: "counts"}
_KIND_OF: dict[tuple[int, ...], str] = {LENGTH: "distance", TIME: "time", VOLTAGE: "output", COUNTS: "output"}
_BARE: Final = {"m": "m", "V": "V", "s": "s", "in.": "in"}
"""Short words that are units if a header has nothing else; other words must be certain."""
_DISTANCE_MARK = re.compile(
    rf"(?:(?P<name>[^\W\d_]+)[\s=:@_]*)?(?P<number>[-+\u2212]?{UNSIGNED})"
    r"(?:[\s_]*[\[(]?(?P<unit>[^\W\d_]+)[\])]?(?:\.\d+)?)?"  # pandas renames a second column 0cm to 0cm.1
)
_NO_OBJECT_MARK = re.compile(r"[+]?(inf|infinity|∞)\s*[\[(]?[^\W\d_]*[\])]?", re.IGNORECASE)


class DistanceMark(NamedTuple):
    """Distance in a column header, such as `5 mm`.

    The number and the unit are separate. The number is None if the column has readings without an object.
    """

    number: str | None
    unit: str | None


def split_title(title: str) -> tuple[str, str | None]:
    """Split a column header such as `output [V]` into name and unit.

    Other notations are `output (V)`, `output in volts`, `U / V`, `output_V`, `distanceMm` and a unit alone. Words that
    may mean something else, such as `in`, are units only behind a usual name. A number in brackets is an index.

    Returns:
        Name and unit. A known unit has the spelling of `parse_unit`.
    """
    plain = title.strip()
    if len(title) > _LONGEST:
        return title, None
    plain = plain.removesuffix("()")  # such as millis()
    match = _TITLE.fullmatch(plain)
    if match:
        text = match.group(2).strip()
        return (plain, None) if _INDEX.fullmatch(text) else (match.group(1), unit_in_words(text) or text or None)
    for inner in _INNER.finditer(plain):
        if dimension(inner[1]) in {LENGTH, TIME, *_OUTPUT_UNITS}:
            return " ".join(f"{plain[: inner.start()]} {plain[inner.end() :]}".split()), unit_in_words(inner[1])
    bare = _BARE.get(plain) or (unit_in_words(plain) if is_certain(plain) else None)
    if bare:
        return plain, bare
    if any(_matches(_plain(plain), kind) for kind in ("setting", "count", "repeat")):
        return plain, None
    return _by_word(plain) or _by_word(_CAMEL.sub(" ", plain)) or (plain, None)


def _by_word(title: str) -> tuple[str, str] | None:
    """Split a header whose last word is a unit, or return None."""
    match = _IN_UNIT.fullmatch(title)
    if match and (unit := unit_in_words(match[2])):
        return match[1], unit
    match = _PER_UNIT.fullmatch(title)
    if match:
        name, text = match[1] or match[3], match[2] or match[4]
        known = dimension(text) in {LENGTH, TIME, *_OUTPUT_UNITS}
        if known and (match[1] or any(_matches(_plain(name), kind) for kind in ("distance", "output", "time"))):
            return name, str(unit_in_words(text))
    match = _LAST_WORD.fullmatch(title)
    if match:
        name, word = match[1], match[2]
        kind = _KIND_OF.get(dimension(word), "")
        if kind and (is_certain(word) or _matches(_plain(name), kind)):
            return name, str(unit_in_words(word))
    return None


def is_logarithmic(title: str) -> bool:
    """Return True if a header says that the column has logarithms, such as `level [dB]` or `ln(V)`."""
    name, unit = split_title(title)
    return bool(
        _LOGARITHM.fullmatch(unit or "") or re.fullmatch(r"(?:.*\W)?(?:ln|log|log10|log2|lg)", name.strip(), re.I)
    )


def is_unit(title: str) -> bool:
    """Return True if a cell is a unit alone, such as `mm` or `(mV)`."""
    return bool(unit_in_words(title.strip(" []()")))


def is_length(unit: str | None) -> bool:
    """Return True if a text is a unit of length."""
    return dimension(unit) == LENGTH


def is_named(title: str, kind: str) -> bool:
    """Return True if a column header is a usual name.

    The name must be usual for this kind of column, such as distances or outputs.

    A `setting` is a property of the sensor or its surroundings, such as `gain` or `temperature`. A `setting or output`,
    such as a photocurrent, may be the output if no other column is. A `count` numbers the rows, such as `trial`, `#` or
    an empty header. A `remark` has texts on single readings. A `repeat` has the number of a repeat, such as `trial 3`,
    `run2 [V]` or `3`. A `statistic` tells how averaged readings scatter, such as `std`.
    """
    name = _plain(split_title(title)[0])
    name = _OF_CHANNEL.sub("", name) or name
    return _matches(re.split(r"[./]", name)[-1] if _PATH.fullmatch(name) else name, kind)


def _matches(name: str, kind: str) -> bool:
    names = _NAMES[kind]
    if not isinstance(names, set):
        return bool(names.fullmatch(name))
    words = re.split(r"[ ./]", name)
    is_longer = len(words) > 1 and words[-1] in _LAST_WORDS.get(kind, ())
    return name in names or (is_longer and not any(_matches(name, other) for other in ("setting", "statistic")))


def output_unit(text: str | None) -> tuple[str, float]:
    """Return the base unit, V or counts, of a sensor output.

    The second result is the conversion factor. Units of other dimensions are returned unchanged.
    """
    exponents = dimension(text)
    if exponents in _OUTPUT_UNITS:
        return _OUTPUT_UNITS[exponents], parse_unit(str(unit_in_words(str(text)))).factor
    return text or "", 1.0


def is_output_unit(unit: str | None) -> bool:
    """Return True if a text is a unit of sensor outputs.

    These units are volts and counts.
    """
    return output_unit(unit)[0] in _OUTPUT_UNITS.values()


def distance_mark(title: str) -> DistanceMark | None:
    """Parse a column header such as `5 mm` as a distance.

    Other notations are `d=5mm` and `inf`. The result is None for other headers.

    Returns:
        The distance.
    """
    if title and (is_no_object(title) or _NO_OBJECT_MARK.fullmatch(title[:_LONGEST])):
        return DistanceMark(None, None)
    match = _DISTANCE_MARK.fullmatch(title) if len(title) <= _LONGEST else None
    if match is None:
        return None
    name, unit = match["name"], match["unit"]
    if (unit is not None and not is_length(unit)) or (name and (unit is None or _plain(name) not in _DISTANCES)):
        return None
    number = match["number"].replace("\N{MINUS SIGN}", "-").replace(",", ".")
    return DistanceMark(number, unit_in_words(unit) if unit else None)


def looks_wide(header: Sequence[str], *, declared: bool) -> bool:
    """Return True if column headers are distances such as `5 mm`.

    `declared` means that an option gives the unit of the distances. Headers are distances if two of them have units of
    length, or if they are numbers that cannot mean anything else.
    """
    marks = [mark for title in header if (mark := distance_mark(title))]
    if any(mark.unit for mark in marks):
        return len(marks) > 1
    bare = [float(mark.number) for mark in marks if mark.number is not None]
    text = [title for title in header if title and not distance_mark(title)]
    in_order = bare in (sorted(bare), sorted(bare, reverse=True))
    if len(bare) > 1 and in_order and any(is_length(split_title(title)[1]) or is_length(title) for title in text):
        return True
    rising, falling = (len(bare) > 2 and bare == sorted(set(bare), reverse=down) for down in (False, True))
    return (rising and (bool(text) or len(bare) < len(marks))) or (declared and (rising or falling))


def names_a_distance(header: Sequence[str], *, declared: bool, in_words: bool = False) -> bool:
    """Return True if a line looks like a table header.

    The header of a calibration table names a distance.

    A header has a cell with a name of a distance or a unit of length, and no cell that is a number. A header whose
    cells are distances (see `looks_wide`) also counts. With `in_words`, the cells are words of a line that may be
    prose: "Sensor X" does not name a distance.
    """
    if looks_wide(header, declared=declared):
        return True
    for title in header:
        name, unit = split_title(title)
        named = is_named(title, "distance") and unit is None and (len(name) > 1 or not in_words)
        if name and (named or is_length(unit)):
            return not any(is_number(cell) for cell in header)
    return False


def _plain(name: str) -> str:
    spaced = _CAMEL.sub(" ", name) if not name.isupper() else name
    return re.sub(r"[\s_-]+", " ", spaced).strip(" .:").casefold()
