"""Solve encounters by `find_contact` and `solve_motion`, and define interfaces of custom solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch.sensors import SensorModel

from .contact import ContactResult, Motion
from .laws import DAMPER, ContinuousLaw, PredictableLaw, continuous_law
from .scenario import Scenario

Evaluator: TypeAlias = Callable[[Scenario, SensorModel, Any], ContactResult]
"""Function from encounters, their sensor and values of the law's number, which broadcast, to their result."""


@runtime_checkable
class NoisyEvaluator(Protocol):
    """Interface of a solver with reproducible random noise.

    Every gain is simulated with the same noise.
    """

    def __call__(self, scenario: Scenario, sensor: SensorModel, gain: Any) -> ContactResult:
        """Solve encounters with one sensor curve, for one or several gains."""

    def after(self, runs: int) -> NoisyEvaluator:
        """Return a solver that starts with the noise of a later run."""


@runtime_checkable
class ManySensorEvaluator(Protocol):
    """Interface of a solver with one sensor curve per encounter.

    The i-th encounter has the noise of run i.
    """

    def __call__(self, scenario: Scenario, sensor: SensorModel, gain: Any) -> ContactResult:
        """Solve encounters with one sensor curve, for one or several gains."""

    def with_each(self, scenario: Scenario, sensors: Sequence[SensorModel], gain: Any) -> ContactResult:
        """Solve encounters that each have their own sensor curve.

        Each element along the last axis has its own curve.
        """


def with_noise_after(evaluator: Evaluator, runs: int) -> Evaluator:
    """Return a solver that starts with the noise of a later run.

    A solver without numbered noise is returned unchanged.
    """
    return evaluator.after(runs) if isinstance(evaluator, NoisyEvaluator) else evaluator


def _law_and_value(value: Any, law: Any) -> tuple[ContinuousLaw, Any]:
    """Return the control law and the value of its coefficient."""
    if law is DAMPER and isinstance(value, PredictableLaw):
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
    """Solve encounters until the first contact.

    Contact is the first moment of zero distance, as in L(21) and L(23). The motion is that of L(1) with the virtual
    force L(2), of another law, or the uniform motion L(16)-(19). A distance that reaches zero and turns there, within
    1e-12 of its terms, is a contact with l' = 0. A distance that only decays to zero is no contact.

    Args:
        scenario: one encounter or an array of encounters.
        sensor: the sensor curve; its scale has no effect.
        gain: the law's number, such as D_p [N s] of the virtual damper, where negative gains mitigate; it broadcasts
            with the scenario. Or a sampled law such as `pretouch.control.VirtualDrag(...)`, which contains its number.
        law: the law in continuous time, or its name: "virtual-damper" (L(2)), "virtual-drag" (`Drag`), or a CustomLaw.
        method: for the virtual damper: "closed-form" (L(10), constant slope only), "integration" (any curve),
            "uniform-motion" (L(16)-(19)), or "auto": the closed form for a constant slope, else integration. The
            uniform motion is one particular motion of the second-order exponential curve. It does not start from the
            given state and shifts an optimal gain by about 10 %.
        horizon: longest time to contact that is searched [s].

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
    continuous, value = _law_and_value(gain, law)
    return continuous.contact(scenario, sensor, value, method=method, horizon=horizon)


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
    """Compute sampled motions of robot and obstacle under a control law.

    The motion is that of L(1) with the virtual force L(2), or with the force of another law.

    Args:
        scenario: one encounter or an array of encounters.
        sensor: the sensor curve.
        gain: the law's number, such as D_p [N s], or a sampled law, as in `find_contact`.
        law: as in `find_contact`.
        method: as in `find_contact`.
        horizon: longest time to contact that is searched [s].
        samples: number of equally spaced samples from 0 to the end of each run, both included; at least 2.

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
        raise InvalidInputError(f"samples: found {samples}, which must be at least 2", value=samples)
    continuous, value = _law_and_value(gain, law)
    return continuous.motion(scenario, sensor, value, method=method, horizon=horizon, samples=samples)
