"""Provide base classes whose instances can be compared by content, copied and pickled."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, Final

import numpy as np


def _copy_methods(cls: type, *names: str) -> None:
    """Copy inherited methods into a class. Otherwise `dataclass` would replace them by generated methods."""
    for name in names:
        if name not in vars(cls):
            setattr(cls, name, getattr(cls, name))


class Picklable:
    """Base class of objects with support for pickling and copying.

    The objects may contain caches or read-only arrays. Inheriting is sufficient, both for dataclasses and for classes
    with slots. Read-only flags matter: the compiled core treats writable arrays differently, and a cached number must
    not change.
    """

    __slots__ = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        _copy_methods(cls, "__getstate__", "__setstate__")

    def __getstate__(self) -> dict[str, Any]:
        # the same names of slots that pickle uses; there is no public function for them
        slots = [name for name in copyreg._slotnames(type(self)) if hasattr(self, name)]  # type: ignore[attr-defined]
        state = {**{name: getattr(self, name) for name in slots}, **getattr(self, "__dict__", {})}
        return {name: _wrap(value) for name, value in state.items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)


class Value(Picklable):
    """Base class of immutable objects compared by content.

    NaN equals NaN. Copying such a value returns the value itself.
    """

    __slots__ = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        _copy_methods(cls, "__eq__", "__hash__")

    def __copy__(self) -> Any:
        return self

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return self is other or _equal(self._compared(), other._compared())

    def __hash__(self) -> int:
        return hash((type(self), _hash(self._compared())))

    def _compared(self) -> tuple[Any, ...]:
        """Return the compared fields of a dataclass instance."""
        return tuple(getattr(self, f.name) for f in fields(self) if f.compare)  # type: ignore[arg-type]


class _ReadOnly:
    """Pickle wrapper for a NumPy array that stays read-only after loading."""

    __slots__ = ("array",)

    def __init__(self, array: Any) -> None:
        self.array = array

    def __reduce__(self) -> tuple[Callable[[Any], Any], tuple[Any]]:
        return _read_only, (self.array,)


def _read_only(array: Any) -> Any:
    array.setflags(write=False)
    return array


def _wrap(value: Any) -> Any:
    """Wrap read-only arrays for pickling, including arrays inside lists, tuples and dictionaries."""
    if type(value) is np.ndarray:
        return value if value.flags.writeable else _ReadOnly(value)
    if type(value) in _PLAIN:
        return type(value)(map(_wrap, value))
    return {key: _wrap(v) for key, v in value.items()} if type(value) is dict else value


_PLAIN: Final = (tuple, list)


def _equal(a: Any, b: Any) -> bool:
    """Return True if two values are equal, where NaN equals NaN."""
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        x, y = np.asarray(a), np.asarray(b)
        return x.shape == y.shape and bool(((x == y) | ((x != x) & (y != y))).all())  # noqa: PLR0124 - NaN
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_equal(value, b[key]) for key, value in a.items())
    if isinstance(a, tuple | list) and type(a) is type(b):
        return len(a) == len(b) and all(map(_equal, a, b))
    return bool(a == b or (a != a and b != b))  # noqa: PLR0124 - NaN


def _hash(value: Any) -> int:
    """Return a hash value for nested containers and arrays. Equal objects have equal hashes."""
    if isinstance(value, np.ndarray):
        return hash(value.shape)
    if isinstance(value, Mapping):
        return hash(frozenset(value))
    if isinstance(value, tuple | list):
        return hash(tuple(map(_hash, value)))
    try:
        return hash(value) if value == value else 0  # noqa: PLR0124 - NaN
    except TypeError:
        return hash(type(value))
