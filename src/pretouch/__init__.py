"""pretouch designs the gain of a preemptive impact controller with proximity sensors, without collision tests.

Calibrate the sensor, describe the encounter, and get the optimal gain, the contact that it results in, the margins and
the evidence:

    >>> import pretouch as pt
    >>> sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    >>> scenario = pt.Scenario(
    ...     admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    ...     obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
    ... )
    >>> objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    >>> design = pt.design_gain(pt.Task(scenario, sensor, objective, bounds=(-10.0, -0.01)))
    >>> round(design.gain, 4)
    -0.7463

The stub __init__.pyi lists the public names. Less frequent functions are in modules such as `pt.plots`, `pt.robust` or
`pt.simulation`. Everything is imported when it is first used. Numbers are SI floats or arrays of them.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from ._core.lazy_names import lazy_names

_load, __dir__ = lazy_names(__name__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 - slow to import

        return version(__name__)
    return _load(name)


class _PublicModule(ModuleType):
    """Keeps `pretouch.sweep` the function: importing the package `pretouch.sweep` would replace it."""

    def __setattr__(self, name: str, value: object) -> None:
        is_package = name == "sweep" and isinstance(value, ModuleType)
        super().__setattr__(name, value.sweep if is_package else value)  # type: ignore[attr-defined]


sys.modules[__name__].__class__ = _PublicModule
