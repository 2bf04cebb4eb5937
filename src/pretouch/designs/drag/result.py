"""Define the result of a virtual drag design.

The result predicts the contact for every approach speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.display import Described
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
"""Relative amount by which a value may exceed a limit, as rounding."""

PREMISES: Final = (
    "The plant follows the virtual object of mass M exactly. Sensor and controller have no delay and no noise.",
    "While the object approaches, the pull of the admittance toward it is suspended. At detection, the plant is at "
    "rest at its reference or already retreats.",
    "The object is visible from the detection distance down to contact, and ln xi falls with the distance everywhere.",
    "Ratio, excursion and peak acceleration are for an object in uniform motion relative to the reference. The bound "
    "of the contact speed is for any object whose acceleration toward the plant never exceeds the given limit.",
    "The excursion is the one at contact. At contact, the plant still retreats at 1 - rho times the approach speed.",
)
"""The assumptions of a drag design."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DragDesign(Described, Value):
    """A designed virtual drag with its predicted contact at every approach speed.

    Only a design of a task has an encounter and a report page.

    Args:
        sensor: the sensor curve.
        mass: M of the virtual object [kg].
        detection_distance: detection distance l_d [m].
        drag: phi [N s^2].
        slope_integral: G [1/m], the integral of g^2 up to l_d.
        ratio: rho, contact speed over approach speed.
        excursion: retreat of the plant until contact [m].
        peak: the largest acceleration over the square of the approach speed [1/m].
        peak_distance: distance of the largest acceleration [m].
        largest_speed: the approach speed [m/s] up to which the limit of the design is met; infinite if it is met at
            every speed.
        task: the task of the design; None for a design without a task.
    """

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
        """The control law of the virtual drag."""
        return DRAG

    @property
    def gain(self) -> Any:
        """The coefficient phi of the virtual drag [N s^2].

        All design results call their designed number `gain`.
        """
        return self.drag

    @property
    def designed_task(self) -> Task:
        """The task of the virtual drag design.

        Raises:
            ResultUnavailableError: the design has no task.
        """
        if self.task is None:
            raise ResultUnavailableError(
                "drag: found a design without an encounter, expected the result of design_drag(task)"
            )
        return self.task

    @property
    def scenario(self) -> Scenario:
        """The encounter that the task describes."""
        return self.designed_task.scenario

    @property
    def result(self) -> ContactResult:
        """The predicted motion of the task's encounter with the designed drag."""
        return DRAG.contact(self.scenario, self.sensor, self.drag, horizon=self.designed_task.horizon)

    @property
    def holds(self) -> bool:
        """True if the virtual drag meets every limit of the task.

        The encounter must also end in contact. Limits of the gain D_p do not count.
        """
        return bool(self.result.reached) and all(map(self.keeps, self.designed_task.limits))

    def keeps(self, limit: Constraint) -> bool:
        """Return True if the virtual drag meets a limit.

        The limit applies to the encounter of the task. Rounding errors are ignored.
        """
        if limit.quantity == "gain":
            return True
        return bool(limit.magnitude(self.result.end, self.designed_task.impact) <= limit.limit * (1 + ROUNDING))

    @property
    def headline(self) -> str:
        """A summary of the virtual drag in one or two sentences.

        For arrays, it gives only the number of designed drags.
        """
        if np.shape(self.drag):
            return f"{np.size(self.drag)} drags"
        text = (
            f"With the virtual drag {DRAG.number.equals(self.drag)}, the contact speed is {100 * self.ratio:.3g} "
            f"% of every approach speed, after an excursion of {format_quantity(self.excursion, 'm')}."
        )
        if self.task is None:
            return text
        result, speed = self.result, abs(float(self.scenario.relative_velocity))
        contact_speed = format_quantity(abs(float(result.end.relative_velocity)), "m/s")
        outcome = f"contact at {contact_speed}" if result.reached else "no contact"
        return f"{text} For {format_quantity(speed, 'm/s')}: {outcome}."

    def __str__(self) -> str:
        return repr(self) if self.task is None else Described.__str__(self)

    def _repr_html_(self) -> str | None:
        return None if self.task is None else Described._repr_html_(self)

    def __repr__(self) -> str:
        return f"<DragDesign: {self.headline}>"

    @property
    def premises(self) -> tuple[str, ...]:
        """Sentences that state the assumptions of the design."""
        return PREMISES

    def contact_speed(self, speed: ArrayLike) -> Any:
        """Return the contact speed for a constant approach speed.

        Both speeds are in m/s.
        """
        return self.ratio * nonnegative(speed, "speed", "m/s")

    def acceleration(self, speed: ArrayLike) -> Any:
        """Return the robot's largest acceleration for a constant approach speed.

        The acceleration is in m/s^2, the approach speed in m/s.
        """
        return self.peak * np.square(nonnegative(speed, "speed", "m/s"))

    def time(self, speed: ArrayLike) -> Any:
        """Return the time to contact for a constant approach speed.

        The time [s] starts at detection. The approach speed is in m/s.
        """
        return (self.detection_distance + self.excursion) / positive(speed, "speed", "m/s")

    def contact_speed_bound(self, speed: ArrayLike, acceleration: ArrayLike) -> Any:
        """Return an upper bound of the contact speed.

        The acceleration of the object toward the robot is limited. The bound is the contact speed of an object that
        always has the largest acceleration. It also holds for an object that turns around within the detection
        distance and returns.

        Args:
            speed: approach speed at the detection distance, relative to the plant [m/s].
            acceleration: largest acceleration [m/s^2], the sum of two parts: that of the object toward the plant,
                relative to the reference, and that of the plant by its admittance unless it is suspended.

        Returns:
            The bound [m/s].

        Raises:
            InvalidInputError: both are zero, so that the object never arrives.
        """
        approach, push = nonnegative(speed, "speed", "m/s"), nonnegative(acceleration, "acceleration", "m/s^2")
        if np.any((np.asarray(approach) == 0) & (np.asarray(push) == 0)):
            raise InvalidInputError(
                "speed: found 0 m/s with an acceleration of 0 m/s^2, expected one of them above 0: this object never "
                "arrives"
            )
        result = encounter(self.sensor, self.mass, self.detection_distance, self.drag, approach, push)
        return -result.contact.relative_velocity

    def seen_from(self, distance: ArrayLike) -> DragDesign:
        """Return the results of a drag for other detection distances.

        The distances are in m.

        The smallest distance has the fastest contact, and the largest distance has the largest excursion. So the two
        ends of an uncertain detection distance bound the effects. An object that stops and starts again counts as
        detected where it stopped.
        """
        return predict_drag(self.sensor, distance, self.mass, self.drag, largest_speed=self.largest_speed)

    def to_dict(self) -> dict[str, Any]:
        """Return the drag design as a JSON object.

        Numbers are in SI units.
        """
        numbers = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in {"sensor", "task"}}
        contact = {} if self.task is None else {"contact": self.result, "holds": self.holds}
        document: dict[str, Any] = plain(
            {"sensor": self.sensor.to_dict(), **numbers, "premises": self.premises, **contact}
        )
        return document


