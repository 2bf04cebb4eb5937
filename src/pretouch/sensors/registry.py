"""List the sensor curves that scenario files and fits can select by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pretouch._core.extensions import Extensions, kind_problem

from .custom import CustomSensor
from .model import SensorModel
from .recessed import Recessed
from .table import PiecewiseCubic

_HOME: Final = "pretouch."


def sensor_curves(*, fitted: bool = False, foreign: bool = False) -> dict[str, type[SensorModel]]:
    """Return all named classes of sensor curves.

    Scenario files and fits select these classes by name.

    Args:
        fitted: return only curves that can be fitted to a calibration.
        foreign: also return curves that the calling program has defined, if their names are not used by pretouch. They
            can be selected by name but are not part of default lists.

    Returns:
        The classes by name. Curves made of functions, of cubic polynomials or of another curve are not included.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor_curves()["inverse-power"] is InversePower
        True
    """
    curves: dict[str, type[SensorModel]] = {}
    built_in: set[str] = set()
    for curve in _subclasses(SensorModel):  # type: ignore[type-abstract]
        is_ours = curve.__module__.startswith(_HOME)
        if vars(curve).get("name") and (is_ours or (foreign and curve.name not in built_in)):
            curves[curve.name] = curve
            built_in |= {curve.name} if is_ours else set()
    for composed in (CustomSensor, PiecewiseCubic, Recessed):
        curves.pop(composed.name, None)
    return {name: curve for name, curve in curves.items() if not fitted or _is_fitted(curve)}


CURVE_KINDS: Final = Extensions(
    group="pretouch.sensors",
    built_in=sensor_curves,
    problem=kind_problem(SensorModel, "pretouch.SensorModel"),
)
"""The curves that files and fits may name: those of pretouch, and those of installed packages."""


def find_curve(name: str) -> type[SensorModel] | None:
    """Return the sensor curve class with a given name.

    It is None if no class has this name. Built-in classes, classes of the calling program and those of installed
    packages are searched.
    """
    curve: type[SensorModel] | None = sensor_curves(foreign=True).get(name) or CURVE_KINDS.find(name)
    return curve


def _subclasses(cls: type[SensorModel]) -> Iterator[type[SensorModel]]:
    """Yield all direct and indirect subclasses of a sensor curve class."""
    for sub in cls.__subclasses__():
        yield sub
        yield from _subclasses(sub)


def _is_fitted(curve: type[SensorModel]) -> bool:
    """Return True if a curve class can be fitted to readings."""
    has_start = any("fit_start" in vars(cls) for cls in curve.__mro__ if cls is not SensorModel)
    return has_start or curve.family is not SensorModel.family
