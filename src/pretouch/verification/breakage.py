"""Simulate sensors that fail during an approach, and find settings of the controller that prevent harm."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.progress import note_work
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.control import Controller, VirtualDamper, VirtualDrag
from pretouch.control.laws import release_for_noise
from pretouch.simulation import ClosedLoop, Disturbance, SimulationResult

from .appraisal import Draws
from .changed_loop import rounded_up, with_settings
from .effect import contact_speeds

PLACES: Final = (0.9, 0.7, 0.5, 0.3, 0.1)  # shares of the start distance at which a disturbance begins
_RUNS: Final = 8  # encounters for each disturbance, which the compiled loop runs side by side
_HARDER: Final = 0.02  # share of a speed; a smaller increase does not count
_LEAST: Final = 1e-3  # m/s: a smaller increase does not count either
_LEAST_RELEASE: Final = 0.01  # of ln xi, for readings without noise
_FACTOR: Final = 2.0  # step of the reflectance
_CRITICAL: Final = 1e-8  # 1 - zeta^2: the exponent differs from that of critical damping by less
_STUCK: Final = "readings that are stuck"


@dataclass(frozen=True, slots=True, kw_only=True)
class BreakageResult(Value):
    """Simulated runs in which one kind of disturbance begins at several distances.

    Args:
        name: the disturbance in words.
        speed: the largest speed of the robot toward the object, beyond that of the reference [m/s].
        distance: the distance at which the disturbance with this speed begins [m].
        contact_speed: largest |l'| at contact [m/s]; None if no run ends in contact.
        harder_than_unmitigated: number of runs in which contact is harder than in the same run without mitigation.
        harder: number of those of them in which contact is also harder than if the readings were stuck from any of
            these distances on. A better check of the readings can prevent only these.
        increase: largest increase of |l'| at contact, compared with no mitigation [m/s]; 0 if no contact is harder.
        runs: number of runs.
    """

    name: str
    speed: float
    distance: float
    contact_speed: float | None
    harder_than_unmitigated: int
    harder: int
    increase: float
    runs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Breakage(Value):
    """What the robot does if its sensor fails during an approach.

    Readings that are stuck cause no force, so that only the admittance moves the robot, back to its reference. The
    other disturbances are compared with this motion, which no check of the readings can prevent.

    Args:
        results: the results of each kind of disturbance.
        speed: the largest speed toward the object in all these runs [m/s].
        returning: the largest speed toward the object if the readings are stuck [m/s].
        jump: the largest speed that a single believed jump of the readings can cause [m/s], |D_p| largest_rate
            (T_s + fade_time / 2) / M; 0 for a law that never pulls, None for a damper without largest_rate.
        return_rate: the largest speed of the admittance back to its reference, as a share of the excursion before
            [1/s], see `return_rate`.
        excursion: the largest excursion in all these runs [m].
        remedy: settings of the controller with which no contact is harder; empty if none is needed or known.
    """

    results: tuple[BreakageResult, ...]
    speed: float
    returning: float
    return_rate: float
    excursion: float
    jump: float | None = None
    remedy: str = ""

    @property
    def bound(self) -> float | None:
        """The largest speed toward the object after an excursion as in these runs [m/s]; None without a bound.

        It is the speed that a jump of the readings can cause, and that of the return to the reference.
        """
        return None if self.jump is None else self.jump + self.return_rate * self.excursion

    @property
    def harder(self) -> int:
        """The number of runs in which contact is harder than without mitigation, and than with stuck readings."""
        return sum(one.harder for one in self.results)

    @property
    def harder_than_unmitigated(self) -> int:
        """The number of runs in which contact is harder than without mitigation."""
        return sum(one.harder_than_unmitigated for one in self.results)

    @property
    def is_prevented_by_rate(self) -> bool:
        """True if largest_rate alone prevents a harder contact."""
        return self.remedy.startswith("set largest_rate")

    @property
    def runs(self) -> int:
        """The number of runs with a disturbance."""
        return sum(one.runs for one in self.results)

    @property
    def worst(self) -> BreakageResult:
        """The kind of disturbance that makes contact most harder; otherwise, the one with the largest speed.

        Kinds that are worse than stuck readings come first.
        """
        return max(self.results, key=lambda one: (one.harder > 0, one.increase, one.speed))

    @property
    def text(self) -> str:
        """A sentence on the motion of the robot if the sensor fails."""
        speed = format_quantity(max(self.speed, 0.0), "m/s", 3)
        text = f"If the sensor fails, the robot moves toward the object at up to {speed}"
        hardest = max(self.results, key=lambda one: one.increase)
        more, share = format_quantity(hardest.increase, "m/s", 3), f"{self.harder_than_unmitigated} of {self.runs} runs"
        if self.harder:
            return (
                f"{text}, and in {share}, contact is up to {more} harder than without mitigation, most with "
                f"{hardest.name}"
            )
        back = ", back to its reference" if self.returning > 0 else ""
        limit = f" (bound {format_quantity(self.bound, 'm/s', 3)})" if self.bound else ""
        if not self.harder_than_unmitigated:
            return f"{text}{back}{limit}. In {self.runs} runs, contact is never harder than without mitigation"
        return f"{text}{back}{limit}. In {share}, contact is up to {more} harder than without mitigation"


def return_rate(admittance: Any) -> float:
    """Return the largest speed of an admittance back to its reference, as a share of the excursion before [1/s].

    A spring of stiffness K returns the mass M from the largest excursion at a speed of at most
    omega exp(-zeta arccos(zeta) / sqrt(1 - zeta^2)) times this excursion, with omega = sqrt(K / M) and the damping
    ratio zeta. A force away from the object only makes the return slower.

    Args:
        admittance: mass [kg], damping [N s/m] and stiffness [N/m].

    Examples:
        >>> from pretouch.motion import Admittance
        >>> round(return_rate(Admittance(mass=1.0, damping=10.0, stiffness=25.0)), 3)  # 5 rad/s / e
        1.839
    """
    mass, damping, stiffness = (float(getattr(admittance, name)) for name in ("mass", "damping", "stiffness"))
    if not stiffness:
        return 0.0
    frequency = math.sqrt(stiffness / mass)
    ratio = damping / (2 * math.sqrt(stiffness * mass))
    square = 1 - ratio**2
    if abs(square) < _CRITICAL:
        exponent = 1.0
    elif square > 0:
        exponent = ratio * math.acos(ratio) / math.sqrt(square)
    else:
        exponent = ratio * math.acosh(ratio) / math.sqrt(-square)
    return frequency * math.exp(-exponent)


def check_breakage(draws: Draws, gain: float, unmitigated: SimulationResult, largest_rate: float) -> Breakage | None:
    """Simulate encounters in which the sensor fails.

    Args:
        draws: the encounters; the first few are simulated.
        gain: the verified gain.
        unmitigated: the same encounters without mitigation.
        largest_rate: the largest plausible rate of ln xi, for a controller without this limit [1/s].

    Returns:
        The results; None for a control law other than those of pretouch.
    """
    loop = draws.task.loop
    if not isinstance(loop.law, Controller) or not gain:
        return None
    note_work("simulating sensors that fail")
    breakage = _simulated(loop, draws, gain, unmitigated)
    if not breakage.harder or not isinstance(loop.law.law, VirtualDamper):
        return breakage
    for text, guarded in _guards(loop, largest_rate):
        if not _simulated(guarded, draws, gain, unmitigated).harder:
            return replace(breakage, remedy=text)
    return breakage


def _guards(loop: ClosedLoop, largest_rate: float) -> Iterator[tuple[str, ClosedLoop]]:
    """Yield settings of the controller against failing sensors, with the least restrictive first."""
    controller: Any = loop.law
    conditioning, law, chain = controller.conditioning, controller.law, loop.chain
    rate = float(f"{largest_rate:.3g}")
    if conditioning.largest_rate is None or conditioning.largest_rate > rate:
        limited = with_settings(loop, conditioning={"largest_rate": rate})
        yield f"set largest_rate of the controller to {format_quantity(rate, '1/s')}", limited
    if not law.approach_only:
        noise = chain.additive_noise
        release = release_for_noise(conditioning.floor, noise, chain.relative_noise)
        only = replace(law, approach_only=True, release=rounded_up(max(release, _LEAST_RELEASE)))
        text = f"set approach_only = true and release = {only.release:g} in [controller]"
        yield text, replace(loop, law=replace(controller, law=only))


def _simulated(loop: ClosedLoop, draws: Draws, gain: float, unmitigated: SimulationResult) -> Breakage:
    """Simulate each kind of disturbance from several distances on."""
    controller: Any = loop.law
    count = min(_RUNS, draws.task.verify.runs)
    free = contact_speeds(unmitigated)[:count]
    places = [place * float(draws.distance[:count].mean()) for place in PLACES]
    short = replace(loop, follow_time=min(loop.follow_time, loop.law.period))
    stuck, back, farthest = _runs(
        short, draws, gain, count, [Disturbance(kind="stuck", distance=place) for place in places]
    )
    usual = np.maximum(stuck.max(axis=0), free)
    results, excursion = [], float(farthest.max())
    for name, kind in _kinds(loop):
        ones = [Disturbance(distance=place, **kind) for place in places]
        speeds, advances, farthest = _runs(short, draws, gain, count, ones)
        excursion = max(excursion, float(farthest.max()))
        harder, above = speeds > (1 + _HARDER) * usual + _LEAST, speeds > (1 + _HARDER) * free + _LEAST
        largest = float(speeds.max())
        results.append(
            BreakageResult(
                name=name,
                speed=float(advances.max()),
                distance=places[int(np.unravel_index(advances.argmax(), advances.shape)[0])],
                contact_speed=largest if largest > 0 else None,
                harder_than_unmitigated=int(above.sum()),
                harder=int(harder.sum()),
                increase=float((speeds - free)[above].max(initial=0.0)),
                runs=speeds.size,
            )
        )
    return Breakage(
        results=tuple(results),
        speed=max(one.speed for one in results),
        returning=float(back.max()),
        return_rate=return_rate(controller.admittance),
        excursion=excursion,
        jump=_jump(loop, gain),
    )


def _runs(
    loop: ClosedLoop, draws: Draws, gain: float, count: int, disturbances: list[Disturbance]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Simulate encounters with each disturbance.

    Returns:
        The speed at contact, the largest speed toward the object [m/s], and the largest excursion [m], with a row for
        each disturbance.
    """
    speeds, advances, excursions = [], [], []
    for one in disturbances:
        chain = replace(loop.chain, disturbances=(*loop.chain.disturbances, one))
        result = draws.run(replace(loop, chain=chain), gain, count)
        speeds.append(contact_speeds(result))
        advances.append(np.asarray(result.largest_advance))
        excursions.append(np.asarray(result.largest_excursion))
    return np.stack(speeds), np.stack(advances), np.stack(excursions)


