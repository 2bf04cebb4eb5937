"""Results as JSON that every reader accepts."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, Final

__all__ = ["as_json", "plain", "with_kind"]


def as_json(value: Mapping[str, Any], *, indent: int | None = 2) -> str:
    """Write an object as JSON that every reader accepts.

    Args:
        value: the object.
        indent: spaces per level; None for one line without any space.

    Returns:
        JSON in ASCII.

    Examples:
        >>> print(as_json({"gain": -0.75, "horizon": float("inf")}))
        {
          "gain": -0.75,
          "horizon": null
        }
        >>> as_json({"gain": -0.75, "bounds": (-10, 0)}, indent=None)
        '{"gain":-0.75,"bounds":[-10,0]}'
    """
    separators = (",", ":") if indent is None else None
    return json.dumps(plain(value), indent=indent, separators=separators, allow_nan=False)


def plain(value: Any) -> Any:
    """Turn a value into what JSON can hold; a number that is not finite becomes null.

    Args:
        value: anything a result may hold: numbers and arrays of NumPy, tuples, enumerations, paths, and what is made
            of these: a dataclass becomes its fields, or what its `to_dict` returns.

    Returns:
        The same in dicts, lists, text, numbers, truth values and None.

    Examples:
        >>> plain({"low": float("-inf"), "pair": (1, 2.5)})
        {'low': None, 'pair': [1, 2.5]}
    """
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, _LISTS) else _plain_one(value)


def with_kind(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass, and the name of its class as `kind`: where one of several may stand."""
    return {"kind": type(value).__name__, **{f.name: getattr(value, f.name) for f in fields(value)}}


_LISTS: Final = (list, tuple, set, frozenset)


def _plain_one(value: Any) -> Any:
    """Turn what holds no other value into what JSON can hold."""
    if isinstance(value, Enum):
        return plain(value.value)
    if hasattr(value, "tolist"):  # scalars and arrays of NumPy
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
