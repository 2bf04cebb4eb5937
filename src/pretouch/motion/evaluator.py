"""What solves encounters in the place of `find_contact`: the sampled loop, or a function of the user's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

from pretouch.sensors import SensorModel

from .contact import ContactResult
from .scenario import Scenario

Evaluator: TypeAlias = Callable[[Scenario, SensorModel, Any], ContactResult]
"""From encounters, their sensor and gains [N s], which broadcast, to what they come to."""


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
