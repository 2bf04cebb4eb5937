"""The verbs that solve encounters, and what does so in their place: the sampled loop, or a function of the user's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch.sensors import SensorModel

from .contact import ContactResult, Motion
from .laws import DAMPER, ContinuousLaw, continuous_law
from .scenario import Scenario

Evaluator: TypeAlias = Callable[[Scenario, SensorModel, Any], ContactResult]
"""From encounters, their sensor and gains, which broadcast, to what they come to."""


@runtime_checkable
class NoisyEvaluator(Protocol):
    """An evaluator with noise by number: its i-th encounter meets the noise of run i, whatever the gain."""

    def __call__(self, scenario: Scenario, sensor: SensorModel, gain: Any) -> ContactResult:
        """Solve encounters."""

    def after(self, runs: int) -> NoisyEvaluator:
        """Return the same evaluator, whose first encounter meets the noise of a later run."""


@runtime_checkable
class ManySensorEvaluator(Protocol):
    """An evaluator that solves encounters with a sensor each at once, the i-th with the noise of run i."""

    def __call__(self, scenario: Scenario, sensor: SensorModel, gain: Any) -> ContactResult:
        """Solve encounters."""

    def with_each(self, scenario: Scenario, sensors: Sequence[SensorModel], gain: Any) -> ContactResult:
        """Solve encounters whose last axis is that of the sensors."""


def with_noise_after(evaluator: Evaluator, runs: int) -> Evaluator:
    """Return an evaluator that goes on after the noise of some runs; one without numbered noise as it is."""
    return evaluator.after(runs) if isinstance(evaluator, NoisyEvaluator) else evaluator


def _asked(value: Any, law: Any) -> tuple[ContinuousLaw, Any]:
    """Return a law with values of its number: what was given for these may be a sampled law, which holds its own."""
    if law is DAMPER and hasattr(value, "continuous"):
        return continuous_law(value), value.value
    return continuous_law(law), value


@check_arguments
def find_contact(
    scenario: Scenario,
    sensor: SensorModel,
    gain: Any,
    *,
    law: Any = DAMPER,
    method: str = "auto",
    horizon: float = 600.0,
) -> ContactResult:
    """Find the first contact of an encounter, l = 0 of L(21) and L(23), and what it demands of the robot until then.

    The motion is that of L(1) with L(2), or by request the uniform motion L(16)-(19), or that of another law. A
    distance that comes to zero and turns there, within 1e-12 of its terms, is a contact with l' = 0; one that only
    decays to zero never is one.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve; its scale is of no consequence.
        gain: the number of the law, broadcast with the scenario: D_p [N s] of the virtual damper, where negative gains
            mitigate; or a sampled law, such as `pretouch.control.VirtualDrag(...)`, which holds its own.
        law: the law in continuous time, or its name: "virtual-damper" of L(2), "virtual-drag" (`Drag`), or an OwnLaw.
        method: of the virtual damper: "closed-form" (L(10), for a constant slope only), "integration" (any curve),
            "uniform-motion" (L(16)-(19), one particular motion of the second-order exponential curve that does not
            start from the given state: it shifts an optimal gain by about 10 %), or "auto": closed form where the slope
            is constant, integration elsewhere.
        horizon: how long to wait for contact [s].

    Returns:
        Status and state at the end of each run, of the broadcast shape.

    Valid for:
        A plant that follows the virtual object exactly and a sensor without delay (the letter's Section II).

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = ExponentialFirstOrder(scale=0.458, rate=-61.0)
        >>> round(find_contact(scenario, sensor, -1.0).contact.position, 4)
        -0.1353
        >>> round(find_contact(scenario, sensor, 0.012, law="virtual-drag").contact.position, 4)
        -0.0828
    """
    own, value = _asked(gain, law)
    return own.contact(scenario, sensor, value, method=method, horizon=horizon)


@check_arguments
def solve_motion(
    scenario: Scenario,
    sensor: SensorModel,
    gain: Any,
    *,
    law: Any = DAMPER,
    method: str = "auto",
    horizon: float = 600.0,
    samples: int = 200,
) -> Motion:
    """Solve an encounter and sample its whole motion, L(1) with L(2) or another law.

    Args:
        scenario: the encounter, or an array of them.
        sensor: the sensor curve.
        gain: the number of the law, broadcast with the scenario, or a sampled law, as in `find_contact`.
        law: as in `find_contact`.
        method: as in `find_contact`.
        horizon: how long to wait for contact [s].
        samples: how many instants, from 0 to the end of each run, ends included; at least 2.

    Returns:
        The motion; its arrays have the broadcast shape with the samples as a last axis.

    Raises:
        InvalidInputError: there are too few samples.

    Examples:
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> motion = solve_motion(scenario, sensor, -0.7)
        >>> round(float(motion.position[-1]), 4)
        -0.0915
    """
    if samples < 2:
        raise InvalidInputError(f"samples: found {samples}, which must be at least 2")
    own, value = _asked(gain, law)
    return own.motion(scenario, sensor, value, method=method, horizon=horizon, samples=samples)
