"""Format invalid values for error messages."""

from __future__ import annotations

import os
import types
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

EXAMPLES: Final = {
    "AdmittanceDesign": "an AdmittanceDesign, which pretouch.design returns",
    "Calibration": "a Calibration, such as read_calibration(path) returns",
    "CalibrationReport": "a CalibrationReport, which pretouch.fit returns",
    "ContactModel": "a contact model, such as SpringDamper(stiffness=1e4)",
    "ContinuousLaw": "a law in continuous time, such as pretouch.motion.DRAG",
    "DragDesign": "a DragDesign, which pretouch.design returns",
    "GainDesign": "a GainDesign, which pretouch.design returns",
    "ImpactModel": "an impact model, such as SpringImpact(robot_mass=1.0, stiffness=1e4)",
    "JointDistribution": "a distribution, such as Normal(mean=-0.3, deviation=0.02)",
    "SteppedLaw": "a law for a controller, such as VirtualDamper(gain=-0.7)",
    "Measure": "a measure, such as Expected() or Quantile(probability=0.9)",
    "ParetoFront": "a ParetoFront, which pretouch.pareto returns",
    "ParetoOptions": "options such as ParetoOptions(choice=-0.7)",
    "PlantModel": "a robot, such as ImpedancePlant(mass=4.0, stiffness=4e3, damping=250.0)",
    "RobustDesign": "a RobustDesign, which pretouch.robust returns",
    "RobustOptions": "options such as RobustOptions(samples=512)",
    "SampledLaw": "a sampled law, such as Controller(...)",
    "SensorFit": "a SensorFit, such as pretouch.fit(calibration).best",
    "SensorModel": "a sensor curve, such as InversePower(...)",
    "SimulatedEncounter": "a SimulatedEncounter, which pretouch.simulate returns",
    "Task": "a Task, such as load_scenario(path) returns",
    "TunableLaw": "a sampled law, such as Controller(...)",
    "Verdict": "a Verdict, which pretouch.verify returns",
    "VerifyOptions": "options such as VerifyOptions(runs=500)",
}
"""Descriptions of expected values, for classes whose name does not say how to make one."""

_LONGEST: Final = 60  # characters of a value that a message shows
_FEW: Final = 8  # items that are shown


def not_one_of(argument: str, value: Any, names: Iterable[str]) -> dict[str, Any]:
    """Describe the error of a name that is not one of the allowed names.

    Returns:
        The arguments of the error: message, value and limit.

    Examples:
        >>> not_one_of("method", "exact", ["auto", "integration"])["message"]
        "method: found 'exact', expected one of auto, integration"
    """
    allowed = tuple(names)
    message = f"{argument}: found {value!r}, expected one of {', '.join(allowed)}"
    return {"message": message, "value": value, "limit": allowed}


def short_repr(value: Any) -> str:
    """Return a short representation of a value for error messages.

    Args:
        value: any value.

    Returns:
        Text such as `'x'`, `None`, `a Task`, `an array of the shape (3,)`.

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
    return f"a {type(value).__name__} of {len(value)}" if container else with_article(type(value).__name__)


def _cut_repr(value: Any) -> str:
    try:
        text = repr(value)
    except ValueError:  # an integer with thousands of digits
        return with_article(type(value).__name__)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _is_simple(value: Any) -> bool:
    return isinstance(value, None | bool | int | float | complex | str | bytes | np.generic | os.PathLike)


def with_article(name: str) -> str:
    """Put `a` or `an` before a class name, as in `an Obstacle`."""
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"
