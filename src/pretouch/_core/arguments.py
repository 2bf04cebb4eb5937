"""Check the arguments of public functions, and the fields of values, by their annotations.

`check_arguments` decorates a function; `check_declared` of values.py asks for `rules_of_fields`. A rule is made once,
when its function or class is first used. A type that was allowed before costs one look-up.
"""

from __future__ import annotations

import builtins
import os
import sys
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from functools import wraps
from inspect import Parameter, signature, unwrap
from typing import Any, Final, Literal, NamedTuple, TypeAlias, TypeVar, Union, cast, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from .errors import InvalidInputError
from .messages import EXAMPLES, short_repr, with_article
from .numbers import are_numbers, as_float, is_number, is_whole

F = TypeVar("F", bound=Callable[..., Any])

_HOME: Final = "pretouch."
RULES_ATTRIBUTE: Final = "_rules_of_fields"
"""The attribute of a class in which the rules of its fields are cached."""


class _Kind(NamedTuple):
    """What an annotation allows.

    Args:
        quick: types of which every value is allowed; more are added as they are met, if `by_type`.
        holds: whether a value is allowed.
        one: what is allowed, in words.
        many: the same, of several.
        by_type: whether the type of a value decides.
        convert: from a value of another type to the one that is kept, such as from a number of NumPy to a float.
    """

    quick: set[type]
    holds: Callable[[Any], bool]
    one: str
    many: str
    by_type: bool = True
    convert: Callable[[Any], Any] | None = None


class Rule:
    """What is allowed for one argument.

    Args:
        name: of the argument.
        kind: what its annotation allows.
        default: its default, which need not be checked.

    Attributes:
        quick: types of which every value is allowed.
    """

    __slots__ = ("_kind", "_name", "default", "quick")

    def __init__(self, name: str, kind: _Kind, default: Any = None) -> None:
        self._name, self._kind, self.default, self.quick = name, kind, default, kind.quick

    def check(self, value: Any, before: str = "") -> Any:
        """Refuse a value that is not allowed.

        Args:
            value: the argument.
            before: what is before the name in messages.

        Returns:
            The value to be kept: a number, a whole number, a truth value or a row of numbers as those of Python.

        Raises:
            InvalidInputError: it is not allowed.
        """
        if type(value) in self.quick:
            return value
        if not self._kind.holds(value):
            raise InvalidInputError(f"{before}{self._name}: found {short_repr(value)}, expected {self._kind.one}")
        if self._kind.by_type and type(value).__module__.startswith(_HOME):
            self.quick.add(type(value))  # a class of the user's is not kept alive
        return value if self._kind.convert is None else self._kind.convert(value)


_Rules: TypeAlias = tuple[tuple[Rule | None, ...], Rule | None, dict[str, Rule]]
"""Of a function: the rules of its leading parameters, of any further ones, and of all by name."""


def check_arguments(function: F) -> F:
    """Make a public function check its arguments before it does anything.

    Args:
        function: with annotations; what these leave open, such as Any, is left to the function.

    Returns:
        The function, which refuses arguments of other types by InvalidInputError: argument, value, what is allowed.

    Examples:
        >>> @check_arguments
        ... def double(number: float) -> float:
        ...     return 2 * number
        >>> double(1.5)
        3.0
        >>> double("1.5")
        Traceback (most recent call last):
        pretouch._core.errors.InvalidInputError: number: found '1.5', expected a number
    """
    rules: _Rules | None = None

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        nonlocal rules
        if rules is None:
            rules = _rules_of_function(function)
        leading, further, by_name = rules
        for value, rule in zip(args, leading):  # noqa: B905 - there may be more of either
            if rule is not None and type(value) not in rule.quick:
                break
        else:
            for name, value in options.items():
                rule = by_name.get(name)
                if rule is not None and type(value) not in rule.quick:
                    break
            else:
                if further is None:
                    return function(*args, **options)
        each = (*leading, *[further] * (len(args) - len(leading)))
        kept = [_keep(rule, value) for rule, value in zip(each, args)]  # noqa: B905 - there may be fewer arguments
        return function(*kept, **{name: _keep(by_name.get(name), value) for name, value in options.items()})

    return cast("F", call)


def _keep(rule: Rule | None, value: Any) -> Any:
    return value if rule is None else rule.check(value)


