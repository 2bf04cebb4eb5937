"""The compiled core: a plain shared library, loaded by ctypes when a kernel is first called.

A kernel takes numbers and addresses. `address` gives that of an array and refuses every array that a kernel would
misread, so an error here is a Python exception and never a crash there. ctypes releases the interpreter's lock while a
kernel runs.
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

POINTER: Final = ctypes.c_void_p
INTEGER: Final = ctypes.c_int64
DOUBLE: Final = ctypes.c_double

VARIANTS: Final = ("base", "avx2", "avx512")
"""For which kinds of processor there are kernels."""

INTERFACE: Final = "1f941c90fcd3eb6c"
"""Hash of the headers that the calls in Python are written for; native/build.py tells when they have changed."""

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
    _check_file(path)
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise _broken(path, f"cannot be loaded ({' '.join(str(error).split())})") from None
    wanted = os.environ.get(_SWITCH, "")
    if wanted not in {"", *VARIANTS}:
        raise InvalidInputError(f"{_SWITCH}: found {wanted!r}, expected one of {', '.join(VARIANTS)}")
    number = VARIANTS.index(wanted) if wanted else -1
    if wanted and library.pretouch_choose_variant(number) != number:
        raise InvalidInputError(f"{_SWITCH}: found {wanted}, which this processor does not have")
    return library


def _check_file(path: Path) -> None:
    """Refuse a library that is not as it was built: to load a truncated one would kill the process."""
    try:
        content = path.read_bytes()
        record = json.loads(path.with_name(f"{path.name}.json").read_bytes())
        size, digest, interface = int(record["size"]), str(record["sha256"]), str(record["interface"])
    except FileNotFoundError as error:
        what = "is missing" if error.filename == str(path) else "has no record of its build beside it"
        raise _broken(path, what) from None
    except OSError as error:
        raise _broken(path, f"cannot be read ({error.strerror or error})") from None
    except (ValueError, KeyError, TypeError):
        raise _broken(path, "has a damaged record of its build beside it") from None
    if len(content) != size:
        raise _broken(path, f"has {len(content):,} bytes, expected {size:,}")
    if interface != INTERFACE:
        raise _broken(path, "was built for another version of pretouch")
    if sha256(content).hexdigest() != digest:
        raise _broken(path, "is not as it was built: its hash differs")


def _broken(path: Path, what: str) -> BrokenCoreError:
    named = f"; {_OTHER} names it" if os.environ.get(_OTHER) else ""
    return BrokenCoreError(
        f"pretouch's compiled core, {path.name} in {path.parent}, {what}{named}: reinstall pretouch by pip; in a "
        "source tree, run python native/build.py"
    )


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


T = TypeVar("T")
_FUNCTION: Any = ctypes.CFUNCTYPE(None).__mro__[1]  # the type of every function of ctypes
_CAPSULE_NAME = ctypes.pythonapi.PyCapsule_GetName
_CAPSULE_NAME.argtypes, _CAPSULE_NAME.restype = (ctypes.py_object,), ctypes.c_char_p
_CAPSULE_POINTER = ctypes.pythonapi.PyCapsule_GetPointer
_CAPSULE_POINTER.argtypes, _CAPSULE_POINTER.restype = (ctypes.py_object, ctypes.c_char_p), ctypes.c_void_p


class Structure(ctypes.Structure):
    """A structure of C: fields by name, equal where all bits are, pickled and copied as it is.

    Its fields can be changed, but not while it is a key of a dictionary.
    """

    _fields_: ClassVar[Any]
    __signature__: ClassVar[Signature]

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        cls.__signature__ = Signature([Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name, *_ in cls._fields_])

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return bytes(self) == bytes(other)

    def __hash__(self) -> int:
        return hash((type(self), bytes(self)))

    def __repr__(self) -> str:
        said = (f"{name}={_shown(getattr(self, name))!r}" for name, *_ in self._fields_)
        return f"{type(self).__name__}({', '.join(said)})"


def numbers(*names: str, kind: Any = ctypes.c_double) -> tuple[tuple[str, Any], ...]:
    """Return fields of one type.

    Args:
        *names: of the fields.
        kind: their type.

    Returns:
        What `_fields_` of a structure takes.
    """
    return tuple((name, kind) for name in names)


def _shown(value: Any) -> Any:
    return [_shown(part) for part in value] if isinstance(value, ctypes.Array) else value


def copy_of(memory: T) -> T:
    """Copy what a function of C reads and writes: a ctypes structure or a NumPy array."""
    if isinstance(memory, ctypes.Structure):
        return type(memory).from_buffer_copy(memory)
    return np.array(memory)  # type: ignore[return-value]


def location(memory: Any, name: str) -> tuple[int, int]:
    """Return where something lies that a function of C reads, and its size in octets.

    Args:
        memory: a ctypes structure or a contiguous NumPy array; it must outlive the call that takes the address.
        name: what it is called in messages.

    Returns:
        The address and the size.

    Raises:
        InvalidInputError: it is neither.
    """
    if isinstance(memory, ctypes.Structure):
        return ctypes.addressof(memory), ctypes.sizeof(memory)
    if isinstance(memory, np.ndarray) and memory.flags.c_contiguous and not memory.dtype.hasobject:
        return int(memory.__array_interface__["data"][0]), memory.nbytes
    raise InvalidInputError(
        f"{name}: found {type(memory).__name__}, and a compiled step reads memory: expected a ctypes.Structure or a "
        "contiguous NumPy array"
    )


def machine_code(function: Any) -> int | None:
    """Return the address of a compiled function.

    Args:
        function: a scipy.LowLevelCallable, a capsule such as those of Cython, a function of ctypes, anything that has
            its `address`, such as numba.cfunc gives, or the address itself.

    Returns:
        The address; None for a function of Python.

    Raises:
        InvalidInputError: it is none of these.
    """
    told = getattr(function, "address", function)
    if isinstance(told, int) and not isinstance(told, bool):
        found: int | None = told
    elif isinstance(function, _FUNCTION):
        found = ctypes.cast(function, ctypes.c_void_p).value
    elif isinstance(function, tuple) and type(function).__name__ == "LowLevelCallable":
        found = _of_capsule(tuple.__getitem__(function, 0))  # it hides its parts
    elif type(function).__name__ == "PyCapsule":
        found = _of_capsule(function)
    elif callable(function):
        return None
    else:
        raise InvalidInputError(f"step: found {function!r}, expected a function, compiled or of Python")
    if not found:
        raise InvalidInputError("step: found the address 0, expected that of a function")
    return found


def _of_capsule(capsule: Any) -> int | None:
    return _CAPSULE_POINTER(capsule, _CAPSULE_NAME(capsule))  # type: ignore[no-any-return]
