"""Check arguments and dataclass fields against their type annotations.

`check_arguments` decorates a function; `check_declared` of fields.py calls `rules_of_fields`. A rule is made once,
when its function or class is first used. Checking an argument whose type was accepted before takes one lookup.
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

_PACKAGE: Final = "pretouch."
RULES_ATTRIBUTE: Final = "_rules_of_fields"
"""The attribute of a class in which the rules of its fields are cached."""


class _Allowed(NamedTuple):
    """The argument values allowed by a type annotation.

    Args:
        quick: types whose values are all allowed; if `by_type`, accepted types are added.
        holds: returns whether a value is allowed.
        singular: describes one allowed value in messages.
        plural: describes several allowed values in messages.
        by_type: whether the type of a value alone decides.
        convert: turns an allowed value into the type that is stored, such as a NumPy number into a float.
        choices: the allowed names; empty if the values are not names.
    """

    quick: set[type]
    holds: Callable[[Any], bool]
    singular: str
    plural: str
    by_type: bool = True
    convert: Callable[[Any], Any] | None = None
    choices: tuple[str, ...] = ()


class Rule:
    """Type check for one function argument or dataclass field.

    Args:
        name: name of the argument.
        kind: the values that its annotation allows.
        default: its default value, which is not checked.

    Attributes:
        quick: types of which every value is allowed.
    """

    __slots__ = ("_allowed", "_name", "default", "quick")

    def __init__(self, name: str, kind: _Allowed, default: Any = None) -> None:
        self._name, self._allowed, self.default, self.quick = name, kind, default, kind.quick

    def check(self, value: Any, before: str = "") -> Any:
        """Check and convert the value of one argument.

        Args:
            value: the argument.
            before: text before the argument's name in messages.

        Returns:
            The value to store: numbers, booleans and tuples of numbers become Python types.

        Raises:
            InvalidInputError: the value is not allowed.
        """
        if type(value) in self.quick:
            return value
        if not self._allowed.holds(value):
            raise InvalidInputError(
                f"{before}{self._name}: found {short_repr(value)}, expected {self._allowed.singular}",
                value=value,
                limit=self._allowed.choices or None,
            )
        if self._allowed.by_type and type(value).__module__.startswith(_PACKAGE):
            self.quick.add(type(value))  # a user's class is not stored, so that it can be garbage-collected
        return value if self._allowed.convert is None else self._allowed.convert(value)


_Rules: TypeAlias = tuple[tuple[Rule | None, ...], Rule | None, dict[str, Rule]]
"""The rules of a function: by position, for *args, and by name."""


def check_arguments(function: F) -> F:
    """Check the types of a function's arguments at each call.

    Args:
        function: an annotated function; parameters annotated with Any are not checked.

    Returns:
        The function. For an argument of another type it raises InvalidInputError, which names the argument, the value
        and what is allowed.

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
        for value, rule in zip(args, leading):  # noqa: B905 - the lengths may differ
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
        all_rules = (*leading, *[further] * (len(args) - len(leading)))
        checked = [_check(rule, value) for rule, value in zip(all_rules, args)]  # noqa: B905 - there may be fewer arguments
        return function(*checked, **{name: _check(by_name.get(name), value) for name, value in options.items()})

    return cast("F", call)


def _check(rule: Rule | None, value: Any) -> Any:
    return value if rule is None else rule.check(value)


