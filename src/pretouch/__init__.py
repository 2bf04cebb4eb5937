"""pretouch designs controllers that use proximity sensors to soften impacts.

No collision tests are needed. Calibrate the sensor, describe the encounter, and get the optimal gain, the contact that
it results in, the margins and the evidence:

    >>> import pretouch as pt
    >>> sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    >>> scenario = pt.Scenario(
    ...     admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    ...     obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
    ... )
    >>> objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    >>> design = pt.design(pt.Task(scenario, sensor, objective, bounds=(-10.0, -0.01)))
    >>> round(design.gain, 4)
    -0.7463

The stub __init__.pyi lists the public names. Less frequent functions are in modules such as `pt.plots`, `pt.designs` or
`pt.simulation`. Everything is imported when it is first used. Numbers are SI floats or arrays of them.
"""

from typing import Any

import lazy_loader

from ._core import display as _display

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def _renderer() -> _display.Renderer:
    """Import the functions that show results."""
    from .report import display  # noqa: PLC0415 - loaded when a result is first shown

    return display


_display.register_renderer(_renderer)


def __getattr__(name: str) -> Any:
    if name in __all__:
        return _load(name)
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 - slow to import

        return version(__name__)
    hint = "" if name.startswith("_") else _hint(name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")


def _hint(name: str) -> str:
    """Suggest a similar name for an unknown public name. The text is empty if no public name is similar."""
    from difflib import get_close_matches  # noqa: PLC0415 - only for mistakes

    similar = [known for known in __all__ if len(name) > 2 and name.lower() in known.lower()]
    similar = similar[:3] or get_close_matches(name, __all__, 1)
    return f"; did you mean {' or '.join(similar)}?" if similar else ""
