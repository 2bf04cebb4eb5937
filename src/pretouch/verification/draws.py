"""The encounters of a verdict: drawn once, and run on any loop with any gain, each with noise of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion import Scenario, find_contact
from pretouch.motion.inputs import map_fields
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Ensemble, Uncertainty, make_ensemble, sample_inputs

__all__ = ["Draws", "draw_encounters"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draws:
    """Encounters that may happen, the i-th of which always meets the i-th noise.

    Args:
        scenario: the nominal encounter.
        sensor: the nominal sensor curve.
        count: how many encounters.
        ensemble: those that were drawn; None where each is the nominal one.
        sensors: the curve of each, where each has one of its own.
    """

    scenario: Scenario
    sensor: SensorModel
    count: int
    ensemble: Ensemble | None
    sensors: tuple[SensorModel, ...] = ()

    @property
    def own_sensors(self) -> bool:
        """Whether each encounter has a sensor curve of its own."""
        return bool(self.sensors)

    @property
    def speed(self) -> FloatArray:
        """|x_o'| of each encounter at the start [m/s]."""
        return self._each(self.scenarios.obstacle.velocity, magnitude=True)

    @property
    def approach(self) -> FloatArray:
        """|l'| of each encounter at the start [m/s]."""
        return self._each(self.scenarios.relative_velocity, magnitude=True)

    @property
    def distance(self) -> FloatArray:
        """The distance of each encounter at the start [m]."""
        return self._each(self.scenarios.distance)

    @property
    def scenarios(self) -> Scenario:
        """The encounters, of the shape () or (count,)."""
        return self.scenario if self.ensemble is None else self.ensemble.scenario

    def run(self, loop: ClosedLoop, gain: float, count: int | None = None) -> SimulationResult:
        """Run the first encounters on a loop.

        Args:
            loop: the loop.
            gain: D_p [N s].
            count: how many of them; all by default.

        Returns:
            The runs, of the shape (count,).
        """
        n = self.count if count is None else min(count, self.count)
        if self.ensemble is None:
            return loop.run(self.scenario, self.sensor, gain, runs=n)
        several = map_fields(self.scenarios, lambda v: v[:n] if np.ndim(v) else v)
        if not self.own_sensors:
            return loop.run(several, self.sensor, gain)
        return loop.run_each(several, self.sensors[:n], gain)

    def predicted(self, gain: float, method: str, horizon: float) -> BoolArray:
        """Tell which encounters come to a contact in continuous time with a perfect sensor.

        Args:
            gain: D_p [N s].
            method: how encounters are solved, as in `find_contact`.
            horizon: how long to wait for contact [s].

        Returns:
            Truth values, of the shape (count,).
        """
        if self.ensemble is not None:
            return self.ensemble.contacts(gain).reached
        found = find_contact(self.scenario, self.sensor, gain, method=method, horizon=horizon)
        return np.full(self.count, bool(found.reached.all()))

    def _each(self, value: Any, magnitude: bool = False) -> FloatArray:
        return np.broadcast_to(np.abs(value) if magnitude else np.asarray(value, dtype=np.float64), (self.count,))


def draw_encounters(
    scenario: Scenario,
    sensor: SensorModel,
    uncertainty: Uncertainty | None,
    *,
    count: int,
    seed: int,
    method: str,
    horizon: float,
) -> Draws:
    """Draw independent encounters, for which exact bounds of a probability hold.

    Args:
        scenario: the nominal encounter.
        sensor: the nominal sensor curve.
        uncertainty: what is known of inputs; None where all are known.
        count: how many.
        seed: of the samples.
        method: how encounters are solved in continuous time.
        horizon: how long to wait for contact there [s].

    Returns:
        The encounters.

    Raises:
        InvalidInputError: an input of the admittance is uncertain, which is a number in the controller.
    """
    if not uncertainty:
        return Draws(scenario=scenario, sensor=sensor, count=count, ensemble=None)
    values = sample_inputs(uncertainty, count, seed=seed, sampling="random")
    known = [name for name in values if name.startswith("admittance.")]
    if known:
        raise InvalidInputError(
            f"uncertainty: found {known[0]}, which is a number in the law of the loop and known exactly; leave it out"
        )
    several = make_ensemble(scenario, sensor, values, method=method, horizon=horizon)
    own = several.sensors() if any(name.startswith("sensor.") for name in values) else ()
    return Draws(scenario=scenario, sensor=sensor, count=count, ensemble=several, sensors=own)
