"""Parse quantities with units into SI floats, and format SI floats with units.

Inside pretouch every number is a float in SI. In files and on the command line a quantity may be written as text with
its unit, such as `"42.2 mm"`; its dimension is checked.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from typing import Any, Final, NamedTuple

from .errors import UnitError

MAGNITUDES: Final = (1e-60, 1e60)
"""Smallest and largest magnitude in SI, so that a product of five such numbers neither overflows nor underflows."""

WORKABLE: Final = "of a magnitude from {:g} to {:g}, or 0".format(*MAGNITUDES)
"""The allowed magnitudes, in words, for messages."""


class Unit(NamedTuple):
    """A unit with its SI factor and dimension exponents.

    The exponents are those of m, kg, s, V and counts.
    """

    factor: float
    exponents: tuple[int, int, int, int, int]


_NONE: Final = (0, 0, 0, 0, 0)
_BASE: Final[dict[str, Unit]] = {
    "1": Unit(1.0, _NONE),
    "m": Unit(1.0, (1, 0, 0, 0, 0)),
    "g": Unit(1e-3, (0, 1, 0, 0, 0)),
    "s": Unit(1.0, (0, 0, 1, 0, 0)),
    "N": Unit(1.0, (1, 1, -2, 0, 0)),
    "J": Unit(1.0, (2, 1, -2, 0, 0)),
    "Pa": Unit(1.0, (-1, 1, -2, 0, 0)),
    "Hz": Unit(1.0, (0, 0, -1, 0, 0)),
    "V": Unit(1.0, (0, 0, 0, 1, 0)),
}
_PLAIN: Final[dict[str, Unit]] = {
    "min": Unit(60.0, (0, 0, 1, 0, 0)),
    "h": Unit(3600.0, (0, 0, 1, 0, 0)),
    "d": Unit(86400.0, (0, 0, 1, 0, 0)),
    "day": Unit(86400.0, (0, 0, 1, 0, 0)),
    "days": Unit(86400.0, (0, 0, 1, 0, 0)),
    "in": Unit(0.0254, (1, 0, 0, 0, 0)),
    "inch": Unit(0.0254, (1, 0, 0, 0, 0)),
    "thou": Unit(2.54e-5, (1, 0, 0, 0, 0)),
    "ft": Unit(0.3048, (1, 0, 0, 0, 0)),
    "rad": Unit(1.0, _NONE),
    "deg": Unit(math.pi / 180, _NONE),
    "%": Unit(0.01, _NONE),
    "count": Unit(1.0, (0, 0, 0, 0, 1)),
    "counts": Unit(1.0, (0, 0, 0, 0, 1)),
    "volt": Unit(1.0, (0, 0, 0, 1, 0)),
    "volts": Unit(1.0, (0, 0, 0, 1, 0)),
}
_PREFIX: Final = {
    "n": 1e-9,
    "u": 1e-6,
    "µ": 1e-6,
    "μ": 1e-6,
    "m": 1e-3,
    "c": 1e-2,
    "k": 1e3,
    "M": 1e6,
    "G": 1e9,
}
_DISPLAY: Final = {"m": (("mm", 1e-3),), "s": (("ms", 1e-3),)}
_NEGLIGIBLE: Final = 1e-14  # rounding of quantities of order one
_WRITTEN_OUT: Final = 9  # power of ten below which a number has no exponent
_MOST_DIGITS: Final = 15  # digits of a double
_SUPERSCRIPT: Final = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_TOKEN: Final = re.compile(r"(\s*)(\*\*|[*·/^()]|[^\W\d_]+|%|[-+]?\d+)")
_DEEPEST: Final = 8  # depth of nested parentheses from which on a unit is refused
_LARGEST_POWER: Final = 99
_LARGEST_WHOLE: Final = 1e300  # largest factor (or inverse factor) that is tested for being an integer
_LONGEST: Final = 1000  # characters; longer numbers are not scaled exactly
_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf"
_QUANTITY: Final = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*", re.DOTALL)
_DECIMAL_COMMA: Final = re.compile(r"\s*([-+]?)(\d*),(\d+)((?![\d,.]).*)", re.DOTALL)
_THOUSAND: Final = 3  # digits behind a comma that may separate thousands
_LIKELY: Final = {"m": "mm", "s": "ms"}  # the unit that is most likely meant if it is missing


def parse_unit(text: str) -> Unit:
    """Parse a unit such as `N*s/m`, `m/s^2`, `mm` or `N/(m/s)`.

    Args:
        text: the unit; `*`, `·` or a space multiplies, `/` divides by the next factor, `^`, `**` or a superscript
            raises to a power. After a division a space is ambiguous, and is refused.

    Returns:
        The factor to SI and the exponents of the base units.

    Raises:
        UnitError: the text is not a unit that pretouch knows.

    Examples:
        >>> parse_unit("mm/ms").factor
        1.0
    """
    tokens = _tokens(text)
    if not tokens:
        return Unit(1.0, _NONE)
    try:
        unit, rest = _product(tokens, text)
    except (OverflowError, ZeroDivisionError):
        unit, rest = Unit(math.inf, _NONE), []
    if rest:
        raise UnitError(f"{text!r} is not a unit: cannot read {rest[0]!r}", argument="unit", value=text)
    if not 0 < unit.factor < math.inf:
        raise UnitError(
            f"{text!r} is not a valid unit: its conversion factor to SI units would be zero or infinite",
            argument="unit",
            value=text,
        )
    return unit


def unit_tables() -> dict[str, dict[str, Any]]:
    """Return the known units and prefixes as a JSON object.

    Programs in other languages use these tables to parse quantities.

    Returns:
        `prefixable` and `units`: factor to SI and exponents of m, kg, s, V and counts, by name; `prefixes`: factors.
    """
    return {
        "prefixable": {name: [*unit] for name, unit in _BASE.items()},
        "units": {name: [*unit] for name, unit in {**_BASE, "kg": Unit(1.0, (0, 1, 0, 0, 0)), **_PLAIN}.items()},
        "prefixes": dict(_PREFIX),
    }


def _tokens(text: str) -> list[str]:
    """Split the text of a unit into symbols, integers and operators; a space between units becomes `*`."""
    source = re.sub(r"([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda m: "^" + m.group(1).translate(_SUPERSCRIPT), text).rstrip()
    tokens: list[str] = []
    divided = [False]  # for each open parenthesis, whether it contains a `/` so far
    position = 0
    while position < len(source):
        match = _TOKEN.match(source, position)
        if match is None:
            raise UnitError(
                f"{text!r} is not a unit: cannot read {source[position:].strip()!r}", argument="unit", value=text
            )
        space, part = match.groups()
        if space and tokens and _ends_factor(tokens) and _starts_factor(part):
            if divided[-1]:
                raise UnitError(
                    f"{text!r} is not a valid unit: the space before {part!r} is ambiguous; write * or / instead "
                    "of the space",
                    argument="unit",
                    value=text,
                )
            tokens.append("*")
        divided[-1] |= part == "/"
        if part == "(":
            divided.append(False)
            if len(divided) > _DEEPEST:
                raise UnitError(
                    f"{text!r} is not a valid unit: at most {_DEEPEST - 1} nested parentheses are allowed",
                    argument="unit",
                    value=text,
                )
        elif part == ")" and len(divided) > 1:
            divided.pop()
        tokens.append(part)
        position = match.end()
    return tokens


def _starts_factor(part: str) -> bool:
    return part in {"(", "%"} or part.isalpha()


def _ends_factor(tokens: list[str]) -> bool:
    """Check whether the last token completes a factor of a unit. Such a factor is `mm` or `s^2`."""
    return tokens[-1] in {")", "%"} or tokens[-1].isalpha() or (len(tokens) > 1 and tokens[-2] in {"^", "**"})


def _product(tokens: list[str], text: str) -> tuple[Unit, list[str]]:
    """Parse a product or quotient of units. The result is the unit and the unparsed tokens."""
    unit, tokens = _power(tokens, text)
    while tokens and tokens[0] in {"*", "·", "/"}:
        sign = -1 if tokens[0] == "/" else 1
        factor, tokens = _power(tokens[1:], text)
        unit = _combine(unit, factor, sign)
    return unit, tokens


def _power(tokens: list[str], text: str) -> tuple[Unit, list[str]]:
    """Parse one unit with its exponent. The result is the unit and the unparsed tokens."""
    if not tokens or tokens[0] in {"*", "**", "·", "/", "^", ")"}:
        raise UnitError(f"{text!r} is not a unit: a unit is missing", argument="unit", value=text)
    if tokens[0] == "(":
        unit, tokens = _product(tokens[1:], text)
        if not tokens or tokens[0] != ")":
            raise UnitError(f"{text!r} is not a unit: a parenthesis is not closed", argument="unit", value=text)
    else:
        unit = _symbol(tokens[0], text)
    tokens = tokens[1:]
    if tokens and tokens[0] in {"^", "**"}:
        if len(tokens) < 2 or not re.fullmatch(r"[-+]?\d{1,4}", tokens[1]) or abs(int(tokens[1])) > _LARGEST_POWER:
            raise UnitError(
                f"{text!r} is not a valid unit: exponents must be integers from -{_LARGEST_POWER} to {_LARGEST_POWER}",
                argument="unit",
                value=text,
            )
        unit = _combine(Unit(1.0, _NONE), unit, int(tokens[1]))
        tokens = tokens[2:]
    return unit, tokens


def _symbol(symbol: str, text: str) -> Unit:
    """Return the unit for a unit symbol."""
    if symbol in _PLAIN:
        return _PLAIN[symbol]
    if symbol in _BASE:
        return _BASE[symbol]
    if symbol[0] in _PREFIX and symbol[1:] in _BASE and symbol[1:] != "1":
        base = _BASE[symbol[1:]]
        # the gram has the factor 1e-3, so that "kg" is exactly 1
        factor = 1.0 if symbol == "kg" else _PREFIX[symbol[0]] * base.factor
        return Unit(factor, base.exponents)
    symbols = "m, s, g, N, J, Pa, Hz, V with a prefix, min, h, d, in, ft, counts, %"
    raise UnitError(
        f"{text!r} is not a valid unit: the symbol {symbol!r} is unknown; known symbols are {symbols}",
        argument="unit",
        value=text,
    )


def _combine(left: Unit, right: Unit, power: int) -> Unit:
    """Multiply a unit by a power of another unit."""
    exponents = tuple(a + power * b for a, b in zip(left.exponents, right.exponents, strict=True))
    factor = left.factor / right.factor if power == -1 else left.factor * right.factor**power
    return Unit(factor, exponents)  # type: ignore[arg-type]


def missing_unit(text: str, unit: str) -> str:
    """Suggest units for a number without a unit.

    Args:
        text: text that may be such a number.
        unit: the expected SI unit.

    Returns:
        The alternatives, for messages; empty also for infinity, which is the same in every unit.

    Examples:
        >>> missing_unit("42.2", "m")
        'a number with its unit, such as "42.2 mm", or 42.2 without quotes (unit: m)'
        >>> missing_unit("42.2 mm", "m"), missing_unit("0.95", "")
        ('', '')
    """
    match = _QUANTITY.fullmatch(text)
    if match is None or match.group(2) or "inf" in match.group(1) or parse_unit(unit).exponents == _NONE:
        return ""
    number, base = match.group(1), written_unit(unit)
    example = f"{number} {_LIKELY.get(unit, base)}"
    return f'a number with its unit, such as "{example}", or {float(number):.15g} without quotes (unit: {base})'


def to_si(value: float | str, unit: str, *, name: str, bare_text: bool = False) -> float:
    """Convert a number or text to a value in SI.

    The unit in the text is checked.

    Args:
        value: a number in SI, or text such as `"42.2 mm"`.
        unit: the expected SI unit, such as `m/s`; empty for a pure number.
        name: name of the quantity in messages.
        bare_text: whether text without a unit counts as a number in SI; if False, such text raises an error.

    Returns:
        The value in SI.

    Raises:
        UnitError: the text is not a quantity, lacks its unit, has another dimension, or is not a number.

    Examples:
        >>> to_si("42.2 mm", "m", name="position")
        0.0422
        >>> to_si(-0.3, "m/s", name="velocity")
        -0.3
    """
    expected = _expected("a quantity in", unit)
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise UnitError(
            f"{name}: found {value!r}, expected {_expected('a number or text with a unit of', unit)}", value=value
        )
    if isinstance(value, str):
        match = _QUANTITY.fullmatch(with_point(value, name=name))
        if match is None:
            raise UnitError(
                f"{name}: found {value!r}, expected {_expected('a number with a unit of', unit)}", value=value
            )
        try:
            parsed = parse_unit(match.group(2))
        except UnitError as error:
            raise UnitError(f"{name}: {error}; expected {_expected('a unit of', unit)}", value=value) from None
        required = parse_unit(unit)
        if not bare_text and (instead := missing_unit(match.group(0), unit)):
            raise UnitError(f"{name}: found {value!r}, expected {instead}", value=value)
        if match.group(2) and parsed.exponents != required.exponents:
            raise UnitError(f"{name}: found {value!r}, expected {expected}", value=value)
        number = _scaled(match.group(1), parsed.factor)
        if math.isinf(number) and "inf" not in match.group(1):
            raise UnitError(f"{name}: found {value!r}, which is larger than any float", value=value)
    else:
        try:
            number = float(value)
        except OverflowError:
            raise UnitError(
                f"{name}: found an integer that is too large for a floating-point number, expected {expected}",
                value=value,
            ) from None
    if math.isnan(number):
        raise UnitError(f"{name}: found {value!r}, expected {expected}", value=value)
    return number


def with_point(text: str, *, name: str) -> str:
    """Replace a decimal comma by a decimal point.

    Args:
        text: a number with or without a unit.
        name: name of the quantity in messages.

    Returns:
        The text, unchanged if it has no decimal comma.

    Raises:
        UnitError: the comma may also separate thousands.

    Examples:
        >>> with_point("0,3 m/s", name="speed"), with_point("0.3 m/s", name="speed")
        ('0.3 m/s', '0.3 m/s')
    """
    match = _DECIMAL_COMMA.match(text)
    if match is None:
        return text
    sign, whole, decimals, rest = match.groups()
    if len(decimals) == _THOUSAND and len(whole) <= _THOUSAND and whole.strip("0"):
        raise UnitError(
            f"{name}: found {text!r}, which may be {sign}{whole}{decimals} or {sign}{whole}.{decimals}; write one of "
            "these numbers, with a decimal point",
            value=text,
        )
    return f"{sign}{whole}.{decimals}{rest}"


def _expected(words: str, unit: str) -> str:
    """Describe the expected value for an error message."""
    return f"{words} {written_unit(unit)}" if unit else "a pure number"


def has_workable_magnitude(value: float) -> bool:
    """Check that a number is neither extremely large nor extremely small.

    Products of such numbers neither overflow nor underflow. Zero is accepted too.

    Args:
        value: a finite number.

    Returns:
        False if products of such numbers could overflow or underflow.

    Examples:
        >>> has_workable_magnitude(-0.3), has_workable_magnitude(0.0), has_workable_magnitude(1e-308)
        (True, True, False)
    """
    return value == 0 or MAGNITUDES[0] <= abs(value) <= MAGNITUDES[1]


def read_quantity(value: float | str, unit: str, *, name: str) -> float:
    """Convert a command-line quantity to SI units.

    Extremely large or small values raise an error.

    Args:
        value: a number, or text with or without a unit; text without a unit counts as a number in SI.
        unit: the expected SI unit.
        name: name of the quantity in messages.

    Returns:
        The value in SI; it may be infinite.

    Raises:
        UnitError: the value is not such a quantity, or its magnitude is outside MAGNITUDES.

    Examples:
        >>> read_quantity("-0.7 N*s", "N*s", name="gain")
        -0.7
    """
    number = to_si(value, unit, name=name, bare_text=True)
    if not (math.isinf(number) or has_workable_magnitude(number)):
        raise UnitError(f"{name}: found {value!r}, expected {_expected('a quantity in', unit)} {WORKABLE}", value=value)
    return number


def _scaled(literal: str, factor: float) -> float:
    """Multiply a number by its unit's factor with one rounding, so that `33.3 ms` becomes 0.0333 s."""
    number, size = float(literal), factor if factor >= 1 else 1 / factor
    whole = size < _LARGEST_WHOLE and math.isclose(size, round(size), rel_tol=1e-12)
    if not (whole and 0 < abs(number) < math.inf and len(literal) < _LONGEST):
        return number * factor
    exact = Fraction(literal) * (Fraction(round(size)) if factor >= 1 else Fraction(1, round(size)))
    try:
        return float(exact)
    except OverflowError:
        return math.copysign(math.inf, number)


