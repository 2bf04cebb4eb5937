"""Find classes, such as sensor curves, that installed packages offer through Python entry points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

from .errors import InvalidInputError
from .messages import short_repr

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Extensions:
    """Lookup of built-in and installed classes by name.

    Other packages offer their classes as entry points. Entry points are read only if a name is not built in, because
    reading them takes time. A package cannot replace a built-in kind.

    Args:
        group: the group of entry points, such as "pretouch.laws".
        built_in: returns the built-in classes or values by name.
        problem: function of a name and an object; returns why the object is invalid, as in "found 3, expected ...", or
            an empty text.
    """

    group: str
    built_in: Callable[[], Mapping[str, Any]]
    problem: Callable[[str, Any], str]

    def find(self, name: str) -> Any:
        """Return the class with a given name.

        The class is built in or imported from an installed package. The result is None for an unknown name.

        Raises:
            InvalidInputError: an entry point is broken, or its name is used twice.
        """
        built_in = self.built_in()
        if name in built_in:
            return built_in[name]
        match = None
        for entry in self._entries():
            if entry.name in built_in:
                raise InvalidInputError(
                    f"the entry point {self._label(entry)} has the name of a built-in kind; rename the entry point"
                )
            if entry.name == name:
                if match is not None:
                    other = _package(match)
                    raise InvalidInputError(
                        f"the entry point {self._label(entry)} is also in the package {other}; uninstall one of them"
                    )
                match = entry
        return None if match is None else self._load(match)

    def names(self) -> tuple[str, ...]:
        """Return all available class names, the built-in classes first."""
        return (*self.built_in(), *self.installed())

    def installed(self) -> tuple[str, ...]:
        """Return the names of all classes that installed packages add to pretouch."""
        return tuple(sorted({entry.name for entry in self._entries()} - set(self.built_in())))

    def _entries(self) -> list[EntryPoint]:
        from importlib.metadata import entry_points  # noqa: PLC0415 - slow to import

        return list(entry_points(group=self.group))

    def _load(self, entry: EntryPoint) -> Any:
        try:
            value = entry.load()
        except Exception as error:  # whatever a foreign module raises
            text = " ".join(f"{type(error).__name__}: {error}".split())
            raise InvalidInputError(
                f"the entry point {self._label(entry)} cannot be imported from {entry.value}. The error is "
                f'"{text}". Repair or uninstall the package'
            ) from error
        problem = self.problem(entry.name, value) or _incomplete(value)
        if problem:
            raise InvalidInputError(f"the entry point {self._label(entry)} is invalid: {problem}")
        return value

    def _label(self, entry: EntryPoint) -> str:
        return f'"{entry.name}" of {self.group} in the package {_package(entry)}'


def kind_problem(base: type, of: str) -> Callable[[str, Any], str]:
    """Return a function that checks the class and name of an entry point.

    Args:
        base: the base class; if a subclass has an attribute `kind` or `name`, this attribute must equal the name of the
            entry point.
        of: the public name of the base class, for messages.

    Returns:
        The check, for `Extensions`.
    """

    def problem(name: str, value: Any) -> str:
        if not (isinstance(value, type) and issubclass(value, base)):
            return f"found {short_repr(value)}, expected a subclass of {of}"
        kind = getattr(value, "kind", getattr(value, "name", name))
        return (
            ""
            if kind == name
            else f'the class has the kind "{kind}", but its entry point has the name "{name}"; use the same name for '
            "both"
        )

    return problem


def _incomplete(value: Any) -> str:
    """Return why scenario files cannot create instances of a class; empty if they can."""
    missing = ", ".join(sorted(getattr(value, "__abstractmethods__", ())))
    if missing:
        return f"the class lacks the methods {missing}"
    for f in fields(value) if isinstance(value, type) and is_dataclass(value) else ():
        if f.init and not f.metadata and f.default is MISSING and f.default_factory is MISSING:
            return (
                f"a scenario file cannot set the field {f.name} of the class; declare this field by "
                "pretouch.fields.quantity"
            )
    return ""


def _package(entry: EntryPoint) -> str:
    return "of an unknown name" if entry.dist is None else entry.dist.name
