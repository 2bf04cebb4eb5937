"""A virtual drag and what it does, at every speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.blocks import Described
from pretouch._core.errors import InvalidInputError, ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import finite, nonnegative, positive
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.motion import DRAG, ContactResult, ContinuousLaw, Scenario
from pretouch.motion.drag import slope_integral
from pretouch.sensors import SensorModel

from ..constraints import Constraint
from ..task import Task
from .limits import encounter

ROUNDING: Final = 1e-9
"""Of a limit, by which an encounter may exceed it."""

PREMISES: Final = (
    "The plant follows the virtual object of mass M exactly; sensor and controller have no delay and no noise.",
    "While the object approaches, the admittance's pull toward it is held off; the plant was at rest at its reference "
    "or gave way when the object was detected.",
    "The object is seen from the detection distance on, down to contact, and ln xi falls with the distance all along.",
    "Ratio, excursion and peak acceleration hold for an object in uniform motion relative to the reference; the bound "
    "holds for any of an acceleration toward the plant that never exceeds the one that is given.",
    "The excursion is that at contact; the plant then goes back at 1 - rho of the approach speed.",
)
"""What a design of a drag assumes."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DragDesign(Described, Value):
    """A virtual drag and what it does, at every speed: numbers, or arrays of one shape.

    That of a task has a page of its own; without one there is no encounter to speak of.

    Args:
        sensor: the sensor curve.
        mass: M of the virtual object [kg].
        detection_distance: l_d [m], from which on the object is seen.
        drag: phi [N s^2].
        slope_integral: G [1/m], the integral of g^2 up to l_d.
        ratio: rho, contact speed over approach speed.
        excursion: how far the plant has gone back at contact [m].
        peak: the largest acceleration over the square of the approach speed [1/m].
        peak_distance: where it is [m].
        largest_speed: the approach speed [m/s] up to which the limit is kept that the design was made for; infinite
            where it is kept at every speed.
        task: what it answers, where it was designed for one.
    """

    page: ClassVar[str] = "pretouch.design.drag.page:drag_page"

    sensor: SensorModel
    mass: float
    detection_distance: Any
    drag: Any
    slope_integral: Any
    ratio: Any
    excursion: Any
    peak: Any
    peak_distance: Any
    largest_speed: float = math.inf
    task: Task | None = None

    @property
    def law(self) -> ContinuousLaw:
        """The law whose number it is."""
        return DRAG

    @property
    def gain(self) -> Any:
        """The number of that law, phi [N s^2]: under this name every answer has its own."""
        return self.drag

    @property
    def asked(self) -> Task:
        """The task, of a design that answers one.

        Raises:
            ResultUnavailableError: it answers none.
        """
        if self.task is None:
            raise ResultUnavailableError("drag: found one without an encounter, expected that of design_drag(task)")
        return self.task

    @property
    def scenario(self) -> Scenario:
        """The encounter of its task."""
        return self.asked.scenario

    @property
    def result(self) -> ContactResult:
        """The contact of that encounter."""
        return DRAG.contact(self.scenario, self.sensor, self.drag, horizon=self.asked.horizon)

    @property
    def holds(self) -> bool:
        """Whether that encounter ends in contact and keeps every limit of the task; one of D_p is none of a drag."""
        return bool(self.result.reached) and all(map(self.keeps, self.asked.limits))

    def keeps(self, limit: Constraint) -> bool:
        """Tell whether that encounter keeps a limit, to rounding: a drag is made to meet one exactly."""
        if limit.quantity == "gain":
            return True
        return bool(limit.magnitude(self.result.end, self.asked.impact) <= limit.limit * (1 + ROUNDING))

    @property
    def headline(self) -> str:
        """The answer in a sentence or two; of arrays how many there are."""
        if np.shape(self.drag):
            return f"{np.size(self.drag)} drags"
        text = (
            f"Drag {DRAG.number.equals(self.drag)}: contact at {100 * self.ratio:.3g} % of any approach "
            f"speed, after an excursion of {format_quantity(self.excursion, 'm')} at every speed."
        )
        if self.task is None:
            return text
        found, speed = self.result, abs(float(self.scenario.relative_velocity))
        left = format_quantity(abs(float(found.end.relative_velocity)), "m/s")
        how = f"contact at {left}" if found.reached else "no contact"
        return f"{text} At {format_quantity(speed, 'm/s')}: {how}."

    def __str__(self) -> str:
        return repr(self) if self.task is None else Described.__str__(self)

    def _repr_html_(self) -> str | None:
        return None if self.task is None else Described._repr_html_(self)

    def __repr__(self) -> str:
        return f"<DragDesign: {self.headline}>"

    @property
    def premises(self) -> tuple[str, ...]:
        """What the design assumes, in words."""
        return PREMISES

    def contact_speed(self, speed: ArrayLike) -> Any:
        """Return the contact speed [m/s] of an object that approaches uniformly at a speed [m/s]."""
        return self.ratio * nonnegative(speed, "speed", "m/s")

    def acceleration(self, speed: ArrayLike) -> Any:
        """Return the largest acceleration [m/s^2] for an object that approaches uniformly at a speed [m/s]."""
        return self.peak * np.square(nonnegative(speed, "speed", "m/s"))

    def time(self, speed: ArrayLike) -> Any:
        """Return the time from detection to contact [s] of an object that approaches uniformly at a speed [m/s]."""
        return (self.detection_distance + self.excursion) / positive(speed, "speed", "m/s")

    def contact_speed_bound(self, speed: ArrayLike, acceleration: ArrayLike) -> Any:
        """Return the contact speed that no object exceeds whose acceleration toward the plant keeps below a limit.

        It is that of an object with exactly this acceleration all along; one that turns back and comes again from
        within the detection distance keeps it as well.

        Args:
            speed: at the detection distance, relative to the plant [m/s].
            acceleration: of the object toward the plant, relative to the reference, and of the plant by its admittance
                where that is not held off, in sum at most [m/s^2].

        Returns:
            The bound [m/s].

        Raises:
            InvalidInputError: both are zero: such an object never comes.
        """
        approach, push = nonnegative(speed, "speed", "m/s"), nonnegative(acceleration, "acceleration", "m/s^2")
        if np.any((np.asarray(approach) == 0) & (np.asarray(push) == 0)):
            raise InvalidInputError("speed: found 0 m/s beside an acceleration of 0 m/s^2: such an object never comes")
        result = encounter(self.sensor, self.mass, self.detection_distance, self.drag, approach, push)
        return -result.contact.relative_velocity

    def seen_from(self, distance: ArrayLike) -> DragDesign:
        """Return what the same drag does to an object that is detected at another distance [m], or at several.

        Contact is fastest for the smallest distance and the excursion largest for the largest, so the two ends of an
        uncertain detection distance say all; one that stops on its way and comes again is seen from where it stopped.
        """
        return predict_drag(self.sensor, distance, self.mass, self.drag, largest_speed=self.largest_speed)

    def to_dict(self) -> dict[str, Any]:
        """Return the design as one JSON object, in SI."""
        numbers = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in {"sensor", "task"}}
        contact = {} if self.task is None else {"contact": self.result, "holds": self.holds}
        found: dict[str, Any] = plain(
            {"sensor": self.sensor.to_dict(), **numbers, "premises": self.premises, **contact}
        )
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class DragRails(Value):
    """What any schedule of the drag keeps that stays between two constant ones, whatever it follows.

    Args:
        weak: the weaker of the two.
        strong: the stronger one, for the same curve, mass and detection distance.
    """

    weak: DragDesign
    strong: DragDesign

    def __post_init__(self) -> None:
        one, other = ((d.sensor, d.mass, d.detection_distance, np.shape(d.drag)) for d in (self.weak, self.strong))
        if one != other or np.shape(self.weak.drag):
            raise InvalidInputError("rails: found two designs that differ in more than their drag, or arrays")
        if not 0 < self.weak.drag <= self.strong.drag:
            raise InvalidInputError(
                f"rails: found {self.weak.drag:g} N*s^2 for the weak and {self.strong.drag:g} N*s^2 for "
                "the strong drag, which must be positive and not smaller"
            )

    @property
    def ratio(self) -> tuple[float, float]:
        """Between which the contact speed stays, over that of a uniform approach."""
        return self.strong.ratio, self.weak.ratio

    @property
    def excursion(self) -> tuple[float, float]:
        """Between which the excursion at contact stays in a uniform approach [m]."""
        return self.weak.excursion, self.strong.excursion

    @property
    def peak(self) -> float:
        """What the acceleration never exceeds, over the square of a uniform approach speed [1/m].

        More than that of either constant law: the strong one may set in where the weak one has slowed little.
        """
        return float(self.strong.drag / self.weak.drag * self.weak.peak)

    def contact_speed_bound(self, speed: ArrayLike, acceleration: ArrayLike) -> Any:
        """Return the bound of the weak drag [m/s], which every schedule keeps (`DragDesign.contact_speed_bound`)."""
        return self.weak.contact_speed_bound(speed, acceleration)


