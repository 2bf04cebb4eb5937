"""Define the contact and motion results of solved encounters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.display import Described
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value

from .gradients import ContactGradients, gradients_of
from .layout import TRACE_COLUMNS, ContactStatus
from .obstacle_path import obstacle_path
from .request import Request


class Columns(Protocol):
    """Interface of lazily computed encounter results.

    Each quantity, such as the contact time, is computed on first access.
    """

    def column(self, name: str) -> Any:
        """Return one result quantity, such as the contact time.

        The result is an array for several encounters, and a float for one.
        """


@dataclass(frozen=True, slots=True)
class KnownColumns(Value):
    """Encounter results that were computed in advance.

    Args:
        columns: the quantities of every run by name, of the broadcast shape; made read-only.
    """

    columns: Mapping[str, Any]

    def __post_init__(self) -> None:
        for values in self.columns.values():
            values.setflags(write=False)

    def column(self, name: str) -> Any:
        """Return one result quantity, such as the contact time."""
        values = self.columns[name]
        return values if values.ndim else values.item()


@dataclass(frozen=True, slots=True)
class _OtherGain(Value):
    """Results of solved encounters with a different reported gain."""

    columns: Columns
    gain: FloatArray

    def column(self, name: str) -> Any:
        """Return one result quantity, such as the contact time."""
        values = self.columns.column(name)
        if name != "gain":
            return values
        gain = np.broadcast_to(self.gain, np.shape(values))
        return gain if gain.ndim else gain.item()


class _Quantity:
    """Descriptor for one result quantity, such as the contact time."""

    __slots__ = ("name",)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        return self if instance is None else instance.columns.column(self.name)


@dataclass(frozen=True, slots=True, repr=False)
class ContactState(Value):
    """State of robot and obstacle at the end of an encounter.

    The state includes peak values of robot motion and virtual force. Each quantity is computed when it is first read.

    Args:
        columns: source of the quantities.

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
        """Return the names of all quantities of the contact state."""
        return tuple(name for name, value in vars(cls).items() if isinstance(value, _Quantity))

    def as_dict(self) -> dict[str, Any]:
        """Return all quantities of the contact state by name."""
        return {name: getattr(self, name) for name in self.names()}

    def _compared(self) -> tuple[Any, ...]:
        return tuple(self.as_dict().values())

    def __hash__(self) -> int:
        return hash(np.shape(self.time))  # all other properties would have to be computed first

    def __repr__(self) -> str:
        return f"ContactState({', '.join(f'{name}={value!r}' for name, value in self.as_dict().items())})"


