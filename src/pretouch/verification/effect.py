"""Compare contact speeds of simulated runs with and without impact mitigation.

The speeds are also compared with those of an infinitely fast sensor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.control import Controller
from pretouch.motion import LawNumber
from pretouch.simulation import ClosedLoop, SimulationResult

from .changed_loop import NOISES, controller_at

OFTEN: Final = 0.05  # share of the runs above which harder contact counts as frequent
LOST: Final = 0.5  # share of the predicted mitigation; a loop that loses more fails
EFFECT: Final = 0.01  # a gain that changes the speed by less than this share has no effect
SIGNIFICANT: Final = 2.0  # standard errors: by chance, one in twenty differences exceeds them, half of these upward
_ALIKE: Final = 1e-9  # relative: the speeds of equal runs without noise differ by less
_SHOWN_SHARE: Final = 5e-4  # relative: a smaller change of a speed is not reported
_FAULTS: Final = ("jitter", "dropout", "misfit", "drift", "resolution", "distance_resolution")
_MOST: Final = 0.95  # share of the runs
_LEAST_SPEED: Final = 1e-9  # m/s: smaller speeds are not divided by
UNSEEN: Final = 5e-5  # relative: a smaller difference does not show in four digits


def contact_speeds(result: SimulationResult) -> FloatArray:
    """Return the speed at contact of each run, 0 without contact [m/s]."""
    return np.where(result.touched, np.abs(result.relative_velocity), 0.0)


def is_harder(run: SimulationResult, free: SimulationResult) -> bool:
    """Return True if contact in one run is harder with the gain than without mitigation."""
    return bool(contact_speeds(run) > contact_speeds(free) * (1 + UNSEEN))


def percent(share: float) -> str:
    """Return the magnitude of a relative change as a percentage.

    Below 100 %, the text has two digits.
    """
    size = abs(100 * share)
    return f"{size:.0f} %" if size >= 99.5 else f"{size:.2g} %"


def higher_in_words(excess: float, other: str = "") -> str:
    """Return a relative change of a speed in words.

    Examples:
        >>> higher_in_words(0.12, "predicted"), higher_in_words(5.39, "predicted"), higher_in_words(-0.22)
        ('12 % higher than predicted', '6.4 times as high as predicted', '22 % lower')
    """
    if excess >= 1:
        times = 1 + excess
        text, link = f"{times:.0f}" if times >= 99.5 else f"{times:.2g}", "as"
        text = f"{text} times as high"
    else:
        text, link = f"{percent(excess)} {'higher' if excess > 0 else 'lower'}", "than"
    return f"{text} {link} {other}" if other else text


class VerdictStatus(StrEnum):
    """Status of a verified gain, such as `holds`.

    A gain meets all requirements (holds), meets them narrowly, misses one, or does not exist.
    """

    HOLDS = "holds"
    HOLDS_NARROWLY = "holds-narrowly"
    DOES_NOT_HOLD = "does-not-hold"
    NO_GAIN = "no-gain"

    @property
    def is_passed(self) -> bool:
        """True if the gain meets its requirements, at least narrowly."""
        return self in {VerdictStatus.HOLDS, VerdictStatus.HOLDS_NARROWLY}

    @property
    def place(self) -> int:
        """Place among all statuses, 0 for the best one."""
        return list(VerdictStatus).index(self)

    @property
    def meaning(self) -> str:
        """A sentence that explains the status of the verified gain."""
        return {
            VerdictStatus.HOLDS: "Every limit was met as often as required, every predicted contact happened, and the "
            "gain margin is at least 2.",
            VerdictStatus.HOLDS_NARROWLY: "No requirement is missed in these runs, but at least one is nearly missed "
            "or not demonstrated.",
            VerdictStatus.DOES_NOT_HOLD: "A limit was missed, a predicted contact did not happen, contact is no softer "
            "than without mitigation, the loop is unstable, or the calibration is not good enough.",
            VerdictStatus.NO_GAIN: "There is no gain to verify.",
        }[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect(Value):
    """Change of the contact speed due to a gain.

    Values are averages over all simulated runs that end in contact. If the same run ends without contact at gain 0, its
    unmitigated speed counts as 0.

    Args:
        speed: mean |l'| with the gain [m/s].
        unmitigated: mean |l'| with D_p = 0 [m/s].
        difference: mean of speed - unmitigated speed, run by run [m/s].
        standard_error: standard error of `difference`; NaN for a single run.
        runs: number of runs.
        harder_count: number of runs in which contact is harder with the gain.
        predicted: mean |l'| in continuous time with a perfect sensor, over the runs for which a contact is
            predicted [m/s]; None if there are none.
        reached: mean |l'| with the gain over the same runs [m/s].

    Examples:
        >>> Effect(speed=0.39, unmitigated=0.3, difference=0.09, standard_error=0.01, runs=20).is_harder
        True
    """

    speed: float
    unmitigated: float
    difference: float
    standard_error: float
    runs: int
    harder_count: int = 0
    predicted: float | None = None
    reached: float | None = None

    @property
    def is_harder(self) -> bool:
        """True if the gain makes contact harder.

        Contact must be significantly harder on average, or harder in significantly more than half of the runs.
        Significant means more than two standard errors.
        """
        half = self.runs / 2
        return self.difference > self._chance or self.harder_count > half + SIGNIFICANT * math.sqrt(half / 2)

    @property
    def is_softer(self) -> bool:
        """True if the gain significantly reduces the mean contact speed.

        Significant means more than two standard errors.
        """
        return -self.difference > self._chance

    @property
    def is_absent(self) -> bool:
        """True if the gain has no effect on the contact speed.

        Contact is not harder, and the contact speed falls by less than 1 %.
        """
        return not self.is_harder and self.difference > -EFFECT * self.unmitigated

    @property
    def is_clear(self) -> bool:
        """True if the gain clearly makes contact softer.

        Contact is significantly softer on average, and harder in at most one run in 20.
        """
        return self.is_softer and self.harder_count <= OFTEN * self.runs

    @property
    def excess(self) -> float | None:
        """Relative difference between the simulated and the predicted contact speed.

        It is positive if the simulated speed is higher. Both speeds are means. None without a prediction.
        """
        return self.reached / self.predicted - 1 if self.predicted and self.reached is not None else None

    @property
    def lost(self) -> float:
        """Share of the predicted speed reduction lost in the sampled loop.

        0 if no speed reduction is predicted.
        """
        if self.predicted is None or self.reached is None or not self.predicted < self.unmitigated:
            return 0.0
        return (self.reached - self.predicted) / (self.unmitigated - self.predicted)

    def to_dict(self) -> dict[str, Any]:
        """Return the effect as one JSON object in SI units."""
        derived = {name: getattr(self, name) for name in ("is_harder", "is_absent", "excess", "lost")}
        return {**asdict(self), **derived}

    @property
    def _chance(self) -> float:
        chance = SIGNIFICANT * self.standard_error if math.isfinite(self.standard_error) else 0.0
        return max(chance, _ALIKE * self.unmitigated)


def effect_of(
    result: SimulationResult, unmitigated: SimulationResult, foreseen: FloatArray | None = None
) -> Effect | None:
    """Compare contact speeds with and without impact mitigation.

    Returns:
        The effect of the gain; None if no run ends in contact.
    """
    n, some = result.shape[0], result.touched
    if not some.any():
        return None
    speed, free = contact_speeds(result)[some], contact_speeds(unmitigated)[:n][some]
    difference, error = mean_and_error(speed - free)
    mean, without = float(speed.mean()), float(free.mean())
    promised = np.full(len(speed), np.nan) if foreseen is None else foreseen[:n][some]
    predictable = np.isfinite(promised)
    return Effect(
        speed=mean,
        unmitigated=without,
        difference=difference,
        standard_error=error,
        runs=len(speed),
        harder_count=int((speed > free * (1 + _ALIKE)).sum()),
        predicted=float(promised[predictable].mean()) if predictable.any() else None,
        reached=float(speed[predictable].mean()) if predictable.any() else None,
    )


def chase_in_words(number: LawNumber, gain: float | None) -> Iterator[str]:
    """Yield a warning if the gain has the wrong sign.

    With this sign, the robot chases the object.
    """
    if gain is not None and number.sign * gain < 0:
        text = f"{number.equals(gain)} makes the robot chase the object"
        yield f"{text}: mitigating {number.name}s are {number.mitigating}"


def mean_and_error(values: FloatArray) -> tuple[float, float]:
    """Return the mean over independent runs and its standard error.

    Both are NaN if a value is infinite or if there are no values. The error of a single value is NaN.
    """
    if not len(values) or not np.isfinite(values).all():
        return math.nan, math.nan
    error = float(np.std(values, ddof=1)) / np.sqrt(len(values)) if len(values) > 1 else math.nan
    return float(np.mean(values)), float(error)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSpeed(Value):
    """Contact speeds with the real and an infinitely fast sensor.

    Both speeds are simulated without noise.

    Args:
        rate: readings per second of the loop [Hz].
        speed: mean |l'| at contact on the loop [m/s].
        fast: mean |l'| with a reading for every step of the controller, without exposure and delay [m/s].
        excess: relative excess of the speed over that with the fast sensor: 95 % quantile over the runs; negative if
            contact is softer.
        tolerance: the allowed relative excess.

    Examples:
        >>> SensorSpeed(rate=60.0, speed=0.081, fast=0.079, excess=0.04, tolerance=0.1).is_fast_enough
        True
    """

    rate: float
    speed: float
    fast: float
    excess: float
    tolerance: float

    @property
    def is_fast_enough(self) -> bool:
        """True if the sensor is fast enough for the gain.

        The contact speed exceeds that of an infinitely fast sensor by at most `tolerance`.
        """
        return self.excess <= self.tolerance

    @property
    def text(self) -> str:
        """A sentence that says whether the sensor is fast enough."""
        enough = "fast enough" if self.is_fast_enough else "too slow"
        speed, fast = format_quantity(self.speed, "m/s", 3), format_quantity(self.fast, "m/s", 3)
        text = (
            f"The sensor is {enough}: with {self.rate:.6g} readings per second, the average contact speed is {speed}. "
        )
        text += (
            f"With an infinitely fast sensor, the average contact speed would be {fast} (sensor noise is excluded in "
            "this comparison). "
        )
        return f"{text}{self.excess_in_words[:1].upper()}{self.excess_in_words[1:]}."

    @property
    def excess_in_words(self) -> str:
        """Text on the increase of the contact speed by a slow sensor.

        The text includes the allowed increase.
        """
        size, fast = "no higher than with an infinitely fast sensor", "with an infinitely fast sensor"
        if self.excess > _SHOWN_SHARE:
            size = f"up to {higher_in_words(self.excess, fast)}"
        return (
            f"in 95 % of the runs, the contact speed is {size}; an increase of up to {100 * self.tolerance:.3g} % is "
            "allowed"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the sensor comparison as one JSON object in SI units."""
        return {**asdict(self), "is_fast_enough": self.is_fast_enough}


