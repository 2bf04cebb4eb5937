"""List the sensor curves that scenario files and fits can select by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions, kind_problem

from .custom import CustomSensor
from .model import SensorModel
from .recessed import Recessed
from .table import PiecewiseCubic

_HOME: Final = "pretouch."
_COMPOSED: Final = (CustomSensor.name, PiecewiseCubic.name, Recessed.name)  # made of functions or of another curve


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
    for name in _COMPOSED:
        curves.pop(name, None)
    return {name: curve for name, curve in curves.items() if not fitted or _is_fitted(curve)}


CURVE_KINDS: Final = Extensions(
    group="pretouch.sensors",
    built_in=sensor_curves,
    problem=kind_problem(SensorModel, "pretouch.sensors.SensorModel"),
)
"""The curves that files and fits may name: those of pretouch, and those of installed packages."""


def find_curve(name: str) -> type[SensorModel] | None:
    """Return the sensor curve class with a given name.

    It is None if no class has this name. Built-in classes, classes of the calling program and those of installed
    packages are searched.

    Raises:
        InvalidInputError: two classes have this name. A class that is defined again, such as in a notebook, counts
            once, and replaces the earlier one.
    """
    if name in _COMPOSED:
        return None
    classes = {_label(curve): curve for curve in _subclasses(SensorModel) if vars(curve).get("name") == name}  # type: ignore[type-abstract]
    if not all(label.startswith(_HOME) for label in classes) or not classes:
        installed: type[SensorModel] | None = CURVE_KINDS.find(name)
        classes |= {} if installed is None else {_label(installed): installed}
    if len(classes) > 1:
        raise InvalidInputError(
            f"the sensor curves {' and '.join(sorted(classes))} have the same name {name!r}; rename one of them"
        )
    return next(iter(classes.values()), None)


def _label(curve: type[SensorModel]) -> str:
    return f"{curve.__module__}.{curve.__qualname__}"


def _subclasses(cls: type[SensorModel]) -> Iterator[type[SensorModel]]:
    """Yield all direct and indirect subclasses of a sensor curve class."""
    for sub in cls.__subclasses__():
        yield sub
        yield from _subclasses(sub)


def _is_fitted(curve: type[SensorModel]) -> bool:
    """Return True if a curve class can be fitted to readings."""
    has_start = any("fit_start" in vars(cls) for cls in curve.__mro__ if cls is not SensorModel)
    return has_start or curve.family is not SensorModel.family
