"""What an encounter comes to, and the verbs that find it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .gradients import ContactGradients, gradients_of
from .guaranteed import trace_guaranteed
from .layout import TRACE_COLUMNS, ContactStatus
from .request import Request, make_request
from .scenario import Scenario
from .solution import Solution


class Columns(Protocol):
    """Where the numbers of a result come from: each column is computed when it is first asked for."""

    def column(self, name: str) -> Any:
        """Return a quantity of every run, a float for a single one."""


class _Quantity:
    """A quantity that is read from the columns of its owner."""

    __slots__ = ("name",)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        return self if instance is None else instance.columns.column(self.name)


@dataclass(frozen=True, slots=True, repr=False)
class ContactState(Value):
    """The state at the end of a run, and the largest demands on the robot until then; floats or arrays of one shape.

    Quantities are computed when they are first read, those that need the whole motion last of all.

    Args:
        columns: where the quantities come from.

    Attributes:
        time: t [s], from the entry into the detection range.
        distance: l [m]; 0 at contact.
        position: x of the plant [m], absolute.
        velocity: x' of the plant [m/s].
        acceleration: x'' of the plant [m/s^2].
        displacement: x - x_d [m], the deviation from the reference.
        relative_velocity: l' [m/s]; negative at contact, 0 at a touch.
        virtual_force: F_p [N].
        largest_excursion: max |x - x_d| [m] over the whole motion.
        largest_travel: max |x - x(0)| [m] over the whole motion.
        largest_speed: max |x'| [m/s] over the whole motion.
        largest_acceleration: max |x''| [m/s^2] over the whole motion.
        largest_virtual_force: max |F_p| [N] over the whole motion.
    """

    columns: Columns

    time = _Quantity()
    distance = _Quantity()
    position = _Quantity()
    velocity = _Quantity()
    acceleration = _Quantity()
    displacement = _Quantity()
    relative_velocity = _Quantity()
    virtual_force = _Quantity()
    largest_excursion = _Quantity()
    largest_travel = _Quantity()
    largest_speed = _Quantity()
    largest_acceleration = _Quantity()
    largest_virtual_force = _Quantity()

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of all quantities."""
        return tuple(name for name, value in vars(cls).items() if isinstance(value, _Quantity))

    def as_dict(self) -> dict[str, Any]:
        """Return the quantities by name."""
        return {name: getattr(self, name) for name in self.names()}

    def _compared(self) -> tuple[Any, ...]:
        return tuple(self.as_dict().values())

    def __hash__(self) -> int:
        return hash(np.shape(self.time))  # what says more would have to be computed first

    def __repr__(self) -> str:
        return f"ContactState({', '.join(f'{name}={value!r}' for name, value in self.as_dict().items())})"


