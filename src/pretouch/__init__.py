"""pretouch chooses the gain of a proximity-sensor-based preemptive impact controller without one collision.

Calibrate the sensor on the bench, describe the encounter, and get the optimal gain, the contact that it leads to, the
margins and the evidence:

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

The names of the front are listed in the stub beside this file; what few need stands in rooms of its own, such as
`pt.plots`, `pt.robust` or `pt.simulation`, each loaded when it is first used. Numbers are SI floats or arrays of them.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from ._core.lazy_names import lazy_names

_load, __dir__ = lazy_names(__name__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 - takes longer than the rest

        return version(__name__)
    return _load(name)


class _Front(ModuleType):
    """Keeps `pretouch.sweep` the verb: Python puts a folder that it loads in the place of the same name."""

    def __setattr__(self, name: str, value: object) -> None:
        folder = name == "sweep" and isinstance(value, ModuleType)
        super().__setattr__(name, value.sweep if folder else value)  # type: ignore[attr-defined]


sys.modules[__name__].__class__ = _Front
