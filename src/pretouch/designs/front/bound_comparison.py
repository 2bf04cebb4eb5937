"""Compare excursion and contact speed with the best values that any controller can reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, float_or_array
from pretouch._core.values import Value
from pretouch.motion import DAMPER, DRAG, ContactResult, Scenario

from ..search.trials import Trials
from .physical_bound import PhysicalBound, why_no_bound

_SAMPLES: Final = 400
_FORWARD: Final = 1e-9  # the bound applies up to this motion toward the obstacle, relative to the excursion
_NOTHING: Final = 1e-9  # an acceleration below this share of the deceleration that the approach needs counts as none


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BoundComparison(Value):
    """Comparison of encounters with those of the best possible controller.

    Excursion and acceleration are compared with their smallest possible values.

    Args:
        acceleration: the largest acceleration of the encounter [m/s^2].
        excursion: the deviation from the reference at contact, |x - x_d| [m].
        least_excursion: the smallest excursion [m] with which any robot with that acceleration can reach the same
            contact speed; NaN if the plant first moves toward the obstacle, because the bound then does not apply.
        least_acceleration: the smallest acceleration [m/s^2] with which any robot can reach that contact speed from
            the same detection distance.
    """

    acceleration: Any
    excursion: Any
    least_excursion: Any
    least_acceleration: Any

    @property
    def ratio(self) -> Any:
        """The excursion relative to the smallest possible excursion.

        The ratio is at least 1. NaN if the smallest excursion is 0 or unknown.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(
                np.asarray(self.least_excursion) > 0, np.divide(self.excursion, self.least_excursion), np.nan
            )
        return float(ratio) if ratio.ndim == 0 else ratio

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison with the bound as a JSON object.

        Numbers are in SI units.
        """
        others = {name: getattr(self, name) for name in ("excursion", "least_excursion", "least_acceleration")}
        return {"largest_acceleration": self.acceleration, **others}

    def __repr__(self) -> str:
        return f"<BoundComparison: {np.size(self.acceleration)} encounters>"


def compare_with_bound(
    trials: Trials, scenario: Scenario, gain: FloatArray, result: ContactResult
) -> BoundComparison | None:
    """Compare encounters with the physical bound of every controller.

    Returns:
        The comparison; None if the bound is not valid.
    """
    original = trials.freedom.scenario
    if not trials.encounters.is_continuous or why_no_bound(original):
        return None
    end = result.end
    acceleration, speed = np.asarray(end.largest_acceleration), np.abs(end.relative_velocity)
    approach = original.obstacle.velocity**2 / original.distance
    still = acceleration < _NOTHING * approach
    bound = PhysicalBound(
        distance=original.distance,
        velocity=original.obstacle.velocity,
        acceleration=original.obstacle.acceleration,
        acceleration_limit=np.where(still, approach, acceleration),
    )
    least = np.where(still, 0.0, bound.excursion(speed))
    least = np.where(_only_retreats(trials, scenario, gain, result), least, np.nan)
    return BoundComparison(
        acceleration=float_or_array(acceleration),
        excursion=float_or_array(np.abs(end.displacement)),
        least_excursion=float_or_array(least),
        least_acceleration=float_or_array(np.asarray(bound.least_acceleration(speed))),
    )


def _only_retreats(trials: Trials, scenario: Scenario, gain: FloatArray, result: ContactResult) -> BoolArray:
    """Return a mask of the encounters in which the robot only retreats. Motions up to the rest position are allowed.

    This is proved if the admittance is not under-damped, the gain mitigates and the obstacle does not brake
    (docs/developers/fast-designs.md: l' < 0 until contact, so the force always pushes away, and the admittance does not
    oscillate). With a drag it is a premise of the motion (docs/explanation/drag.md). Otherwise the motions are sampled.
    """
    a = scenario.admittance
    damped = np.square(a.damping) >= 4 * np.multiply(a.mass, a.stiffness) * (1 - 1e-12)
    task, braked = trials.encounters.task, trials.freedom.scenario.obstacle.acceleration > 0
    mitigates = damped & (np.asarray(gain) <= 0) & np.logical_not(braked) & (task.law == DAMPER)
    proved = np.asarray(mitigates | (task.law == DRAG))
    if np.all(proved):
        return np.ones(np.shape(gain), dtype=bool)
    motion = task.law.motion(scenario, task.sensor, gain, method=task.method, horizon=task.horizon, samples=_SAMPLES)
    forward = motion.displacement.max(axis=-1) <= _FORWARD * np.abs(result.end.displacement)
    return np.asarray(proved | forward)
