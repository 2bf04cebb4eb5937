"""Encounters beside the physical bound: the best motion of a robot that accelerates as much as they do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, float_or_array
from pretouch._core.values import Value
from pretouch.motion import ContactResult, Scenario, solve_motion

from ..search.trials import Trials
from .physical_bound import PhysicalBound, why_no_bound

__all__ = ["BoundComparison", "compare_with_bound"]

_SAMPLES: Final = 400
_FORWARD: Final = 1e-9  # of the excursion: a motion that goes farther toward the obstacle first is another case
_NOTHING: Final = 1e-9  # of the deceleration that the approach needs: as good as no acceleration at all


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BoundComparison(Value):
    """Encounters beside the best that a robot with the same largest acceleration could do; floats or arrays.

    Args:
        acceleration: the largest acceleration that the encounter takes [m/s^2].
        excursion: its deviation from the reference at contact, |x - x_d| [m].
        least_excursion: the least excursion with which any robot of that acceleration comes to the same contact speed
            [m]; NaN where the plant first moves toward the obstacle, of which the bound does not speak.
        least_acceleration: the least acceleration with which any robot comes to that contact speed from the same
            detection distance [m/s^2].
    """

    acceleration: Any
    excursion: Any
    least_excursion: Any
    least_acceleration: Any

    @property
    def ratio(self) -> Any:
        """How many times the least excursion the encounter takes, never below 1; NaN where the least is 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(
                np.asarray(self.least_excursion) > 0, np.divide(self.excursion, self.least_excursion), np.nan
            )
        return float(found) if found.ndim == 0 else found

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as one JSON object, in SI; arrays as lists."""
        others = {name: getattr(self, name) for name in ("excursion", "least_excursion", "least_acceleration")}
        return {"largest_acceleration": self.acceleration, **others}

    def __repr__(self) -> str:
        return f"<BoundComparison: {np.size(self.acceleration)} encounters>"


def compare_with_bound(
    trials: Trials, scenario: Scenario, gain: FloatArray, result: ContactResult
) -> BoundComparison | None:
    """Put encounters in contact beside the best that any robot with the same largest acceleration could do."""
    # None where the bound does not speak of such encounters.
    given = trials.freedom.scenario
    if not trials.encounters.is_differentiable or why_no_bound(given):
        return None
    end = result.end
    acceleration, speed = np.asarray(end.largest_acceleration), np.abs(end.relative_velocity)
    approach = given.obstacle.velocity**2 / given.distance
    still = acceleration < _NOTHING * approach
    bound = PhysicalBound(
        distance=given.distance,
        velocity=given.obstacle.velocity,
        acceleration=given.obstacle.acceleration,
        acceleration_limit=np.where(still, approach, acceleration),
    )
    least = np.where(still, 0.0, bound.excursion(speed))
    least = np.where(_gives_way(trials, scenario, gain, result), least, np.nan)
    return BoundComparison(
        acceleration=float_or_array(acceleration),
        excursion=float_or_array(np.abs(end.displacement)),
        least_excursion=float_or_array(least),
        least_acceleration=float_or_array(np.asarray(bound.least_acceleration(speed))),
    )


def _gives_way(trials: Trials, scenario: Scenario, gain: FloatArray, result: ContactResult) -> BoolArray:
    """Tell which plants never move toward the obstacle, past where they rested; of the shape of the gain."""
    # Where the admittance is not under-damped, the gain mitigates and the obstacle does not brake, that is proved
    # (docs/fast-designs.md: l' < 0 all the way, so the force only ever pushes, and such an admittance does not swing).
    # Elsewhere motions are sampled.
    a = scenario.admittance
    damped = np.square(a.damping) >= 4 * np.multiply(a.mass, a.stiffness) * (1 - 1e-12)
    proved = damped & (np.asarray(gain) <= 0) & (trials.freedom.scenario.obstacle.acceleration <= 0)
    if np.all(proved):
        return np.ones(np.shape(gain), dtype=bool)
    how = trials.encounters.task
    motion = solve_motion(scenario, how.sensor, gain, method=how.method, horizon=how.horizon, samples=_SAMPLES)
    forward = motion.displacement.max(axis=-1) <= _FORWARD * np.abs(result.end.displacement)
    return np.asarray(proved | forward)
