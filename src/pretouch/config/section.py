"""Describe and check one section of a scenario file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from typing import Any, Final, TypeAlias

from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions
from pretouch._core.units import written_unit
from pretouch.motion.laws import DAMPER, LAW_KINDS, LAWS, ContinuousLaw

from .quantities import KeyPath, Quantity, UnfitValueError, value_text

Reader: TypeAlias = Callable[[Any], Any]
"""A function that converts a TOML value, or raises UnfitValueError."""

REQUIRED: Final[Any] = object()
"""The default of a required key."""


@dataclass(frozen=True, slots=True)
class Key:
    """Description of one key in a section of a scenario file.

    Args:
        read: the reader of its value; a `Quantity` for a quantity.
        default: the value if the key is missing; None for no value.
        example: an example value, as TOML, for messages about a missing key; a `Quantity` has its own example.
        after: another key that is read first, and a function that makes the reader from its value; or None.
    """

    read: Reader
    default: Any = None
    example: str = "..."
    after: tuple[str, Callable[[Any], Reader]] | None = None

    def missing(self, name: str) -> str:
        """Return the error message about a missing key.

        The message gives the expected value and an example.
        """
        if isinstance(self.read, Quantity):
            example = written_unit(self.read.example)
            if not example:
                return f"this key is missing; add {name} with {self.read.expected}"
            return f"this key is missing, expected {self.read.expected}; add, for example: {name} = {example}"
        return f"missing; add, for example: {name} = {self.example}"


@dataclass(frozen=True, slots=True)
class Section:
    """The allowed keys of a scenario-file section or table.

    Unknown keys raise an error.

    Args:
        keys: its keys, in the order of messages.
        check: raises UnfitValueError if the values do not fit together.
        make: makes the object that the section describes, from its values by name.
        example: an example of such a table, for messages.
        more: kinds that installed packages may add as further keys, and a function that returns the key of a kind by
            its name, or None if there is no such kind; None if packages cannot add keys.

    Calling a section parses a TOML table. The optional argument `unknown` is a function that returns the message for an
    unknown key. A missing key is not reported if an unknown key is probably its misspelling.
    """

    keys: Mapping[str, Key]
    check: Callable[[Mapping[str, Any]], None] | None = None
    make: Callable[..., Any] | None = None
    example: str = "{ ... }"
    more: tuple[Extensions, Callable[[str], Key | None]] | None = None

    def __call__(self, table: Any, unknown: Callable[[str], str] | None = None) -> dict[str, Any]:
        """Parse the values of a TOML table. The error message lists all mistakes in the table."""
        if not isinstance(table, Mapping):
            raise UnfitValueError(f"expected a table such as {self.example}")
        keys = dict(self.keys)
        if self.more is not None:
            others = {name: _added_key(self.more[1], name) for name in table if name not in keys}
            keys |= {name: key for name, key in others.items() if key is not None}
        unknown_keys = [name for name in table if name not in keys]
        missing = tuple(name for name in keys if name not in table)
        meant = {nearest(name, missing) for name in unknown_keys} if unknown else set()
        mistakes: list[tuple[KeyPath, str]] = []
        values: dict[str, Any] = {}
        for name, key in keys.items():
            if name in table:
                read = key.read if key.after is None else key.after[1](values.get(key.after[0]))
                values[name] = _attempt(read, table[name], name, mistakes)
            elif key.default is REQUIRED and name not in meant:
                mistakes.append(((name,), key.missing(name)))
        mistakes += [((name,), (unknown or self._unknown)(name)) for name in unknown_keys]
        if mistakes:
            raise UnfitValueError.of(mistakes)
        if self.check is not None:
            self.check(values)
        filled = {name: values.get(name, key.default) for name, key in keys.items()}
        return {name: value for name, value in filled.items() if value is not None}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all keys of the section.

        Keys that installed packages add are included.
        """
        return (*self.keys, *(() if self.more is None else self.more[0].installed()))

    def _unknown(self, name: str) -> str:
        near = nearest(name, self.names)
        hint = f'; did you mean "{near}"?' if near else ""
        return f"found an unknown key, expected one of {', '.join(self.names)}{hint}"


def _attempt(read: Reader, value: Any, at: str | int, mistakes: list[tuple[KeyPath, str]]) -> Any:
    """Parse a value and record its mistakes. Each mistake has the path of the wrong key."""
    try:
        return read(value)
    except UnfitValueError as unfit:
        for path, sentence in unfit.mistakes:
            message = f"found {value_text(value)}, {sentence}" if sentence.startswith("expected") else sentence
            mistakes.append(((at, *path), message))


LENGTH: Final = Quantity("m", '"0 m"')
EFFECTS: Final = ("ratio", "excursion", "acceleration", "contact_speed", "impact_force")
"""The keys of [law] that choose a drag by its effect, so that objective and bounds are not needed."""
WEIGHT: Final = Key(Quantity("", "1.0", "nonnegative"), 1.0)
TAG: Final = Key(lambda _: None, REQUIRED)
"""The key that selects the variant of its section; it has no further value."""


def _added_key(find: Callable[[str], Key | None], name: str) -> Key | None:
    """Return the key that an installed package adds; None if there is none; a broken package raises an error."""
    try:
        return find(name)
    except InvalidInputError as error:
        raise UnfitValueError(f"found {value_text(name)}, but {error}", name) from None


def checked(holds: Callable[[Any], bool], what: str) -> Reader:
    """Return a function that checks a condition on a value.

    The function returns the value, or raises an error if the condition is not met.
    """

    def read(value: Any) -> Any:
        if not holds(value):
            raise UnfitValueError(f"expected {what}")
        return value

    return read


