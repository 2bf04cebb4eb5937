"""Find the virtual drag with which a quantity, such as the excursion of the robot, just reaches its limit."""

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

from ..impact import ImpactModel

_STRONGEST: Final = 1e-9  # ratio of the strongest drag that is searched; an object is practically stopped by it
_PARTS: Final = 33
_CLOSE: Final = 1e-13
_MET: Final = 1e-12
_PASSES: Final = 200
_FOREVER: Final = 1e300
_UNITS: Final = {"ratio": "", "excursion": "m", "acceleration": "m/s^2", "contact_speed": "m/s", "impact_force": "N"}


@dataclass(frozen=True, slots=True, kw_only=True)
class DragEffect(Value):
    """The requirement by which a virtual drag is chosen, such as a largest excursion or contact speed.

    Exactly one effect is given. It refers to an object in uniform motion.

    A limit on excursion or acceleration gives the strongest drag that meets it; a limit on contact speed or impact
    force gives the weakest. Ratio and excursion hold at every speed, the other limits up to a largest approach speed.

    Args:
        ratio: rho, contact speed over approach speed, in (0, 1]; or an array.
        excursion: the largest excursion at contact [m].
        acceleration: the largest acceleration [m/s^2].
        contact_speed: the largest contact speed [m/s].
        impact_force: the largest peak force of the impact [N].
        largest_speed: the largest approach speed [m/s]; None for that of the task.

    Raises:
        InvalidInputError: there is not exactly one effect, or a number is out of range.
    """

    ratio: ArrayLike | None = None
    excursion: float | None = None
    acceleration: float | None = None
    contact_speed: float | None = None
    impact_force: float | None = None
    largest_speed: float | None = None

    def __post_init__(self) -> None:
        check_types(self)
        names = [name for name in _UNITS if getattr(self, name) is not None]
        if len(names) != 1:
            raise InvalidInputError(f"drag: found {', '.join(names) or 'nothing'}, expected one of {', '.join(_UNITS)}")
        (name,) = names
        value = positive(getattr(self, name), name, _UNITS[name])
        if name == "ratio" and np.max(value) > 1:
            raise InvalidInputError(
                f"ratio: found {np.max(value):g}, expected a positive number up to 1, because a virtual drag "
                "reduces the speed"
            )
        if self.largest_speed is not None:
            positive(self.largest_speed, "largest_speed", "m/s")

    @property
    def chosen(self) -> tuple[str, Any, str]:
        """Name, value and SI unit of the quantity that the drag must reach, such as the excursion."""
        return next((f.name, v, _UNITS[f.name]) for f in fields(self) if (v := getattr(self, f.name)) is not None)

    def drag(
        self, sensor: SensorModel, distance: float, mass: float, impact: ImpactModel | None = None
    ) -> tuple[Any, float]:
        """Find the virtual drag that meets this requirement for an approaching object.

        Args:
            sensor: the sensor curve, which must be valid down to contact.
            distance: detection distance l_d [m].
            mass: M of the virtual object [kg].
            impact: the impact model, which gives the force from the contact speed; for `impact_force`.

        Returns:
            phi [N s^2], and the approach speed [m/s] up to which the limit is met.

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
                "largest_speed: the largest approach speed [m/s] is missing, but designing a virtual drag for a "
                f"limit of the {self.chosen[0]} needs this speed"
            )
        else:
            speed = self.largest_speed
            if self.acceleration is not None:
                return strongest_by_peak(sensor, distance, mass, self.acceleration / speed**2), speed
            rho = np.asarray(min(1.0, allowed_speed(self.contact_speed, self.impact_force, impact, speed) / speed))
        return positive(mass, "mass", "kg") * np.log(1 / rho) / slope_integral(sensor, distance), speed


def encounter(  # noqa: PLR0917
    sensor: SensorModel, mass: Any, distance: Any, drag: Any, speed: Any, push: Any
) -> ContactResult:
    """Compute approaches toward a robot at rest on which only the virtual drag acts.

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
    contact_speed: float | None, impact_force: float | None, impact: ImpactModel | None, speed: float
) -> float:
    """Return the largest allowed contact speed [m/s], computed from a limit of the contact speed or the impact force.

    Args:
        contact_speed: the limit of the contact speed [m/s]; or None.
        impact_force: the largest peak force [N]; used instead of the contact speed unless None.
        impact: the impact model, which gives the force from the contact speed.
        speed: the approach speed [m/s], which the result does not exceed.

    Returns:
        The speed [m/s].

    Raises:
        InvalidInputError: a limit is not a positive number, or there is a force without an impact model.
    """
    if impact_force is None:
        return float(positive(contact_speed or 0.0, "contact_speed", "m/s"))
    limit = positive(impact_force, "impact_force", "N")
    if impact is None:
        raise InvalidInputError(
            "impact: found none, expected an impact model for a design by impact_force, such as SpringImpact"
        )
    return _last(lambda w: np.asarray(impact.peak_force(w)) <= limit, speed)


