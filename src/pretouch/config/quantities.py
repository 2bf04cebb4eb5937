"""Parse quantities with units in a scenario file, and explain invalid values."""

from __future__ import annotations

import json
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from pretouch._core.errors import UnitError
from pretouch._core.fields import Sign
from pretouch._core.units import WORKABLE, has_workable_magnitude, missing_unit, parse_unit, to_si, written_unit

KeyPath: TypeAlias = tuple[str | int, ...]
"""The path of a value in a file: keys as text, list elements as index."""

_HOLDS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    "nonzero": operator.ne,
    "positive": operator.gt,
    "nonnegative": operator.ge,
    "negative": operator.lt,
}
_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_OUTPUT_UNITS: Final = {"output": ("V", "counts", ""), "output/s": ("V/s", "counts/s", "1/s")}
_LARGEST_BARE: Final = {"m": 5.0}  # more than the range of proximity sensors: a larger bare number is probably in mm
_LONGEST: Final = 60


class UnfitValueError(ValueError):
    """Error for a value that a scenario-file key does not allow.

    Args:
        sentence: the message; if it starts with "expected", the wrong value is written before it.
        path: path of the wrong part inside the value.
    """

    def __init__(self, sentence: str, *path: str | int) -> None:
        super().__init__(sentence)
        self.mistakes: list[tuple[KeyPath, str]] = [(path, sentence)]

    @classmethod
    def of(cls, mistakes: Iterable[tuple[KeyPath, str]]) -> UnfitValueError:
        """Combine several mistakes in one value into one error."""
        error = cls("")
        error.mistakes = list(mistakes)
        return error


def value_text(value: Any) -> str:
    """Format a value as in a TOML file.

    Long values are shortened.

    Returns:
        Text for a message.

    Examples:
        >>> value_text("10 N/m"), value_text(True), value_text([1, 2])
        ('"10 N/m"', 'true', 'a list of 2 values')
    """
    if isinstance(value, str):
        text = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, Mapping):
        text = "a table"
    elif isinstance(value, Sequence):
        text = f"a list of {len(value)} value{'' if len(value) == 1 else 's'}"
    elif isinstance(value, int) and abs(value) > 10**20:
        text = "a very large integer"
    else:
        text = str(value)
    text = printable(text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]}...{text[-1]}"


