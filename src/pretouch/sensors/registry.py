"""The curves that files and fits may name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from .custom import CustomSensor
from .model import SensorModel
from .recessed import Recessed
from .table import PiecewiseCubic

_HOME: Final = "pretouch."


def known_curves(*, fitted: bool = False, foreign: bool = False) -> dict[str, type[SensorModel]]:
    """Return the classes of curves that files and fits may name.

    Args:
        fitted: only those that a calibration can be fitted by.
        foreign: also those that the program has defined, each under a name of its own: they are found by name, but
            take part in nothing unasked.

    Returns:
        The classes by name; curves made of functions or of another curve are not among them.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> known_curves()["inverse-power"] is InversePower
        True
    """
    found: dict[str, type[SensorModel]] = {}
    ours: set[str] = set()
    for curve in _below(SensorModel):  # type: ignore[type-abstract]
        own = curve.__module__.startswith(_HOME)
        if vars(curve).get("name") and (own or (foreign and curve.name not in ours)):
            found[curve.name] = curve
            ours |= {curve.name} if own else set()
    for composed in (CustomSensor, PiecewiseCubic, Recessed):
        found.pop(composed.name, None)
    return {name: curve for name, curve in found.items() if not fitted or _is_fitted(curve)}


def _below(cls: type[SensorModel]) -> Iterator[type[SensorModel]]:
    for sub in cls.__subclasses__():
        yield sub
        yield from _below(sub)


def _is_fitted(curve: type[SensorModel]) -> bool:
    says = any("fit_start" in vars(cls) for cls in curve.__mro__ if cls is not SensorModel)
    return says or curve.family is not SensorModel.family