def _last(keeps: Callable[[FloatArray], Any], high: float) -> float:
    """Return the largest number up to `high` for which a condition is true, by repeated refinement of a grid."""
    low = 0.0
    if bool(keeps(np.array([high]))[0]):
        return high
    while high - low > _CLOSE * high:
        grid = np.linspace(low, high, _PARTS)[1:-1]
        count = int(np.count_nonzero(keeps(grid)))
        ends = np.array([low, *grid, high])
        if ends[count] == low and ends[count + 1] == high:
            break
        low, high = float(ends[count]), float(ends[count + 1])
    return low


def strongest_by_excursion(  # noqa: PLR0917
    sensor: SensorModel, distance: float, mass: float, limit: float, speed: float = 1.0, push: float = 0.0
) -> float:
    """Find the strongest virtual drag whose excursion E stays within a limit, by a bracketing secant method.

    E is convex and increasing in phi, and ln(1 + E/l_d) is nearly linear. By convexity, reducing phi by a share reduces
    E by at least the same share.

    Args:
        sensor: the sensor curve.
        distance: l_d [m].
        mass: M [kg].
        limit: the largest excursion [m].
        speed: approach speed [m/s]; it has no effect if the push is 0.
        push: the acceleration of the object toward the plant >= 0 [m/s^2].

    Returns:
        phi [N s^2].

    Raises:
        InvalidInputError: even the strongest searched drag meets the limit.
    """
    unit = float(positive(mass, "mass", "kg") / slope_integral(sensor, distance))  # the drag of the ratio 1/e
    strongest = unit * math.log(1 / _STRONGEST)

    def excursion(drag: float) -> float:
        return -float(encounter(sensor, mass, distance, drag, speed, push).end.displacement)

    def excess(value: float) -> float:
        return math.log((distance + value) / (distance + limit))

    low, under, last = 0.0, excess(0.0), 0.0
    high = min(unit * math.log1p(2 * limit / distance), strongest)
    while (over := excess(excursion(high))) <= 0:
        if high == strongest:
            raise InvalidInputError(
                f"excursion: the limit of {limit:g} m is too large to choose a virtual drag, because even the "
                f"strongest drag of the search, with the speed ratio {_STRONGEST:g}, stays below the limit; "
                "choose the drag by its speed ratio instead"
            )
        low, under, high = high, over, min(2 * high, strongest)
    for _ in range(_PASSES):
        drag = min(max(high - over * (high - low) / (over - under), low), high)
        value = excursion(drag)
        if abs(value / limit - 1) <= _CLOSE or high - low <= _CLOSE * high:
            break
        more = excess(value)
        again = last * more > 0  # the same end moves a second time; the weight of the other end is then halved
        last = more
        if more > 0:
            high, over, under = drag, more, under / 2 if again else under
        else:
            low, under, over = drag, more, over / 2 if again else over
    return drag * (1 - max(value / limit - 1, 0.0))


def strongest_by_peak(sensor: SensorModel, distance: float, mass: float, limit: float) -> float:
    """Find the strongest virtual drag whose peak acceleration per squared approach speed stays within a limit.

    This peak is not monotone in phi.

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
        phi [N s^2].

    Raises:
        InvalidInputError: even the strongest searched drag meets the limit, or the peak of a drag equals the limit.
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
            f"acceleration: the limit of {limit:g} 1/m on acceleration divided by squared approach speed "
            "is too large to choose a virtual drag, because even the strongest drag of the search, with "
            f"the speed ratio {_STRONGEST:g}, stays below the limit; choose the drag by its speed ratio "
            "instead"
        )
    for _ in range(_PASSES):
        if excess <= _MET:
            return float(high * math.exp(-max(excess, 0.0)))
        steps = 0.9 * excess * (1 - 0.95 * steepness) ** np.arange(_PARTS)
        grid = high * np.exp(-np.cumsum(steps))
        beyond = np.log(peaks(grid) / limit)
        end = int(
            np.argmin(np.append(beyond[:-1] >= steps[1:], False))
        )  # up to here no drag between grid points can meet it
        steepness = float(np.clip((excess - beyond[end]) / math.log(high / grid[end]), 0.0, 1.0))
        high, excess = float(grid[end]), float(beyond[end])
    raise InvalidInputError(
        f"acceleration: the search for a virtual drag failed for a limit of {limit:g} 1/m on "
        "acceleration divided by squared approach speed; change the limit slightly"
    )
