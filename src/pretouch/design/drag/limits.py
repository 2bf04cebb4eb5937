"""The drag that keeps a limit: by sections where its effect is monotone, else down from above by steps that prove."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_types
from pretouch._core.numbers import FloatArray, positive
from pretouch._core.values import Value
from pretouch.motion import Admittance, ContactResult, Obstacle, Scenario
from pretouch.motion.drag import slope_integral, solve_drag
from pretouch.sensors import SensorModel

from ..constraints import ImpactModel

_STRONGEST: Final = 1e-9  # the smallest ratio that a limit may ask for: what comes of it is as good as stopped
_PARTS: Final = 33
_CLOSE: Final = 1e-13
_MET: Final = 1e-12
_PASSES: Final = 200
_FOREVER: Final = 1e300
_UNITS: Final = {"ratio": "", "excursion": "m", "acceleration": "m/s^2", "contact_speed": "m/s", "impact_force": "N"}


@dataclass(frozen=True, slots=True, kw_only=True)
class DragEffect(Value):
    """What a drag is chosen by: exactly one of its effects on an object in uniform motion.

    By a limit on excursion or acceleration it is the strongest drag that keeps it; by one on contact speed or impact
    force the weakest. All but ratio and excursion are limits up to a largest approach speed.

    Args:
        ratio: rho, contact speed over approach speed, in (0, 1]; or an array.
        excursion: the largest excursion at contact [m].
        acceleration: the largest acceleration [m/s^2].
        contact_speed: the largest contact speed [m/s].
        impact_force: the largest peak force of the impact [N].
        largest_speed: the largest approach speed [m/s]; that of the task where None.

    Raises:
        InvalidInputError: not exactly one effect is given, or a number without a meaning.
    """

    ratio: ArrayLike | None = None
    excursion: float | None = None
    acceleration: float | None = None
    contact_speed: float | None = None
    impact_force: float | None = None
    largest_speed: float | None = None

    def __post_init__(self) -> None:
        check_types(self)
        given = [name for name in _UNITS if getattr(self, name) is not None]
        if len(given) != 1:
            raise InvalidInputError(f"drag: found {', '.join(given) or 'nothing'}, expected one of {', '.join(_UNITS)}")
        (name,) = given
        found = positive(getattr(self, name), name, _UNITS[name])
        if name == "ratio" and np.max(found) > 1:
            raise InvalidInputError(f"ratio: found {np.max(found):g}, which must lie in (0, 1]: a drag only slows down")
        if self.largest_speed is not None:
            positive(self.largest_speed, "largest_speed", "m/s")

    @property
    def chosen(self) -> tuple[str, Any, str]:
        """Name, value and SI unit of the effect."""
        return next((f.name, v, _UNITS[f.name]) for f in fields(self) if (v := getattr(self, f.name)) is not None)

    def drag(
        self, sensor: SensorModel, distance: float, mass: float, impact: ImpactModel | None = None
    ) -> tuple[Any, float]:
        """Find the drag of this effect.

        Args:
            sensor: the sensor curve, which holds down to contact.
            distance: l_d [m], from which on the object is seen.
            mass: M of the virtual object [kg].
            impact: what the force follows the contact speed by; for `impact_force`.

        Returns:
            phi [N s^2], and up to which speed [m/s] the limit is kept.

        Raises:
            InvalidInputError: the largest speed or the impact is missing, or even a ratio of 1e-9 keeps the limit.
        """
        if self.excursion is not None:
            return strongest_by_excursion(sensor, distance, mass, self.excursion), math.inf
        if self.ratio is not None:
            rho, speed = np.asarray(self.ratio), math.inf
        elif self.largest_speed is None:
            raise InvalidInputError(f"largest_speed: found none, which a design by {self.chosen[0]} needs: [m/s]")
        else:
            speed = self.largest_speed
            if self.acceleration is not None:
                return strongest_by_peak(sensor, distance, mass, self.acceleration / speed**2), speed
            rho = np.asarray(min(1.0, allowed_speed(self.contact_speed, self.impact_force, impact, speed) / speed))
        return positive(mass, "mass", "kg") * np.log(1 / rho) / slope_integral(sensor, distance), speed


def encounter(  # noqa: PLR0917
    sensor: SensorModel, mass: Any, distance: Any, drag: Any, speed: Any, push: Any
) -> ContactResult:
    """Solve encounters of a plant at rest, whose admittance is held off, with objects from a distance.

    Args:
        sensor: the sensor curve.
        mass: M [kg].
        distance: l_d [m].
        drag: phi [N s^2].
        speed: of the approach [m/s].
        push: the acceleration of the object toward the plant [m/s^2].

    Returns:
        The contacts, however late.
    """
    obstacle = Obstacle(position=distance, velocity=-np.asarray(speed), acceleration=-np.asarray(push))
    scenario = Scenario(admittance=Admittance(mass=mass, damping=0.0, stiffness=0.0), obstacle=obstacle)
    return solve_drag(scenario, sensor, drag, horizon=_FOREVER)


def allowed_speed(
    contact_speed: float | None, impact_force: float | None, impact: ImpactModel | None, speed: float
) -> float:
    """Return the contact speed that is allowed.

    Args:
        contact_speed: the limit itself [m/s]; or None.
        impact_force: the largest peak force [N], where there is none.
        impact: what it follows the speed by.
        speed: the approach speed [m/s]; no force asks for more.

    Returns:
        The speed [m/s].

    Raises:
        InvalidInputError: a limit is no positive number, or there is a force and no impact.
    """
    if impact_force is None:
        return float(positive(contact_speed or 0.0, "contact_speed", "m/s"))
    limit = positive(impact_force, "impact_force", "N")
    if impact is None:
        raise InvalidInputError("impact: found none, which a design by impact_force needs, such as SpringImpact")
    return _last(lambda w: np.asarray(impact.peak_force(w)) <= limit, speed)


def _last(keeps: Callable[[FloatArray], Any], high: float) -> float:
    """Return the largest number up to `high` that keeps a limit which the numbers from some one on do not keep."""
    low = 0.0
    if bool(keeps(np.array([high]))[0]):
        return high
    while high - low > _CLOSE * high:
        grid = np.linspace(low, high, _PARTS)[1:-1]
        kept = int(np.count_nonzero(keeps(grid)))
        ends = np.array([low, *grid, high])
        if ends[kept] == low and ends[kept + 1] == high:
            break
        low, high = float(ends[kept]), float(ends[kept + 1])
    return low


def strongest_by_excursion(  # noqa: PLR0917
    sensor: SensorModel, distance: float, mass: float, limit: float, speed: float = 1.0, push: float = 0.0
) -> float:
    """Find the strongest drag by its excursion E, which grows with phi, and convexly: by secants that enclose it.

    ln(1 + E/l_d) is nearly linear in phi. By the convexity, E falls by no less a share than phi does.

    Args:
        sensor: the sensor curve.
        distance: l_d [m].
        mass: M [kg].
        limit: the largest excursion [m].
        speed: of the approach [m/s], of no consequence without a push.
        push: the acceleration of the object toward the plant >= 0 [m/s^2].

    Returns:
        phi [N s^2].

    Raises:
        InvalidInputError: even the strongest drag that is looked at keeps the limit.
    """
    one = float(positive(mass, "mass", "kg") / slope_integral(sensor, distance))  # whose ratio is 1/e
    strongest = one * math.log(1 / _STRONGEST)

    def excursion(drag: float) -> float:
        return -float(encounter(sensor, mass, distance, drag, speed, push).end.displacement)

    def beyond(found: float) -> float:
        return math.log((distance + found) / (distance + limit))

    low, under, last = 0.0, beyond(0.0), 0.0
    high = min(one * math.log1p(2 * limit / distance), strongest)
    while (over := beyond(excursion(high))) <= 0:
        if high == strongest:
            raise InvalidInputError(
                f"excursion: found a limit of {limit:g} m that even a ratio of {_STRONGEST:g} keeps; choose the drag "
                "by its ratio"
            )
        low, under, high = high, over, min(2 * high, strongest)
    for _ in range(_PASSES):
        drag = min(max(high - over * (high - low) / (over - under), low), high)
        found = excursion(drag)
        if abs(found / limit - 1) <= _CLOSE or high - low <= _CLOSE * high:
            break
        more = beyond(found)
        again = last * more > 0  # the same end moves a second time: the other one counts half (Illinois)
        last = more
        if more > 0:
            high, over, under = drag, more, under / 2 if again else under
        else:
            low, under, over = drag, more, over / 2 if again else over
    return drag * (1 - max(found / limit - 1, 0.0))


def strongest_by_peak(sensor: SensorModel, distance: float, mass: float, limit: float) -> float:
    """Find the strongest drag by its peak acceleration over v^2, which is not monotone in phi.

    The peak is the largest over l of k g^2 exp(-2 k int g^2): in ln k, none of these rises faster than ln k itself. So
    from a drag that exceeds the limit by a factor, all down to this factor weaker exceed it as well: going down by it
    never passes a drag that keeps the limit. All above limit / g(l_d)^2 exceed it at detection.

    Args:
        sensor: the sensor curve.
        distance: l_d [m].
        mass: M [kg].
        limit: the largest acceleration over the square of the speed [1/m].

    Returns:
        phi [N s^2].

    Raises:
        InvalidInputError: even the strongest drag that is looked at keeps the limit, or a peak just touches it.
    """
    strongest = float(positive(mass, "mass", "kg") * math.log(1 / _STRONGEST) / slope_integral(sensor, distance))
    slope = float(sensor.log_slope(distance))
    top = mass * limit / slope**2 if slope else math.inf

    def peaks(drag: FloatArray) -> FloatArray:
        return np.asarray(encounter(sensor, mass, distance, drag, 1.0, 0.0).end.largest_acceleration)

    high = min(top, strongest)
    excess, steepness = math.log(float(peaks(np.array([high]))[0]) / limit), 0.5
    if high == strongest < top and excess <= 0:
        raise InvalidInputError(
            f"acceleration: found a limit that even a ratio of {_STRONGEST:g} keeps; choose the drag by its ratio"
        )
    for _ in range(_PASSES):
        if excess <= _MET:
            return float(high * math.exp(-max(excess, 0.0)))
        steps = 0.9 * excess * (1 - 0.95 * steepness) ** np.arange(_PARTS)
        grid = high * np.exp(-np.cumsum(steps))
        beyond = np.log(peaks(grid) / limit)
        end = int(np.argmin(np.append(beyond[:-1] >= steps[1:], False)))  # up to here each proves all down to the next
        steepness = float(np.clip((excess - beyond[end]) / math.log(high / grid[end]), 0.0, 1.0))
        high, excess = float(grid[end]), float(beyond[end])
    raise InvalidInputError(
        f"acceleration: found a limit of {limit:g}/m times v^2, which the peak of some drag touches; change it a little"
    )
