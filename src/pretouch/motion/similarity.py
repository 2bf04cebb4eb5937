"""Scale encounters so that all have the same sensor curve.

All of them can then be solved with one sensor curve.

With X = s x the equation of motion keeps its form if the force does. Take g(l) = -n / (l + l_0) and s = L_0 / l_0, so
that L + L_0 = s (l + l_0). The curve (n, l_0) with the gain D_p then gives the same motion as the curve (N, L_0) with
the gain s (n / N) D_p. Times are equal; lengths, speeds and forces are s times as large. For a constant slope g only
the product g D_p matters. For g = c + 2 b l = 2 b (l - l*), s = L* / l* and the gain is proportional to c. Encounters
with ten thousand different sensors are therefore ten thousand encounters with one sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .contact import ContactResult, ContactState
from .scenario import SCENARIO_INPUTS, Scenario, scenario_with

_LENGTHS: Final = {*ContactState.names(), "closest_distance", "settling_distance"} - {"time"}
"""Quantities that are proportional to the unit of length; forces are, since masses do not change."""

_SCALED: Final = tuple(name for name in SCENARIO_INPUTS if not name.startswith("admittance."))
"""Inputs of an encounter that are proportional to the unit of length."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EncounterSimilarity(Value):
    """Scale factors that convert encounters to one reference sensor.

    Args:
        sensor: the reference sensor.
        length: scale factor s of the lengths of each encounter.
        gain: scale factor of the gain of each encounter.
        parameters: for each parameter of the sensors that matters, the derivatives of ln(length) and ln(gain) by it.
    """

    sensor: SensorModel
    length: Any
    gain: Any
    parameters: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)

    def scenario(self, scenario: Scenario) -> Scenario:
        """Scale encounters so that they can be solved with the reference sensor."""
        if np.ndim(self.length) == 0 and self.length == 1:
            return scenario
        scaled = scenario_with(scenario, {name: attrgetter(name)(scenario) * self.length for name in _SCALED})
        course = tuple(replace(s, acceleration=s.acceleration * self.length) for s in scenario.obstacle.course)
        return replace(scaled, obstacle=replace(scaled.obstacle, course=course))

    def result(self, result: ContactResult, scenario: Scenario) -> ContactResult:
        """Convert a result for the reference sensor back to the original encounters."""
        return ContactResult(_Rescaled(result, self, scenario), result.method)

    def of_degree(self, degree: int) -> EncounterSimilarity:
        """Return the scale factors for a force law with a given exponent.

        The force is proportional to the rate d(ln xi)/dt to the power of this exponent. For a force proportional to
        s'^d, the gain factor is k^d / s^(d - 1).
        """
        if degree == 1:
            return self
        by = {name: (s, degree * k - (degree - 1) * s) for name, (s, k) in self.parameters.items()}
        gain = self.gain**degree / self.length ** (degree - 1)
        return EncounterSimilarity(sensor=self.sensor, length=self.length, gain=gain, parameters=by)


@dataclass(frozen=True, slots=True)
class _Rescaled(Value):
    """Results for a reference sensor, converted back to the original sensors."""

    reference: ContactResult
    similarity: EncounterSimilarity
    scenario: Scenario

    def column(self, name: str) -> Any:
        """Return one result quantity, converted back to the original sensors."""
        value = self.reference.columns.column(name)
        if name in _LENGTHS:
            return value / self.similarity.length
        return value / self.similarity.gain if name == "gain" else value

    @property
    def gradients(self) -> _RescaledGradients:
        """The derivatives at contact, converted back to the original sensors."""
        return _RescaledGradients(self)


@dataclass(frozen=True, slots=True)
class _RescaledGradients(Value):
    """Derivatives for a reference sensor, converted back to the original sensors.

    A length is q = Q(s x, s^0 M, k D_p) / s, and a time is q = Q.

    For an input, the chain rule gives a factor s or k. A parameter changes s and k:
    dq / d ln s = (sum of X dQ/dX over all lengths) / s - q, and dq / d ln k = k D_p dQ/dG / s with G = k D_p.
    """

    columns: _Rescaled

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a contact quantity with respect to an input."""
        gradients, similarity = self.columns.reference.gradients, self.columns.similarity
        weight = 1.0 / similarity.length if quantity in _LENGTHS else 1.0
        if by == "gain":
            return gradients.of(quantity, by) * similarity.gain * weight
        part, _, name = by.partition(".")
        if part == "admittance":
            return gradients.of(quantity, by) * weight
        if part != "sensor":
            return gradients.of(quantity, by) * similarity.length * weight
        if name not in similarity.parameters:
            return np.zeros(np.shape(self.columns.column(quantity)))
        length, gain = similarity.parameters[name]
        total = gain * gradients.of(quantity, "gain") * self.columns.reference.gain * weight
        if np.any(length != 0):
            scenario = similarity.scenario(self.columns.scenario)
            moved = sum(np.asarray(attrgetter(name)(scenario)) * gradients.of(quantity, name) for name in _SCALED)
            level = self.columns.column(quantity) if quantity in _LENGTHS else 0.0
            total = total + length * (moved * weight - level)
        return total


def find_similarity(sensor: SensorModel, values: Mapping[str, FloatArray], distance: Any) -> EncounterSimilarity | None:
    """Find a reference sensor to which encounters can be scaled.

    The sensors of the encounters differ in their parameters. Parameters have the shape (n,).

    Args:
        sensor: the sensor curve.
        values: the parameters that differ.
        distance: the distances at which encounters start [m].

    Returns:
        The similarity. None if there is none, or if a curve is not valid from the start to the contact.
    """
    curve, default = sensor.bare
    recess = np.asarray(values.get("recess", default))
    low, high = curve.valid_range
    if not (np.all(low - recess <= 0) and np.all(np.asarray(distance) <= high - recess)):
        return None
    similarity = curve._similarity(values, recess, distance)
    if similarity is None:
        return None
    return EncounterSimilarity(
        sensor=similarity.curve, length=similarity.length, gain=similarity.gain, parameters=similarity.parameters
    )
