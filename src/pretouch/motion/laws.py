"""Define the virtual damper and the virtual drag in continuous time.

The module also contains the interface of such control laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final, NamedTuple, Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.extensions import Extensions
from pretouch._core.messages import short_repr
from pretouch._core.numbers import nonnegative
from pretouch._core.units import format_quantity, pretty_unit
from pretouch._core.vocabulary import QUANTITIES, Entry
from pretouch.sensors import SensorModel

from .contact import ContactResult, Motion, motion_from_trace
from .guaranteed import trace_guaranteed
from .layout import TRACE_COLUMNS
from .many_curves import ManyCurves
from .request import COURSE, Request, check_integration, make_request
from .scenario import Scenario
from .solution import Solution


class LawNumber(NamedTuple):
    """Name, symbol and unit of a control law's coefficient.

    A design chooses the coefficient, such as the gain D_p.

    Args:
        name: such as "gain".
        symbol: such as "D_p".
        unit: such as "N*s".
        sign: sign of mitigating values, -1 or 1.
    """

    name: str
    symbol: str
    unit: str
    sign: int

    @property
    def label(self) -> str:
        """Name and symbol of the coefficient, such as "gain D_p"."""
        return f"{self.name} {self.symbol}"

    def equals(self, value: float) -> str:
        """Format the coefficient as text, such as "D_p = -0.7 N s"."""
        return f"{self.symbol} = {self.text(value)}"

    def text(self, value: float, digits: int = 4) -> str:
        """Format a coefficient with its unit, such as "-0.7 N s"."""
        return pretty_unit(format_quantity(value, self.unit, digits))

    def entry(self, name: str) -> Entry:
        """Return name, symbol and unit of a quantity.

        The name "gain" stands for the coefficient of this law.
        """
        return Entry(self.name, self.symbol, self.unit) if name == "gain" else QUANTITIES[name]

    @property
    def key(self) -> str:
        """The key of the coefficient in scenario files, such as "drag".

        It belongs to the section `[law]`.
        """
        return self.name.replace(" ", "_")

    @property
    def mitigating(self) -> str:
        """The sign of impact-mitigating coefficients, "positive" or "negative"."""
        return "positive" if self.sign > 0 else "negative"

    @property
    def plot_symbol(self) -> str:
        """The symbol of the coefficient in plots, such as "Dₚ"."""
        return self.symbol.replace("_p", "\u209a")

    def plot_text(self, value: float, digits: str = ".4g") -> str:
        """Format a coefficient for plots, such as "-0.7 N s"."""
        return f"{value:{digits}} {pretty_unit(self.unit)}"


@runtime_checkable
class PredictableLaw(Protocol):
    """The part of a sampled control law that predictions need; `pretouch.control.Law` is the whole interface."""

    @property
    def continuous(self) -> Any:
        """The continuous-time law that it approximates, or the name of that law."""

    @property
    def value(self) -> Any:
        """The coefficient of the control law."""


@runtime_checkable
class ContinuousLaw(Protocol):
    """Interface of a control law in continuous time.

    Designs and predictions use this interface. `DAMPER` and `DRAG` are the built-in laws; `CustomLaw` makes a law of
    any force.

    Attributes:
        kind: its name in files and on pages.
        number: description of the number that a design chooses.
        degree: d if the force is proportional to the number times s'^d, with s' = d(ln xi)/dt; else None.

    A law that switches off the admittance's pull during an approach, such as the drag, has the attribute
    `suspends_admittance`. A law that scenario files may run on a loop has a method `sampled`, which returns its
    `pretouch.control.Law` for a value of the number. Fields of a dataclass that are declared by `quantity` are keys of
    the section [law].
    """

    @property
    def kind(self) -> str:
        """The name of the control law in scenario files and reports."""

    @property
    def number(self) -> LawNumber:
        """Name, symbol and unit of the coefficient, such as gain D_p."""

    @property
    def degree(self) -> int | None:
        """The exponent of the rate d(ln xi)/dt in the virtual force.

        It is None if the force is not proportional to a power of this rate.
        """

    def contact(
        self, scenario: Scenario, sensor: SensorModel, value: ArrayLike, *, method: str = ..., horizon: float = ...
    ) -> ContactResult:
        """Solve encounters for one or several gains."""

    def motion(
        self,
        scenario: Scenario,
        sensor: SensorModel,
        value: ArrayLike,
        *,
        method: str = ...,
        horizon: float = ...,
        samples: int = ...,
    ) -> Motion:
        """Compute the motion of each encounter at equally spaced times.

        `value` contains one or several gains.
        """

    def damping(self, value: Any, slope: Any, relative_velocity: Any) -> Any:
        """Return the damping of the control law [N s/m].

        It is the derivative of the virtual force with respect to the relative velocity. An unknown damping is NaN.
        """


@final
@dataclass(frozen=True, slots=True)
class Damper:
    """The virtual damper in continuous time.

    This is the letter's law F_p = D_p g(l) l', L(2). The force is the product of gain, sensor slope and relative
    velocity.
    """

    kind: ClassVar[str] = "virtual-damper"
    number: ClassVar[LawNumber] = LawNumber("gain", "D_p", "N*s", -1)
    degree: ClassVar[int] = 1

    def __reduce__(self) -> str:
        return "DAMPER"

    def contact(
        self,
        scenario: Scenario,
        sensor: SensorModel,
        value: ArrayLike,
        *,
        method: str = "auto",
        horizon: float = 600.0,
        many: ManyCurves | None = None,
        peaks: Sequence[str] = (),
    ) -> ContactResult:
        """Return the states at contact of encounters under the virtual damper.

        With `many`, each encounter along the last axis has its own sensor curve. The `peaks` that will be read, such
        as `largest_excursion`, are computed together with the contacts.
        """
        return _result(_request(scenario, sensor, value, method, horizon, many=many), peaks=peaks)

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
        """Compute sampled motions of robot and obstacle under the virtual damper."""
        return _sampled(_request(scenario, sensor, value, method, horizon), samples)

    def damping(self, value: Any, slope: Any, relative_velocity: Any) -> Any:
        """Return the damping of the virtual damper [N s/m].

        It is gain times sensor slope, at every speed.
        """
        return np.asarray(value) * slope + np.zeros_like(relative_velocity)


@final
@dataclass(frozen=True, slots=True)
class Drag:
    """The virtual drag in continuous time.

    It slows an approach and does not act on receding objects. The force is F = -phi s'^2 while s = ln xi grows, and 0
    otherwise (docs/explanation/drag.md).

    The admittance's pull toward the object is switched off during an approach: M x~'' = F - max(K x~ + D x~', 0). From
    rest at the reference, or behind it, the motion is M l'' = M a_o + phi g^2 l'^2, solved by quadrature for any curve.
    For an object of constant velocity, the contact speed is the same fraction of every approach speed, rho =
    exp(-(phi/M) int g^2 dl). The excursion is the same at every speed.

    `impulse_residual` is the residual of M l' = M l'(0) + M a_o t + phi int s' ds and of its moment. The moment also
    certifies the time. Here s is the sensor's ln xi, which the quadrature does not use. A run that comes to rest
    relative to the object ends there with the status NEVER, since a_o > 0 then moves the object away.

    Valid for:
        A plant that follows the virtual object exactly, and that is at rest at its reference or retreats from behind
        it. A sensor without delay that detects the object at the farthest distance of the encounter. Other cases raise
        InvalidInputError: a plant ahead of its reference, or faster than it toward the object; a plant that is not at
        rest while the object does not approach; a curve whose ln xi rises with the distance.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle, find_contact
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=np.array([-0.05, -0.3, -1.0])),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> contact = find_contact(scenario, sensor, 0.01437, law=DRAG).contact
        >>> contact.relative_velocity / scenario.relative_velocity
        array([0.15003894, 0.15003894, 0.15003894])
        >>> np.round(contact.displacement, 6)
        array([-0.059604, -0.059604, -0.059604])
    """

    kind: ClassVar[str] = "virtual-drag"
    number: ClassVar[LawNumber] = LawNumber("drag", "\u03c6", "N*s^2", 1)
    degree: ClassVar[int] = 2
    suspends_admittance: ClassVar[bool] = True

    def __reduce__(self) -> str:
        return "DRAG"

    def contact(
        self,
        scenario: Scenario,
        sensor: SensorModel,
        value: ArrayLike,
        *,
        method: str = "auto",
        horizon: float = 600.0,
        many: ManyCurves | None = None,
    ) -> ContactResult:
        """Return the states at contact of encounters under the virtual drag.

        With `many`, each encounter along the last axis has its own sensor curve.
        """
        from .drag import solve_drag  # noqa: PLC0415 - only drags need it

        if scenario.obstacle.course:
            drag = nonnegative(value, "drag", "N*s^2")
            return _result(_request(scenario, sensor, drag, method, horizon, many=many, degree=2))
        _check_quadrature(method)
        return solve_drag(scenario, sensor, value, horizon=horizon, many=many)

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
        """Compute sampled motions of robot and obstacle under the virtual drag."""
        from .drag import sample_drag  # noqa: PLC0415 - only drags need it

        if scenario.obstacle.course:
            drag = nonnegative(value, "drag", "N*s^2")
            return _sampled(_request(scenario, sensor, drag, method, horizon, degree=2), samples)
        _check_quadrature(method)
        return sample_drag(scenario, sensor, value, horizon=horizon, samples=samples)

    def damping(self, value: Any, slope: Any, relative_velocity: Any) -> Any:
        """Return the damping of the virtual drag [N s/m].

        It grows with the approach speed. The damping is 2 phi g^2 |l'| in an approach, and 0 for a receding object.
        """
        return 2 * np.asarray(value) * np.square(slope) * np.maximum(0.0 - np.asarray(relative_velocity), 0.0)


def _request(
    scenario: Scenario,
    sensor: SensorModel,
    number: ArrayLike,
    method: str,
    horizon: float,
    *,
    many: ManyCurves | None = None,
    degree: int = 1,
) -> Request:
    """Check the inputs of an encounter with a built-in law."""
    if not scenario.obstacle.course:
        return make_request(scenario, sensor, number, method, horizon, many=many)
    method = check_integration(method, COURSE)
    return make_request(scenario, sensor, number, method, horizon, many=many, with_course=True, degree=degree)


def _result(request: Request, *, peaks: Sequence[str] = ()) -> ContactResult:
    return ContactResult(Solution(request, peaks=peaks), request.method)


def _sampled(request: Request, samples: int) -> Motion:
    """Solve encounters, and sample their motions at equally spaced times."""
    result = ContactResult(Solution(request, whole=True), request.method)
    end = np.atleast_1d(np.asarray(result.end.time)).ravel()
    times = end[:, None] * np.linspace(0.0, 1.0, samples)
    times[:, -1] = end
    trace = np.full((len(end), samples, len(TRACE_COLUMNS)), np.nan)
    trace_guaranteed(request, times, trace)
    trace[:, -1, 0] = np.ravel(result.end.distance)
    return motion_from_trace(request, times, trace, result)


def _check_quadrature(method: str) -> None:
    if method not in {"auto", "quadrature"}:
        raise InvalidInputError(
            f"method: found {method!r}, but a virtual drag supports only the methods 'auto' and 'quadrature'",
            value=method,
        )


DAMPER: Final = Damper()
"""The letter's virtual damper, L(2)."""

