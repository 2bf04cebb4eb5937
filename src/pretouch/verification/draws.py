"""The encounters of a verdict: drawn once, and run on any loop with any gain, each with noise of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion import Scenario
from pretouch.motion.inputs import map_fields
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.uncertainty import Ensemble, make_ensemble, sample_inputs

from .request import VerdictRequest

__all__ = ["Draws", "draw_encounters"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draws:
    """Encounters that may happen, the i-th of which always meets the i-th noise.

    Args:
        asked: what was asked, with the nominal encounter and sensor curve.
        ensemble: the encounters that were drawn; None where each is the nominal one.
        sensors: the curve of each, where each has one of its own.
    """

    asked: VerdictRequest
    ensemble: Ensemble | None = None
    sensors: tuple[SensorModel, ...] = ()

    @property
    def speed(self) -> FloatArray:
        """|x_o'| of each encounter at the start [m/s]."""
        return self._each(np.abs(self.scenarios.obstacle.velocity))

    @property
    def approach(self) -> FloatArray:
        """|l'| of each encounter at the start [m/s]."""
        return self._each(np.abs(self.scenarios.relative_velocity))

    @property
    def distance(self) -> FloatArray:
        """The distance of each encounter at the start [m]."""
        return self._each(self.scenarios.distance)

    @property
    def scenarios(self) -> Scenario:
        """The encounters, of the shape () or (runs,)."""
        return self.asked.scenario if self.ensemble is None else self.ensemble.scenario

    def run(self, loop: ClosedLoop, gain: float, count: int | None = None) -> SimulationResult:
        """Run the first encounters on a loop.

        Args:
            loop: the loop.
            gain: D_p [N s].
            count: how many of them; all by default.

        Returns:
            The runs, of the shape (count,).
        """
        n = self.asked.runs if count is None else min(count, self.asked.runs)
        if self.ensemble is None:
            return loop.run(self.asked.scenario, self.asked.sensor, gain, runs=n)
        several = map_fields(self.scenarios, lambda v: v[:n] if np.ndim(v) else v)
        if not self.sensors:
            return loop.run(several, self.asked.sensor, gain)
        return loop.run_each(several, self.sensors[:n], gain)

    def predicted(self, gain: float) -> BoolArray:
        """Tell which encounters come to a contact with a gain [N s], in continuous time with a perfect sensor."""
        if self.ensemble is not None:
            return self.ensemble.contacts(gain).reached
        return np.full(self.asked.runs, bool(self.asked.predicted(gain).reached.all()))

    def _each(self, value: Any) -> FloatArray:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (self.asked.runs,))


def draw_encounters(asked: VerdictRequest) -> Draws:
    """Draw independent encounters, for which exact bounds of a probability hold.

    Args:
        asked: what was asked; the seed is that of its loop.

    Returns:
        The encounters.

    Raises:
        InvalidInputError: an input of the admittance is uncertain, which is a number in the controller.
    """
    if not asked.uncertainty:
        return Draws(asked=asked)
    values = sample_inputs(asked.uncertainty, asked.runs, seed=asked.loop.seed, sampling="random")
    known = [name for name in values if name.startswith("admittance.")]
    if known:
        raise InvalidInputError(
            f"uncertainty: found {known[0]}, which is a number in the law of the loop and known exactly; leave it out"
        )
    several = make_ensemble(asked.scenario, asked.sensor, values, method=asked.method, horizon=asked.horizon)
    own = several.sensors() if any(name.startswith("sensor.") for name in values) else ()
    return Draws(asked=asked, ensemble=several, sensors=own)
