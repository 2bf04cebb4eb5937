"""Stability limits of the sampled loop: the largest stable gain for a sensor, and the lowest sensor rate for a gain."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
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

_PLACES: Final = 65  # at which an encounter is linearized, contact and start included
_PER_DECADE: Final = 12  # rates of the scan for the lowest one
_SLOWEST: Final = 1e-6  # Hz
_PLENTY: Final = 100.0  # times the rate of an undelayed mass: the period then adds a hundredth to what a delay does
_FASTEST: Final = 1e6  # Hz: no proximity sensor reads faster, and what is held for milliseconds has thousands of parts


@dataclass(frozen=True, slots=True, kw_only=True)
class DampingLimit(Value):
    """The largest damping d, such as D_p g, with which the sampled loop is stable, at any distance.

    Args:
        damping: the limit [N s/m]; infinite where no damping makes the loop unstable, 0 where any does, however weak:
            a spring without damping that is pushed too late, or a robot whose own loop is unstable.
        frequency: at which the loop oscillates there [Hz]; NaN where there is no limit.
        radius_below: spectral radius of the closed loop at 0.999 of the limit, by its eigenvalues; where forces act
            beyond 300 periods after their readings, the modulus of the one eigenvalue that leaves the unit circle.
            NaN for a limit of 0.
        radius_above: the same at 1.001 of the limit: the limit lies between. For a limit of 0, that of the growing
            eigenvalue right after 0.
        delay: from reading to force, with which it is the limit [s]: the worst of the range of the timing.
    """

    damping: float
    frequency: float
    radius_below: float
    radius_above: float
    delay: float = math.nan

    @property
    def is_certified(self) -> bool:
        """Whether the eigenvalues confirm that the loop is stable below the limit and not above it."""
        if self.damping == 0:
            return self.radius_above > 1
        return self.radius_below < 1 < self.radius_above or math.isinf(self.damping)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainLimit(Value):
    """The number of a law with the largest magnitude with which the loop is stable, at each distance.

    Args:
        distance: l [m], shape (n,).
        gain: the strongest stable number at each, shape (n,): D_p < 0 [N s] of a damper, phi > 0 [N s^2] of a drag;
            infinite where it damps nothing, and 0 where no damping is stable.
        damping: the largest damping, the same at all distances.
        law: the law whose number it is.
    """

    distance: FloatArray
    gain: FloatArray
    damping: DampingLimit
    law: ContinuousLaw = DAMPER

    @property
    def strongest(self) -> float:
        """The strongest number that is stable at every distance, that of the smallest magnitude [N s for a damper]."""
        return float(self.gain[np.abs(self.gain).argmin()])

    @property
    def critical_distance(self) -> float:
        """The distance [m] that allows the least."""
        return float(self.distance[np.abs(self.gain).argmin()])

    def allowed(self, margin: float = 2.0) -> float:
        """Return the largest |D_p| that keeps a margin to instability: the limit of a `Constraint(name="gain")`.

        Args:
            margin: how many times the number could grow until the loop is unstable, > 1; 2 is the usual 6 dB.

        Returns:
            The magnitude [N s for a damper]; infinite where none makes the loop unstable, 0 where any does.

        Raises:
            InvalidInputError: the margin does not exceed 1.
        """
        if not finite(margin, "margin") > 1:
            raise InvalidInputError(f"margin: found {margin:g}, which must exceed 1")
        return abs(self.strongest) / margin

    def bounds(self, *, margin: float = 2.0, weakest: float = -1e-3) -> tuple[float, float]:
        """Return bounds of the number that keep the margin of `allowed`; none left is refused."""
        n, unit = self.law.number, pretty_unit(self.law.number.unit)
        strongest = n.sign * self.allowed(margin)
        if not 0 < n.sign * finite(weakest, "weakest", n.unit) < n.sign * strongest:
            raise InvalidInputError(
                f"weakest: found {weakest:g} {unit}, which must lie between the strongest {n.name} with this margin, "
                f"{strongest:g} {unit}, and 0; a faster sensor allows stronger {n.name}s"
            )
        return min(strongest, weakest), max(strongest, weakest)


def passed_distances(sensor: SensorModel, farthest: float) -> FloatArray:
    """Return distances that are passed from its farthest start to contact [m], ascending, as far as a curve holds."""
    low, high = sensor.valid_range
    first = max(low, 0.0)
    return np.linspace(first, max(min(farthest, high), first), _PLACES)


def passage(
    law: ContinuousLaw, scenario: Scenario, sensor: SensorModel, value: float, farthest: float
) -> tuple[FloatArray, FloatArray | None]:
    """Return distances that an encounter passes [m], and the predicted l' there [m/s] where the damping follows it."""
    if law.degree == 1:
        return passed_distances(sensor, farthest), None
    motion = law.motion(scenario, sensor, value)
    return motion.distance, motion.relative_velocity