@dataclass(frozen=True, slots=True, repr=False)
class ContactResult(Described, Value):
    """Result of `find_contact` for one encounter or for an array of encounters.

    Status and time of every run are available at once; other quantities are computed when they are first read.

    Args:
        columns: source of the quantities.
        method: how the encounters were solved: "closed-form", "integration", "uniform-motion", "quadrature" (virtual
            drag), or "loop" (ClosedLoop).

    Attributes:
        status: how each run ended; a ContactStatus, or an array of its integer values.
        end: state at the end of each run, for any status; always finite.
        gain: the law's number in each run, such as D_p [N s].
        closest_distance: smallest distance of each run [m]; 0 at contact, and if the distance decays to 0.
        settling_distance: distance at which a run without contact comes to rest [m]; 0 if the distance decays to 0,
            infinite if the run does not come to rest, NaN if it is unknown whether it does.
        impulse_residual: |M dx~' + D dx~ + K int x~ dt - D_p d ln xi|, relative to the largest of these terms and the
            momentum of the approach. It is zero for the exact motion of L(1) and L(2) with any curve, so it certifies
            the computed motion. Other laws use their own impulse. NaN for the uniform motion, which does not start
            from the given state, and for a sampled loop, whose law is unknown here.
    """

    columns: Columns
    method: str
    end: ContactState = field(init=False)

    gain = _Quantity()
    closest_distance = _Quantity()
    settling_distance = _Quantity()
    impulse_residual = _Quantity()

    __str__ = object.__str__  # its fields, not its page

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", ContactState(self.columns))

    def _compared(self) -> tuple[Any, ...]:
        distances = self.closest_distance, self.settling_distance
        return (self.method, self.status, self.gain, *distances, self.impulse_residual, self.end)

    def __hash__(self) -> int:
        return hash((self.method, self.end))

    @property
    def status(self) -> Any:
        """How each encounter ended, for example in contact or without contact."""
        status = self.columns.column("status")
        return status if np.ndim(status) else ContactStatus(int(status))

    @property
    def reached(self) -> BoolArray:
        """A boolean array that is true for encounters that ended in contact."""
        return np.asarray(np.asarray(self.columns.column("status")) == ContactStatus.CONTACT)

    @property
    def contact(self) -> ContactState:
        """The state at contact, if every encounter ended in contact.

        Raises:
            ResultUnavailableError: a run did not end in contact; `status` reports how it ended.
        """
        if not self.reached.all():
            status = ContactStatus(int(np.atleast_1d(self.status)[~np.atleast_1d(self.reached)][0]))
            count = int((~self.reached).sum())
            which = "the run" if self.reached.size == 1 else f"{count} of {self.reached.size} runs"
            raise ResultUnavailableError(
                f"contact: {which} did not end in contact, so there is no state at contact; read the attribute `end` "
                f'for the final state. The first run without contact has the status "{status.label}". {status.meaning} '
                "The smallest distance between robot and object was "
                f"{float(np.min(np.asarray(self.closest_distance)[~self.reached])):.4g} m"
            )
        return self.end

    @property
    def gradients(self) -> ContactGradients:
        """Exact derivatives of the state at contact with respect to all inputs.

        Raises:
            ResultUnavailableError: derivatives are not available for this method or law.
        """
        gradients: ContactGradients | None = gradients_of(self.columns)
        if gradients is None:
            raise ResultUnavailableError(
                "gradients: this result has none. They are computed for the virtual damper and the virtual drag, if "
                "the obstacle has no course and the method is not 'uniform-motion'"
            )
        return gradients

    def with_gain(self, gain: ArrayLike) -> ContactResult:
        """Return a copy of this result with another reported gain.

        The encounters are not solved again.
        """
        return ContactResult(_OtherGain(self.columns, np.asarray(gain, dtype=np.float64)), self.method)

    def to_dict(self) -> dict[str, Any]:
        """Return the result of one encounter as a dictionary for JSON."""
        status = self.status.label if isinstance(self.status, ContactStatus) else self.status
        others = {name: getattr(self, name) for name in ("closest_distance", "settling_distance", "impulse_residual")}
        content: dict[str, Any] = plain({"status": status, "gain": self.gain, **self.end.as_dict(), **others})
        return content

    def __repr__(self) -> str:
        if np.ndim(self.status):
            return f"<ContactResult: {int(self.reached.sum())} of {self.reached.size} runs in contact, {self.method}>"
        return f"<ContactResult: {self.status.label} after {self.end.time:.4g} s, {self.method}>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Motion(Described, Value):
    """Sampled motion of robot and obstacle during an encounter.

    The samples reach from the start to the end of the encounter.

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

    __str__ = object.__str__  # its fields, not its page

    def __repr__(self) -> str:
        count = "" if self.time.ndim == 1 else f"{int(np.prod(self.time.shape[:-1]))} motions, "
        return f"<Motion: {count}{self.time.shape[-1]} samples to {float(self.time.max()):.4g} s>"


def motion_of(
    result: ContactResult,
    shape: tuple[int, ...],
    bodies: Mapping[str, FloatArray],
    course: Mapping[str, FloatArray],
) -> Motion:
    """Create a Motion from arrays of sampled quantities.

    Args:
        result: the result of the encounters.
        shape: shape of the encounters.
        bodies: position r, velocity r_v and acceleration r_a of the reference at the start, shape (n, 1).
        course: time, distance, relative_velocity, displacement, displacement_velocity, displacement_acceleration and
            virtual_force, shape (n, m).

    Returns:
        The motion.
    """
    time, b = course["time"], bodies
    arrays = {
        "time": time,
        "distance": course["distance"],
        "position": course["displacement"] + b["r"] + (b["r_v"] + b["r_a"] * time / 2) * time,
        "velocity": course["displacement_velocity"] + b["r_v"] + b["r_a"] * time,
        "acceleration": course["displacement_acceleration"] + b["r_a"],
        "displacement": course["displacement"],
        "relative_velocity": course["relative_velocity"],
        "virtual_force": course["virtual_force"],
    }
    full_shape = (*shape, time.shape[-1])
    return Motion(**{name: values.reshape(full_shape) for name, values in arrays.items()}, result=result)


def motion_from_trace(request: Request, times: FloatArray, trace: FloatArray, result: ContactResult) -> Motion:
    """Convert the samples of a compiled solver to a motion.

    The virtual force is that of the virtual damper, L(2), or of the virtual drag.

    Returns:
        The motion.
    """
    each, reference = request.relative, request.scenario.reference
    distance, _, speed, acceleration = (trace[..., i] for i in range(len(TRACE_COLUMNS)))
    columns = {"r": reference.position, "r_v": each.reference_velocity, "r_a": each.reference_acceleration}
    bodies = {name: _column(values, request.shape) for name, values in columns.items()}
    path, path_velocity = obstacle_path(request, times)
    relative_velocity = path_velocity - speed
    with np.errstate(all="ignore"):  # a custom curve may overflow at large distances
        slope = np.asarray(request.sensor.log_slope(np.clip(distance, *request.sensor.valid_range)))
    rate = slope * relative_velocity
    course = {
        "time": times,
        "distance": distance,
        "relative_velocity": relative_velocity,
        "displacement": path - distance,
        "displacement_velocity": speed,
        "displacement_acceleration": acceleration,
        "virtual_force": each.gain[:, None] * (-(np.maximum(rate, 0.0) ** 2) if request.degree == 2 else rate),
    }
    return motion_of(result, request.shape, bodies, course)


def _column(values: Any, shape: tuple[int, ...]) -> FloatArray:
    """Reshape the values of a quantity to a column."""
    array = np.asarray(values, dtype=np.float64)
    return (array if array.size == 1 or array.ndim == 1 else np.broadcast_to(array, shape)).reshape(-1, 1)