def without_noise(loop: ClosedLoop) -> ClosedLoop:
    """Return a copy of the loop with ideal sensor readings.

    The readings have no noise, jitter, quantization, dropouts, drift or curve error.
    """
    quiet: dict[str, Any] = dict.fromkeys((*NOISES, *_FAULTS), 0.0)
    return replace(loop, chain=replace(loop.chain, **quiet), follow_time=0.0)


def with_fast_sensor(loop: ClosedLoop) -> ClosedLoop | None:
    """Return the loop with an infinitely fast sensor.

    Every controller step gets an undelayed reading. None for user-defined laws.
    """
    law = loop.law
    if not isinstance(law, Controller):
        return None
    quick: dict[str, Any] = {"rate": 1 / law.period, "exposure": 0.0, "delay": 0.0, "phase": 0.0, "random_phase": False}
    return replace(loop, chain=replace(loop.chain, **quick), law=controller_at(law, law.period))


def compare_with_fast_sensor(
    loop: ClosedLoop, run: Callable[[ClosedLoop], SimulationResult], quiet: SimulationResult, tolerance: float
) -> SensorSpeed | None:
    """Compare the contact speeds with the real and an infinitely fast sensor.

    Returns:
        The comparison; None without contact, or for a user-defined law.
    """
    fast = with_fast_sensor(without_noise(loop))
    if fast is None:
        return None
    fast_speed = run(fast)
    both = quiet.touched & fast_speed.touched
    if not both.any():
        return None
    speed, ideal = (np.abs(np.asarray(r.relative_velocity)[both]) for r in (quiet, fast_speed))
    ratio = speed / np.maximum(ideal, _LEAST_SPEED)
    harder = float(np.quantile(ratio, _MOST)) - 1
    means = {"speed": float(speed.mean()), "fast": float(ideal.mean())}
    return SensorSpeed(rate=loop.chain.rate, **means, excess=harder, tolerance=tolerance)
