"""Base classes of values: comparison by content, copying and pickling."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, Final

import numpy as np


def _own(cls: type, *names: str) -> None:
    """Make inherited methods a class's own: a dataclass makes those that it does not find in the class itself."""
    for name in names:
        if name not in vars(cls):
            setattr(cls, name, getattr(cls, name))


class Travels:
    """What can be pickled and copied with all that it has computed, read-only arrays as such.

    The compiled core tells arrays that can be written from others, and a number that was kept must not change on the
    way. Inheriting is all there is to do, for a dataclass as for a class with slots.
    """

    __slots__ = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        _own(cls, "__getstate__", "__setstate__")

    def __getstate__(self) -> dict[str, Any]:
        # the names of slots as pickle itself has them; there is no public way to ask
        slots = [name for name in copyreg._slotnames(type(self)) if hasattr(self, name)]  # type: ignore[attr-defined]
        state = {**{name: getattr(self, name) for name in slots}, **getattr(self, "__dict__", {})}
        return {name: _packed(value) for name, value in state.items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)


class Value(Travels):
    """What cannot be changed: it equals what holds the same, arrays and NaN among it, and its copy is itself."""

    __slots__ = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        _own(cls, "__eq__", "__hash__")

    def __copy__(self) -> Any:
        return self

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return self is other or _alike(self._compared(), other._compared())

    def __hash__(self) -> int:
        return hash((type(self), _digest(self._compared())))

    def _compared(self) -> tuple[Any, ...]:
        """Return what makes two of a class equal: the fields of a dataclass."""
        return tuple(getattr(self, f.name) for f in fields(self) if f.compare)  # type: ignore[arg-type]


class _ReadOnly:
    """A read-only array on its way."""

    __slots__ = ("array",)

    def __init__(self, array: Any) -> None:
        self.array = array

    def __reduce__(self) -> tuple[Callable[[Any], Any], tuple[Any]]:
        return _read_only, (self.array,)


def _read_only(array: Any) -> Any:
    array.setflags(write=False)
    return array


def _packed(value: Any) -> Any:
    """Mark read-only arrays, in plain containers too."""
    if type(value) is np.ndarray:
        return value if value.flags.writeable else _ReadOnly(value)
    if type(value) in _PLAIN:
        return type(value)(map(_packed, value))
    return {key: _packed(v) for key, v in value.items()} if type(value) is dict else value


_PLAIN: Final = (tuple, list)


def _alike(one: Any, other: Any) -> bool:
    """Tell whether two values are the same, NaN being the same as NaN."""
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        a, b = np.asarray(one), np.asarray(other)
        return a.shape == b.shape and bool(((a == b) | ((a != a) & (b != b))).all())  # noqa: PLR0124 - NaN
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_alike(value, other[key]) for key, value in one.items())
    if isinstance(one, tuple | list) and type(one) is type(other):
        return len(one) == len(other) and all(map(_alike, one, other))
    return bool(one == other or (one != one and other != other))  # noqa: PLR0124 - NaN


def _digest(value: Any) -> int:
    """Return a hash that is the same for what is alike."""
    if isinstance(value, np.ndarray):
        return hash(value.shape)
    if isinstance(value, Mapping):
        return hash(frozenset(value))
    if isinstance(value, tuple | list):
        return hash(tuple(map(_digest, value)))
    try:
        return hash(value) if value == value else 0  # noqa: PLR0124 - NaN
    except TypeError:
        return hash(type(value))
