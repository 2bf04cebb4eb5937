"""Check the arguments of public functions, and the fields of values, by their annotations.

`check_arguments` decorates a function; `check_declared` of values.py asks for `rules_of_fields`. A rule is made once,
when its function or class is first used. A type that was allowed before costs one look-up.
"""

from __future__ import annotations

import builtins
import math
import os
import sys
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from decimal import Decimal
from functools import wraps
from inspect import Parameter, signature, unwrap
from numbers import Real
from typing import Any, Final, Literal, NamedTuple, TypeVar, Union, cast, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from .errors import InvalidInputError
from .numbers import are_numbers

F = TypeVar("F", bound=Callable[..., Any])

_HOME: Final = "pretouch."
_KEPT: Final = "_rules_of_fields"  # in a class, with which it vanishes
_LONGEST: Final = 60  # characters of a value that a message shows
_FEW: Final = 8  # items that are shown
_EXAMPLES: Final = {
    "AdmittanceDesign": "an AdmittanceDesign, which design_admittance returns",
    "Calibration": "a Calibration, such as read_calibration(path) returns",
    "CalibrationReport": "a CalibrationReport, which rank_models returns",
    "ContactModel": "a contact model, such as SpringDamper(stiffness=1e4)",
    "ContinuousLaw": "a law in continuous time, such as pretouch.motion.DRAG",
    "DragDesign": "a DragDesign, which design_drag returns",
    "GainDesign": "a GainDesign, which design_gain returns",
    "ImpactModel": "an impact model, such as SpringImpact(robot_mass=1.0, stiffness=1e4)",
    "JointDistribution": "a distribution, such as Normal(mean=-0.3, deviation=0.02)",
    "SteppedLaw": "a law for a controller, such as VirtualDamper(gain=-0.7)",
    "Measure": "a measure, such as Expected() or Quantile(probability=0.9)",
    "ParetoFront": "a ParetoFront, which pareto_front returns",
    "PlantModel": "a robot, such as ImpedancePlant(mass=4.0, stiffness=4e3, damping=250.0)",
    "RobustDesign": "a RobustDesign, which design_robust_gain returns",
    "SampledLaw": "a sampled law, such as Controller(...)",
    "SensorFit": "a SensorFit, which fit_sensor returns",
    "SensorModel": "a sensor curve, such as InversePower(...)",
    "SimulatedEncounter": "a SimulatedEncounter, which simulate_encounter returns",
    "Task": "a Task, such as load_scenario(path) returns",
    "TunableLaw": "a sampled law, such as Controller(...)",
    "Verdict": "a Verdict, which verify_gain returns",
}
"""What is expected, for classes whose name alone does not say how to come by one."""


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
    rules: tuple[tuple[Rule | None, ...], Rule | None, dict[str, Rule]] | None = None

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        nonlocal rules
        if rules is None:
            rules = _rules_of_function(function)
        leading, further, by_name = rules
        for value, rule in zip(args, leading, strict=False):
            if rule is not None and type(value) not in rule.quick:
                rule.check(value)
        if further is not None:
            for value in args[len(leading) :]:
                further.check(value)
        for name, value in options.items():
            rule = by_name.get(name)
            if rule is not None and type(value) not in rule.quick:
                rule.check(value)
        return function(*args, **options)

    return cast("F", call)


def _rules_of_function(
    function: Callable[..., Any],
) -> tuple[tuple[Rule | None, ...], Rule | None, dict[str, Rule]]:
    """Return the rules of the leading parameters, of any further ones, and of all by name."""
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
    """Return the rules of the fields of a dataclass that no `quantity` declares, by name; kept in the class."""
    known: dict[str, Rule] | None = cls.__dict__.get(_KEPT)
    if known is None:
        known = _make_rules(cls)
        setattr(cls, _KEPT, known)
    return known


def _make_rules(cls: Any) -> dict[str, Rule]:
    rules = {}
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
    return rules


def short_repr(value: Any) -> str:
    """Return a value as a message shows it, in few characters.

    Args:
        value: any.

    Returns:
        Such as `'x'`, `None`, `a Task`, `an array of the shape (3,)`.

    Examples:
        >>> short_repr("x"), short_repr(object()), short_repr(int)
        ("'x'", 'an object', 'the class int')
    """
    container = isinstance(value, tuple | list | dict | set)
    if _is_simple(value) or (container and len(value) <= _FEW and all(map(_is_simple, value))):
        return _cut_repr(value)
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of {value.dtype} of the shape {value.shape}"
    if isinstance(value, type | types.FunctionType | types.BuiltinFunctionType):
        return f"the {'class' if isinstance(value, type) else 'function'} {value.__name__}"
    return f"a {type(value).__name__} of {len(value)}" if container else _with_article(type(value).__name__)


def _cut_repr(value: Any) -> str:
    try:
        text = repr(value)
    except ValueError:  # of a whole number with thousands of digits
        return _with_article(type(value).__name__)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _is_simple(value: Any) -> bool:
    return isinstance(value, None | bool | int | float | complex | str | bytes | np.generic | os.PathLike)


def _with_article(name: str) -> str:
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"


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


def _is_number(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "iuf" and not np.ma.is_masked(value)
    return isinstance(value, Real | Decimal) and not isinstance(value, bool)


def _as_float(value: Any) -> float:
    """Return a number as a float: infinite where it is beyond all floats, NaN where it is no number."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    except ValueError:  # a signaling NaN of Decimal
        return math.nan


def _is_whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


_NUMBER: Final = _Kind({float, int, np.float64}, _is_number, "a number", "numbers", by_type=False, convert=_as_float)
_KINDS: Final[dict[Any, _Kind]] = {
    float: _NUMBER,
    int: _Kind({int}, _is_whole, "a whole number", "whole numbers", by_type=False, convert=int),
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
        said = ", ".join(map(repr, parts))
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
        return all(type(item) in quick or holds(item) for item in value)

    def convert(value: Any) -> Any:
        return tuple(item if kind.convert is None or type(item) in quick else kind.convert(item) for item in value)

    words = f"{_COUNTS.get(count, count)} {kind.many}"
    return _Kind(set(), fits, words, words, by_type=False, convert=convert)


def _sequence(kind: _Kind | None) -> _Kind:
    def fits(value: Any) -> bool:
        if isinstance(value, np.ndarray) and kind is not None and kind.holds is _is_number:
            return value.ndim > 0 and are_numbers(value)
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
            return False
        if kind is None or not isinstance(value, Sequence | np.ndarray):  # what can be read once only is left unread
            return True
        return all(type(item) in kind.quick or kind.holds(item) for item in value)

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
    one, many = _EXAMPLES.get(name, _with_article(name)), f"{name}s"
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