def text(example: str) -> Reader:
    """Make a function that accepts only text that is not empty."""
    return checked(lambda v: isinstance(v, str) and bool(v.strip()) and "\0" not in v, f"text, for example {example}")


def whole(least: int, example: str) -> Reader:
    """Make a parser for integers with a lower limit."""
    what = f"a whole number of at least {least}, such as {example}"
    return checked(lambda v: type(v) is int and least <= v < 2**31, what)


def name_of(*names: str) -> Reader:
    """Make a function that accepts only one of several names."""

    def read(value: Any) -> str:
        if not isinstance(value, str) or value not in names:
            raise UnfitValueError(one_of(value, names))
        return value

    return read


def list_of(read: Reader, least: int, most: int | None, what: str) -> Reader:
    """Return a parser for a list with limited length.

    The number of elements lies between `least` and `most`.
    """

    def read_all(value: Any) -> list[Any]:
        if not isinstance(value, list) or len(value) < least or (most is not None and len(value) > most):
            raise UnfitValueError(f"expected {what}")
        mistakes: list[tuple[KeyPath, str]] = []
        elements = [_attempt(read, element, i, mistakes) for i, element in enumerate(value)]
        if mistakes:
            raise UnfitValueError.of(mistakes)
        return elements

    return read_all


def one_of(value: Any, names: tuple[str, ...]) -> str:
    """Describe the allowed names in an error message.

    The message suggests the name most similar to the value.

    Returns:
        The part of a message after the value.

    Examples:
        >>> one_of("Exponential 1", ("exponential-1", "table"))
        'expected one of "exponential-1", "table"; did you mean "exponential-1"?'
    """
    listed = ", ".join(f'"{name}"' for name in names)
    near = nearest(value, names) if isinstance(value, str) else None
    return f"expected one of {listed}" + (f'; did you mean "{near}"?' if near else "")


def nearest(name: str, valid: tuple[str, ...]) -> str | None:
    """Return the valid name closest to a misspelled name.

    Returns:
        The valid name, or None.

    Examples:
        >>> nearest("dampng", ("mass", "damping", "stiffness"))
        'damping'
    """
    from difflib import get_close_matches  # noqa: PLC0415 - only for mistakes

    plain = {choice.replace("_", "-").lower(): choice for choice in valid}
    key = name[:80].strip().lower().replace("_", "-").replace(" ", "-")
    match = get_close_matches(key, list(plain), n=1, cutoff=0.6)
    return plain[match[0]] if match else None


class ByLaw(dict[str, Section]):
    """Variants of a scenario-file section for different control laws.

    The keys are the names of the laws. Iteration gives the variants of the built-in laws. The variant of an installed
    law is made when a file uses the law.

    Args:
        make: makes the section for a law, which is a value or a class.
    """

    def __init__(self, make: Callable[[ContinuousLaw], Section]) -> None:
        super().__init__({kind: make(law) for kind, law in LAWS.items()})
        self._make = make

    def __missing__(self, kind: str) -> Section:
        return self._make(LAW_KINDS.find(kind))


def gain_of(law: ContinuousLaw) -> Quantity:
    """Return the function that parses the gain of a control law."""
    n = law.number
    return Quantity(n.unit, '"-0.7 N*s"' if law == DAMPER else f'"{n.sign * 0.0144} {n.unit}"', of=law.kind)


def example_bounds(law: ContinuousLaw) -> str:
    """Return example gain bounds of a control law as TOML."""
    if law == DAMPER:
        return '["-10 N*s", "-0.01 N*s"]'
    unit = written_unit(law.number.unit)
    return f'["0.0001 {unit}", "1 {unit}"]' if law.number.sign > 0 else f'["-1 {unit}", "-0.0001 {unit}"]'


def declared_keys(*classes: Any, optional: bool = False, without: Iterable[str] = ()) -> dict[str, Key]:
    """Make the keys of a scenario-file section from the fields of dataclasses.

    Args:
        classes: the classes; only fields of dataclasses that are quantities, flags or counts become keys.
        optional: whether all keys are optional, because the defaults are determined elsewhere.
        without: names of fields that do not become keys.

    Returns:
        The keys by the names of their fields.
    """
    dataclasses = [cls for cls in classes if is_dataclass(cls)]
    readers = {f.name: (f, _reader_of(f.metadata)) for cls in dataclasses for f in fields(cls) if f.name not in without}
    return {
        name: Key(read, None if optional else REQUIRED if f.default is MISSING else f.default)
        for name, (f, read) in readers.items()
        if read is not None
    }


def described_section(described: Any, keys: Mapping[str, Key] | None = None) -> Section:
    """Describe the scenario-file section for a class.

    Its keys are the declared fields of the class.

    Args:
        described: a class whose declared fields are keys, or a value; the fields of a value have default values.
        keys: further keys, which are not passed to the class.

    Returns:
        The section; its `make` returns an instance of the class, or the value with other values of its fields.
    """
    others = keys or {}

    def make(**values: Any) -> Any:
        own = {name: value for name, value in values.items() if name not in others}
        if isinstance(described, type):
            return described(**own)
        return replace(described, **own) if own else described

    own_keys = declared_keys(described, optional=not isinstance(described, type))
    return Section({"kind": TAG, **others, **own_keys}, make=make)


def _reader_of(metadata: Mapping[str, Any]) -> Reader | None:
    """Return the parser for a dataclass field. The result is None if the field is not declared as a file key."""
    if "unit" in metadata:
        unit = metadata["unit"] if metadata.get("of_output") is None else "output"
        return Quantity(unit, metadata["example"], metadata["sign"], metadata["infinite"])
    if "flag" in metadata:
        return checked(lambda value: isinstance(value, bool), "true or false")
    return whole(metadata["least"], metadata["example"]) if "least" in metadata else None
