"""The compiled core: a plain shared library, loaded by ctypes when a kernel is first called.

A kernel takes numbers and addresses. `address` gives that of an array and refuses every array that a kernel would
misread, so an error here is a Python exception and never a crash there. ctypes releases the interpreter's lock while a
kernel runs.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from struct import pack
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .errors import InvalidInputError

__all__ = [
    "DOUBLE",
    "INTEGER",
    "POINTER",
    "VARIANTS",
    "address",
    "columns",
    "entry",
    "kernel",
    "rows_of",
    "shaped",
    "variant",
]

POINTER: Final = ctypes.c_void_p
INTEGER: Final = ctypes.c_int64
DOUBLE: Final = ctypes.c_double

VARIANTS: Final = ("base", "avx2", "avx512")
"""For which kinds of processor there are kernels."""

_SWITCH: Final = "PRETOUCH_VARIANT"
_OTHER: Final = "PRETOUCH_LIBRARY"  # a library in the place of the own one, such as one that checks itself
_SUFFIXES: Final = {"win32": ".dll", "darwin": ".dylib"}
_FLOAT: Final = np.dtype(np.float64)
_word: Final = ctypes.c_size_t.from_address


def _head() -> int | None:
    """Return where an array's own object holds the address of its numbers, None where it can not be told so."""
    if sys.implementation.name != "cpython":
        return None
    probe, head = np.zeros(1), object.__basicsize__  # the first field, by NumPy's ABI
    return head if _word(id(probe) + head).value == probe.ctypes.data else None


_HEAD: Final = _head()


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    """Load the library and choose the kernels for this processor, or those that the environment asks for."""
    own = Path(__file__).with_name(f"libpretouch{_SUFFIXES.get(sys.platform, '.so')}")
    path = Path(os.environ.get(_OTHER) or own)
    if not path.exists():
        raise ImportError(
            f"pretouch's compiled core, {path.name}, is missing in {path.parent}: install pretouch by pip, which "
            "brings or builds it; in a source tree, run python native/build.py"
        )
    library = ctypes.CDLL(str(path))
    wanted = os.environ.get(_SWITCH, "")
    if wanted not in {"", *VARIANTS}:
        raise InvalidInputError(f"{_SWITCH}: found {wanted!r}, expected one of {', '.join(VARIANTS)}")
    number = VARIANTS.index(wanted) if wanted else -1
    if wanted and library.pretouch_choose_variant(number) != number:
        raise InvalidInputError(f"{_SWITCH}: found {wanted}, which this processor does not have")
    return library


def variant() -> str:
    """Return for which kind of processor the kernels that run are compiled, one of VARIANTS."""
    best = _library().pretouch_best_variant()  # having refused what the environment may not ask for
    return os.environ.get(_SWITCH) or VARIANTS[best]


def kernel(name: str, *arguments: Any, result: Any = None) -> Callable[..., Any]:
    """Return a function of the library, which is loaded when it is first called.

    Args:
        name: what it is called there, without `pretouch_`.
        *arguments: the types of its arguments: POINTER, INTEGER or DOUBLE.
        result: the type of what it returns; None for nothing.

    Returns:
        The function, of addresses and numbers.
    """
    found: Any = None

    def call(*values: Any) -> Any:
        nonlocal found
        if found is None:
            function = _library()[f"pretouch_{name}"]
            function.argtypes, function.restype = arguments, result
            found = function
        return found(*values)

    return call


def entry(name: str) -> int:
    """Return the address of a function of the library, for what calls it from there.

    Args:
        name: what it is called there, without `pretouch_`.

    Returns:
        The address.
    """
    return ctypes.cast(_library()[f"pretouch_{name}"], POINTER).value or 0


def address(array: NDArray[Any], dtype: np.dtype[Any] = _FLOAT) -> int:
    """Return where the numbers of an array lie.

    Args:
        array: contiguous, in C's order; it must outlive the call that takes the address.
        dtype: of its numbers.

    Returns:
        The address.

    Raises:
        TypeError: the array is not of that type, or not contiguous.
    """
    if array.dtype != dtype or not array.flags.c_contiguous:
        raise TypeError(f"a kernel takes contiguous arrays of {dtype}, not {array.dtype} with strides {array.strides}")
    if _HEAD is None:
        return int(array.__array_interface__["data"][0])
    return _word(id(array) + _HEAD).value  # ten times as fast as to ask for it


def shaped(array: NDArray[Any], shape: tuple[int, ...], dtype: np.dtype[Any] = _FLOAT) -> int:
    """Return where the numbers of an array of a certain shape lie.

    Args:
        array: see `address`.
        shape: what a kernel reads or fills.
        dtype: see `address`.

    Returns:
        The address.

    Raises:
        TypeError: the array is not of that shape or type, or not contiguous.
    """
    if array.shape != shape:
        raise TypeError(f"a kernel takes an array of shape {shape} here, not {array.shape}")
    return address(array, dtype)


def rows_of(array: NDArray[np.float64], shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return where the rows of a part of an array lie, that a kernel fills.

    Args:
        array: as for `address`, but only its last axis need be contiguous.
        shape: what a kernel fills.

    Returns:
        The address, and for each axis but the last how many numbers lie from one index to the next.

    Raises:
        TypeError: the array is not of that shape or type, or has another last axis.
    """
    *steps, last = array.strides
    if array.shape != shape or (last != _FLOAT.itemsize and array.size) or not array.flags.aligned:
        raise TypeError(f"a kernel takes rows of shape {shape} here, not {array.shape} with strides {array.strides}")
    start = address(array[..., :0])  # a part without numbers is contiguous
    return (start, *[step // _FLOAT.itemsize for step in steps])


def columns(arrays: Sequence[NDArray[np.float64]], count: int | None = None) -> bytes:
    """Return addresses and strides of several arrays as the kernels' pretouch_column.

    Args:
        arrays: of one number for all encounters, or of one for each.
        count: how many encounters there are, if that is to be checked.

    Returns:
        What is handed to a kernel while the arrays live.

    Raises:
        TypeError: an array has another size, type or order.
    """
    found: list[int] = []
    for array in arrays:
        size = array.size
        if size != 1 and count is not None and size != count:
            raise TypeError(f"a kernel takes 1 or {count} numbers, not {size}")
        found += (address(array), size != 1)
    return pack(f"{len(found)}q", *found)
