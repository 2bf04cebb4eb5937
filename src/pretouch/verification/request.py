"""What a verdict is asked with: the question, what makes no sense as one, and the impact that it predicts with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite, positive
from pretouch.calibration import CalibrationReport
from pretouch.design import ImpactModel, Objective
from pretouch.design.robust import Required
from pretouch.motion import ContactResult, Scenario, find_contact
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, ContactModel, PlantModel
from pretouch.simulation.law import TunableLaw
from pretouch.simulation.size import refuse_too_many_runs
from pretouch.uncertainty import Uncertainty

__all__ = ["ElasticImpact", "VerdictRequest", "elastic_impact"]


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictRequest:
    """All that a verdict is asked with: the arguments of `verify_gain`, limits each with a probability.

    What makes no sense is refused; the parts check the rest.
    """

    scenario: Scenario
    sensor: SensorModel
    objective: Objective
    loop: ClosedLoop
    bounds: tuple[float, float]
    limits: tuple[Required, ...]
    impact: ImpactModel | None
    uncertainty: Uncertainty
    runs: int
    confidence: float
    method: str
    horizon: float
    calibration: CalibrationReport | None = None

    def __post_init__(self) -> None:
        if self.scenario.shape != ():
            raise InvalidInputError(f"scenario: found encounters of shape {self.scenario.shape}, expected one")
        loop: Any = self.loop
        if not isinstance(loop, ClosedLoop):
            raise InvalidInputError(f"loop: found {type(loop).__name__}, expected a ClosedLoop")
        law: Any = loop.law
        if not isinstance(law, TunableLaw):
            raise InvalidInputError(
                f"loop: found a law ({type(law).__name__}) without with_gain, which gives it another gain"
            )
        if type(self.runs) is not int or self.runs < 1:
            raise InvalidInputError(f"runs: found {self.runs!r}, expected a positive whole number")
        refuse_too_many_runs(self.runs)
        if not 0 < finite(self.confidence, "confidence") < 1:
            raise InvalidInputError(
                f"confidence: found {self.confidence:g}, expected a number between 0 and 1, such as 0.95"
            )

    @property
    def foreseen_impact(self) -> ImpactModel | None:
        """The impact that is predicted with: the given one, else the loop's contact without its loss."""
        return self.impact or elastic_impact(self.loop.contact, self.loop.plant)

    def predicted(self, gain: float) -> ContactResult:
        """Return how the nominal encounter ends with a gain [N s], in continuous time with a perfect sensor."""
        return find_contact(self.scenario, self.sensor, gain, method=self.method, horizon=self.horizon)

    def check_horizon(self, predicted: ContactResult) -> None:
        """Refuse a loop that would be stopped before the contact that is predicted."""
        if predicted.reached.all() and float(predicted.end.time) >= self.loop.horizon:
            raise InvalidInputError(
                f"loop horizon: found {self.loop.horizon:g} s, before the contact that is predicted after "
                f"{float(predicted.end.time):.4g} s; give the loop a longer one"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticImpact(ImpactModel):
    """Impact on F = k d^n without loss: 1/2 mu v^2 = k d^(n+1) / (n+1) gives the depth d, and so the force k d^n.

    Args:
        robot_mass: the physical reflected mass of the robot at the contact point [kg].
        obstacle_mass: mass of the obstacle [kg]; infinite where it is driven.
        stiffness: k > 0 [N/m^n].
        exponent: n >= 1; 1 for a spring, 3/2 for a sphere after Hertz.

    Examples:
        >>> ElasticImpact(robot_mass=1.0, stiffness=1e4, exponent=1.0).peak_force(-0.1)
        10.0
    """

    stiffness: float
    exponent: float

    def __post_init__(self) -> None:
        ImpactModel.__post_init__(self)
        positive(self.stiffness, "stiffness", "N/m^n")
        if not positive(self.exponent, "exponent") >= 1:
            raise InvalidInputError(f"exponent: found {self.exponent:g}, which must be at least 1")

    def peak_force(self, relative_velocity: ArrayLike) -> Any:
        """Return k ((n + 1) mu v^2 / (2 k))^(n / (n + 1)) [N]."""
        n, k = self.exponent, self.stiffness
        energy = 0.5 * (n + 1) * self.reduced_mass * np.square(relative_velocity)
        force = k * (energy / k) ** (n / (n + 1))
        return float(force) if np.ndim(force) == 0 else force

    def peak_force_slope(self, relative_velocity: ArrayLike) -> Any:
        """Return the derivative of the peak force [N s/m], 2 n / (n + 1) F / v."""
        share = 2 * self.exponent / (self.exponent + 1)
        slope = share * np.asarray(self.peak_force(relative_velocity)) / np.asarray(relative_velocity)
        return float(slope) if np.ndim(slope) == 0 else slope


def elastic_impact(contact: ContactModel | None, plant: PlantModel) -> ElasticImpact | None:
    """Return a contact without its loss, met by the robot's physical mass; None where no mass meets a contact."""
    mass = plant.coefficients()[0]
    if contact is None or mass == 0:
        return None
    stiffness, _, exponent, _, inverse = contact.numbers()
    obstacle = 1 / inverse if inverse else float("inf")
    return ElasticImpact(robot_mass=mass, obstacle_mass=obstacle, stiffness=stiffness, exponent=exponent)
