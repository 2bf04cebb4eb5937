"""What is computed from a curve once and kept, for curves that are told apart by what they compare."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cached_property, lru_cache, wraps
from typing import Concatenate, ParamSpec, TypeVar

from .model import SensorModel

__all__ = ["kept_by_curve"]

P = ParamSpec("P")
R = TypeVar("R")


def kept_by_curve(
    most: int,
) -> Callable[[Callable[Concatenate[SensorModel, P], R]], Callable[Concatenate[SensorModel, P], R]]:
    """Keep `most` results of a function of a curve and of numbers; what was asked before changes nothing of them."""
    # Equal curves share their results. Curves compare their fields: one that holds anything else, which a comparison
    # does not see, has its results computed anew.

    def keeping(function: Callable[Concatenate[SensorModel, P], R]) -> Callable[Concatenate[SensorModel, P], R]:
        kept = lru_cache(maxsize=most)(function)

        @wraps(function)
        def found(sensor: SensorModel, /, *args: P.args, **kwargs: P.kwargs) -> R:
            return (kept if _is_what_it_compares(sensor) else function)(sensor, *args, **kwargs)  # type: ignore[arg-type]

        return found

    return keeping


def _is_what_it_compares(sensor: SensorModel) -> bool:
    """Tell whether a curve, and each that it is made of, holds its fields and what it has computed from them only."""
    held = getattr(sensor, "__dict__", None)
    if held:
        others = held.keys() - {f.name for f in fields(sensor)}
        if any(not isinstance(getattr(type(sensor), name, None), cached_property) for name in others):
            return False
    inner = getattr(sensor, "sensor", None)
    return _is_what_it_compares(inner) if isinstance(inner, SensorModel) else True