def _rules_of_function(function: Callable[..., Any]) -> _Rules:
    inner: Any = unwrap(function)
    leading: list[Rule | None] = []
    further, by_name = None, {}
    for parameter in signature(inner).parameters.values():
        kind = _kind(_evaluate(parameter.annotation, inner.__globals__))
        rule = None if kind is None else Rule(parameter.name, kind)
        if parameter.kind is Parameter.VAR_POSITIONAL:
            further = rule
        elif parameter.kind is not Parameter.VAR_KEYWORD:
            if parameter.kind is not Parameter.KEYWORD_ONLY:
                leading.append(rule)
            if rule is not None:
                by_name[parameter.name] = rule
    return tuple(leading), further, by_name


def rules_of_fields(cls: Any) -> dict[str, Rule]:
    """Return the rules of the fields of a dataclass that no `quantity` declares, by name.

    They are kept in the class as KEPT, and vanish with it.
    """
    rules: dict[str, Rule] = {}
    for f in fields(cls):
        if not f.init or "unit" in f.metadata or f.metadata.get("checked") is False:
            continue
        home = next(base for base in cls.__mro__ if f.name in vars(base).get("__annotations__", {}))
        if not home.__module__.startswith(_HOME):  # a user's class checks what it adds
            continue
        annotation = f.metadata.get("takes", f.type)
        kind = _kind(_evaluate(annotation, vars(sys.modules[home.__module__])))
        if kind is not None:
            rules[f.name] = Rule(f.name, kind, f.default)
    setattr(cls, RULES_ATTRIBUTE, rules)
    return rules


class _Elsewhere(type):
    """The class of a name that is imported for type checkers alone: of its instances the name is known."""

    def __getattr__(cls, name: str) -> Any:  # as in `xr.Dataset`
        if name.startswith("__"):
            raise AttributeError(name)
        return _Elsewhere(name, (), {})


class _Names(dict[str, Any]):
    """The names of a module, and of classes that it imports for type checkers alone."""

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            raise KeyError(name)
        return _Elsewhere(name, (), {})


def _evaluate(annotation: Any, names: Mapping[str, Any]) -> Any:
    """Return what an annotation says; Any where that cannot be told."""
    if annotation is Parameter.empty:
        return Any
    try:
        while isinstance(annotation, str):
            annotation = eval(annotation, {}, _Names(names))  # noqa: S307 - from pretouch's own source
    except (TypeError, AttributeError, NameError):
        return Any
    return annotation


_NUMBER: Final = _Kind({float, int, np.float64}, is_number, "a number", "numbers", by_type=False, convert=as_float)
_KINDS: Final[dict[Any, _Kind]] = {
    float: _NUMBER,
    int: _Kind({int}, is_whole, "a whole number", "whole numbers", by_type=False, convert=int),
    bool: _Kind({bool}, lambda v: isinstance(v, bool | np.bool_), "True or False", "", by_type=False, convert=bool),
    str: _Kind({str}, lambda v: isinstance(v, str), "text", "texts"),
    None: _Kind({type(None)}, lambda v: v is None, "None", "None"),
    type(None): _Kind({type(None)}, lambda v: v is None, "None", "None"),
    os.PathLike: _Kind(set(), lambda v: isinstance(v, os.PathLike), "a path", "paths"),
    Callable: _Kind(set(), lambda v: callable(v) and not isinstance(v, type), "a function", "functions"),
}
_NUMBERS: Final = _Kind({float, int, np.float64}, are_numbers, "a number or an array of numbers", "arrays", False)


def _kind(hint: Any) -> _Kind | None:
    """Return what an annotation allows; None where that is anything."""
    origin, parts = get_origin(hint), get_args(hint)
    if hint is ArrayLike or origin is np.ndarray:
        return _NUMBERS
    known = _KINDS.get(origin or hint)
    if known is not None:
        return known._replace(quick=set(known.quick))
    if origin is not None:
        return _composed(origin, parts)
    return _instance(hint) if isinstance(hint, type) and hint not in {object, Any} else None


def _composed(origin: Any, parts: tuple[Any, ...]) -> _Kind | None:
    """Return what a union, a literal or a container of some parts allows."""
    if origin in {Union, types.UnionType}:
        return _any_of([_kind(part) for part in parts])
    if origin is Literal:
        said = ", ".join(map(str, parts))
        return _Kind(set(), lambda v: isinstance(v, str) and v in parts, f"one of {said}", said, by_type=False)
    if origin is tuple and parts[-1:] != (Ellipsis,):
        return _row(parts)
    found = None
    if isinstance(origin, type) and issubclass(origin, Iterable):
        found = _mapping(*parts) if issubclass(origin, Mapping) else _sequence(_kind(parts[0]))
    return found


