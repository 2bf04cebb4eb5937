"""Exponentials and rows of blocks for kernels that LLVM vectorizes.

Numba brings no vector library, and `math.exp` in a loop keeps it scalar. Here exp is the usual reduction
x = n ln 2 + r, |r| <= ln 2 / 2, with a polynomial in r and 2^n put together from its bits, so that the loops around it
run on vectors. The polynomial is kept as p(r) in e^r = 1 + r + r^2 p(r): near zero, where e^x - 1 and the quotients of
closed forms lose their digits, its parts are these quotients themselves,

    phi_1(x) = (e^x - 1) / x = 1 + x phi_2(x),   phi_2(x) = p(x),   phi_3(x) = (p(x) - 1/2) / x.

A block is one flat array in which row k starts at k BLOCK: between parts of one array LLVM sees by itself that what is
written is not read again, where separate arrays would ask for more checks than it is willing to make.
"""

from __future__ import annotations

from typing import Any

import numba
from numba.core import types

from .compiler import block_part

__all__ = ["BLOCK", "exponential", "exponential_parts", "load_row", "rough_exponential", "rough_logarithm"]

BLOCK = 256

_LOG2E = 1.4426950408889634
_LN2 = 0.6931471805599453
_LN2_HIGH = 0.6931471803691238
_LN2_LOW = 1.9082149292705877e-10
_ROOT2 = 1.4142135623730951
_SHIFT = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to an integer, which then are the lowest bits
_LOWEST = -708.0
_P0 = 0.5
_P1 = 0.16666666666666666
_P2 = 0.041666666666651246
_P3 = 0.008333333333332147
_P4 = 0.0013888888905973543
_P5 = 0.00019841269854409363
_P6 = 2.480153620505534e-05
_P7 = 2.755727992579576e-06
_P8 = 2.761390867578486e-07
_P9 = 2.509563297507093e-08


def _emit_power(_context: Any, _shifted: Any) -> Any:
    """Numba's intrinsic for 2^n, n the integer in the lowest bits of a shifted number."""

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        integer = context.get_value_type(types.int64)
        biased = builder.add(builder.bitcast(arguments[0], integer), integer(1023))
        return builder.bitcast(builder.shl(biased, integer(52)), arguments[0].type)

    return types.float64(types.float64), build


_power: Any = numba.extending.intrinsic(_emit_power)


def _emit_octave(_context: Any, _value: Any) -> Any:
    """Numba's intrinsic for 2^n and n of a positive float 2^n m, 1 <= m < 2."""

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        integer = context.get_value_type(types.int64)
        exponent = builder.lshr(builder.bitcast(arguments[0], integer), integer(52))
        power = builder.bitcast(builder.shl(exponent, integer(52)), arguments[0].type)
        shifted = builder.bitcast(builder.or_(exponent, integer(0x433 << 52)), arguments[0].type)  # 2^52 + exponent
        number = builder.fsub(shifted, arguments[0].type(2.0**52 + 1023.0))
        return context.make_tuple(builder, _signature.return_type, (power, number))

    pair: Any = types.UniTuple
    return pair(types.float64, 2)(types.float64), build


_octave: Any = numba.extending.intrinsic(_emit_octave)


@block_part
def exponential(x: float) -> Any:
    """Return e^x and 1 - e^x for x <= 0, each to a few units of its last digit; below -708 e^x stays at 3e-308."""
    x = _LOWEST if x < _LOWEST else x  # a nan stays one
    shifted = x * _LOG2E + _SHIFT
    n = shifted - _SHIFT
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    s = r * r
    f = s * s
    high = (_P8 + _P9 * r) * f + ((_P4 + _P5 * r) + (_P6 + _P7 * r) * s)
    p = (_P0 + _P1 * r) + (_P2 + _P3 * r) * s + high * f
    q = r + s * p
    power = _power(shifted)
    return power + power * q, (1.0 - power) - power * q


@block_part
def exponential_parts(x: float) -> Any:
    """Return e^x and 1 - e^x for x <= 0, and phi_2(x), phi_3(x) with whether these two hold: near zero, above -0.34."""
    x = _LOWEST if x < _LOWEST else x
    shifted = x * _LOG2E + _SHIFT
    n = shifted - _SHIFT
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    s = r * r
    high = (_P5 + _P6 * r) + (_P7 + _P8 * r) * s + _P9 * (s * s)
    cubic = (_P1 + _P2 * r) + (_P3 + _P4 * r) * s + high * (s * s)
    p = _P0 + r * cubic
    q = r + s * p
    power = _power(shifted)
    return power + power * q, (1.0 - power) - power * q, p, cubic, n == 0.0


@block_part
def rough_exponential(x: float) -> Any:
    """Return e^x and 1 - e^x for x <= 0 to some 1e-6 of themselves: for the first step of an iteration."""
    x = _LOWEST if x < _LOWEST else x
    shifted = x * _LOG2E + _SHIFT
    n = shifted - _SHIFT
    r = x - n * _LN2
    s = r * r
    q = r + s * ((_P0 + _P1 * r) + (_P2 + _P3 * r) * s)
    power = _power(shifted)
    return power + power * q, (1.0 - power) - power * q


@block_part
def rough_logarithm(x: float) -> float:
    """Return ln(1 + x) for x >= 0 to 1e-9 of itself, small ones included: for a place, not for a value."""
    power, n = _octave((1.0 + x) * _ROOT2)
    s = (x - (power - 1.0)) / (x + 1.0 + power)  # |s| <= 0.1716
    f = s * s
    return n * _LN2 + 2.0 * s * (
        ((1.0 + f * (1 / 3)) + f * f * ((1 / 5) + f * (1 / 7))) + (f * f) * (f * f) * ((1 / 9) + f * (1 / 11))
    )


@block_part
def load_row(data: Any, row: int, values: Any, start: int, stop: int) -> None:
    """Copy a block of an input into the row that starts at row; one value for all encounters once, with the first."""
    if values.size != 1:
        part = values[start:stop]
        for i in range(part.size):
            data[row + i] = part[i]
    elif start == 0:
        data[row : row + BLOCK] = values[0]