def format_quantity(value: float, unit: str, digits: int = 4) -> str:
    """Format an SI value with its unit.

    Lengths below 1 m are in mm, and times below 1 s are in ms.

    Args:
        value: the value in SI.
        unit: its SI unit.
        digits: number of significant digits.

    Returns:
        Text such as `42.2 mm`.

    Examples:
        >>> format_quantity(0.0422, "m")
        '42.2 mm'
        >>> format_quantity(-0.74634, "N*s")
        '-0.7463 N s'
        >>> format_quantity(2.5, "m/s^2")
        '2.5 m/s²'
    """
    shown, symbol = (0.0 if abs(value) < _NEGLIGIBLE else value), unit
    for smaller, factor in _DISPLAY.get(unit, ()):
        if abs(value) < 1:
            shown, symbol = shown / factor, smaller
    text = f"{shown:.{digits}g}"
    return f"{text} {pretty_unit(symbol)}".strip()


def supported_digits(value: float, error: float = 0.0, least: int = 4) -> int:
    """Return how many significant digits of a value are shown.

    Two digits of its error are shown, and numbers below 1e9 are written out.

    Examples:
        >>> supported_digits(3186950.0, 240.0), supported_digits(0.6, 0.0018), supported_digits(65535.0)
        (7, 4, 5)
    """
    if not (value and math.isfinite(value)):
        return least
    place = int(f"{value:.{least - 1}e}".partition("e")[2])  # after rounding, which can add a place
    whole = place + 1 if place < _WRITTEN_OUT else 0
    resolved = place - math.floor(math.log10(error)) + 2 if 0 < error < math.inf else 0
    return min(max(least, whole, resolved), _MOST_DIGITS)


def format_percent(share: float, digits: int = 2) -> str:
    """Format a share as a percentage, without an exponent.

    Returns:
        The text.

    Examples:
        >>> format_percent(0.0123), format_percent(79.0)
        ('1.2 %', '7900 %')
    """
    return f"{100 * share:.{supported_digits(100 * share, least=digits)}g} %"


def format_range(ends: tuple[float, float], unit: str) -> str:
    """Format a range of SI values with its unit.

    Returns:
        Text such as `38 mm to 46 mm`.
    """
    return " to ".join(format_quantity(end, unit) for end in ends)


def pretty_unit(unit: str) -> str:
    """Format a unit for reports.

    Returns:
        Text such as `N s/m` for `N*s/m`, and `m/s²` for `m/s^2`.
    """
    return written_unit(unit).replace("*", " ")


def written_unit(unit: str) -> str:
    """Format a unit for messages.

    Returns:
        Text that users can type, such as `N*s²/m` for `N*s^2/m`.
    """
    return unit.replace("^2", "²").replace("^3", "³").replace("^n", "ⁿ")
