"""What values share: they compare and travel by what they hold, and their fields say unit, sign and example once."""

from __future__ import annotations

import copyreg
import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, field, fields
from functools import cache
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from .arguments import KEPT, rules_of_fields
from .errors import InvalidInputError
from .numbers import finite, nonnegative, positive


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


Sign: TypeAlias = Literal["any", "positive", "nonnegative", "negative", "nonzero"]

OUTPUT: Final = "output"
"""The unit of a sensor output: V, counts, or none."""

ONE_ROBOT: Final = ": a controller runs one robot"
"""Why a controller takes no arrays."""

OUTPUT_RATE: Final = "output/s"
"""The unit of a change of a sensor output."""

_RULES: Final[dict[str, Callable[..., Any]]] = {"positive": positive, "nonnegative": nonnegative}
_TOLD: Final = {OUTPUT: "unit of xi", OUTPUT_RATE: "unit of xi per s"}


def quantity(
    unit: str,
    default: Any = MISSING,
    *,
    sign: Sign = "any",
    example: str = "",
    infinite: bool = False,
    **others: Any,
) -> Any:
    """Declare a field that is a number, or an array of them, in SI.

    Args:
        unit: its SI unit; the empty text for a pure number; OUTPUT or OUTPUT_RATE for a sensor output.
        default: its value where none is given; None where it may be left out.
        sign: what must hold.
        example: a value as a scenario file has it.
        infinite: whether it may be infinite.
        others: further metadata.

    Returns:
        The field.
    """
    told = {"unit": unit, "sign": sign, "example": example, "infinite": infinite, **others}
    return field(metadata=told) if default is MISSING else field(default=default, metadata=told)


def flag(default: bool) -> Any:
    """Declare a field that is true or false."""
    return field(default=default, metadata={"flag": True})


def count(least: int, default: int, example: str) -> Any:
    """Declare a field that is a whole number from some number on; the class checks it."""
    return field(default=default, metadata={"least": least, "example": example})


@cache
def declared(cls: Any) -> tuple[Any, ...]:
    """Return the fields of a dataclass that are quantities."""
    return tuple(f for f in fields(cls) if "unit" in f.metadata)


def units_of_fields(cls: Any) -> dict[str, str]:
    """Return the SI units of the quantities of a dataclass, by name."""
    return {f.name: f.metadata["unit"] for f in declared(cls)}


def check_declared(value: Any, *, arrays: bool = False, before: str = "", instead: str = "") -> None:
    """Check every field of a frozen dataclass, and keep quantities as floats; called in its `__post_init__`.

    Args:
        value: the instance.
        arrays: whether arrays will do.
        before: what stands before the name in messages.
        instead: why an array will not do, for the message.
    """
    kind: Any = type(value)
    if kind.__dict__.get(KEPT) != {}:  # where nothing else is to be checked
        check_types(value, before)
    for name, least, above, full in _quick(kind):
        given = getattr(value, name)
        if type(given) is not float or not (given > least or (given == least and not above)) or given == math.inf:
            _check_one(value, full, arrays=arrays, before=before, instead=instead)


def check_types(value: Any, before: str = "") -> None:
    """Check the fields of a frozen dataclass that are no quantities by their annotations; called in `__post_init__`.

    Numbers of NumPy and other kinds are kept as those of Python.

    Args:
        value: the instance.
        before: what stands before the name in messages.
    """
    kind: Any = type(value)
    rules = kind.__dict__.get(KEPT)
    for name, rule in (rules_of_fields(kind) if rules is None else rules).items():
        given = getattr(value, name)
        if given is not rule.default and type(given) not in rule.quick:
            kept = rule.check(given, before)
            if kept is not given:
                object.__setattr__(value, name, kept)


@cache
def _quick(cls: Any) -> tuple[tuple[str, float, bool, Any], ...]:
    """Return of each quantity its name, what a finite float must exceed or reach, which of the two, and its field."""
    ends = {"positive": (0.0, True), "nonnegative": (0.0, False)}
    found = []
    for f in declared(cls):
        least, above = ends.get(f.metadata["sign"], (-math.inf, True))
        found.append((f.name, least, above, f))
    return tuple(found)


def _check_one(value: Any, f: Field[Any], *, arrays: bool, before: str, instead: str) -> None:
    """Check what is not simply a finite float of the right sign."""
    given, told = getattr(value, f.name), f.metadata
    if given is None and f.default is None:
        return
    if told["infinite"] and isinstance(given, float) and math.isinf(given):
        if given < 0 and told["sign"] == "positive":
            raise InvalidInputError(f"{before}{f.name}: found -inf {told['unit']}, which must be positive")
        return
    unit = _TOLD.get(told["unit"], told["unit"])
    rule: Callable[..., Any] = _RULES.get(told["sign"], finite)
    number = rule(given, f"{before}{f.name}", unit)
    if not arrays and not isinstance(number, float):
        raise InvalidInputError(f"{before}{f.name}: found an array, expected one number{instead}")
    object.__setattr__(value, f.name, number)
