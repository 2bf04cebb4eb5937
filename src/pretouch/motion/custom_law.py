"""Define custom control laws with a user-defined force function.

The force depends on the log output ln xi of the sensor and its time derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.fields import check_types
from pretouch._core.numbers import finite
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .contact import ContactResult, Motion
from .custom_force import ForceLaw
from .laws import LawNumber
from .request import COURSE, Request, check_integration, make_request
from .scenario import Scenario


def _unknown_damping(value: Any, slope: Any, relative_velocity: Any) -> Any:
    return np.full(np.broadcast_shapes(np.shape(value), np.shape(slope), np.shape(relative_velocity)), np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class CustomLaw(Value):
    """A control law with a user-defined force function.

    The force F depends on one coefficient (the number), the log output s = ln xi, and its time derivative s' = g(l) l'.

    The motion of the admittance L(1), M x~'' + D x~' + K x~ = F, is integrated in time by SciPy's LSODA, which handles
    stiff motions. Encounters are integrated one after the other, in 3 to 10 ms each, to about 1e-10. `impulse_residual`
    is |M dx~' + D dx~ + K int x~ dt - int F dt - int H dt| relative to the largest of these terms. H is the part of the
    pull that is switched off. The integrals are computed independently of the integration.

    A run ends as `NEVER` if everything is at rest. With `suspends_admittance` it also ends as `NEVER` if no later
    approach is possible: the object does not approach, a_o >= 0, and F at s' = 0 is at most M a_o at all
    tested larger distances. Other runs without contact end at the horizon. `settling_distance` is NaN if it is unknown.

    Args:
        kind: its name in files and on pages.
        number: description of the number that a design chooses.
        force: function of a value of the number, s, and s' [1/s] that returns F [N]. It is called with floats, or with
            arrays if `vectorized` is set.
        damping: function of a value, g [1/m] and l' [m/s], floats or arrays, that returns dF/dl' [N s/m], or None.
        vectorized: whether `force` takes and returns one-dimensional arrays of one length. A compiled function, such
            as a NumPy ufunc made by Numba's `vectorize`, is one of these.
        suspends_admittance: whether the admittance's pull toward the object is switched off while the object
            approaches, as for a virtual drag (docs/explanation/drag.md). Then M x~'' = F - max(K x~ + D x~', 0) for
            l' < 0. If the pull would cause a new approach as soon as it acts again, the plant keeps the distance,
            l' = 0.
        sampled: function of a value that returns the sampled law, a `pretouch.control.Law`, or None. A scenario file
            that names the law runs it on the loop.

    Valid for:
        A plant that follows the virtual object exactly and a sensor without delay. If an integration step needs the
        curve outside its valid range, s and g are those at the nearest end. The force may have jumps that the motion
        passes; a run that would have to stay at a jump is `UNRESOLVED`.

    Examples:
        >>> from pretouch.motion import Admittance, LawNumber, Obstacle, CustomLaw, find_contact
        >>> from pretouch.sensors import InversePower
        >>> def cubic(value, s, rate):
        ...     return -value * max(rate, 0.0) ** 3
        >>> cube = LawNumber("cube", "c", "N*s^3", 1)
        >>> law = CustomLaw(kind="cubic", number=cube, force=cubic, suspends_admittance=True)
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=np.array([-0.1, -0.3])),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> find_contact(scenario, sensor, 1e-3, law=law).contact.relative_velocity.round(6)
        array([-0.056069, -0.089538])
    """

    kind: str
    number: LawNumber
    degree: ClassVar[int | None] = None
    force: Callable[[float, float, float], float]
    damping: Any = field(default=None, metadata={"takes": "Callable | None"})
    vectorized: bool = False
    suspends_admittance: bool = False
    sampled: Any = field(default=None, metadata={"takes": "Callable | None"})

    def __post_init__(self) -> None:
        check_types(self)
        if self.damping is None:
            object.__setattr__(self, "damping", _unknown_damping)

    def contact(
        self,
        scenario: Scenario,
        sensor: SensorModel,
        value: ArrayLike,
        *,
        method: str = "auto",
        horizon: float = 600.0,
    ) -> ContactResult:
        """Solve encounters under the custom law by numerical integration."""
        from .custom_result import CustomColumns  # noqa: PLC0415 - SciPy is loaded only for custom laws

        columns = CustomColumns(*self._requested(scenario, sensor, value, method, horizon))
        return ContactResult(columns, "integration")

    def motion(
        self,
        scenario: Scenario,
        sensor: SensorModel,
        value: ArrayLike,
        *,
        method: str = "auto",
        horizon: float = 600.0,
        samples: int = 200,
    ) -> Motion:
        """Compute sampled motions of robot and obstacle under the custom law."""
        from .custom_result import custom_motion  # noqa: PLC0415 - SciPy is loaded only for custom laws

        return custom_motion(*self._requested(scenario, sensor, value, method, horizon), samples)

    def _requested(
        self, scenario: Scenario, sensor: SensorModel, value: ArrayLike, method: str, horizon: float
    ) -> tuple[Request, ForceLaw]:
        """Check the inputs of encounters, and return them with the force along the sensor curve."""
        number = finite(value, self.number.name, self.number.unit)
        method = check_integration(method, COURSE if scenario.obstacle.course else f"the custom law {self.kind}")
        request = make_request(scenario, sensor, number, method, horizon, with_course=True)
        options = {name: getattr(self, name) for name in ("kind", "force", "vectorized", "suspends_admittance")}
        return request, ForceLaw(**options, sensor=sensor)
