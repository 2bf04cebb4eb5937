"""Compute the strongest stable gain and the lowest stable sensor rate.

The gain is that of a sampled control loop. The rate is the lowest that a gain needs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive
from pretouch._core.units import format_quantity, pretty_unit
from pretouch._core.values import Value
from pretouch.motion import DAMPER, Admittance, ContinuousLaw, Scenario
from pretouch.sensors import SensorModel

from .chain import LoopTiming
from .linear_loop import spectral_radius, worst_crossover, zero_between
from .robot import IdealPlant, PlantModel, linear_plant

_PLACES: Final = 65  # distances at which an encounter is linearized, including contact and start
_PER_DECADE: Final = 12  # rates per decade in the scan for the lowest stable rate
_SLOWEST: Final = 1e-6  # Hz
_PLENTY: Final = 100.0  # times the lowest rate of an undelayed mass: the period then has 1 % of the effect of a delay
_FASTEST: Final = 1e6  # Hz: no proximity sensor is faster, and long forces would overlap thousands of readings


@dataclass(frozen=True, slots=True, kw_only=True)
class DampingLimit(Value):
    """The largest virtual damping with which the sampled control loop is stable.

    The damping d, such as D_p g, does not depend on the distance.

    Args:
        damping: the limit [N s/m]; infinite if no damping makes the loop unstable. It is 0 if every damping does,
            however weak: with an undamped spring and a late force, or with a robot whose own loop is unstable.
        frequency: frequency of the oscillation at the limit [Hz]; NaN without a limit.
        radius_below: spectral radius of the closed loop at 0.999 of the limit, by its eigenvalues. If forces act for
            more than 300 periods after their readings, it is the modulus of the eigenvalue that leaves the unit circle.
            NaN for a limit of 0.
        radius_above: the same at 1.001 of the limit, so that the limit lies between. For a limit of 0, the modulus of
            the eigenvalue that grows for the weakest damping.
        delay: delay from reading to force for which the limit was computed [s]: the worst in the range of the timing.
    """

    damping: float
    frequency: float
    radius_below: float
    radius_above: float
    delay: float = math.nan

    @property
    def is_certified(self) -> bool:
        """True if eigenvalues confirm the stability limit.

        The loop must be stable just below the limit, and unstable just above it.
        """
        if self.damping == 0:
            return self.radius_above > 1
        return self.radius_below < 1 < self.radius_above or math.isinf(self.damping)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainLimit(Value):
    """The strongest stable gain at each distance to the object.

    Up to this gain, the sampled control loop is stable.

    Args:
        distance: l [m], shape (n,).
        gain: the strongest stable gain at each distance, shape (n,): D_p < 0 [N s] of a damper, phi > 0 [N s^2] of a
            drag. It is infinite where the law does not damp, and 0 if no damping is stable.
        damping: the largest damping, the same at all distances.
        law: the law of the gain.
    """

    distance: FloatArray
    gain: FloatArray
    damping: DampingLimit
    law: ContinuousLaw = DAMPER

    @property
    def strongest(self) -> float:
        """The strongest gain with a stable loop at every distance.

        For a damper, it is D_p [N s].
        """
        return float(self.gain[np.abs(self.gain).argmin()])

    @property
    def critical_distance(self) -> float:
        """The distance [m] at which a stronger gain first causes instability."""
        return float(self.distance[np.abs(self.gain).argmin()])

    def allowed(self, margin: float = 2.0) -> float:
        """Return the largest gain magnitude with the required gain margin.

        It is the limit for a `Constraint(name="gain")`.

        Args:
            margin: gain margin, the factor by which the gain can grow until the loop is unstable, > 1; 2 is the usual
                6 dB.

        Returns:
            The magnitude [N s for a damper]; infinite if no gain makes the loop unstable, 0 if every gain does.

        Raises:
            InvalidInputError: the margin does not exceed 1.
        """
        if not finite(margin, "margin") > 1:
            raise InvalidInputError(f"margin: found {margin:g}, which must exceed 1", value=margin)
        return abs(self.strongest) / margin

    def bounds(self, *, margin: float = 2.0, weakest: float = -1e-3) -> tuple[float, float]:
        """Return bounds for gains with the required gain margin.

        All gains between the bounds have this margin.

        Raises:
            InvalidInputError: no gain has the margin.
        """
        n, unit = self.law.number, pretty_unit(self.law.number.unit)
        strongest = n.sign * self.allowed(margin)
        if not 0 < n.sign * finite(weakest, "weakest", n.unit) < n.sign * strongest:
            found, most = f"{weakest:g} {unit}", f"{strongest:g} {unit}"
            raise InvalidInputError(
                f"weakest: found {found}, expected a value between 0 and {most}. The value {most} is the strongest "
                f"{n.name} with the required gain margin. A faster sensor allows a stronger {n.name}",
                value=float(weakest),
                limit=(0.0, strongest),
            )
        return min(strongest, weakest), max(strongest, weakest)


def passed_distances(sensor: SensorModel, farthest: float) -> FloatArray:
    """Return equally spaced distances [m] between contact and initial distance.

    They lie within the usable range of the sensor.
    """
    low, high = sensor.valid_range
    first = max(low, 0.0)
    return np.linspace(first, max(min(farthest, high), first), _PLACES)


def passage(
    law: ContinuousLaw, scenario: Scenario, sensor: SensorModel, value: float, farthest: float
) -> tuple[FloatArray, FloatArray | None]:
    """Return the distances [m] and relative velocities of an encounter.

    The velocities are None unless the law's damping depends on them.
    """
    if law.degree == 1:
        return passed_distances(sensor, farthest), None
    motion = law.motion(scenario, sensor, value)
    return motion.distance, motion.relative_velocity


@check_arguments
def largest_damping(admittance: Admittance, timing: LoopTiming, *, plant: PlantModel | None = None) -> DampingLimit:
    """Find the largest stable virtual damping of the sampled loop.

    The damping is d [N s/m]. The loop consists of admittance and robot. The linear loop is discretized exactly. Its
    eigenvalues reach the unit circle where 1 + d P(z) = 0 with P real and negative. The phase crossover of P with the
    smallest d is the limit, and the eigenvalues of the closed loop below and above it prove it. If the loop has an
    undamped oscillation without force, a weak force must damp it.

    Args:
        admittance: one virtual admittance.
        timing: the timing of the loop.
        plant: the robot behind the virtual object; ideal by default. Its Coulomb friction is ignored.

    Returns:
        The limit, with the frequency of the oscillation and its certificate.

    Valid for:
        One constant force per reading. Jitter, noise and saturation are ignored; a median counts as its delay. A delay
        that differs between runs is tried at both ends and in the middle of its range, and refined if the worst is not
        the longest.

    Examples:
        A virtual mass alone, read without delay, is stable up to exactly 2 M / T:

        >>> limit = largest_damping(Admittance(mass=1.0, damping=0.0, stiffness=0.0), LoopTiming(rate=100.0))
        >>> round(limit.damping, 6)
        200.0
    """
    loop, first = worst_crossover(linear_plant(admittance, plant or IdealPlant()), timing)
    free = admittance.stiffness == 0  # the position is then a free integrator that does not affect any force
    delay = loop.timing.delay
    if first is None:
        below = spectral_radius(loop, 0.0, free=free, near=math.nan)
        return DampingLimit(
            damping=math.inf, frequency=math.nan, radius_below=below, radius_above=math.nan, delay=delay
        )
    d, angle, grown = first.damping, first.angle, math.exp(first.growth)
    return DampingLimit(
        damping=d,
        frequency=angle * timing.rate / (2 * math.pi),
        radius_below=spectral_radius(loop, 0.999 * d, free=free, near=angle) if d > 0 else math.nan,
        radius_above=spectral_radius(loop, 1.001 * d, free=free, near=angle) if d > 0 else grown,
        delay=delay,
    )


@check_arguments
def gain_limit(
    sensor: SensorModel,
    admittance: Admittance,
    timing: LoopTiming,
    *,
    distance: ArrayLike,
    plant: PlantModel | None = None,
    law: ContinuousLaw = DAMPER,
    relative_velocity: ArrayLike | None = None,
) -> GainLimit:
    """Find the strongest stable gain at each distance of an encounter.

    Up to this gain, the linearized loop is stable. By default it is the gain D_p of the admittance L(1) with the
    virtual force L(2). For any law with a force proportional to its gain, it is the largest damping over the damping of
    the gain 1. An active drag suspends spring and damping of the admittance, so its loop is that of the virtual mass
    alone.

    Args:
        sensor: the sensor curve.
        admittance: one virtual admittance.
        timing: the timing of the loop.
        distance: distances l of the encounter at which the loop is linearized [m], including contact.
        plant: the robot behind the virtual object; ideal by default.
        law: the law in continuous time.
        relative_velocity: l' at each distance [m/s], for a law whose damping depends on it, such as a drag.

    Returns:
        The limits; their `allowed` is a constraint, and their `bounds` are bounds, of `design`.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> admittance = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
        >>> limit = gain_limit(sensor, admittance, LoopTiming(rate=15.0), distance=[0.0, 0.02, 0.0422])
        >>> round(limit.strongest, 2), limit.critical_distance
        (-0.57, 0.0)
    """
    distances, damping_of_one, free = _linearize(law, sensor, admittance, distance, relative_velocity)
    limit = largest_damping(free, timing, plant=plant)
    gain = np.full(distances.shape, math.inf)
    np.divide(limit.damping, damping_of_one, out=gain, where=damping_of_one > 0)
    return GainLimit(distance=distances, gain=0.0 + law.number.sign * gain, damping=limit, law=law)


def _linearize(
    law: ContinuousLaw, sensor: SensorModel, admittance: Admittance, distance: ArrayLike, relative_velocity: Any
) -> tuple[FloatArray, FloatArray, Admittance]:
    """Return distances, virtual damping and admittance of the linearized loop; unknown damping is refused."""
    distances = np.atleast_1d(np.asarray(finite(distance, "distance", "m"), dtype=np.float64)).ravel()
    slope = np.abs(np.asarray(sensor.log_slope(distances)))
    velocity = math.nan if relative_velocity is None else np.asarray(finite(relative_velocity, "relative_velocity"))
    damping_of_one = np.abs(law.damping(1.0, -slope, velocity))
    if np.isnan(damping_of_one).any() and relative_velocity is None:
        raise InvalidInputError(
            "relative_velocity: found none, expected the relative velocity l' [m/s] at each distance. "
            f"The damping of the control law {law.kind} depends on this velocity"
        )
    if np.isnan(damping_of_one).any():
        raise InvalidInputError(
            f"law: the damping of the control law {law.kind} is unknown (NaN) at some distances, expected a number "
            "at every distance"
        )
    active = (
        replace(admittance, damping=0.0, stiffness=0.0) if getattr(law, "suspends_admittance", False) else admittance
    )
    return distances, np.broadcast_to(damping_of_one, distances.shape), active


@check_arguments
def lowest_rate(
    sensor: SensorModel,
    admittance: Admittance,
    gain: float,
    *,
    distance: ArrayLike,
    timing_at: Callable[[float], LoopTiming] | None = None,
    plant: PlantModel | None = None,
    margin: ArrayLike = 1.0,
    law: ContinuousLaw = DAMPER,
    relative_velocity: ArrayLike | None = None,
) -> Any:
    """Find the lowest sensor rate for a stable loop.

    At every higher rate, the loop with the given gain is stable at every distance. The limit on the gain does not
    always grow with the rate: it has local minima. A gain near a minimum is unstable between two rates, and stable
    again below the lower one; the result is the upper one. So the lowest rate jumps when a change of the gain, a delay,
    an exposure or a mass lets the gain pass such a minimum.

    Args:
        sensor: the sensor curve.
        admittance: one virtual admittance.
        gain: a mitigating gain of the law, such as D_p < 0 [N s].
        distance: distances l of the encounter [m].
        timing_at: function that returns the timing for a rate [Hz]; by default without delay. It includes delays that
            depend on the rate, such as a transfer that waits for the next period.
        plant: the robot behind the virtual object; ideal by default.
        margin: the required gain margin, one or several; several share one scan over the rates.
        law: the law in continuous time.
        relative_velocity: l' at each distance [m/s], for a law whose damping depends on it, such as a drag.

    Returns:
        The rate [Hz], with the shape of `margin`; 0 if the gain is stable from 1e-6 Hz on. The search ends at 1 MHz or
        at a hundred times D_p g / (2 M), multiplied by the largest margin, whichever is lower. If the gain is unstable
        there, the delay or the plant forbids it, and the result is infinite.

    Raises:
        InvalidInputError: the gain does not mitigate.

    Examples:
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> sensor = ExponentialFirstOrder(scale=0.458, rate=-61.0)
        >>> mass = Admittance(mass=1.0, damping=0.0, stiffness=0.0)
        >>> round(lowest_rate(sensor, mass, -1.0, distance=0.0), 3)  # |D_p g| / (2 M)
        30.5
    """
    number = law.number
    if not finite(gain, "gain", number.unit) * number.sign > 0:
        raise InvalidInputError(
            f"gain: found {format_quantity(gain, number.unit)}, which does not mitigate the impact. Values "
            f"that mitigate the impact are {number.mitigating}",
            value=gain,
        )
    _, damping_of_one, free = _linearize(law, sensor, admittance, distance, relative_velocity)
    required = np.asarray(positive(margin, "margin")) * abs(gain) * float(damping_of_one.max())
    if not required.size:
        raise InvalidInputError("margin: found an empty array, expected one margin or several")
    timing_of_rate = timing_at or (lambda rate: LoopTiming(rate=rate))
    system = linear_plant(free, plant or IdealPlant())
    highest = math.log(min(_PLENTY * float(required.max()) / (2 * admittance.mass), _FASTEST))

    @cache
    def log_limit(logarithm: float) -> float:
        _, crossover = worst_crossover(system, timing_of_rate(math.exp(logarithm)))
        limit = math.inf if crossover is None else crossover.damping
        return math.log(min(max(limit, 1e-300), 1e300))

    def rate(damping: float) -> float:
        def log_margin(logarithm: float) -> float:
            return log_limit(logarithm) - math.log(damping)

        if log_margin(highest) <= 0:
            return math.inf
        interval = _last_change(log_margin, highest)
        return 0.0 if interval is None else math.exp(zero_between(log_margin, *interval, 1e-9))

    rates = np.array([rate(float(damping)) for damping in required.ravel()]).reshape(required.shape)
    return rates if rates.ndim else float(rates)


def _last_change(spare: Callable[[float], float], top: float) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Find a function's last sign change below a given argument.

    If a minimum between three points of the scan may be negative, it is searched for.

    Returns:
        The interval at the highest argument below `top` in which the sign changes.
    """
    step = math.log(10) / _PER_DECADE
    above, at = (math.inf, math.inf), (top, spare(top))
    while at[0] > math.log(_SLOWEST):
        below = at[0] - step, spare(at[0] - step)
        change = max(above[1] - at[1], below[1] - at[1]) if at[1] < min(above[1], below[1]) < math.inf else 0.0
        if 0 < at[1] < change < math.inf:
            from scipy.optimize import minimize_scalar  # noqa: PLC0415 - heavy

            least = minimize_scalar(spare, bounds=(below[0], above[0]), method="bounded", options={"xatol": 1e-4})
            if least.fun <= 0:
                return (float(least.x), float(least.fun)), at if least.x < at[0] else above
        if below[1] <= 0:
            return below, at
        above, at = at, below
    return None
