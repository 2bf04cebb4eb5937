"""Arithmetic on eight encounters at once: what LLVM needs to be told so that it becomes vector instructions.

Numba's loop vectorizer turns a loop over lanes into vector code, but keeps the sums of a convolution in memory, and its
vectorizer of straight-line code is off. So the two inner steps of series_block are written as expressions of vectors:
`Vector` is a value of eight floats with Python's operators, and `Rows` the rows of an array of shape (rows, 8) that
starts at a multiple of 64 bytes. LLVM splits the vectors into what the processor has: one register of AVX-512, two of
AVX2, four of NEON.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils

from .compiler import kernel

__all__ = ["LANES", "Rows", "Vector", "aligned_rows"]

LANES = 8
_FLOATS = ir.VectorType(ir.DoubleType(), LANES)
_INTEGERS = ir.VectorType(ir.IntType(64), LANES)
_MANTISSA = 2.0**52


@kernel
def aligned_rows(count: int) -> Any:
    """Return zeros of shape (count, LANES) that start at a multiple of 64 bytes."""
    room = np.zeros(count * LANES + 8)
    skip = (-(room.ctypes.data >> 3)) & 7
    return room[skip : skip + count * LANES].reshape(count, LANES)


class Vector:
    """A value of eight floats in the code that is being built."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder = builder
        self.value = value

    def _other(self, other: Vector | float) -> Any:
        return other.value if isinstance(other, Vector) else ir.Constant(_FLOATS, [float(other)] * LANES)

    def __add__(self, other: Vector | float) -> Vector:
        return Vector(self.builder, self.builder.fadd(self.value, self._other(other)))

    def __sub__(self, other: Vector | float) -> Vector:
        return Vector(self.builder, self.builder.fsub(self.value, self._other(other)))

    def __mul__(self, other: Vector | float) -> Vector:
        return Vector(self.builder, self.builder.fmul(self.value, self._other(other)))

    def __truediv__(self, other: Vector | float) -> Vector:
        return Vector(self.builder, self.builder.fdiv(self.value, self._other(other)))

    def __neg__(self) -> Vector:
        return Vector(self.builder, self.builder.fneg(self.value))

    def __abs__(self) -> Vector:
        return self._call("llvm.fabs", self)

    def plus(self, left: Vector | float, right: Vector | float) -> Vector:
        """Return self + left * right, fused where the processor can."""
        return self._call("llvm.fmuladd", left, right, self)

    def _call(self, name: str, *arguments: Vector | float) -> Vector:
        signature = ir.FunctionType(_FLOATS, [_FLOATS] * len(arguments))
        insert: Any = cgutils.get_or_insert_function
        function = insert(self.builder.module, signature, f"{name}.v{LANES}f64")
        return Vector(self.builder, self.builder.call(function, [self._other(a) for a in arguments]))

    def below(self, other: Vector | float) -> Any:
        """Compare lane by lane; not-a-number is below nothing."""
        return self.builder.fcmp_ordered("<", self.value, self._other(other))

    def where(self, condition: Any, other: Vector | float) -> Vector:
        """Return self in the lanes where the condition holds, the other elsewhere."""
        return Vector(self.builder, self.builder.select(condition, self.value, self._other(other)))

    def least(self, other: Vector) -> Vector:
        """Return the smaller of the two; the other where self is not a number."""
        return self.where(self.below(other), other)

    def most(self, other: Vector | float) -> Vector:
        """Return the larger of the two; self where the other is not a number."""
        value = other if isinstance(other, Vector) else Vector(self.builder, self._other(other))
        return value.where(self.below(value), self)

    def logarithm(self) -> Vector:
        """Return about log2 |self|, to 0.09, from the bits of the float."""
        bits = self.builder.bitcast(abs(self).value, _INTEGERS)
        return Vector(self.builder, self.builder.sitofp(bits, _FLOATS)) * (1 / _MANTISSA) - 1023.0

    def exponential(self) -> Vector:
        """Return about 2 to the power of self, at most 6 % too large, for |self| < 1000."""
        bits = self.builder.fptosi(((self + 1023.0) * _MANTISSA).value, _INTEGERS)
        return Vector(self.builder, self.builder.bitcast(bits, _FLOATS))


class Rows:
    """The rows of an aligned array of shape (rows, LANES), in the code that is being built."""

    def __init__(self, context: Any, builder: Any, array_type: Any, array: Any) -> None:
        data = context.make_array(array_type)(context, builder, array).data
        self._builder = builder
        self._start = builder.bitcast(data, ir.PointerType(_FLOATS))

    def _at(self, row: int) -> Any:
        return self._builder.gep(self._start, [ir.Constant(ir.IntType(64), row)])

    def __getitem__(self, row: int) -> Vector:
        return Vector(self._builder, self._builder.load(self._at(row), align=64))

    def __setitem__(self, row: int, vector: Vector) -> None:
        self._builder.store(vector.value, self._at(row), align=64)

    def constant(self, value: float) -> Vector:
        """Return a vector of equal values."""
        return Vector(self._builder, ir.Constant(_FLOATS, [float(value)] * LANES))

    def all(self, conditions: Sequence[Any]) -> Any:
        """Return the condition that all conditions hold."""
        both = conditions[0]
        for condition in conditions[1:]:
            both = self._builder.and_(both, condition)
        return both

    def masks(self, *conditions: Any) -> Any:
        """Return an integer with one bit for each lane in which a condition holds, the first condition lowest."""
        word, total = ir.IntType(64), ir.Constant(ir.IntType(64), 0)
        for place, condition in enumerate(conditions):
            bits = self._builder.zext(self._builder.bitcast(condition, ir.IntType(LANES)), word)
            total = self._builder.or_(total, self._builder.shl(bits, ir.Constant(word, place * LANES)))
        return total
