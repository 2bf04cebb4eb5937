"""What a verdict is asked with, what makes no sense as such, and the encounters that are drawn for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, finite
from pretouch.design import ElasticImpact, ImpactModel, Task
from pretouch.design.robust import Required
from pretouch.design.robust.measures import limits_of
from pretouch.motion import ContactResult, Scenario, find_contact
from pretouch.motion.inputs import map_fields
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, ContactModel, PlantModel, SimulationResult
from pretouch.simulation.law import TunableLaw
from pretouch.simulation.size import refuse_too_many_runs
from pretouch.uncertainty import Ensemble, make_ensemble, sample_inputs

__all__ = ["Draws", "VerdictRequest", "draw_encounters", "elastic_impact", "loop_of"]

_NO_LOOP: Final = (
    "loop: found none, expected the sampled loop, loop=ClosedLoop(...); in a file [chain] and [controller], such as "
    '[chain] with part = "VCNL4010" and [controller] with rate = "1 kHz"'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictRequest:
    """What a verdict is asked with.

    What makes no sense is refused; the parts check the rest.

    Args:
        task: the encounter with its loop, and what is asked of the gain.
        bounds: smallest and largest gain [N s], for the ideal design and for the best gain on the loop.
        limits: the constraints, each with a probability.
    """

    task: Task
    bounds: tuple[float, float]
    limits: tuple[Required, ...]

    @classmethod
    def of(cls, task: Task) -> VerdictRequest:
        """Check a task, and cut its bounds where it asks for a margin to instability."""
        if task.scenario.shape != ():
            raise InvalidInputError(f"scenario: found encounters of shape {task.scenario.shape}, expected one")
        law: Any = loop_of(task).law
        if not isinstance(law, TunableLaw):
            raise InvalidInputError(
                f"loop: found a law ({type(law).__name__}) without with_gain, which gives it another gain"
            )
        if type(task.runs) is not int or task.runs < 1:
            raise InvalidInputError(f"runs: found {task.runs!r}, expected a positive whole number")
        refuse_too_many_runs(task.runs)
        if not 0 < finite(task.confidence, "confidence") < 1:
            raise InvalidInputError(
                f"confidence: found {task.confidence:g}, expected a number between 0 and 1, such as 0.95"
            )
        return cls(task=task, bounds=task.stable_bounds(), limits=limits_of(task.constraints))

    @property
    def loop(self) -> ClosedLoop:
        """The loop of the task."""
        return loop_of(self.task)

    @property
    def foreseen_impact(self) -> ImpactModel | None:
        """The impact that is predicted with: the given one, else the loop's contact without its loss."""
        return self.task.impact or elastic_impact(self.loop.contact, self.loop.plant)

    def predicted(self, gain: float) -> ContactResult:
        """Return how the nominal encounter ends with a gain [N s], in continuous time with a perfect sensor."""
        return find_contact(
            self.task.scenario, self.task.sensor, gain, method=self.task.method, horizon=self.task.horizon
        )

    def check_horizon(self, predicted: ContactResult) -> None:
        """Refuse a loop that would be stopped before the contact that is predicted."""
        if predicted.reached.all() and float(predicted.end.time) >= self.loop.horizon:
            raise InvalidInputError(
                f"loop horizon: found {self.loop.horizon:g} s, before the contact that is predicted after "
                f"{float(predicted.end.time):.4g} s; give the loop a longer one"
            )


def loop_of(task: Task) -> ClosedLoop:
    """Return the loop of a task; refuse a task without one."""
    if task.loop is None:
        raise InvalidInputError(_NO_LOOP)
    if not isinstance(task.loop, ClosedLoop):
        raise InvalidInputError(f"loop: found {type(task.loop).__name__}, expected a ClosedLoop")
    return task.loop


def elastic_impact(contact: ContactModel | None, plant: PlantModel) -> ElasticImpact | None:
    """Return a contact without its loss, met by the robot's physical mass; None where no mass meets a contact."""
    mass = plant.coefficients()[0]
    if contact is None or mass == 0:
        return None
    stiffness, _, exponent, _, inverse = contact.numbers()
    obstacle = 1 / inverse if inverse else float("inf")
    return ElasticImpact(robot_mass=mass, obstacle_mass=obstacle, stiffness=stiffness, exponent=exponent)


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
        return self.asked.task.scenario if self.ensemble is None else self.ensemble.scenario

    def run(self, loop: ClosedLoop, gain: float, count: int | None = None) -> SimulationResult:
        """Run the first encounters on a loop.

        Args:
            loop: the loop.
            gain: D_p [N s].
            count: how many of them; all by default.

        Returns:
            The runs, of the shape (count,).
        """
        n = self.asked.task.runs if count is None else min(count, self.asked.task.runs)
        if self.ensemble is None:
            return loop.run(self.asked.task.scenario, self.asked.task.sensor, gain, runs=n)
        several = map_fields(self.scenarios, lambda v: v[:n] if np.ndim(v) else v)
        if not self.sensors:
            return loop.run(several, self.asked.task.sensor, gain)
        return loop.run_each(several, self.sensors[:n], gain)

    def predicted(self, gain: float) -> BoolArray:
        """Tell which encounters come to a contact with a gain [N s], in continuous time with a perfect sensor."""
        if self.ensemble is not None:
            return self.ensemble.contacts(gain).reached
        return np.full(self.asked.task.runs, bool(self.asked.predicted(gain).reached.all()))

    def _each(self, value: Any) -> FloatArray:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (self.asked.task.runs,))


def draw_encounters(asked: VerdictRequest) -> Draws:
    """Draw independent encounters, for which exact bounds of a probability hold.

    Args:
        asked: what was asked; the seed is that of its loop.

    Returns:
        The encounters.

    Raises:
        InvalidInputError: an input of the admittance is uncertain, which is a number in the controller.
    """
    if not asked.task.uncertainty:
        return Draws(asked=asked)
    values = sample_inputs(asked.task.uncertainty, asked.task.runs, seed=asked.loop.seed, sampling="random")
    known = [name for name in values if name.startswith("admittance.")]
    if known:
        raise InvalidInputError(
            f"uncertainty: found {known[0]}, which is a number in the law of the loop and known exactly; leave it out"
        )
    several = make_ensemble(
        asked.task.scenario, asked.task.sensor, values, method=asked.task.method, horizon=asked.task.horizon
    )
    own = several.sensors() if any(name.startswith("sensor.") for name in values) else ()
    return Draws(asked=asked, ensemble=several, sensors=own)
