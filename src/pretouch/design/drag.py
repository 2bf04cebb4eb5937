"""The design of the virtual drag: one number, by the ratio of the speeds or by a limit on what it comes to.

Nothing is searched for an optimum: ratio and excursion trade off along one curve, and each limit picks one point of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.numbers import FloatArray, finite, nonnegative, positive
from pretouch._core.values import Value
from pretouch.motion.drag import slope_integral
from pretouch.sensors import SensorModel

from .constraints import ImpactModel
from .drag_limits import allowed_speed, encounter, strongest_by_excursion, strongest_by_peak

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


@dataclass(frozen=True, slots=True, kw_only=True)
class DragDesign(Value):
    """A virtual drag and what it does, at every speed: numbers, or arrays of one shape.

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
        numbers = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "sensor"}
        found: dict[str, Any] = plain({"sensor": self.sensor.to_dict(), **numbers, "premises": self.premises})
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
    sensor: SensorModel, distance: ArrayLike, mass: float, drag: ArrayLike, *, largest_speed: float = math.inf
) -> DragDesign:
    """Tell what a virtual drag does.

    Args:
        sensor: the sensor curve, which holds down to contact.
        distance: l_d [m], from which on the object is seen; a number or an array.
        mass: M of the virtual object [kg].
        drag: phi >= 0 [N s^2], broadcast with the distance.
        largest_speed: up to which speed a limit is kept [m/s], for the record.

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
    )


def design_drag(
    sensor: SensorModel,
    distance: float,
    mass: float,
    *,
    ratio: ArrayLike | None = None,
    excursion: float | None = None,
    acceleration: float | None = None,
    contact_speed: float | None = None,
    impact_force: float | None = None,
    impact: ImpactModel | None = None,
    largest_speed: float | None = None,
) -> DragDesign:
    """Choose the virtual drag by exactly one of its effects.

    By a limit on excursion or acceleration it is the strongest drag that keeps it; by one on contact speed or impact
    force the weakest. All but ratio and excursion need the largest approach speed.

    Args:
        sensor: the sensor curve, which holds down to contact.
        distance: l_d [m], from which on the object is seen.
        mass: M of the virtual object [kg].
        ratio: rho, contact speed over approach speed, in (0, 1]; or an array.
        excursion: the largest excursion at contact [m].
        acceleration: the largest acceleration [m/s^2].
        contact_speed: the largest contact speed [m/s].
        impact_force: the largest peak force of the impact [N].
        impact: what the force follows the contact speed by; with `impact_force`.
        largest_speed: the largest approach speed [m/s].

    Returns:
        The design.

    Raises:
        InvalidInputError: not exactly one effect is given, or a number without a meaning, or a limit that even a ratio
            of 1e-9 keeps.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> drag = design_drag(sensor, 0.0422, 1.0, ratio=0.15)
        >>> round(drag.drag, 6), round(drag.excursion, 6)
        (0.014372, 0.059619)
        >>> round(design_drag(sensor, 0.0422, 1.0, acceleration=2.0, largest_speed=0.3).ratio, 4)
        0.1522
    """
    given = {
        "ratio": ratio,
        "excursion": excursion,
        "acceleration": acceleration,
        "contact_speed": contact_speed,
        "impact_force": impact_force,
    }
    chosen = [name for name, value in given.items() if value is not None]
    if len(chosen) != 1:
        raise InvalidInputError(f"drag: found {', '.join(chosen) or 'nothing'}, expected one of {', '.join(given)}")
    (name,) = chosen
    if ratio is not None:
        rho, speed = np.asarray(positive(ratio, "ratio")), math.inf
    elif excursion is not None:
        limit, speed = positive(excursion, "excursion", "m"), math.inf
        return predict_drag(sensor, distance, mass, strongest_by_excursion(sensor, distance, mass, limit))
    elif largest_speed is None:
        raise InvalidInputError(f"largest_speed: found none, which a design by {name} needs: [m/s]")
    else:
        speed = positive(largest_speed, "largest_speed", "m/s")
        if acceleration is not None:
            limit = positive(acceleration, "acceleration", "m/s^2") / speed**2
            found = strongest_by_peak(sensor, distance, mass, limit)
            return predict_drag(sensor, distance, mass, found, largest_speed=speed)
        rho = np.asarray(min(1.0, allowed_speed(contact_speed, impact_force, impact, speed) / speed))
    if (rho > 1).any():
        raise InvalidInputError(f"ratio: found {float(rho.max()):g}, which must lie in (0, 1]: a drag only slows down")
    drag = positive(mass, "mass", "kg") * np.log(1 / rho) / slope_integral(sensor, distance)
    return predict_drag(sensor, distance, mass, drag, largest_speed=speed)


def drag_trade_off(sensor: SensorModel, distance: float, mass: float, ratios: FloatArray | None = None) -> DragDesign:
    """Return the curve along which ratio and excursion trade off, one design with arrays.

    Args:
        sensor: the sensor curve, which holds down to contact.
        distance: l_d [m].
        mass: M of the virtual object [kg].
        ratios: rho of its points; 99 from 0.99 to 0.01 by default.

    Returns:
        The curve.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> curve = drag_trade_off(ExponentialFirstOrder(scale=1.0, rate=-60.0), 0.04, 1.0, np.array([0.5, 0.1]))
        >>> np.round(curve.excursion, 4)
        array([0.0177, 0.1163])
    """
    return design_drag(sensor, distance, mass, ratio=np.linspace(0.99, 0.01, 99) if ratios is None else ratios)
