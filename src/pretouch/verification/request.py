"""What a verdict is asked with, and what makes no sense as such."""

from __future__ import annotations

from dataclasses import dataclass

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite
from pretouch.calibration import CalibrationReport
from pretouch.design import ImpactModel, Objective
from pretouch.design.robust import Required
from pretouch.motion import ContactResult, Scenario, find_contact
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop
from pretouch.simulation.law import TunableLaw
from pretouch.simulation.size import refuse_too_many_runs
from pretouch.uncertainty import Uncertainty

from .elastic import elastic_impact

__all__ = ["Request", "check_horizon", "checked_request"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """All that a verdict is asked with: the arguments of `verify_gain`, limits each with a probability."""

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

    @property
    def foreseen_impact(self) -> ImpactModel | None:
        """The impact that is predicted with: the given one, else the loop's contact without its loss."""
        return self.impact or elastic_impact(self.loop.contact, self.loop.plant)

    def contact(self, gain: float) -> ContactResult:
        """Predict the nominal encounter in continuous time with a perfect sensor.

        Args:
            gain: D_p [N s].

        Returns:
            How it ends.
        """
        return find_contact(self.scenario, self.sensor, gain, method=self.method, horizon=self.horizon)


def checked_request(r: Request) -> Request:
    """Refuse what makes no sense as a verdict; the parts check the rest.

    Args:
        r: the request.

    Returns:
        The same.

    Raises:
        InvalidInputError: it makes no sense.
    """
    if r.scenario.shape != ():
        raise InvalidInputError(f"scenario: found encounters of shape {r.scenario.shape}, expected one")
    if not isinstance(r.loop, ClosedLoop):
        raise InvalidInputError(f"loop: found {type(r.loop).__name__}, expected a ClosedLoop")
    if not isinstance(r.loop.law, TunableLaw):
        raise InvalidInputError(
            f"loop: found a law ({type(r.loop.law).__name__}) without with_gain, which gives it another gain"
        )
    if type(r.runs) is not int or r.runs < 1:
        raise InvalidInputError(f"runs: found {r.runs!r}, expected a positive whole number")
    refuse_too_many_runs(r.runs)
    if not 0 < finite(r.confidence, "confidence") < 1:
        raise InvalidInputError(f"confidence: found {r.confidence:g}, expected a number between 0 and 1, such as 0.95")
    return r


def check_horizon(r: Request, predicted: ContactResult) -> None:
    """Refuse a loop that would be stopped before the contact that is predicted.

    Args:
        r: the request.
        predicted: the nominal encounter in continuous time.

    Raises:
        InvalidInputError: it would be.
    """
    if predicted.reached.all() and float(predicted.end.time) >= r.loop.horizon:
        raise InvalidInputError(
            f"loop horizon: found {r.loop.horizon:g} s, before the contact that is predicted after "
            f"{float(predicted.end.time):.4g} s; give the loop a longer one"
        )