@dataclass(frozen=True, slots=True, repr=False)
class ContactResult(Value):
    """What `find_contact` returns, for one encounter or an array of them.

    Status and time of every run are known at once; the other numbers are computed when they are first read.

    Args:
        columns: where the numbers come from.
        method: "closed-form", "integration", "uniform-motion", "quadrature" of a drag, or "loop" by a ClosedLoop.

    Attributes:
        status: how each run ended: a ContactStatus, or an array of their numbers.
        end: the state in which each run ended, whatever its status; always finite.
        gain: the gain D_p of each run [N s]; NaN for a drag.
        closest_distance: the smallest distance of each run [m]; 0 at contact, and where it only decays to 0.
        settling_distance: the distance at which a run without contact comes to rest [m], 0 where it decays to 0;
            infinite where it does not.
        impulse_residual: |M dx~' + D dx~ + K int x~ dt - D_p d ln xi| relative to the largest of these terms and the
            momentum of the approach: an identity of L(1) and L(2) for every curve, so this certifies the computed
            motion. NaN for the uniform motion, which does not start from the given state, and for a sampled loop, which
            does not know its law.
    """

    columns: Columns
    method: str
    end: ContactState = field(init=False)

    gain = _Quantity()
    closest_distance = _Quantity()
    settling_distance = _Quantity()
    impulse_residual = _Quantity()

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", ContactState(self.columns))

    def _compared(self) -> tuple[Any, ...]:
        own = (self.method, self.status, self.gain, self.closest_distance, self.settling_distance)
        return (*own, self.impulse_residual, self.end)

    def __hash__(self) -> int:
        return hash((self.method, self.end))

    @property
    def status(self) -> Any:
        """How each run ended: a ContactStatus, or an array of their numbers."""
        status = self.columns.column("status")
        return status if np.ndim(status) else ContactStatus(int(status))

    @property
    def reached(self) -> BoolArray:
        """Which runs ended in contact."""
        return np.asarray(np.asarray(self.columns.column("status")) == ContactStatus.CONTACT)

    @property
    def contact(self) -> ContactState:
        """The state at contact.

        Raises:
            ResultUnavailableError: a run did not end in contact; `status` says how it ended.
        """
        if not self.reached.all():
            status = ContactStatus(int(np.atleast_1d(self.status)[~np.atleast_1d(self.reached)][0]))
            count = int((~self.reached).sum())
            which = "the run" if self.reached.size == 1 else f"{count} of {self.reached.size} runs"
            raise ResultUnavailableError(
                f"contact: {which} did not end in contact ({status.label}: {status.meaning} "
                f"Nearest distance {float(np.min(np.asarray(self.closest_distance)[~self.reached])):.4g} m); "
                "read .end for the state in which it ended"
            )
        return self.end

    @property
    def gradients(self) -> ContactGradients:
        """The exact derivatives of the quantities at contact by every input, computed when they are first read.

        Raises:
            ResultUnavailableError: the result does not come from a motion of L(1), or not from `find_contact`.
        """
        found: ContactGradients | None = gradients_of(self.columns)
        if found is None:
            raise ResultUnavailableError(
                f"gradients: there are none of a result by {self.method}; solve the encounter by find_contact with "
                "another method"
            )
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return an encounter as one JSON object; its quantities are those at the end of the run, see `status`."""
        status = self.status.label if isinstance(self.status, ContactStatus) else self.status
        known = {name: getattr(self, name) for name in ("closest_distance", "settling_distance", "impulse_residual")}
        found: dict[str, Any] = plain({"status": status, "gain": self.gain, **self.end.as_dict(), **known})
        return found

    def __repr__(self) -> str:
        if np.ndim(self.status):
            return f"<ContactResult: {int(self.reached.sum())} of {self.reached.size} runs in contact, {self.method}>"
        return f"<ContactResult: {self.status.label} after {self.end.time:.4g} s, {self.method}>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Motion(Value):
    """A motion sampled from the entry into the detection range to its end: arrays with time as their last axis.

    Args:
        time: t [s], equally spaced.
        distance: l [m].
        position: x of the plant [m], absolute.
        velocity: x' of the plant [m/s].
        acceleration: x'' of the plant [m/s^2].
        displacement: x - x_d [m].
        relative_velocity: l' [m/s].
        virtual_force: F_p [N].
        result: how the encounter ended.
    """

    time: FloatArray
    distance: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    displacement: FloatArray
    relative_velocity: FloatArray
    virtual_force: FloatArray
    result: ContactResult

    def __repr__(self) -> str:
        many = "" if self.time.ndim == 1 else f"{int(np.prod(self.time.shape[:-1]))} motions, "
        return f"<Motion: {many}{self.time.shape[-1]} samples to {float(self.time.max()):.4g} s>"


def find_contact(
    scenario: Scenario,
    sensor: SensorModel,
    gain: ArrayLike,
    *,
    method: str = "auto",
    horizon: float = 600.0,
) -> ContactResult:
    """Find the first contact of an encounter, l = 0 of L(21) and L(23), and what it demands of the robot until then.

    The motion is that of L(1) with L(2), or by request the uniform motion L(16)-(19). A distance that comes to zero and
    turns there, within 1e-12 of its terms, is a contact with l' = 0; one that only decays to zero never is one.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve; its scale is of no consequence.
        gain: D_p [N s], broadcast with the scenario; negative gains mitigate.
        method: "closed-form" (L(10), for a constant slope only), "integration" (any curve), "uniform-motion"
            (L(16)-(19), one particular motion of the second-order exponential curve that does not start from the
            given state: it shifts an optimal gain by about 10 %), or "auto": closed form where the slope is
            constant, integration elsewhere.
        horizon: how long to wait for contact [s].

    Returns:
        Status and state at the end of each run, of the broadcast shape.

    Valid for:
        A plant that follows the virtual object exactly and a sensor without delay (the letter's Section II).

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = ExponentialFirstOrder(scale=0.458, rate=-61.0)
        >>> round(find_contact(scenario, sensor, -1.0).contact.position, 4)
        -0.1353
    """
    request = make_request(scenario, sensor, gain, method, horizon)
    return ContactResult(Solution(request), request.method)


def solve_motion(
    scenario: Scenario,
    sensor: SensorModel,
    gain: ArrayLike,
    *,
    method: str = "auto",
    horizon: float = 600.0,
    samples: int = 200,
) -> Motion:
    """Solve an encounter and sample its whole motion, L(1) with L(2).

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve.
        gain: D_p [N s], broadcast with the scenario.
        method: as in `find_contact`.
        horizon: how long to wait for contact [s].
        samples: how many instants, from 0 to the end of each run, ends included; at least 2.

    Returns:
        The motion; its arrays have the broadcast shape with the samples as a last axis.

    Raises:
        InvalidInputError: there are too few samples.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> motion = solve_motion(scenario, sensor, -0.7)
        >>> round(float(motion.position[-1]), 4)
        -0.0915
    """
    if samples < 2:
        raise InvalidInputError(f"samples: found {samples}, which must be at least 2")
    request = make_request(scenario, sensor, gain, method, horizon)
    result = ContactResult(Solution(request, whole=True), request.method)
    end = np.atleast_1d(np.asarray(result.end.time)).ravel()
    times = end[:, None] * np.linspace(0.0, 1.0, samples)
    times[:, -1] = end
    trace = np.empty((len(end), samples, len(TRACE_COLUMNS)))
    trace_guaranteed(request, times, trace)
    trace[:, -1, 0] = np.ravel(result.end.distance)
    return _motion(request, times, trace, result)


def _motion(request: Request, times: FloatArray, trace: FloatArray, result: ContactResult) -> Motion:
    """Return the trace as a motion, with the virtual force by L(2)."""
    shape, each, reference = (*request.shape, times.shape[-1]), request.relative, request.scenario.reference
    p, v, a = (x[:, None] for x in (each.p, each.v, each.a))
    distance, _, speed, acceleration = (trace[..., i] for i in range(len(TRACE_COLUMNS)))
    displacement, relative_velocity = p + (v + a * times / 2) * times - distance, v + a * times - speed
    with np.errstate(all="ignore"):  # a function of the user's may overflow where the object has gone far away
        slope = np.asarray(request.sensor.log_slope(np.clip(distance, *request.sensor.valid_range)))
    moment, force = times.reshape(shape), each.gain[:, None] * slope * relative_velocity
    x, u, w = (
        np.expand_dims(np.asarray(r), -1) for r in (reference.position, reference.velocity, reference.acceleration)
    )
    return Motion(
        time=moment,
        distance=distance.reshape(shape),
        position=displacement.reshape(shape) + x + (u + w * moment / 2) * moment,
        velocity=speed.reshape(shape) + u + w * moment,
        acceleration=acceleration.reshape(shape) + w,
        displacement=displacement.reshape(shape),
        relative_velocity=relative_velocity.reshape(shape),
        virtual_force=force.reshape(shape),
        result=result,
    )