@dataclass(frozen=True, slots=True, kw_only=True)
class DragLimits(Value):
    """Guaranteed bounds of the motion for a drag between two limits.

    The bounds apply to contact speed, excursion and acceleration. The drag coefficient is phi.

    Args:
        weak: the weaker drag.
        strong: the stronger drag, for the same curve, mass and detection distance.
    """

    weak: DragDesign
    strong: DragDesign

    def __post_init__(self) -> None:
        weak, strong = ((d.sensor, d.mass, d.detection_distance, np.shape(d.drag)) for d in (self.weak, self.strong))
        if weak != strong or np.shape(self.weak.drag):
            raise InvalidInputError(
                "rails: found arrays, or designs with different curves, masses or detection distances, expected two "
                "single designs that differ only in their drag"
            )
        if not 0 < self.weak.drag <= self.strong.drag:
            raise InvalidInputError(
                f"rails: found a weak drag of {self.weak.drag:g} N*s^2 and a strong drag of "
                f"{self.strong.drag:g} N*s^2, expected 0 < weak drag <= strong drag",
                value=self.weak.drag,
            )

    @property
    def ratio(self) -> tuple[float, float]:
        """Smallest and largest ratio of contact to approach speed.

        The object has a constant speed.
        """
        return self.strong.ratio, self.weak.ratio

    @property
    def excursion(self) -> tuple[float, float]:
        """Smallest and largest excursion of the robot until contact [m].

        The object has a constant speed.
        """
        return self.weak.excursion, self.strong.excursion

    @property
    def peak(self) -> float:
        """Upper bound of the acceleration divided by the squared approach speed [1/m].

        The bound exceeds the peaks of both constant drags: the schedule may switch to the strong drag after the weak
        one has hardly reduced the speed.
        """
        return float(self.strong.drag / self.weak.drag * self.weak.peak)

    def contact_speed_bound(self, speed: ArrayLike, acceleration: ArrayLike) -> Any:
        """Return an upper bound of the contact speed [m/s].

        No virtual drag between the weak and the strong drag exceeds it.
        """
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
    """Predict contact speed, excursion and acceleration under a virtual drag.

    Args:
        sensor: the sensor curve, which must be valid down to contact.
        distance: detection distance l_d [m]; a number or an array.
        mass: M of the virtual object [kg].
        drag: phi >= 0 [N s^2]; it broadcasts with the distance.
        largest_speed: approach speed up to which a limit is met [m/s], stored in the design.
        task: the task of the design, stored in the design.

    Returns:
        The design.

    Raises:
        InvalidInputError: the curve is not valid down to contact.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> drag = predict_drag(ExponentialFirstOrder(scale=1.0, rate=-60.0), 0.04, 1.0, 0.01)
        >>> round(drag.ratio, 6), round(drag.excursion, 6), round(drag.peak, 6)
        (0.236928, 0.049464, 36.0)
    """
    if sensor.valid_range[0] > 0:
        raise InvalidInputError(
            f"sensor: the sensor curve is valid only above {sensor.valid_range[0]:g} m, but must be valid down to 0 m. "
            "Mount the sensor behind the contact surface, and set its recess"
        )
    result = encounter(sensor, mass, distance, drag, 1.0, 0.0)
    end = result.contact
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
        peak_distance=result.columns.column("distance_of_largest_force"),
        largest_speed=largest_speed,
        task=task,
    )
