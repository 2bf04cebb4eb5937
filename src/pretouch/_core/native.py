"""Load the compiled shared library of pretouch, and call its functions through ctypes.

The library is loaded when a kernel is first called. A kernel takes numbers and addresses. `address` returns the address
of an array. It refuses arrays that a kernel would misread, so that a mistake raises a Python exception instead of a
crash. ctypes releases the interpreter's lock while a kernel runs.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache
from hashlib import sha256
from inspect import Parameter, Signature
from pathlib import Path
from struct import pack
from typing import Any, ClassVar, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import BrokenCoreError, InvalidInputError
from .messages import not_one_of

POINTER: Final = ctypes.c_void_p
INTEGER: Final = ctypes.c_int64
DOUBLE: Final = ctypes.c_double

VARIANTS: Final = ("base", "avx2", "avx512")
"""The kinds of processors for which kernels are compiled."""

INTERFACE: Final = "358bd7b821ad38e5"
"""Hash of the C headers for which this module was written; native/build.py reports when the headers have changed."""

_SWITCH: Final = "PRETOUCH_VARIANT"
_LIBRARY: Final = "PRETOUCH_LIBRARY"  # path of another build of the library, such as one with sanitizers
_SUFFIXES: Final = {"win32": ".dll", "darwin": ".dylib"}
_FLOAT: Final = np.dtype(np.float64)
_word: Final = ctypes.c_size_t.from_address


def _data_offset() -> int | None:
    """Return the byte offset of the data pointer in a NumPy array. The result is None if the offset is unknown."""
    if sys.implementation.name != "cpython":
        return None
    probe, offset = np.zeros(1), object.__basicsize__  # the data pointer is the first field in NumPy's ABI
    return offset if _word(id(probe) + offset).value == probe.ctypes.data else None


_DATA_OFFSET: Final = _data_offset()


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    """Load the compiled library for this processor, or for that of PRETOUCH_VARIANT; see `variant`."""
    default = Path(__file__).with_name(f"libpretouch{_SUFFIXES.get(sys.platform, '.so')}")
    path = Path(os.environ.get(_LIBRARY) or default)
    _check_file(path)
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise _broken(path, f"cannot be loaded ({' '.join(str(error).split())})") from None
    requested = os.environ.get(_SWITCH, "")
    if requested not in {"", *VARIANTS}:
        raise InvalidInputError(**not_one_of(_SWITCH, requested, VARIANTS))
    number = VARIANTS.index(requested) if requested else -1
    if requested and library.pretouch_choose_variant(number) != number:
        raise InvalidInputError(
            f"{_SWITCH}: found the processor variant {requested}, which this processor does not support; choose "
            "another variant",
            value=requested,
        )
    return library


def _check_file(path: Path) -> None:
    """Check that a compiled library is complete and unchanged. A damaged library could crash Python."""
    try:
        content = path.read_bytes()
        record = json.loads(path.with_name(f"{path.name}.json").read_bytes())
        size, digest, interface = int(record["size"]), str(record["sha256"]), str(record["interface"])
    except FileNotFoundError as error:
        what = "is missing" if error.filename == str(path) else "has no build record (.json) in the same folder"
        raise _broken(path, what) from None
    except OSError as error:
        raise _broken(path, f"cannot be read ({error.strerror or error})") from None
    except (ValueError, KeyError, TypeError):
        raise _broken(path, "has a damaged build record (.json)") from None
    if len(content) != size:
        raise _broken(path, f"has {len(content):,} bytes, expected {size:,}")
    if interface != INTERFACE:
        raise _broken(path, "was built for another version of pretouch")
    if sha256(content).hexdigest() != digest:
        raise _broken(path, "has been changed since it was built: its hash differs")


def _broken(path: Path, what: str) -> BrokenCoreError:
    origin = f", set by {_LIBRARY}" if os.environ.get(_LIBRARY) else ""
    return BrokenCoreError(
        f"the compiled core of pretouch cannot be used. The file {path.name} has this problem: it {what}. The "
        f"file is in the folder {path.parent}{origin}. Reinstall pretouch by pip; in a source tree, run python "
        "native/build.py"
    )


def variant() -> str:
    """Return the processor variant of the compiled code in use.

    The variants are `base`, `avx2` and `avx512`.
    """
    best = _library().pretouch_best_variant()  # _library has checked PRETOUCH_VARIANT
    return os.environ.get(_SWITCH) or VARIANTS[best]


def kernel(name: str, *arguments: Any, result: Any = None) -> Callable[..., Any]:
    """Return a Python function that calls a function of the compiled library.

    The library is loaded at the first call.

    Args:
        name: name of the function without `pretouch_`.
        *arguments: the types of its arguments: POINTER, INTEGER or DOUBLE.
        result: the type of its result; None for none.

    Returns:
        A function of addresses and numbers.
    """
    loaded: Any = None

    def call(*values: Any) -> Any:
        nonlocal loaded
        if loaded is None:
            function = _library()[f"pretouch_{name}"]
            function.argtypes, function.restype = arguments, result
            loaded = function
        return loaded(*values)

    return call


def entry(name: str) -> int:
    """Return the address of a function in the compiled library.

    Other compiled code can call the function at this address.

    Args:
        name: name of the function without `pretouch_`.

    Returns:
        The address.
    """
    return ctypes.cast(_library()[f"pretouch_{name}"], POINTER).value or 0


def address(array: NDArray[Any], dtype: np.dtype[Any] = _FLOAT) -> int:
    """Return the memory address of the data of a NumPy array.

    Args:
        array: a contiguous array in C order; it must outlive the call that takes the address.
        dtype: the required data type.

    Returns:
        The address.

    Raises:
        TypeError: the array is not of that type, or not contiguous.
    """
    if array.dtype != dtype or not array.flags.c_contiguous:
        raise TypeError(
            f"the compiled function needs a contiguous array of the type {dtype}. The given array has the "
            f"type {array.dtype} and the strides {array.strides}"
        )
    if _DATA_OFFSET is None:
        return int(array.__array_interface__["data"][0])
    return _word(id(array) + _DATA_OFFSET).value  # ten times as fast as the array interface


def shaped(array: NDArray[Any], shape: tuple[int, ...], dtype: np.dtype[Any] = _FLOAT) -> int:
    """Return the memory address of an array after checking its shape.

    Args:
        array: see `address`.
        shape: the required shape.
        dtype: see `address`.

    Returns:
        The address.

    Raises:
        TypeError: the array is not of that shape or type, or not contiguous.
    """
    if array.shape != shape:
        raise TypeError(
            f"the compiled function needs an array of the shape {shape}, but received an array of the shape "
            f"{array.shape}"
        )
    return address(array, dtype)


def rows_of(array: NDArray[np.float64], shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the address and strides of an output array.

    A compiled function fills the array with results.

    Args:
        array: see `address`; only its last axis must be contiguous.
        shape: the required shape.

    Returns:
        The address, and the stride of each axis but the last, counted in numbers.

    Raises:
        TypeError: the array has another shape or type, or its last axis is not contiguous.
    """
    *steps, last = array.strides
    if array.shape != shape or (last != _FLOAT.itemsize and array.size) or not array.flags.aligned:
        raise TypeError(
            f"the compiled function needs an aligned float64 array of the shape {shape} with contiguous rows. The "
            f"given array has the type {array.dtype}, the shape {array.shape} and the strides {array.strides}"
        )
    start = address(array[..., :0])  # an empty slice is contiguous
    return (start, *[step // _FLOAT.itemsize for step in steps])


def columns(arrays: Sequence[NDArray[np.float64]], count: int | None = None) -> bytes:
    """Pack the addresses and strides of arrays for compiled functions.

    Each stride is 0 or 1.

    Args:
        arrays: arrays with one number for all encounters, or one number for each encounter.
        count: number of encounters, for a check of sizes; None for no check.

    Returns:
        Bytes to pass to a kernel; the arrays must outlive the call.

    Raises:
        TypeError: an array has another size, type or order.
    """
    layout: list[int] = []
    for array in arrays:
        size = array.size
        if size != 1 and count is not None and size != count:
            raise TypeError(f"a kernel takes 1 or {count} numbers, not {size}")
        layout += (address(array), size != 1)
    return pack(f"{len(layout)}q", *layout)


T = TypeVar("T")
_FUNCTION: Any = ctypes.CFUNCTYPE(None).__mro__[1]  # the type of every function of ctypes
_CAPSULE_NAME = ctypes.pythonapi.PyCapsule_GetName
_CAPSULE_NAME.argtypes, _CAPSULE_NAME.restype = (ctypes.py_object,), ctypes.c_char_p
_CAPSULE_POINTER = ctypes.pythonapi.PyCapsule_GetPointer
_CAPSULE_POINTER.argtypes, _CAPSULE_POINTER.restype = (ctypes.py_object, ctypes.c_char_p), ctypes.c_void_p


class Structure(ctypes.Structure):
    """Base class of C structures in Python.

    Two structures are equal if all their bytes are equal. Instances can be pickled and copied. Do not change a field
    while the instance is a key of a dictionary.
    """

    _fields_: ClassVar[Any]
    __signature__: ClassVar[Signature]

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.__signature__ = Signature([Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name, *_ in cls._fields_])

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return bytes(self) == bytes(other)

    def __hash__(self) -> int:
        return hash((type(self), bytes(self)))

    def __repr__(self) -> str:
        parts = (f"{name}={_shown(getattr(self, name))!r}" for name, *_ in self._fields_)
        return f"{type(self).__name__}({', '.join(parts)})"


def numbers(*names: str, kind: Any = ctypes.c_double) -> tuple[tuple[str, Any], ...]:
    """Declare several fields of a C structure that have the same type.

    Args:
        *names: names of the fields.
        kind: type of the fields.

    Returns:
        Pairs of name and type.
    """
    return tuple((name, kind) for name in names)


def _shown(value: Any) -> Any:
    return [_shown(part) for part in value] if isinstance(value, ctypes.Array) else value


def copy_of(memory: T) -> T:
    """Return a copy of a ctypes structure or of a NumPy array."""
    if isinstance(memory, ctypes.Structure):
        return type(memory).from_buffer_copy(memory)
    return np.array(memory)  # type: ignore[return-value]


def location(memory: Any, name: str) -> tuple[int, int]:
    """Return the memory address and the size [bytes] of an argument.

    A compiled function reads this memory.

    Args:
        memory: a ctypes structure or a contiguous NumPy array; it must outlive the call that takes the address.
        name: name of the argument in messages.

    Returns:
        The address and the size.

    Raises:
        InvalidInputError: `memory` is neither a ctypes structure nor a contiguous array.
    """
    if isinstance(memory, ctypes.Structure):
        return ctypes.addressof(memory), ctypes.sizeof(memory)
    if isinstance(memory, np.ndarray) and memory.flags.c_contiguous and not memory.dtype.hasobject:
        return int(memory.__array_interface__["data"][0]), memory.nbytes
    raise InvalidInputError(
        f"{name}: found {type(memory).__name__}, expected a ctypes.Structure or a contiguous NumPy array. "
        "Compiled functions read the memory of this argument directly"
    )


def machine_code(function: Any) -> int | None:
    """Return the memory address of a compiled function.

    Args:
        function: a scipy.LowLevelCallable, a capsule (as in Cython), a ctypes function, an object with an `address`
            (such as the result of numba.cfunc), or the address itself.

    Returns:
        The address; None for a Python function.

    Raises:
        InvalidInputError: the argument is none of these.
    """
    number = getattr(function, "address", function)
    if isinstance(number, int) and not isinstance(number, bool):
        pointer: int | None = number
    elif isinstance(function, _FUNCTION):
        pointer = ctypes.cast(function, ctypes.c_void_p).value
    elif isinstance(function, tuple) and type(function).__name__ == "LowLevelCallable":
        pointer = _of_capsule(tuple.__getitem__(function, 0))  # LowLevelCallable.__getitem__ raises an error
    elif type(function).__name__ == "PyCapsule":
        pointer = _of_capsule(function)
    elif callable(function):
        return None
    else:
        raise InvalidInputError(
            f"step: found {function!r}, expected a compiled function or a Python function", value=function
        )
    if not pointer:
        raise InvalidInputError("step: found the address 0, expected the address of a function")
    return pointer


def _of_capsule(capsule: Any) -> int | None:
    return _CAPSULE_POINTER(capsule, _CAPSULE_NAME(capsule))  # type: ignore[no-any-return]