def _rules_of_function(function: Callable[..., Any]) -> _Rules:
    inner: Any = unwrap(function)
    leading: list[Rule | None] = []
    further, by_name = None, {}
    for parameter in signature(inner).parameters.values():
        kind = _allowed(_evaluate(parameter.annotation, inner.__globals__))
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
    """Return the type checks of the fields of a dataclass.

    Fields that hold physical quantities are not included. The rules are cached in the class, as RULES_ATTRIBUTE, and
    are freed with it.
    """
    rules: dict[str, Rule] = {}
    for f in fields(cls):
        if not f.init or "unit" in f.metadata or f.metadata.get("checked") is False:
            continue
        owner = next(base for base in cls.__mro__ if f.name in vars(base).get("__annotations__", {}))
        if not owner.__module__.startswith(_PACKAGE):  # a user's class checks the fields that it adds
            continue
        annotation = f.metadata.get("takes", f.type)
        kind = _allowed(_evaluate(annotation, vars(sys.modules[owner.__module__])))
        if kind is not None:
            rules[f.name] = Rule(f.name, kind, f.default)
    setattr(cls, RULES_ATTRIBUTE, rules)
    return rules


class _TypeCheckingOnly(type):
    """Placeholder for a class imported only for static type checking. Values are checked by the name of their class."""

    def __getattr__(cls, name: str) -> Any:  # as in `xr.Dataset`
        if name.startswith("__"):
            raise AttributeError(name)
        return _TypeCheckingOnly(name, (), {})


class _Namespace(dict[str, Any]):
    """Dictionary of module names that returns a placeholder for a missing name."""

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            raise KeyError(name)
        return _TypeCheckingOnly(name, (), {})


def _evaluate(annotation: Any, names: Mapping[str, Any]) -> Any:
    """Return the type described by an annotation. The result is `Any` if the annotation cannot be evaluated."""
    if annotation is Parameter.empty:
        return Any
    try:
        while isinstance(annotation, str):
            annotation = eval(annotation, {}, _Namespace(names))  # noqa: S307 - from pretouch's own source
    except (TypeError, AttributeError, NameError):
        return Any
    return annotation


_NUMBER: Final = _Allowed({float, int, np.float64}, is_number, "a number", "numbers", by_type=False, convert=as_float)
_ALLOWED: Final[dict[Any, _Allowed]] = {
    float: _NUMBER,
    int: _Allowed({int}, is_whole, "a whole number", "whole numbers", by_type=False, convert=int),
    bool: _Allowed({bool}, lambda v: isinstance(v, bool | np.bool_), "True or False", "", by_type=False, convert=bool),
    str: _Allowed({str}, lambda v: isinstance(v, str), "text", "texts"),
    None: _Allowed({type(None)}, lambda v: v is None, "None", "None"),
    type(None): _Allowed({type(None)}, lambda v: v is None, "None", "None"),
    os.PathLike: _Allowed(set(), lambda v: isinstance(v, os.PathLike), "a path", "paths"),
    Callable: _Allowed(set(), lambda v: callable(v) and not isinstance(v, type), "a function", "functions"),
}
_NUMBERS: Final = _Allowed({float, int, np.float64}, are_numbers, "a number or an array of numbers", "arrays", False)