def _kinds(loop: ClosedLoop) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the kinds of disturbances that the sensor can have, in words and as arguments."""
    yield "a broken cable (readings of 0)", {"kind": "cable"}
    yield "an object that leaves the beam", {"kind": "object-leaves"}
    if not loop.chain.measures_distance:
        yield f"a reflectance that is {_FACTOR:g} times as large", {"kind": "reflectance", "factor": _FACTOR}
        yield f"a reflectance that is {1 / _FACTOR:g} times as large", {"kind": "reflectance", "factor": 1 / _FACTOR}
    if math.isfinite(loop.chain.highest):
        yield "readings at full scale", {"kind": "full-scale"}
    yield _STUCK, {"kind": "stuck"}


def _jump(loop: ClosedLoop, gain: float) -> float | None:
    """Return the speed that a jump of the readings can cause if it is just plausible [m/s]."""
    controller: Any = loop.law
    law, rate = controller.law, controller.conditioning.largest_rate
    if isinstance(law, VirtualDrag) or getattr(law, "approach_only", False):
        return 0.0
    if rate is None or not isinstance(law, VirtualDamper):
        return None
    period: float = controller.conditioning.numbers(controller.period).sensor_period
    # if the next reading is late or implausible, the force continues and fades
    fading = controller.period / controller.conditioning.fade_step(controller.period)
    jump: float = abs(gain) * rate * (period + fading / 2) / controller.admittance.mass
    return jump


def breakage_in_words(breakage: Breakage | None) -> Iterator[str]:
    """Yield a warning if a failing sensor makes contact harder than without mitigation."""
    if breakage is None or not breakage.harder:
        return
    remedy = f": {breakage.remedy}" if breakage.remedy else ""
    ending = (
        "." if breakage.remedy else ". No tried setting of the controller prevents this: detect the failure in time."
    )
    worst = breakage.worst
    where = format_quantity(worst.distance, "m", 3)
    yield caution(
        "PT419",
        f"A sensor that fails makes contact harder than without mitigation{remedy}{ending} In "
        f"{breakage.harder_than_unmitigated} of {breakage.runs} runs, contact is harder, by up to "
        f"{format_quantity(worst.increase, 'm/s', 3)} with {worst.name}. The robot moves toward the object at up to "
        f"{format_quantity(worst.speed, 'm/s', 3)}, if this "
        f"begins at a distance of {where}.",
    )
