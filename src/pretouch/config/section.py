"""What a section of a scenario file takes: its keys, what reads each of them, and what must hold of them together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Final, TypeAlias

from pretouch.motion.laws import DAMPER, LAWS, ContinuousLaw

from .quantities import KeyPath, Quantity, UnfitValueError, shown

Reader: TypeAlias = Callable[[Any], Any]
"""Turns what `tomllib` read into a value, or raises UnfitValueError."""

REQUIRED: Final[Any] = object()
"""The default of a key that must be given."""


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a section.

    Args:
        read: turns what stands there into a value; a `Quantity` where that is one.
        default: the value where the key is left out; None for no value at all.
        example: what messages show where the key is missing, as TOML; that of the quantity where it is one.
        after: a key that stands before it, and what makes the reader from the value of that; None where it has none.
    """

    read: Reader
    default: Any = None
    example: str = "..."
    after: tuple[str, Callable[[Any], Reader]] | None = None

    def missing(self, name: str) -> str:
        """Say that the key is missing, what it takes, and show a line with it."""
        if isinstance(self.read, Quantity):
            return f"missing, expected {self.read.expected}; add, for example: {name} = {self.read.example}"
        return f"missing; add, for example: {name} = {self.example}"


@dataclass(frozen=True, slots=True)
class Section:
    """A section, or a table inside of one; keys that it does not name are refused.

    Args:
        keys: what it takes, in the order of messages.
        check: raises UnfitValueError where the values that are given do not go together.
        make: makes what the section describes from its values, by name.
        example: a table of this kind, for messages.

    Where a section is called, `stranger` says of an unknown key what it may have been meant to be; a key that was
    meant is then not missing.
    """

    keys: Mapping[str, Key]
    check: Callable[[Mapping[str, Any]], None] | None = None
    make: Callable[..., Any] | None = None
    example: str = "{ ... }"

    def __call__(self, table: Any, stranger: Callable[[str], str] | None = None) -> dict[str, Any]:
        """Return the values of a table by key; raise UnfitValueError with every mistake in it."""
        if not isinstance(table, Mapping):
            raise UnfitValueError(f"expected a table such as {self.example}")
        strangers = [name for name in table if name not in self.keys]
        left = tuple(name for name in self.keys if name not in table)
        meant = {nearest(name, left) for name in strangers} if stranger else set()
        mistakes: list[tuple[KeyPath, str]] = []
        given: dict[str, Any] = {}
        for name, key in self.keys.items():
            if name in table:
                read = key.read if key.after is None else key.after[1](given.get(key.after[0]))
                given[name] = _attempt(read, table[name], name, mistakes)
            elif key.default is REQUIRED and name not in meant:
                mistakes.append(((name,), key.missing(name)))
        mistakes += [((name,), (stranger or self._stranger)(name)) for name in strangers]
        if mistakes:
            raise UnfitValueError.of(mistakes)
        if self.check is not None:
            self.check(given)
        values = {name: given.get(name, key.default) for name, key in self.keys.items()}
        return {name: value for name, value in values.items() if value is not None}

    def _stranger(self, name: str) -> str:
        near = nearest(name, tuple(self.keys))
        meaning = f'; did you mean "{near}"?' if near else ""
        return f"found an unknown key, expected one of {', '.join(self.keys)}{meaning}"


def _attempt(read: Reader, value: Any, at: str | int, mistakes: list[tuple[KeyPath, str]]) -> Any:
    """Read a value; note what does not fit, with what was found, at its place."""
    try:
        return read(value)
    except UnfitValueError as unfit:
        for path, sentence in unfit.mistakes:
            told = f"found {shown(value)}, {sentence}" if sentence.startswith("expected") else sentence
            mistakes.append(((at, *path), told))


LENGTH: Final = Quantity("m", '"0 m"')
EFFECTS: Final = ("ratio", "excursion", "acceleration", "contact_speed", "impact_force")
"""The keys of [law] by one of which a drag is chosen, without objective and bounds."""
WEIGHT: Final = Key(Quantity("", "1.0", "nonnegative"), 1.0)
TAG: Final = Key(lambda _: None, REQUIRED)
"""A key that has chosen the variant of its section, and says nothing more."""


