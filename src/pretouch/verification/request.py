"""What a verdict is asked with: what makes no sense as such, what is predicted, and the encounters that are drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray, finite
from pretouch.design import ElasticImpact, ImpactModel, Task
from pretouch.motion import ContactResult, Scenario, find_contact
from pretouch.motion.inputs import map_fields
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, SimulationResult
from pretouch.simulation.law import TunableLaw
from pretouch.simulation.size import refuse_too_many_runs
from pretouch.uncertainty import Ensemble, make_ensemble, sample_inputs

__all__ = ["Draws", "checked_task", "draw_encounters", "foreseen_impact", "loop_of", "predicted_contact"]

_COMPARED: Final = 200
_COMPARED_SENSORS: Final = 100  # where each run has a sensor curve of its own, which is tabulated first
_NO_LOOP: Final = (
    "loop: found none, expected the sampled loop, loop=ClosedLoop(...); in a file [chain] and [controller], such as "
    '[chain] with part = "VCNL4010" and [controller] with rate = "1 kHz"'
)


def checked_task(task: Task) -> Task:
    """Refuse what makes no sense as a verdict; return the task with its bounds cut where it asks for a margin."""
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
    return task.replace(bounds=task.stable_bounds(), stability_margin=None, evaluate=None)


def loop_of(task: Task) -> ClosedLoop:
    """Return the loop of a task; refuse a task without one."""
    if task.loop is None:
        raise InvalidInputError(_NO_LOOP)
    if not isinstance(task.loop, ClosedLoop):
        raise InvalidInputError(f"loop: found {type(task.loop).__name__}, expected a ClosedLoop")
    return task.loop


def foreseen_impact(task: Task) -> ImpactModel | None:
    """Return the impact that is predicted with: the given one, else the loop's contact without its loss.

    That meets the robot's physical mass; None where no mass meets a contact.
    """
    contact, mass = task.loop.contact, task.loop.plant.coefficients()[0]
    if task.impact is not None or contact is None or mass == 0:
        return task.impact
    stiffness, _, exponent, _, inverse = contact.numbers()
    obstacle = 1 / inverse if inverse else float("inf")
    return ElasticImpact(robot_mass=mass, obstacle_mass=obstacle, stiffness=stiffness, exponent=exponent)


def predicted_contact(task: Task, gain: float) -> ContactResult:
    """Return how the nominal encounter ends with a gain [N s], in continuous time with a perfect sensor."""
    return find_contact(task.scenario, task.sensor, gain, method=task.method, horizon=task.horizon)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draws:
    """Encounters that may happen, the i-th of which always meets the i-th noise.

    Args:
        task: what was asked, with the nominal encounter and sensor curve.
        scenarios: the encounters, of the shape () or (runs,).
        ensemble: those that were drawn; None where each is the nominal one.
        sensors: the curve of each, where each has one of its own.
    """

    task: Task
    scenarios: Scenario
    ensemble: Ensemble | None = None
    sensors: tuple[SensorModel, ...] = ()

    @property
    def compared(self) -> int:
        """How many of the runs changes and other gains are compared by."""
        return min(self.task.runs, _COMPARED_SENSORS if self.sensors else _COMPARED)

    @property
    def speed(self) -> FloatArray:
        """|x_o'| of each encounter at the start [m/s]."""
        return self._each(np.abs(self.scenarios.obstacle.velocity))

    @property
    def distance(self) -> FloatArray:
        """The distance of each encounter at the start [m]."""
        return self._each(self.scenarios.distance)

    def run(self, loop: ClosedLoop, gain: ArrayLike, count: int | None = None) -> SimulationResult:
        """Run the first encounters on a loop, `count` or all, with D_p [N s]; several gains have the shape (m, 1)."""
        n = self.task.runs if count is None else count
        several = map_fields(self.scenarios, lambda v: v[:n] if np.ndim(v) else v)
        if not self.sensors:
            return loop.run(several, self.task.sensor, gain)
        return loop.run_each(several, self.sensors[:n], gain)

    def predicted(self, gain: float) -> BoolArray:
        """Tell which encounters come to a contact with a gain [N s], in continuous time with a perfect sensor."""
        if self.ensemble is not None:
            return self.ensemble.contacts(gain).reached
        return np.full(self.task.runs, bool(predicted_contact(self.task, gain).reached.all()))

    def _each(self, value: Any) -> FloatArray:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (self.task.runs,))


def draw_encounters(task: Task) -> Draws:
    """Draw independent encounters, for which exact bounds of a probability hold, by the seed of the task's loop."""
    if not task.uncertainty:
        obstacle = task.scenario.obstacle
        alike = replace(obstacle, position=np.full(task.runs, obstacle.position))
        return Draws(task=task, scenarios=replace(task.scenario, obstacle=alike))
    values = sample_inputs(task.uncertainty, task.runs, seed=task.loop.seed, sampling="random")
    known = [name for name in values if name.startswith("admittance.")]
    if known:
        raise InvalidInputError(
            f"uncertainty: found {known[0]}, which is a number in the law of the loop and known exactly; leave it out"
        )
    several = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon)
    own = several.sensors() if any(name.startswith("sensor.") for name in values) else ()
    return Draws(task=task, scenarios=several.scenario, ensemble=several, sensors=own)
