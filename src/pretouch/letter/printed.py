"""Compare published numbers with computed numbers.

The comparison allows for the rounding of the published numbers.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from typing import Any, Final

from pretouch._core.values import Value

_MORE: Final = 2  # digits beyond the printed ones, which show how the computed number rounds
_LONGEST: Final = 14


class Agreement(Enum):
    """Degree to which a published number agrees with the computed number.

    A member is a word, a symbol and its meaning.
    """

    AGREES = "agrees", "\u25cf", "the computed number rounds to the printed digits"
    WITHIN_INPUTS = "agrees-within-inputs", "\u25cb", "agrees for other inputs that round to the printed inputs"
    DISAGREES = "disagrees", "\u25b2", "does not agree, even within the input rounding; the reason is below the table"
    MEASURED = "measured", "\u25a1", "measured on hardware: compared, agreement not required"

    shape: str
    meaning: str

    def __new__(cls, word: str, shape: str, meaning: str) -> Agreement:
        """Create a degree of agreement from a word, a symbol and a meaning."""
        member = object.__new__(cls)
        member._value_, member.shape, member.meaning = word, shape, meaning
        return member

    @property
    def words(self) -> str:
        """The degree of agreement in words, with spaces instead of hyphens."""
        return str(self.value).replace("-", " ")


def resolution(printed: str) -> float:
    """Return the rounding step of a published number.

    This is one unit in its last decimal place.

    Examples:
        >>> resolution("-0.082"), resolution("1.30e-5"), resolution("474")
        (0.001, 1e-07, 1.0)
    """
    return float(Decimal(1).scaleb(int(Decimal(printed).as_tuple().exponent)))


@dataclass(frozen=True, slots=True)
class Parameter(Value):
    """An input of an experiment, as printed in the published letter.

    Args:
        name: name of the input.
        symbol: symbol in the letter.
        printed: the value as printed.
        unit: the unit; empty for a pure number.
        place: where in the letter.
    """

    name: str
    symbol: str
    printed: str
    unit: str
    place: str

    @property
    def value(self) -> float:
        """The value of the published input as a number.

        It is in the unit that the published letter states.
        """
        return float(self.printed)


@dataclass(frozen=True, slots=True)
class Printed(Value):
    """A number from the published letter, compared with the computed number.

    Args:
        name: name of the number.
        printed: the number as printed in the letter.
        value: the computed number.
        unit: the unit of both; empty for a pure number.
        place: where in the letter.
        why: reason of the difference, if it is known.
        hardware: whether the printed number was measured on hardware, so that the two need not agree.
        over_inputs: smallest and largest computed number over the rounding of the printed inputs; None if not computed.

    Examples:
        >>> Printed("l' at contact", "-0.088", -0.08766, "m/s", "Table II").agreement.meaning
        'the computed number rounds to the printed digits'
    """

    name: str
    printed: str
    value: float
    unit: str
    place: str
    why: str = ""
    hardware: bool = False
    over_inputs: tuple[float, float] | None = None

    @property
    def difference(self) -> float:
        """The computed number minus the published number.

        The difference is in the unit of the published number.
        """
        return self.value - float(self.printed)

    @property
    def agreement(self) -> Agreement:
        """Whether the computed number rounds to the published digits.

        The result is a member of `Agreement`. It also says how the two numbers differ.
        """
        if self.hardware:
            return Agreement.MEASURED
        half = resolution(self.printed) / 2 * (1 + 1e-9)
        low, high = self.over_inputs or (self.value, self.value)
        if abs(self.difference) <= half:
            return Agreement.AGREES
        within = low - half <= float(self.printed) <= high + half
        return Agreement.WITHIN_INPUTS if within else Agreement.DISAGREES

    @property
    def reason(self) -> str:
        """The reason why published and computed number differ.

        It is an empty text if they agree.
        """
        return self.why if self.agreement in {Agreement.DISAGREES, Agreement.MEASURED} else ""

    @property
    def unexplained(self) -> bool:
        """Whether published and computed number disagree without a known reason."""
        return self.agreement is Agreement.DISAGREES and not self.why

    @property
    def ours(self) -> str:
        """The computed number as text.

        It has two more decimals than the published number.
        """
        return numeral(self.value, self.printed)

    @property
    def off_by(self) -> str:
        """The difference between computed and published number as text with its sign."""
        notation = self.printed
        if "e" in notation.lower() and math.isfinite(self.difference):
            notation = "1e0" if self.difference else "0"
        return numeral(self.difference, notation, "+")

    @property
    def span(self) -> str:
        """The range of the computed number as text.

        The published inputs vary within their rounding. The text is empty if the range was not computed.
        """
        return " to ".join(numeral(end, self.printed) for end in self.over_inputs or ())

    def to_dict(self) -> dict[str, Any]:
        """Return the published and computed number as a dictionary.

        All values are plain.
        """
        low, high = self.over_inputs or (None, None)
        names = ("name", "printed", "value", "unit", "difference", "place", "reason")
        document = {name: getattr(self, name) for name in names}
        return document | {"low": low, "high": high, "verdict": self.agreement.value}


def numeral(value: float, printed: str, sign: str = "") -> str:
    """Format a computed number like a published number.

    It has two more decimals. A number whose text would be far longer gets six digits.

    Returns:
        The number as text.

    Examples:
        >>> numeral(-0.091534, "-0.082"), numeral(1.2987e-5, "1.30e-5"), numeral(0.00034, "-0.088", "+")
        ('-0.09153', '1.2987e-5', '+0.00034')
    """
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else "infinite" if value > 0 else "-infinite"
    mantissa, exponential, _ = printed.lower().partition("e")
    places = len(mantissa.partition(".")[2]) + _MORE
    text = f"{value:{sign}.{places}{'e' if exponential else 'f'}}"
    if len(text) > _LONGEST + len(printed):
        text = f"{value:{sign}.6g}"
    return short_exponent(text if float(text) else text.lstrip("+-"))


def short_exponent(text: str) -> str:
    """Shorten the exponents of numbers in a text. For example, e-05 becomes e-5."""
    return re.sub(r"e([+-]?)0*(\d)", lambda match: f"e{match[1].strip('+')}{match[2]}", text)