DRAG: Final = Drag()
"""The virtual drag: the contact speed is the same fraction of every approach speed."""

LAWS: Final[dict[str, ContinuousLaw]] = {law.kind: law for law in (DAMPER, DRAG)}
"""The laws by their names in files."""


def _law_problem(name: str, law: Any) -> str:
    """Explain why an object is not a valid control law; empty for a valid one."""
    if not (isinstance(law, ContinuousLaw) and isinstance(law.number, LawNumber)):
        return (
            f"found {short_repr(law)}, expected a control law. A control law is a class or an object with all members "
            "of pretouch.motion.ContinuousLaw"
        )
    return (
        ""
        if law.kind == name
        else f'the kind of the law is "{law.kind}", but the name of its entry point is "{name}"; use the '
        "same name for both"
    )


LAW_KINDS: Final = Extensions(group="pretouch.laws", built_in=lambda: LAWS, problem=_law_problem)
"""The laws that files may name: LAWS, and those of installed packages, each a value or a class."""


def continuous_law(law: Any) -> ContinuousLaw:
    """Return the continuous-time law for a law name or a law object.

    The argument is a law in continuous time, a sampled law, or the name of a law.

    Raises:
        InvalidInputError: the argument is no law, and its attribute `continuous` does not name one.
    """
    result = LAW_KINDS.find(law) if isinstance(law, str) else law
    if isinstance(result, type):
        raise InvalidInputError(
            f"law: found the class {result.__name__}, expected an instance of the class, such as {result.__name__}()"
        )
    if isinstance(result, (Damper, Drag, ContinuousLaw)):  # in this order: the protocol takes 20 us
        return result
    sampled = getattr(law, "continuous", None)
    if sampled is None:
        name = repr(law) if isinstance(law, str) else type(law).__name__
        raise InvalidInputError(
            f"law: found {name}, expected a law in continuous time. Use one of these laws: "
            f"{', '.join(LAW_KINDS.names())}, or a CustomLaw. A sampled law is also possible if its attribute "
            "`continuous` names a law",
            value=name,
        )
    return continuous_law(sampled)
