"""Define custom control laws, whose force depends on the log output ln xi and its rate of change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .contact import ContactResult, ContactState, KnownColumns, Motion, motion_of
from .custom_law_run import CustomLawRun, RelativeEncounter
from .laws import LawNumber
from .request import Request, make_request
from .scenario import Scenario

_COLUMNS: Final = (
    *ContactState.names(),
    *("status", "gain", "closest_distance", "settling_distance", "impulse_residual"),
)
_COURSE: Final = (
    *("time", "distance", "relative_velocity", "displacement_velocity", "displacement_acceleration"),
    "virtual_force",
)
_BODIES: Final = ("p", "v", "a", "r", "r_v", "r_a")


def _unknown_damping(value: Any, slope: Any, relative_velocity: Any) -> Any:
    return np.full(np.broadcast_shapes(np.shape(value), np.shape(slope), np.shape(relative_velocity)), np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class CustomLaw(Value):
    """A user-defined control law, whose force depends on the log output, its rate of change and one coefficient.

    In symbols, the force F depends on s = ln xi, s' = g(l) l' and the number.

    The motion of the admittance L(1), M x~'' + D x~' + K x~ = F, is integrated in time by SciPy's LSODA, which handles
    stiff motions. Encounters are solved one after the other, in about 10 to 50 ms each. Turning points of the distance
    and knots of the curve end integration steps. `impulse_residual` is
    |M dx~' + D dx~ + K int x~ dt - int F dt - int H dt| relative to the largest of these terms. H is the part of the
    pull that is switched off. The integrals are computed independently of the integration.

    A run ends as `NEVER` if everything is at rest. With `suspends_admittance` it also ends as `NEVER` if no later
    approach is possible: the object does not approach, a_o >= 0, and F at s' = 0 is at most M a_o at all
    tested larger distances. Other runs without contact end at the horizon. `settling_distance` is NaN if it is unknown.

    Args:
        kind: its name in files and on pages.
        number: description of the number that a design chooses.
        force: function of a value of the number, s, and s' [1/s], all floats, that returns F [N].
        damping: function of a value, g [1/m] and l' [m/s], floats or arrays, that returns dF/dl' [N s/m], or None.
        suspends_admittance: whether the admittance's pull toward the object is switched off while the object
            approaches, as for a virtual drag (docs/drag.md). Then M x~'' = F - max(K x~ + D x~', 0) for l' < 0. If the
            pull would cause a new approach as soon as it acts again, the plant keeps the distance, l' = 0.
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
        """Solve encounters under the custom law by numerical integration, and return their states at contact."""
        request = self._request(scenario, sensor, value, method, horizon)
        return _result(request, self._runs(request))

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
        """Compute the motion of encounters under the custom law at sampled times, by numerical integration."""
        request = self._request(scenario, sensor, value, method, horizon)
        runs = self._runs(request)
        sampled = [run.sample(samples) for run in runs]
        course = {name: _to_array([arrays[name] for arrays in sampled], (len(runs), samples)) for name in _COURSE}
        bodies = {name: _to_array([getattr(run.encounter, name) for run in runs], (len(runs), 1)) for name in _BODIES}
        return motion_of(_result(request, runs), request.shape, bodies, course)

    def _request(
        self, scenario: Scenario, sensor: SensorModel, value: ArrayLike, method: str, horizon: float
    ) -> Request:
        if method not in {"auto", "integration"}:
            raise InvalidInputError(
                f"method: found {method!r}, but the custom law {self.kind} supports only the methods 'auto' and "
                "'integration'"
            )
        checked = finite(value, self.number.name, self.number.unit)
        return make_request(scenario, sensor, checked, "integration", horizon)

    def _runs(self, request: Request) -> list[CustomLawRun]:
        columns, values = request.part(slice(None))
        reference = np.broadcast_to(request.scenario.reference.position, request.shape).reshape(-1)
        encounters = np.column_stack([columns, reference, values]).tolist()
        options: Any = {"suspends_admittance": self.suspends_admittance, "horizon": request.horizon}
        return [
            CustomLawRun(RelativeEncounter(*row), request.sensor, self.force, self.kind, **options)
            for row in encounters
        ]


def _result(request: Request, runs: list[CustomLawRun]) -> ContactResult:
    quantities = [run.columns() for run in runs]
    columns = {name: _to_array([run[name] for run in quantities], request.shape) for name in _COLUMNS}
    columns["status"] = columns["status"].astype(np.int64)
    return ContactResult(KnownColumns(columns), "integration")


def _to_array(values: list[Any], shape: tuple[int, ...]) -> FloatArray:
    return np.array(values, dtype=np.float64).reshape(shape)