def _allowed(annotation: Any) -> _Allowed | None:
    """Return the argument values that a type annotation allows. The result is None if every value is allowed."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation is ArrayLike or origin is np.ndarray:
        return _NUMBERS
    simple = _ALLOWED.get(origin or annotation)
    if simple is not None:
        return simple._replace(quick=set(simple.quick))
    if origin is not None:
        return _composed(origin, parts)
    return _instance(annotation) if isinstance(annotation, type) and annotation not in {object, Any} else None


def _composed(origin: Any, parts: tuple[Any, ...]) -> _Allowed | None:
    """Return the values allowed by a composed annotation: `Union`, `Literal` or a container type."""
    if origin in {Union, types.UnionType}:
        return _any_of([_allowed(part) for part in parts])
    if origin is Literal:
        choices = ", ".join(map(str, parts))
        return _Allowed(
            set(),
            lambda v: isinstance(v, str) and v in parts,
            f"one of {choices}",
            choices,
            by_type=False,
            choices=parts,
        )
    if origin is tuple and parts[-1:] != (Ellipsis,):
        return _fixed_tuple(parts)
    if isinstance(origin, type) and issubclass(origin, Iterable):
        return _mapping(*parts) if issubclass(origin, Mapping) else _sequence(_allowed(parts[0]))
    return None


def _any_of(kinds: Sequence[_Allowed | None]) -> _Allowed | None:
    members = [kind for kind in kinds if kind is not None]
    if len(members) < len(kinds):
        return None
    quick = set().union(*(kind.quick for kind in members))
    words = " or ".join(dict.fromkeys(kind.singular for kind in members))
    not_none = [kind for kind in members if kind.singular != "None"]
    if len(not_none) == 1:
        return not_none[0]._replace(quick=quick, singular=words)

    def convert(value: Any) -> Any:
        kind = next(kind for kind in members if kind.holds(value))
        return value if kind.convert is None else kind.convert(value)

    decides = all(kind.by_type for kind in members)
    return _Allowed(quick, lambda v: any(kind.holds(v) for kind in members), words, words, decides, convert)


_COUNTS: Final = {1: "one", 2: "two", 3: "three"}


def _fixed_tuple(parts: tuple[Any, ...]) -> _Allowed | None:
    """Return the argument values that an annotation such as `tuple[float, float]` allows."""
    kind, count = _allowed(parts[0]), len(parts)
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

    words = f"{_COUNTS.get(count, count)} {kind.plural}"
    return _Allowed(set(), fits, words, words, by_type=False, convert=convert)


def _sequence(kind: _Allowed | None) -> _Allowed:
    def fits(value: Any) -> bool:
        if type(value) is tuple and kind is not None and kind.quick.issuperset(map(type, value)):
            return True
        if isinstance(value, np.ndarray) and kind is not None and kind.holds is is_number:
            return value.ndim > 0 and are_numbers(value)
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
            return False
        if kind is None or not isinstance(
            value, Sequence | np.ndarray
        ):  # an iterator can be read only once, so it is not checked
            return True
        allowed = kind.quick.issuperset(map(type, value)) or all(map(kind.holds, value))
        if allowed and kind.by_type:
            kind.quick.update(t for t in set(map(type, value)) if t.__module__.startswith(_PACKAGE))
        return allowed

    words = "a sequence" if kind is None else f"a sequence of {kind.plural}"
    return _Allowed(set(), fits, words, "sequences", by_type=False)


def _mapping(key: Any, value: Any) -> _Allowed:
    """Return the values allowed by a `Mapping` annotation. Only the types of the keys are checked."""
    keys, values = _allowed(key), _allowed(value)

    def fits(candidate: Any) -> bool:
        return isinstance(candidate, Mapping) and (keys is None or all(map(keys.holds, candidate)))

    words = (
        f"a mapping from {'names' if keys is None else keys.plural} to {'values' if values is None else values.plural}"
    )
    return _Allowed(set(), fits, words, "mappings", by_type=False)


def _instance(cls: type) -> _Allowed:
    name = cls.__name__
    singular, plural = EXAMPLES.get(name, with_article(name)), f"{name}s"
    if isinstance(cls, _TypeCheckingOnly):
        return _Allowed(set(), lambda v: any(base.__name__ == name for base in type(v).__mro__), singular, plural)
    if getattr(cls, "_is_protocol", False):
        members = _members(cls)
        return _Allowed(set(), lambda v: not isinstance(v, type) and all(_has(v, m) for m in members), singular, plural)
    return _Allowed(set(), lambda v: isinstance(v, cls), singular, plural)


def _members(protocol: type) -> list[str]:
    """Return the names of the attributes that a `typing.Protocol` requires."""
    bases = [base for base in protocol.__mro__ if getattr(base, "_is_protocol", False)]
    names = {name for base in bases for name in (*vars(base), *vars(base).get("__annotations__", {}))}
    return sorted(name for name in names if not name.startswith("_") or name == "__call__")


def _has(value: Any, name: str) -> bool:
    """Check for an attribute without calling a property getter."""
    return hasattr(type(value), name) or hasattr(value, name)