def checked(holds: Callable[[Any], bool], what: str) -> Reader:
    """Make the reader that keeps a value as it is, where it is what is expected."""

    def read(value: Any) -> Any:
        if not holds(value):
            raise UnfitValueError(f"expected {what}")
        return value

    return read


def text(example: str) -> Reader:
    """Make the reader of text that is not empty."""
    return checked(lambda v: isinstance(v, str) and bool(v.strip()) and "\0" not in v, f"text, for example {example}")


def whole(least: int, example: str) -> Reader:
    """Make the reader of a whole number from some number on."""
    what = f"a whole number of at least {least}, such as {example}"
    return checked(lambda v: type(v) is int and least <= v < 2**31, what)


def name_of(*names: str) -> Reader:
    """Make the reader of one of some names."""

    def read(value: Any) -> str:
        if not isinstance(value, str) or value not in names:
            raise UnfitValueError(one_of(value, names))
        return value

    return read


def list_of(read: Reader, least: int, most: int | None, what: str) -> Reader:
    """Make the reader of a list with so many elements."""

    def read_all(value: Any) -> list[Any]:
        if not isinstance(value, list) or len(value) < least or (most is not None and len(value) > most):
            raise UnfitValueError(f"expected {what}")
        mistakes: list[tuple[KeyPath, str]] = []
        found = [_attempt(read, element, i, mistakes) for i, element in enumerate(value)]
        if mistakes:
            raise UnfitValueError.of(mistakes)
        return found

    return read_all


def one_of(value: Any, names: tuple[str, ...]) -> str:
    """Say which names are expected, and which of them is nearest to what was found.

    Returns:
        The part of a message that follows what was found.

    Examples:
        >>> one_of("Exponential 1", ("exponential-1", "table"))
        'expected one of "exponential-1", "table"; did you mean "exponential-1"?'
    """
    listed = ", ".join(f'"{name}"' for name in names)
    near = nearest(value, names) if isinstance(value, str) else None
    return f"expected one of {listed}" + (f'; did you mean "{near}"?' if near else "")


def nearest(found: str, valid: tuple[str, ...]) -> str | None:
    """Find the valid name that a misspelt one is nearest to; None where none is near.

    Returns:
        The name.

    Examples:
        >>> nearest("dampng", ("mass", "damping", "stiffness"))
        'damping'
    """
    from difflib import get_close_matches  # noqa: PLC0415 - only for mistakes

    plain = {name.replace("_", "-").lower(): name for name in valid}
    key = found[:80].strip().lower().replace("_", "-").replace(" ", "-")
    match = get_close_matches(key, list(plain), n=1, cutoff=0.6)
    return plain[match[0]] if match else None


def by_law(make: Callable[[ContinuousLaw], Section]) -> dict[str, Section]:
    """Make the variants of a section that holds gains, whose unit follows the law, by its kind."""
    return {kind: make(law) for kind, law in LAWS.items()}


def gain_of(law: ContinuousLaw) -> Quantity:
    """Return what reads a gain of a law."""
    unit = law.number.unit
    return Quantity(unit, '"-0.7 N*s"' if law == DAMPER else f'"0.0144 {unit}"', of=law.kind)


def declared_keys(*classes: Any, optional: bool = False, without: Iterable[str] = ()) -> dict[str, Key]:
    """Make keys of the declared fields of dataclasses, each in its unit.

    Args:
        classes: the classes; what they have beside quantities, flags and counts is left out.
        optional: whether every key may be left out, for a default that is not known here.
        without: fields that are no keys.

    Returns:
        The keys by the names of their fields.
    """
    found = {f.name: (f, _reader_of(f.metadata)) for cls in classes for f in fields(cls) if f.name not in without}
    return {
        name: Key(read, None if optional else REQUIRED if f.default is MISSING else f.default)
        for name, (f, read) in found.items()
        if read is not None
    }


def _reader_of(told: Mapping[str, Any]) -> Reader | None:
    """Return what reads a declared field; None for a field that is not declared."""
    if "unit" in told:
        unit = told["unit"] if told.get("of_output") is None else "output"
        return Quantity(unit, told["example"], told["sign"], told["infinite"])
    if "flag" in told:
        return checked(lambda value: isinstance(value, bool), "true or false")
    return whole(told["least"], told["example"]) if "least" in told else None
