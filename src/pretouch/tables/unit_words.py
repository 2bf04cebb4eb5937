"""Read units as people write them in headers and cells: `inches`, `in.`, `Mm` or `msec`."""

from __future__ import annotations

from typing import Final

from pretouch._core.errors import UnitError
from pretouch._core.units import parse_unit

LENGTH: Final = (1, 0, 0, 0, 0)
TIME: Final = (0, 0, 1, 0, 0)
VOLTAGE: Final = (0, 0, 0, 1, 0)
COUNTS: Final = (0, 0, 0, 0, 1)

_WORDS: Final[dict[str, str]] = {
    word: unit
    for unit, words in {
        "m": "m meter meters metre metres м",
        "cm": "cm centimeter centimeters centimetre centimetres zentimeter см",
        "mm": "mm millimeter millimeters millimetre millimetres мм",
        "um": "um µm μm micron microns micrometer micrometers micrometre micrometres mikrometer",
        "in": "in in. inch inches zoll \" ″ ''",
        "thou": "thou mil mils thousandth thousandths",
        "ft": "ft ft. foot feet",
        "V": "v volt volts в",
        "mV": "mv millivolt millivolts мв",
        "uV": "uv µv μv microvolt microvolts",
        "counts": "count counts cnt cnts adc lsb lsbs digit digits tick ticks raw",
        "s": "s sec sec. secs second seconds sekunde sekunden с",
        "ms": "ms msec msecs milli millis millisecond milliseconds millisekunden мс",
        "us": "us µs μs usec usecs micros microsec microsecond microseconds мкс",
        "ns": "ns nsec nsecs nanos nanosec nanosecond nanoseconds",
        "min": "min min. mins minute minutes minuten",
        "h": "h hr hrs hour hours",
        "Hz": "hz hertz",
        "kHz": "khz kilohertz",
    }.items()
    for word in words.split()
} | {"adc counts": "counts", "raw counts": "counts", "adc units": "counts", "adc value": "counts"}
_SHORT: Final = frozenset(
    {"m", "in", "s", "v", "h", "min", "milli", "raw", "adc", "digit", "tick", "count", '"', "''", "м", "в", "с"}
)
"""Words that also have other meanings, so that a header such as `sensor_s` has no unit."""


def unit_in_words(text: str) -> str | None:
    """Return the unit that a text means, in the spelling of `parse_unit`.

    Capital letters do not count for lengths, times and voltages: no proximity sensor measures megameters.

    Args:
        text: the text, such as the part of a header in brackets.

    Returns:
        The unit, such as `in` for `Inches`; None if the text is no unit that pretouch knows.

    Examples:
        >>> unit_in_words("Inches"), unit_in_words("MM"), unit_in_words("usec"), unit_in_words("furlongs")
        ('in', 'mm', 'us', None)
    """
    plain = " ".join(text.split())
    found = _WORDS.get(plain.casefold())
    if found is not None:
        return found
    try:
        parse_unit(plain)
    except UnitError:
        return None
    return plain or None


def dimension(text: str | None) -> tuple[int, ...]:
    """Return the exponents of m, kg, s, V and counts of a unit in words; empty if it is none."""
    unit = unit_in_words(text) if text else None
    return parse_unit(unit).exponents if unit else ()


def is_certain(word: str) -> bool:
    """Return True if a word means a unit wherever it stands, such as `mm`, but unlike `in` or `m`."""
    return word.casefold() in _WORDS and word.casefold() not in _SHORT