def _any_of(kinds: Sequence[_Kind | None]) -> _Kind | None:
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds):
        return None
    quick = set().union(*(kind.quick for kind in known))
    words = " or ".join(dict.fromkeys(kind.one for kind in known))
    left = [kind for kind in known if kind.one != "None"]
    if len(left) == 1:
        return left[0]._replace(quick=quick, one=words)

    def convert(value: Any) -> Any:
        kind = next(kind for kind in known if kind.holds(value))
        return value if kind.convert is None else kind.convert(value)

    decides = all(kind.by_type for kind in known)
    return _Kind(quick, lambda v: any(kind.holds(v) for kind in known), words, words, decides, convert)


_COUNTS: Final = {1: "one", 2: "two", 3: "three"}


def _row(parts: tuple[Any, ...]) -> _Kind | None:
    kind, count = _kind(parts[0]), len(parts)
    if kind is None or any(part != parts[0] for part in parts):
        return None
    quick, holds = kind.quick, kind.holds

    def fits(value: Any) -> bool:
        if not isinstance(value, tuple | list | np.ndarray) or len(value) != count:
            return False
        return quick.issuperset(map(type, value)) or all(map(holds, value))

    def convert(value: Any) -> Any:
        if kind.convert is None or (type(value) is tuple and quick.issuperset(map(type, value))):
            return value
        return tuple(item if type(item) in quick else kind.convert(item) for item in value)

    words = f"{_COUNTS.get(count, count)} {kind.many}"
    return _Kind(set(), fits, words, words, by_type=False, convert=convert)


def _sequence(kind: _Kind | None) -> _Kind:
    def fits(value: Any) -> bool:
        if type(value) is tuple and kind is not None and kind.quick.issuperset(map(type, value)):
            return True
        if isinstance(value, np.ndarray) and kind is not None and kind.holds is is_number:
            return value.ndim > 0 and are_numbers(value)
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
            return False
        if kind is None or not isinstance(value, Sequence | np.ndarray):  # what can be read once only is left unread
            return True
        allowed = kind.quick.issuperset(map(type, value)) or all(map(kind.holds, value))
        if allowed and kind.by_type:
            kind.quick.update(t for t in set(map(type, value)) if t.__module__.startswith(_HOME))
        return allowed

    words = "a sequence" if kind is None else f"a sequence of {kind.many}"
    return _Kind(set(), fits, words, "sequences", by_type=False)


def _mapping(key: Any, value: Any) -> _Kind:
    """Return what a mapping allows; what is wrong with a value, the function says with its key."""
    keys, values = _kind(key), _kind(value)

    def fits(found: Any) -> bool:
        return isinstance(found, Mapping) and (keys is None or all(map(keys.holds, found)))

    words = f"a mapping from {'names' if keys is None else keys.many} to {'values' if values is None else values.many}"
    return _Kind(set(), fits, words, "mappings", by_type=False)


def _instance(cls: type) -> _Kind:
    name = cls.__name__
    one, many = EXAMPLES.get(name, with_article(name)), f"{name}s"
    if isinstance(cls, _Elsewhere):
        return _Kind(set(), lambda v: any(base.__name__ == name for base in type(v).__mro__), one, many)
    if getattr(cls, "_is_protocol", False):
        members = _members(cls)
        return _Kind(set(), lambda v: not isinstance(v, type) and all(_has(v, m) for m in members), one, many)
    return _Kind(set(), lambda v: isinstance(v, cls), one, many)


def _members(protocol: type) -> list[str]:
    """Return the names that a value has for a protocol."""
    bases = [base for base in protocol.__mro__ if getattr(base, "_is_protocol", False)]
    names = {name for base in bases for name in (*vars(base), *vars(base).get("__annotations__", {}))}
    return sorted(name for name in names if not name.startswith("_") or name == "__call__")


def _has(value: Any, name: str) -> bool:
    """Tell whether a value has an attribute; one that is computed is not asked for."""
    return hasattr(type(value), name) or hasattr(value, name)