def printable(text: str) -> str:
    r"""Escape line breaks and control characters in a text.

    Returns:
        The text on one line.

    Examples:
        >>> print(printable("1\x9b2 µm"))
        1\x9b2 µm
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


@dataclass(frozen=True, slots=True)
class Quantity:
    """A parser for a physical quantity with its unit.

    A quantity is a text with a number and a unit, or a bare number in SI units.

    Args:
        unit: the expected SI unit; empty for a pure number; "output" for a sensor output, which may be in V, in counts
            or bare; "output/s" for its rate of change.
        example: an example value, as TOML, for messages about a missing key.
        sign: required sign.
        infinite: whether the quantity may be infinite.
        words: words that are allowed instead of a quantity, such as "auto".
        of: kind of the law that determines the unit, for messages; empty if the unit does not depend on the law.

    Examples:
        >>> Quantity("m", '"42.2 mm"')("42.2 mm")
        0.0422
    """

    unit: str
    example: str = ""
    sign: Sign = "any"
    infinite: bool = False
    words: tuple[str, ...] = ()
    of: str = ""

    @property
    def expected(self) -> str:
        """A description of the allowed values, for error messages."""
        return self._described("")

    def _described(self, adjective: str) -> str:
        if self.unit in _OUTPUT_UNITS:
            what, (volts, counts, _) = self.unit.replace("output", "sensor output"), _OUTPUT_UNITS[self.unit]
            text = f"a {adjective}{what.replace('/s', ' per second')}, a number or text in {volts} or {counts}"
        else:
            text = f"a {adjective}quantity in {written_unit(self.unit)}" if self.unit else f"a {adjective}number"
        text += f", the unit of law kind {self.of}" if self.of else ""
        return text + "".join(f' or "{word}"' for word in self.words)

    def __call__(self, value: Any) -> float | str:
        """Convert a TOML value to a number in SI units.

        Returns:
            The number; an allowed word such as "auto" unchanged.

        Raises:
            UnfitValueError: the value is not such a quantity.
        """
        if isinstance(value, str) and value in self.words:
            return value
        if self.unit == "rad/s" and isinstance(value, str) and "Hz" in value:
            raise UnfitValueError(
                'expected an angular frequency in rad/s, because Hz is ambiguous here; 1 Hz equals "6.2832 rad/s"'
            )
        number = self._number(value)
        if not isinstance(value, str) and abs(number) > _LARGEST_BARE.get(self.unit, math.inf):
            meant = f"{value:g} {self.unit}"
            raise UnfitValueError(
                f"expected a quantity with its unit. Without a unit, the number means {meant}, which is implausibly "
                f'large. Did you mean "{value:g} m{self.unit}"? Otherwise write "{meant}"'
            )
        if self.sign != "any" and not _HOLDS[self.sign](number, 0.0):
            raise UnfitValueError(f"expected {self._described(f'{self.sign} ')}")
        if math.isinf(number) and not self.infinite:
            raise UnfitValueError(f"expected {self._described('finite ')}")
        if not (math.isinf(number) or has_workable_magnitude(number)):
            raise UnfitValueError(f"expected {self.expected} {WORKABLE}")
        return number

    def rule(self) -> dict[str, Any]:
        """Return this parser as a JSON object, for programs in other languages.

        Returns:
            `expected`, the description of a value with {} in place of an adjective; and, if they are not the default,
            `sign`, `infinite`, `words` and `largest_bare`, the largest number without a unit.
        """
        optional = {
            "sign": "" if self.sign == "any" else self.sign,
            "infinite": self.infinite,
            "words": list(self.words),
            "largest_bare": _LARGEST_BARE.get(self.unit),
        }
        return {"expected": self._described("{}"), **{name: value for name, value in optional.items() if value}}

    def _number(self, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise UnfitValueError(f"expected {self.expected}")
        if isinstance(value, str):
            value = re.sub(rf"^\s*({_NUMBER})\s*/", r"\1 1/", value)  # "-61 /m" means "-61 1/m"
            if instead := self._with_unit(value):
                raise UnfitValueError(instead)
        for unit in _OUTPUT_UNITS.get(self.unit, (self.unit,)):
            number = _in_unit(value, unit)
            if number is not None:
                return number
        raise UnfitValueError(f"expected {self.expected}{_reason(value)}")

    def _with_unit(self, text: str) -> str:
        """Return the message that suggests a unit for a bare number; empty if no unit is missing."""
        volts, counts, _ = _OUTPUT_UNITS.get(self.unit, (self.unit, "", ""))
        instead = missing_unit(text, volts)
        if counts and instead:
            number = text.strip()
            return (
                f'expected a number with its unit, such as "{number} {volts}" or "{number} {counts}", or the bare '
                f"number {float(number):.15g} (in the unit of the readings)"
            )
        if instead and abs(float(text)) > _LARGEST_BARE.get(self.unit, math.inf):
            instead = f'{instead.partition(", or ")[0]} or "{text.strip()} {self.unit}"'
        return f"expected {instead}" if instead else ""


def _in_unit(value: float | str, unit: str) -> float | None:
    try:
        return to_si(value, unit, name="")
    except (UnitError, ArithmeticError):
        return None


def output_unit(value: Any) -> str:
    """Return the unit of a sensor output.

    The unit is V or counts, also for a rate of change. It is empty for other quantities.
    """
    names = {"": ("", "1/s"), "V": ("V", "V/s"), "counts": ("counts", "counts/s")}
    if not isinstance(value, str):
        return ""
    return next((unit for unit, both in names.items() if any(_in_unit(value, name) is not None for name in both)), "")


def _reason(value: Any) -> str:
    """Return why a text is no quantity, such as a decimal comma; empty if only the dimension is wrong."""
    if not isinstance(value, str):
        return ""
    if re.search(r"\d,\d", value):
        return " (with a decimal point, and no separator of thousands)"
    match = re.fullmatch(rf"\s*{_NUMBER}\s*(\S.*?)\s*", value, re.DOTALL)
    if match is None:
        return ""
    try:
        parse_unit(match.group(1))
    except UnitError as unknown:
        return f" ({unknown})"
    return ""