def predict_drag(
    sensor: SensorModel,
    distance: ArrayLike,
    mass: float,
    drag: ArrayLike,
    *,
    largest_speed: float = math.inf,
    task: Task | None = None,
) -> DragDesign:
    """Tell what a virtual drag does.

    Args:
        sensor: the sensor curve, which holds down to contact.
        distance: l_d [m], from which on the object is seen; a number or an array.
        mass: M of the virtual object [kg].
        drag: phi >= 0 [N s^2], broadcast with the distance.
        largest_speed: up to which speed a limit is kept [m/s], for the record.
        task: what it answers, likewise.

    Returns:
        The design.

    Raises:
        InvalidInputError: the curve does not hold down to contact.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> drag = predict_drag(ExponentialFirstOrder(scale=1.0, rate=-60.0), 0.04, 1.0, 0.01)
        >>> round(drag.ratio, 6), round(drag.excursion, 6), round(drag.peak, 6)
        (0.236928, 0.049464, 36.0)
    """
    if sensor.valid_range[0] > 0:
        raise InvalidInputError(
            f"sensor: found a curve that begins at {sensor.valid_range[0]:g} m, where the contact speed is not known; "
            "it must hold down to 0 m: mount the sensor recessed"
        )
    found = encounter(sensor, mass, distance, drag, 1.0, 0.0)
    end = found.contact
    shape = np.shape(end.time)

    def shared(value: Any) -> Any:
        return value if shape == () else np.broadcast_to(value, shape)

    distances = finite(distance, "distance", "m")
    return DragDesign(
        sensor=sensor,
        mass=positive(mass, "mass", "kg"),
        detection_distance=shared(distances),
        drag=shared(finite(drag, "drag", "N*s^2")),
        slope_integral=shared(slope_integral(sensor, distances)),
        ratio=-end.relative_velocity,
        excursion=-end.displacement,
        peak=end.largest_acceleration,
        peak_distance=found.columns.column("distance_of_largest_force"),
        largest_speed=largest_speed,
        task=task,
    )
