"""Text with units: what is read, exactly to which float, and what is refused with a sentence."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch._core.errors import UnitError
from pretouch._core.units import format_quantity, parse_unit, read_quantity, to_si
from pretouch.recording.record_distances import read_distance, read_distances
from properties import examples
from refusals import refused

FINITE = st.floats(allow_nan=False, allow_infinity=False)
LENGTH, MASS, TIME, VOLT, COUNT = np.eye(5, dtype=int)


@pytest.mark.parametrize(
    ("text", "factor", "exponents"),
    [
        ("", 1.0, 0 * LENGTH),
        ("1", 1.0, 0 * LENGTH),
        ("%", 0.01, 0 * LENGTH),
        ("rad/s", 1.0, -TIME),
        ("m", 1.0, LENGTH),
        ("mm", 1e-3, LENGTH),
        ("cm", 1e-2, LENGTH),
        ("km", 1e3, LENGTH),
        ("in", 0.0254, LENGTH),
        ("µm", 1e-6, LENGTH),  # the micro sign
        ("μm", 1e-6, LENGTH),  # the Greek letter
        ("um", 1e-6, LENGTH),
        ("nm", 1e-9, LENGTH),
        ("g", 1e-3, MASS),
        ("kg", 1.0, MASS),
        ("ms", 1e-3, TIME),
        ("min", 60.0, TIME),
        ("h", 3600.0, TIME),
        ("Hz", 1.0, -TIME),
        ("kHz", 1e3, -TIME),
        ("kN", 1e3, LENGTH + MASS - 2 * TIME),
        ("J", 1.0, 2 * LENGTH + MASS - 2 * TIME),
        ("GPa", 1e9, MASS - LENGTH - 2 * TIME),
        ("mV", 1e-3, VOLT),
        ("counts", 1.0, COUNT),
        ("1/m", 1.0, -LENGTH),
        ("m/s^2", 1.0, LENGTH - 2 * TIME),
        ("m/s**2", 1.0, LENGTH - 2 * TIME),
        ("m/s²", 1.0, LENGTH - 2 * TIME),
        ("m s⁻²", 1.0, LENGTH - 2 * TIME),
        ("m*s^-2", 1.0, LENGTH - 2 * TIME),
        ("(m/s)^2", 1.0, 2 * LENGTH - 2 * TIME),
        ("N*s", 1.0, LENGTH + MASS - TIME),
        ("N·s", 1.0, LENGTH + MASS - TIME),
        ("N s", 1.0, LENGTH + MASS - TIME),
        ("N*s/m", 1.0, MASS - TIME),
        ("N s/m", 1.0, MASS - TIME),
        ("N/(m/s)", 1.0, MASS - TIME),
        ("N/(m s)", 1.0, MASS - 3 * TIME),
        ("m^2 s", 1.0, 2 * LENGTH + TIME),
        (" N * s / m ", 1.0, MASS - TIME),
        ("mm/ms", 1.0, LENGTH - TIME),
        ("N/mm", 1e3, MASS - 2 * TIME),
        ("mm^2", 1e-6, 2 * LENGTH),
    ],
)
def test_a_unit_is_a_factor_and_exponents(text: str, factor: float, exponents: np.ndarray) -> None:
    unit = parse_unit(text)
    assert unit.exponents == tuple(exponents)
    assert unit.factor == pytest.approx(factor, rel=4 * 2.0**-53)  # a product of two rounded prefixes


def test_division_binds_from_the_left_and_powers_first() -> None:
    assert parse_unit("N/m/s") == parse_unit("N/(m*s)")
    assert parse_unit("N/m*s") == parse_unit("(N/m)*s") != parse_unit("N/(m*s)")
    assert parse_unit("m/s^2") == parse_unit("m/(s*s)") != parse_unit("(m/s)^2")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("bar", "'bar' is unknown"),
        ("kmm", "'kmm' is unknown"),
        ("k", "'k' is unknown"),
        ("5", "'5' is unknown"),
        ("m2", "cannot read '2'"),
        ("m(s)", "cannot read '('"),
        ("m)", "cannot read ')'"),
        ("m^2^2", "cannot read '^'"),
        ("m,s", "cannot read ',s'"),
        ("1 mm", "cannot read 'mm'"),
        ("(m", "a parenthesis is not closed"),
        ("()", "a unit is missing"),
        ("/m", "a unit is missing"),
        ("m*", "a unit is missing"),
        ("m//s", "a unit is missing"),
        ("m^", "exponents must be integers"),
        ("m^s", "exponents must be integers"),
        ("m^0.5", "cannot read '.5'"),
        ("m^100", "exponents must be integers from -99 to 99"),
        ("m^" + "9" * 5000, "exponents must be integers from -99 to 99"),
        ("N/m s", "the space before 's' is ambiguous"),
        ("nm^-40", "its conversion factor to SI units would be zero or infinite"),
        ("km^99/nm^99", "its conversion factor to SI units would be zero or infinite"),
        ("1/(nm^36)", "its conversion factor to SI units would be zero or infinite"),
        ("((nm^36))^9", "its conversion factor to SI units would be zero or infinite"),
        ("(" * 5000 + "m", "at most 7 nested parentheses are allowed"),
    ],
)
def test_what_is_no_unit_is_refused_with_the_reason(text: str, reason: str) -> None:
    with pytest.raises(UnitError) as refused:
        parse_unit(text)
    assert repr(text) in str(refused.value)
    assert reason in str(refused.value)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("42.2 mm", "m", 0.0422),
        ("41.9mm", "m", 0.0419),
        ("-0.3 m/s", "m/s", -0.3),
        ("-300 mm/s", "m/s", -0.3),
        ("10 N*s/m", "N*s/m", 10.0),
        ("10 N/(m/s)", "N*s/m", 10.0),
        ("-0.7463 N s", "N*s", -0.7463),
        ("2.5 N/cm", "N/m", 250.0),
        ("3 N/nm", "N/m", 3e9),
        ("70 GPa", "Pa", 70e9),
        ("5 µm", "m", 5e-6),
        ("-61 1/m", "1/m", -61.0),
        ("-0.061 1/mm", "1/m", -61.0),
        ("33.3 ms", "s", 0.0333),
        ("1" + "0" * 5000 + "e-5000 mm", "m", 0.001),
        ("1e-400 mm", "m", 0.0),
        ("2 min", "s", 120.0),
        ("50 %", "", 0.5),
        ("1.3e-5", "", 1.3e-5),
        (".5 m", "m", 0.5),
        ("5. m", "m", 5.0),
        ("+5E-1 m", "m", 0.5),
        ("  42.2   mm  ", "m", 0.0422),
        ("inf mm", "m", math.inf),
        ("-inf", "m", -math.inf),
        (42.2, "m", 42.2),
        (5, "m", 5.0),
        (math.inf, "m", math.inf),
    ],
)
def test_a_quantity_is_exactly_this_number_in_si(text: float | str, unit: str, value: float) -> None:
    found = to_si(text, unit, name="quantity")
    assert type(found) is float
    assert found == value


@given(x=FINITE)
def test_a_multiple_of_a_unit_is_rounded_once(x: float) -> None:
    """The float next to the number as written; x / 1000 rounds what was written and then the quotient: 1 ulp apart."""
    found = to_si(f"{x!r} mm", "m", name="length")
    assert found == float(Fraction(repr(x)) / 1000)
    assert abs(found - x / 1000) <= math.ulp(x / 1000)
    assert to_si(f"{x!r} µm", "m", name="length") == float(Fraction(repr(x)) / 1_000_000)


@given(x=FINITE)
def test_a_bare_number_is_taken_as_si_and_as_text_only_if_bare_text_is_allowed(x: float) -> None:
    assert to_si(x, "m", name="length") == to_si(f"{x!r} m", "m", name="l") == x
    assert to_si(repr(x), "m", name="length", bare_text=True) == x
    with refused("length", error=UnitError):
        to_si(repr(x), "m", name="length")


def test_an_option_of_the_command_line_may_be_a_bare_number() -> None:
    assert read_quantity("-0.7", "N*s", name="--gain") == read_quantity("-0.7 N*s", "N*s", name="--gain") == -0.7


@pytest.mark.parametrize(
    ("value", "unit", "reason"),
    [
        ("42.2", "m", """found '42.2', expected a number with its unit, such as "42.2 mm", or 42.2 without quotes"""),
        ("1", "kg", """such as "1 kg", or 1 without quotes (unit: kg)"""),
        (" -0.3 ", "m/s^2", """such as "-0.3 m/s²", or -0.3 without quotes (unit: m/s²)"""),
        ("1e-3", "s", """such as "1e-3 ms", or 0.001 without quotes (unit: s)"""),
        ("42.2 mm", "m/s", "found '42.2 mm', expected a quantity in m/s"),
        ("5 N*s", "N*s/m", "found '5 N*s', expected a quantity in N*s/m"),
        ("5 m", "", "found '5 m', expected a pure number"),
        ("5 %", "m", "found '5 %', expected a quantity in m"),
        ("5 counts", "V", "found '5 counts', expected a quantity in V"),
        ("5 parsec", "m", "'parsec' is not a valid unit: the symbol 'parsec' is unknown; known symbols are m, s, g,"),
        ("42,2,1 mm", "m", "cannot read ',2,1 mm'"),
        ("3 1 mm", "m", "cannot read 'mm'"),
        ("", "m", "found '', expected a number with a unit of m"),
        ("   ", "m", "expected a number with a unit of m"),
        ("mm", "m", "found 'mm', expected a number with a unit of m"),
        ("m 5", "m", "expected a number with a unit of m"),
        ("nan", "m", "found 'nan', expected a number with a unit of m"),
        ("--5 m", "m", "expected a number with a unit of m"),
        ("1e999 m", "m", "found '1e999 m', which is larger than any float"),
        ("1e308 km", "m", "found '1e308 km', which is larger than any float"),
        (10**400, "m", "found an integer that is too large for a floating-point number, expected a quantity in m"),
        (math.nan, "m", "found nan, expected a quantity in m"),
        (True, "m", "found True, expected a number or text with a unit of m"),
        (None, "m", "found None, expected a number or text with a unit of m"),
        ([5.0], "m", "found [5.0], expected a number or text with a unit of m"),
        (5j, "m", "found 5j, expected a number or text with a unit of m"),
        (b"5 m", "m", "found b'5 m', expected a number or text with a unit of m"),
    ],
)
def test_what_is_no_such_quantity_is_refused_with_its_name_and_the_reason(
    value: object, unit: str, reason: str
) -> None:
    with pytest.raises(UnitError) as refused:
        to_si(value, unit, name="obstacle position")  # type: ignore[arg-type]
    assert str(refused.value).startswith("obstacle position: ")
    assert reason in str(refused.value)


def _outcome(function: Callable, *arguments: object, **named: object) -> tuple[Any, str]:
    """What a function returns, or None and the message of its UnitError; any other error passes."""
    try:
        return function(*arguments, **named), ""
    except UnitError as error:
        return None, str(error)


GRAMMAR = st.text(st.sampled_from(list("mskgNVPaHz1209.eE+-*/^() %µ·²⁻in\t")), max_size=16)


@examples(300)
@given(text=st.text(max_size=20) | GRAMMAR)
def test_any_text_is_a_unit_or_a_unit_error(text: str) -> None:
    unit, message = _outcome(parse_unit, text)
    if unit is None:
        assert repr(text) in message
    else:
        assert 0 < unit.factor < math.inf
        assert {type(e) for e in unit.exponents} == {int}


@examples(300)
@given(
    text=st.text(max_size=20) | GRAMMAR | st.builds("{} {}".format, FINITE, GRAMMAR),
    unit=st.sampled_from(["m", "", "N*s/m", "1/m"]),
)
def test_any_text_is_a_quantity_or_a_unit_error(text: str, unit: str) -> None:
    number, message = _outcome(to_si, text, unit, name="quantity")
    if number is None:
        assert message.startswith("quantity: ")
    else:
        assert type(number) is float
        assert not math.isnan(number)


@pytest.mark.parametrize("unit", ["m", "s", "m/s", "m/s^2", "N*s", "N*s/m", "N", "1/m", "kg", "V", ""])
@given(value=FINITE, digits=st.integers(1, 17))
def test_what_is_written_for_a_person_can_be_read_back(unit: str, value: float, digits: int) -> None:
    text = format_quantity(value, unit, digits)
    # half a unit of the last digit shown, three roundings, and what is negligible beside quantities of order one
    allowed = abs(value) * (0.5 * 10.0 ** (1 - digits) + 2.0**-51) + 1e-14
    back, message = _outcome(to_si, text, unit, name="quantity")
    if back is None:  # the largest floats of all, rounded up
        assert "larger than any float" in message
        assert abs(value) > 1.7e308 * (1 - 10.0 ** (1 - digits))
    else:
        assert abs(back - value) <= allowed


@pytest.mark.parametrize(
    ("value", "unit", "digits", "text"),
    [
        (0.0422, "m", 4, "42.2 mm"),
        (-0.0915, "m", 4, "-91.5 mm"),
        (1.0, "m", 4, "1 m"),
        (0.0, "m", 4, "0 mm"),
        (-0.0, "m", 4, "0 mm"),
        (1e-17, "m", 4, "0 mm"),
        (0.4458, "s", 3, "446 ms"),
        (27.07, "s", 4, "27.07 s"),
        (-0.74634, "N*s", 4, "-0.7463 N s"),
        (59.1337, "N*s/m", 4, "59.13 N s/m"),
        (0.10698, "", 4, "0.107"),
        (math.inf, "m", 4, "inf m"),
    ],
)
def test_a_person_reads_lengths_in_mm_and_times_in_ms(value: float, unit: str, digits: int, text: str) -> None:
    assert format_quantity(value, unit, digits) == text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0,3 m/s", 0.3),
        ("-0,7 m/s", -0.7),
        (",3 m/s", 0.3),
        ("0,300 m/s", 0.3),
        ("1,5e-3 m/s", 1.5e-3),
        ("1250,5 mm/s", 1.2505),
    ],
)
def test_a_decimal_comma_is_understood(text: str, value: float) -> None:
    assert to_si(text, "m/s", name="speed") == value


@pytest.mark.parametrize("text", ["1,250 m/s", "-12,500 mm/s"])
def test_a_comma_that_may_separate_thousands_is_refused_with_both_readings(text: str) -> None:
    with pytest.raises(UnitError) as error:
        to_si(text, "m/s", name="speed")
    number = text.split(maxsplit=1)[0]
    assert number.replace(",", "") in str(error.value)
    assert number.replace(",", ".") in str(error.value)


def test_typed_distances_may_have_decimal_commas() -> None:
    assert read_distances("0; 2,5; 5 mm") == (0.0, 0.0025, 0.005)
    assert read_distances("0, 2.5, 5 mm") == (0.0, 0.0025, 0.005)
    assert read_distance("2,5") == 0.0025  # in mm, as 2.5
