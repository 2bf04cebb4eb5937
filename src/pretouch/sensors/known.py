"""The curves by name: those of this folder, and every other class of a sensor that a program has defined."""

from __future__ import annotations

from collections.abc import Iterator

from .custom import CustomSensor
from .model import SensorModel
from .recessed import Recessed

__all__ = ["known_curves"]


def known_curves(*, fitted: bool = False) -> dict[str, type[SensorModel]]:
    """Return the classes of curves that files and fits may name.

    Args:
        fitted: only those that a calibration can be fitted by.

    Returns:
        The classes by name, in the order in which they were defined; curves made of functions or of another curve are
        not among them.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> known_curves()["inverse-power"] is InversePower
        True
    """
    found = {curve.name: curve for curve in _below(SensorModel) if curve.name}  # type: ignore[type-abstract]
    for composed in (CustomSensor, Recessed):
        found.pop(composed.name, None)
    return {name: curve for name, curve in found.items() if not fitted or _is_fitted(curve)}


def _below(cls: type[SensorModel]) -> Iterator[type[SensorModel]]:
    for sub in cls.__subclasses__():
        yield sub
        yield from _below(sub)


def _is_fitted(curve: type[SensorModel]) -> bool:
    says = any("fit_start" in vars(cls) for cls in curve.__mro__ if cls is not SensorModel)
    return says or curve.family is not SensorModel.family
