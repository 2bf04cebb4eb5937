"""Structures of C as values, and functions of C as whoever compiled them hands them over."""

from __future__ import annotations

import ctypes
from inspect import Parameter, Signature
from typing import Any, ClassVar, TypeVar

import numpy as np

from .errors import InvalidInputError

__all__ = ["Structure", "copy_of", "location", "machine_code", "numbers"]

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
