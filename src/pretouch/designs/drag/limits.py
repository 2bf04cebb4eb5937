"""Find the virtual drag at which a quantity reaches its limit.

An example of a quantity is the excursion of the robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, finite, float_or_array, positive
from pretouch._core.values import Value
from pretouch.motion import Admittance, ContactResult, Obstacle, Scenario
from pretouch.motion.drag import slope_integral, solve_drag
from pretouch.sensors import SensorModel

from ..impact import ImpactModel

_STRONGEST: Final = 1e-9  # ratio of the strongest drag that is searched; an object is practically stopped by it
_PARTS: Final = 33
_CLOSE: Final = 1e-13
_MET: Final = 1e-12
_PASSES: Final = 200
_FOREVER: Final = 1e300
_TOGETHER: Final = 512  # designs by their acceleration that are searched at once, with a grid of drags each
_UNITS: Final = {"ratio": "", "excursion": "m", "acceleration": "m/s^2", "contact_speed": "m/s", "impact_force": "N"}


@dataclass(frozen=True, slots=True, kw_only=True)
class DragEffect(Value):
    """The requirement for a virtual drag, such as a largest excursion.

    Exactly one effect is given. It refers to an object in uniform motion.

    A limit on excursion or acceleration gives the strongest drag that meets it; a limit on contact speed or impact
    force gives the weakest. Ratio and excursion hold at every speed, the other limits up to a largest approach speed.
    Arrays of numbers choose one drag for each.

    Args:
        ratio: rho, contact speed over approach speed, in (0, 1].
        excursion: the largest excursion at contact [m].
        acceleration: the largest acceleration [m/s^2].
        contact_speed: the largest contact speed [m/s].
        impact_force: the largest peak force of the impact [N].
        largest_speed: the largest approach speed [m/s]; None for that of the task.

    Raises:
        InvalidInputError: there is not exactly one effect, or a number is out of range.
    """

    ratio: ArrayLike | None = None
    excursion: ArrayLike | None = None
    acceleration: ArrayLike | None = None
    contact_speed: ArrayLike | None = None
    impact_force: ArrayLike | None = None
    largest_speed: ArrayLike | None = None

    def __post_init__(self) -> None:
        check_types(self)
        for name in (*_UNITS, "largest_speed"):
            limit = getattr(self, name)
            if limit is not None and np.size(positive(limit, name, _UNITS.get(name, "m/s"))) == 0:
                raise InvalidInputError(f"{name}: found an empty array, expected at least one number")
        names = [name for name in _UNITS if getattr(self, name) is not None]
        if len(names) != 1:
            raise InvalidInputError(f"drag: found {', '.join(names) or 'nothing'}, expected one of {', '.join(_UNITS)}")
        (name,) = names
        value = np.asarray(getattr(self, name))
        if name == "ratio" and value.max() > 1:
            raise InvalidInputError(
                f"ratio: found {value.max():g}, expected a positive number up to 1. The ratio is contact speed / "
                "approach speed, and a virtual drag reduces the speed"
            )

    @property
    def chosen(self) -> tuple[str, Any, str]:
        """Name, value and SI unit of the drag requirement."""
        return next((f.name, v, _UNITS[f.name]) for f in fields(self) if (v := getattr(self, f.name)) is not None)

    def drag(
        self, sensor: SensorModel, distance: ArrayLike, mass: float, impact: ImpactModel | None = None
    ) -> tuple[Any, Any]:
        """Find the virtual drag that meets this requirement for an approaching object.

        Args:
            sensor: the sensor curve, which must be valid down to contact.
            distance: detection distance l_d [m]; a number or an array.
            mass: M of the virtual object [kg].
            impact: the impact model, which gives the force from the contact speed; for `impact_force`.

        Returns:
            phi [N s^2], and the approach speed [m/s] up to which the limit is met; arrays if an argument is one.

        Raises:
            InvalidInputError: the largest speed or the impact is missing, or even the drag of the ratio 1e-9 meets the
                limit.
        """
        if self.excursion is not None:
            return strongest_by_excursion(sensor, distance, mass, self.excursion), math.inf
        if self.ratio is not None:
            rho, speed = np.asarray(self.ratio), math.inf
        elif self.largest_speed is None:
            raise InvalidInputError(
                "largest_speed: the largest approach speed [m/s] is missing; set this speed. The virtual drag for the "
                f"limit {self.chosen[0]} depends on the approach speed"
            )
        else:
            speed = finite(self.largest_speed, "largest_speed", "m/s")
            if self.acceleration is not None:
                return strongest_by_peak(sensor, distance, mass, np.asarray(self.acceleration) / speed**2), speed
            rho = np.minimum(1.0, allowed_speed(self.contact_speed, self.impact_force, impact, speed) / speed)
        return positive(mass, "mass", "kg") * np.log(1 / rho) / slope_integral(sensor, distance), speed


def encounter(  # noqa: PLR0917
    sensor: SensorModel, mass: Any, distance: Any, drag: Any, speed: Any, push: Any
) -> ContactResult:
    """Compute encounters in which only the virtual drag moves the robot.

    The robot is initially at rest.

    Args:
        sensor: the sensor curve.
        mass: M [kg].
        distance: l_d [m].
        drag: phi [N s^2].
        speed: approach speed [m/s].
        push: the acceleration of the object toward the plant [m/s^2].

    Returns:
        The contacts; the motion has no time limit.
    """
    obstacle = Obstacle(position=distance, velocity=-np.asarray(speed), acceleration=-np.asarray(push))
    scenario = Scenario(admittance=Admittance(mass=mass, damping=0.0, stiffness=0.0), obstacle=obstacle)
    return solve_drag(scenario, sensor, drag, horizon=_FOREVER)


def allowed_speed(
    contact_speed: ArrayLike | None, impact_force: ArrayLike | None, impact: ImpactModel | None, speed: ArrayLike
) -> Any:
    """Return the largest allowed contact speed [m/s].

    A limit of the contact speed or of the impact force determines it.

    Args:
        contact_speed: the limit of the contact speed [m/s]; or None.
        impact_force: the largest peak force [N]; used instead of the contact speed unless None.
        impact: the impact model, which gives the force from the contact speed.
        speed: the approach speed [m/s], which the result does not exceed.

    Returns:
        The speed [m/s]; an array if a limit or the speed is one.

    Raises:
        InvalidInputError: a limit is not a positive number, or there is a force without an impact model.
    """
    if impact_force is None:
        return positive(0.0 if contact_speed is None else contact_speed, "contact_speed", "m/s")
    limit = positive(impact_force, "impact_force", "N")
    if impact is None:
        raise InvalidInputError(
            "impact: found none, expected an impact model for a design by impact_force, such as SpringImpact"
        )
    limits, high = np.broadcast_arrays(limit, np.asarray(speed, dtype=float))
    result = _last(lambda w: np.asarray(impact.peak_force(w)) <= limits.reshape(-1, 1), high.reshape(-1))
    return float_or_array(result.reshape(high.shape))


def _last(keeps: Callable[[FloatArray], Any], high: FloatArray) -> FloatArray:
    """Return the largest value up to each limit that meets a condition. The limits are `high`.

    The search repeatedly refines a grid. The condition takes a grid for each number, one per row.
    """
    low, high = np.where(keeps(high[:, None])[:, 0], high, 0.0), high.copy()
    while (high - low > _CLOSE * high).any():
        ends = np.linspace(low, high, _PARTS, axis=1)
        count = np.count_nonzero(keeps(ends)[:, 1:-1], axis=1)[:, None]
        new = np.take_along_axis(ends, count, axis=1)[:, 0], np.take_along_axis(ends, count + 1, axis=1)[:, 0]
        if (new[0] == low).all() and (new[1] == high).all():
            break
        low, high = new
    return low


def strongest_by_excursion(  # noqa: PLR0917
    sensor: SensorModel, distance: ArrayLike, mass: float, limit: ArrayLike, speed: float = 1.0, push: float = 0.0
) -> Any:
    """Find the strongest virtual drag within an excursion limit.

    A bracketing secant method finds the drag at which the excursion E reaches its limit. E is convex and increasing in
    phi, and ln(1 + E/l_d) is nearly linear. By convexity, reducing phi by a share reduces E by at least the same share.

    Args:
        sensor: the sensor curve.
        distance: l_d [m].
        mass: M [kg].
        limit: the largest excursion [m].
        speed: approach speed [m/s]; it has no effect if the push is 0.
        push: the acceleration of the object toward the plant >= 0 [m/s^2].

    Returns:
        phi [N s^2]; an array if the distance or the limit is one.

    Raises:
        InvalidInputError: even the strongest searched drag meets the limit.
    """
    shape = np.broadcast_shapes(np.shape(distance), np.shape(limit))
    limits = np.broadcast_to(limit, shape).reshape(-1).astype(float)
    distances = np.broadcast_to(distance, shape).reshape(-1).astype(float)
    unit = positive(mass, "mass", "kg") / slope_integral(sensor, distances)  # the drag of the ratio 1/e
    strongest = unit * math.log(1 / _STRONGEST)

    def excursion(drag: FloatArray, on: Any) -> FloatArray:
        end = encounter(sensor, mass, distances[on], drag, speed, push).end
        return np.asarray(-end.displacement, dtype=float)

    def excess(value: FloatArray, on: Any) -> FloatArray:
        return np.asarray(np.log((distances[on] + value) / (distances[on] + limits[on])))

    low, last = np.zeros_like(limits), np.zeros_like(limits)
    under, over = excess(low, slice(None)), np.zeros_like(limits)
    high = np.minimum(unit * np.log1p(2 * limits / distances), strongest)
    on = np.arange(len(limits))
    while len(on):
        over[on] = excess(excursion(high[on], on), on)
        on = on[over[on] <= 0]
        if (never := on[high[on] == strongest[on]]).size:
            raise InvalidInputError(
                f"excursion: the robot retreats less than the limit of {limits[never[0]]:g} m, even with the strongest "
                "drag. Instead of the excursion, set the ratio of contact speed to approach speed. The strongest drag "
                f"has a ratio of {_STRONGEST:g}"
            )
        low[on], under[on], high[on] = high[on], over[on], np.minimum(2 * high[on], strongest[on])
    drag, reached = high.copy(), limits.copy()
    on = np.arange(len(limits))
    for _ in range(_PASSES):
        secant = high[on] - over[on] * (high[on] - low[on]) / (over[on] - under[on])
        drag[on] = np.clip(secant, low[on], high[on])
        reached[on] = excursion(drag[on], on)
        on = on[(np.abs(reached[on] / limits[on] - 1) > _CLOSE) & (high[on] - low[on] > _CLOSE * high[on])]
        if not len(on):
            break
        more = excess(reached[on], on)
        halved = np.where(last[on] * more > 0, 0.5, 1.0)  # an end that stays a second time counts half
        last[on], above = more, more > 0
        up, down = on[above], on[~above]
        high[up], over[up], under[up] = drag[up], more[above], under[up] * halved[above]
        low[down], under[down], over[down] = drag[down], more[~above], over[down] * halved[~above]
    return float_or_array((drag * (1 - np.maximum(reached / limits - 1, 0.0))).reshape(shape))


def strongest_by_peak(sensor: SensorModel, distance: ArrayLike, mass: float, limit: ArrayLike) -> Any:
    """Find the strongest virtual drag within an acceleration limit.

    The limit applies to the ratio of peak acceleration to squared approach speed. This peak is not monotone in phi.

    With k = phi / M, the peak is the largest value over l of k g^2 exp(-2 k int g^2), and it grows at most
    proportionally to k. So if a drag exceeds the limit by a factor c, all drags between it and 1/c of it exceed the
    limit, too. The search divides the drag by c and never skips a drag that meets the limit. It starts at
    k = limit / g(l_d)^2, because all stronger drags exceed the limit at detection.

    Args:
        sensor: the sensor curve.
        distance: l_d [m].
        mass: M [kg].
        limit: the largest acceleration over the square of the speed [1/m].

    Returns:
        phi [N s^2]; an array if the distance or the limit is one.
    """
    shape = np.broadcast_shapes(np.shape(distance), np.shape(limit))
    limits = np.broadcast_to(limit, shape).reshape(-1)
    distances = np.broadcast_to(distance, shape).reshape(-1)
    parts = [slice(i, i + _TOGETHER) for i in range(0, limits.size, _TOGETHER)]
    drags = [_strongest_by_peak(sensor, distances[part], mass, limits[part]) for part in parts]
    return float_or_array(np.concatenate([*drags, np.empty(0)]).reshape(shape))


def _strongest_by_peak(sensor: SensorModel, distance: FloatArray, mass: float, limit: FloatArray) -> FloatArray:
    """Find the strongest virtual drag for each acceleration limit.

    A limit is peak acceleration / (approach speed)^2.

    Returns:
        phi [N s^2] of each.

    Raises:
        InvalidInputError: even the strongest searched drag meets the limit, or the peak of a drag equals the limit.
    """
    strongest = positive(mass, "mass", "kg") * math.log(1 / _STRONGEST) / slope_integral(sensor, distance)
    slope = np.asarray(sensor.log_slope(distance))
    with np.errstate(divide="ignore"):
        top = mass * limit / slope**2

    def excess_of(drag: FloatArray, on: Any) -> FloatArray:
        peaks = encounter(sensor, mass, distance[on, None], drag, 1.0, 0.0).end.largest_acceleration
        return np.log(np.asarray(peaks) / limit[on, None])

    high, steepness = np.minimum(top, strongest), np.full(len(limit), 0.5)
    excess = excess_of(high[:, None], slice(None))[:, 0]
    if (never := np.flatnonzero((strongest < top) & (excess <= 0))).size:
        raise InvalidInputError(
            "acceleration: even with the strongest drag, the acceleration stays below the limit. Instead of the "
            "acceleration, set the ratio of contact speed to approach speed. The strongest drag has a ratio of "
            f"{_STRONGEST:g}. The limit of acceleration / (approach speed)^2 is {limit[never[0]]:g} 1/m"
        )
    for _ in range(_PASSES):
        on = np.flatnonzero(excess > _MET)
        if not len(on):
            return np.asarray(high * np.exp(-np.maximum(excess, 0.0)))
        shrinks = (1 - 0.95 * steepness[on, None]) ** np.arange(_PARTS)
        steps = 0.9 * excess[on, None] * shrinks
        grid = high[on, None] * np.exp(-np.cumsum(steps, axis=1))
        beyond = excess_of(grid, on)
        enough = np.pad(beyond[:, :-1] >= steps[:, 1:], ((0, 0), (0, 1)))
        end = np.argmin(enough, axis=1)[:, None]  # up to here no drag between grid points can meet the limit
        new, rest = np.take_along_axis(grid, end, axis=1)[:, 0], np.take_along_axis(beyond, end, axis=1)[:, 0]
        steepness[on] = np.clip((excess[on] - rest) / np.log(high[on] / new), 0.0, 1.0)
        high[on], excess[on] = new, rest
    raise InvalidInputError(
        "acceleration: the search found no virtual drag for this limit; change the limit slightly. The limit of "
        f"acceleration / (approach speed)^2 is {limit[on[0]]:g} 1/m"
    )
