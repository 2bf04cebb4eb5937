"""Numbers at the public border: none that is missing, infinite or no number at all comes in."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch._core.errors import InvalidInputError, PretouchError
from pretouch._core.numbers import finite, nonnegative, positive
from refusals import refused

CHECKS = pytest.mark.parametrize("check", [finite, positive, nonnegative])


@CHECKS
@pytest.mark.parametrize("value", [5, 5.0, np.float32(5), np.int64(5), np.array(5), Decimal(5), Fraction(10, 2)])
def test_a_scalar_becomes_a_float(check: object, value: object) -> None:
    found = check(value, "mass", "kg")  # type: ignore[operator]
    assert type(found) is float
    assert found == 5.0


@CHECKS
@pytest.mark.parametrize("value", [[5, 6], (5.0, 6.0), np.array([5, 6], dtype=np.int8), np.ma.array([5.0, 6.0])])
def test_an_array_becomes_a_float_array_that_nobody_can_change(check: object, value: object) -> None:
    found = check(value, "mass", "kg")  # type: ignore[operator]
    assert type(found) is np.ndarray
    assert found.dtype == np.float64
    assert found.tolist() == [5.0, 6.0]
    with pytest.raises(ValueError, match="read-only"):
        found[0] = 1.0


def test_the_callers_own_array_stays_his_own() -> None:
    mine = np.array([1.0, 2.0])
    found = finite(mine, "mass")
    mine[0] = 7.0
    assert found.tolist() == [1.0, 2.0]


@CHECKS
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, None, 10**400])
def test_a_missing_or_infinite_number_is_refused(check: object, value: object) -> None:
    for given_value in (value, [1.0, value], np.array([[1.0], [value]], dtype=object)):
        with refused("mass", limit=(-np.inf, np.inf)):
            check(given_value, "mass", "kg")  # type: ignore[operator]


@CHECKS
@pytest.mark.parametrize(
    "value",
    [
        "5",
        "five",
        ["1", "2"],
        b"5",
        True,
        [True, False],
        5j,
        np.array([1 + 2j]),
        [[1.0], [1.0, 2.0]],
        {"mass": 5},
        object(),
        np.datetime64("2020-01-01"),
        np.ma.array([1.0, 2.0], mask=[False, True]),
    ],
)
def test_what_is_no_number_is_refused(check: object, value: object) -> None:
    """Text, truth values, imaginary parts and masks are all things that NumPy turns into floats without a word."""
    with refused("mass"):
        check(value, "mass", "kg")  # type: ignore[operator]


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_the_sign_decides(value: float) -> None:
    assert finite(value, "x") == value
    for check, holds, rule in ((positive, value > 0, "positive"), (nonnegative, value >= 0, "not be negative")):
        for given_value in (value, [1.0, value]):
            if holds:
                assert np.all(check(given_value, "x", "m") == np.asarray(given_value))
            else:
                with pytest.raises(InvalidInputError) as refused:
                    check(given_value, "x", "m")
                assert str(refused.value).startswith(f"x: found {value:g} m, which must ")
                assert str(refused.value).endswith(rule)


def test_the_first_culprit_is_named_and_the_unit_left_out_where_there_is_none() -> None:
    with refused("order", value=-2.0):
        positive([[1.0, -2.0], [-3.0, 4.0]], "order")


@CHECKS
def test_no_numbers_at_all_are_none_that_are_wrong(check: object) -> None:
    assert check([], "mass").shape == (0,)  # type: ignore[operator]


def test_the_error_is_a_value_error_and_a_pretouch_error() -> None:
    with refused("mass", error=ValueError):
        finite(np.nan, "mass")
    with pytest.raises(PretouchError):
        finite(np.nan, "mass")