@check_arguments
def largest_damping(admittance: Admittance, timing: LoopTiming, *, plant: PlantModel | None = None) -> DampingLimit:
    """Find the largest damping d, as D_p g, for which the loop is stable: L(1) behind a sampler, a delay and a hold.

    The linear loop is discretized exactly; its eigenvalues reach the unit circle where 1 + d P(z) = 0 with P real and
    negative. The crossover of the phase of P with the smallest d is the limit, and the eigenvalues of the closed loop
    below and above it are its proof. An oscillation that is undamped without any force must be damped by a weak one.

    Args:
        admittance: one virtual admittance.
        timing: when the loop samples and acts.
        plant: the robot behind the virtual object; ideal by default. Its Coulomb friction is left out.

    Returns:
        The limit, with the frequency of the oscillation and its certificate.

    Valid for:
        One force per reading, held; jitter, noise and saturation are left out; a median counts as its delay. A delay
        that differs from run to run is tried at both ends and in the middle of its range, and refined where the worst
        is not the longest.

    Examples:
        A virtual mass alone, read without delay, is stable up to exactly 2 M / T:

        >>> limit = largest_damping(Admittance(mass=1.0, damping=0.0, stiffness=0.0), LoopTiming(rate=100.0))
        >>> round(limit.damping, 6)
        200.0
    """
    loop, first = worst_crossover(linear_plant(admittance, plant or IdealPlant()), timing)
    free = admittance.stiffness == 0  # the position is then a free integrator, that no force reads
    delay = loop.timing.delay
    if first is None:
        below = spectral_radius(loop, 0.0, free=free, beside=math.nan)
        return DampingLimit(
            damping=math.inf, frequency=math.nan, radius_below=below, radius_above=math.nan, delay=delay
        )
    d, angle, grown = first.damping, first.angle, math.exp(first.growth)
    return DampingLimit(
        damping=d,
        frequency=angle * timing.rate / (2 * math.pi),
        radius_below=spectral_radius(loop, 0.999 * d, free=free, beside=angle) if d > 0 else math.nan,
        radius_above=spectral_radius(loop, 1.001 * d, free=free, beside=angle) if d > 0 else grown,
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
    """Find the strongest number of a law with which the sampled loop is stable at each distance, linearized there.

    By default that is the D_p of L(1) with L(2). Of any law whose force is in proportion to its number, it is the
    largest damping over that of the number 1. While a drag acts it holds the admittance's pull off, so that its loop is
    that of the virtual mass alone.

    Args:
        sensor: the sensor curve.
        admittance: one virtual admittance.
        timing: when the loop samples and acts.
        distance: l [m], at which the loop is linearized: those that the encounter passes, contact included.
        plant: the robot behind the virtual object; ideal by default.
        law: the law in continuous time.
        relative_velocity: l' at each distance [m/s], of a law whose damping follows it, as that of the drag.

    Returns:
        The limits; their `allowed` is a constraint, and their `bounds` are bounds, of `design_gain`.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> admittance = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
        >>> limit = gain_limit(sensor, admittance, LoopTiming(rate=15.0), distance=[0.0, 0.02, 0.0422])
        >>> round(limit.strongest, 2), limit.critical_distance
        (-0.57, 0.0)
    """
    where, each, free = _frozen(law, sensor, admittance, distance, relative_velocity)
    limit = largest_damping(free, timing, plant=plant)
    gain = np.full(where.shape, math.inf)
    np.divide(limit.damping, each, out=gain, where=each > 0)
    return GainLimit(distance=where, gain=0.0 + law.number.sign * gain, damping=limit, law=law)


def _frozen(
    law: ContinuousLaw, sensor: SensorModel, admittance: Admittance, distance: ArrayLike, relative_velocity: Any
) -> tuple[FloatArray, FloatArray, Admittance]:
    """Return distances [m], the damping of the number 1 there, and what acts beside it; refuse what is not known."""
    where = np.atleast_1d(np.asarray(finite(distance, "distance", "m"), dtype=np.float64)).ravel()
    slope = np.abs(np.asarray(sensor.log_slope(where)))
    velocity = math.nan if relative_velocity is None else np.asarray(finite(relative_velocity, "relative_velocity"))
    each = np.abs(law.damping(1.0, -slope, velocity))
    if np.isnan(each).any() and relative_velocity is None:
        raise InvalidInputError(
            f"relative_velocity: found none, expected l' [m/s] at each distance: the damping of a {law.kind} follows it"
        )
    if np.isnan(each).any():
        raise InvalidInputError(f"law: found a {law.kind} whose damping is not known at every distance")
    free = replace(admittance, damping=0.0, stiffness=0.0) if getattr(law, "holds_off", False) else admittance
    return where, np.broadcast_to(each, where.shape), free


@check_arguments
def lowest_rate(
    sensor: SensorModel,
    admittance: Admittance,
    gain: float,
    *,
    distance: ArrayLike,
    timing_at: Callable[[float], LoopTiming] | None = None,
    plant: PlantModel | None = None,
    margin: float = 1.0,
    law: ContinuousLaw = DAMPER,
    relative_velocity: ArrayLike | None = None,
) -> float:
    """Find the lowest rate of the sensor above which a gain is stable at every distance and every rate.

    The limit on the gain does not only grow with the rate: it has minima. A gain near one of them is unstable between
    two rates, and stable again below; the upper of the two is what counts here. So the lowest rate jumps where a gain
    (or a delay, an exposure, a mass) passes the one at which such a minimum touches it.

    Args:
        sensor: the sensor curve.
        admittance: one virtual admittance.
        gain: the number of the law, one that mitigates: D_p < 0 [N s].
        distance: l [m], those that the encounter passes.
        timing_at: the timing for a rate [Hz]; without any delay by default. What follows the rate, such as a transfer
            that waits for the next period, belongs in it.
        plant: the robot behind the virtual object; ideal by default.
        margin: how many times the gain must be able to grow until the loop is unstable.
        law: the law in continuous time.
        relative_velocity: l' at each distance [m/s], of a law whose damping follows it, as that of the drag.

    Returns:
        The rate [Hz]; 0 where the gain is stable from 1e-6 Hz on, infinite where even a rate of a hundred times
            D_p g / (2 M) is too low, for then it is the delay or the plant that forbids the gain, or even a megahertz.

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
            f"gain: found {format_quantity(gain, number.unit)}, which must be {number.mitigating}: only such gains "
            "mitigate"
        )
    _, each, free = _frozen(law, sensor, admittance, distance, relative_velocity)
    wanted = positive(margin, "margin") * abs(gain) * float(each.max())
    make = timing_at or (lambda rate: LoopTiming(rate=rate))
    system = linear_plant(free, plant or IdealPlant())

    def spare(logarithm: float) -> float:
        _, found = worst_crossover(system, make(math.exp(logarithm)))
        limit = math.inf if found is None else found.damping
        return math.log(min(max(limit, 1e-300), 1e300) / wanted)

    top = math.log(min(_PLENTY * wanted / (2 * admittance.mass), _FASTEST))
    if spare(top) <= 0:
        return math.inf
    ends = _last_change(spare, top)
    if ends is None:
        return 0.0
    return math.exp(zero_between(spare, *ends, 1e-9))


def _last_change(spare: Callable[[float], float], top: float) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return the ends of an interval below `top` in which a function falls below 0, going down, with its values there.

    Where it has a minimum between three points of the scan that may be below 0, the minimum is sought.
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
