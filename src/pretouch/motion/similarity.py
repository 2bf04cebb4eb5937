"""Many sensors of one kind as one sensor: encounters that are the same in other units of length and gain.

With X = s x the equation of motion keeps its form if the force does. For g(l) = -n / (l + l_0) and s = L_0 / l_0,
L + L_0 = s (l + l_0), so the curve (n, l_0) with gain D_p moves as the curve (N, L_0) does with s (n / N) D_p: times
are the same, lengths and speeds are s times as large, and so are forces. A constant slope g needs no other length: only
g D_p counts. The same holds for g = c + 2 b l = 2 b (l - l*) with s = L* / l*, and a gain in proportion to c. So
encounters of ten thousand sensors with other parameters are ten thousand encounters of one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value
from pretouch.sensors import SensorModel

from .contact import ContactResult, ContactState
from .scenario import SCENARIO_INPUTS, Scenario, scenario_with

_LENGTHS: Final = {*ContactState.names(), "closest_distance", "settling_distance"} - {"time"}
"""What grows with the unit of length; forces do, since masses stay."""

_SCALED: Final = tuple(name for name in SCENARIO_INPUTS if not name.startswith("admittance."))
"""The inputs of an encounter that do so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EncounterSimilarity(Value):
    """How encounters of many sensors are encounters of one.

    Args:
        sensor: the one sensor.
        length: s of each encounter, by which its lengths are multiplied; 1 where they stay.
        gain: the factor of its gain.
        parameters: of the many sensors, those that matter: the derivatives of the logarithms of both factors by each.
    """

    sensor: SensorModel
    length: Any
    gain: Any
    parameters: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)

    def scenario(self, scenario: Scenario) -> Scenario:
        """Return the encounters of the one sensor."""
        if np.ndim(self.length) == 0 and self.length == 1:
            return scenario
        return scenario_with(scenario, {name: attrgetter(name)(scenario) * self.length for name in _SCALED})

    def result(self, found: ContactResult, scenario: Scenario) -> ContactResult:
        """Return what was found of the one sensor in the lengths and gains of the many, of encounters as given."""
        return ContactResult(_Rescaled(found, self, scenario), found.method)

    def of_degree(self, degree: int) -> EncounterSimilarity:
        """Return the likeness under a law whose force is its number times a power of s': k^d / s^(d - 1) for k."""
        if degree == 1:
            return self
        by = {name: (s, degree * k - (degree - 1) * s) for name, (s, k) in self.parameters.items()}
        gain = self.gain**degree / self.length ** (degree - 1)
        return EncounterSimilarity(sensor=self.sensor, length=self.length, gain=gain, parameters=by)


@dataclass(frozen=True, slots=True)
class _Rescaled(Value):
    """The columns of a result in other units."""

    found: ContactResult
    likeness: EncounterSimilarity
    scenario: Scenario

    def column(self, name: str) -> Any:
        """Return a quantity of every run."""
        value = self.found.columns.column(name)
        if name in _LENGTHS:
            return value / self.likeness.length
        return value / self.likeness.gain if name == "gain" else value

    @property
    def gradients(self) -> _RescaledGradients:
        """The derivatives at contact."""
        return _RescaledGradients(self)


@dataclass(frozen=True, slots=True)
class _RescaledGradients(Value):
    """The derivatives of a rescaled result, q = Q(s x, s^0 M, k D_p) / s for a length, Q for a time.

    By an input of the many sensors' own units the chain rule gives a factor s or k. A parameter changes s and k:
    dq / d ln s = (sum of X dQ/dX over all lengths) / s - q, and dq / d ln k = k D_p dQ/dG / s with G = k D_p.
    """

    columns: _Rescaled

    def of(self, quantity: str, by: str) -> Any:
        """Return the derivative of a quantity at contact by an input, as ContactGradients has it."""
        own, likeness = self.columns.found.gradients, self.columns.likeness
        weight = 1.0 / likeness.length if quantity in _LENGTHS else 1.0
        if by == "gain":
            return own.of(quantity, by) * likeness.gain * weight
        part, _, name = by.partition(".")
        if part == "admittance":
            return own.of(quantity, by) * weight
        if part != "sensor":
            return own.of(quantity, by) * likeness.length * weight
        if name not in likeness.parameters:
            return np.zeros(np.shape(self.columns.column(quantity)))
        length, gain = likeness.parameters[name]
        total = gain * own.of(quantity, "gain") * self.columns.found.gain * weight
        if np.any(length != 0):
            scenario = likeness.scenario(self.columns.scenario)
            moved = sum(np.asarray(attrgetter(name)(scenario)) * own.of(quantity, name) for name in _SCALED)
            level = self.columns.column(quantity) if quantity in _LENGTHS else 0.0
            total = total + length * (moved * weight - level)
        return total


def find_similarity(sensor: SensorModel, values: Mapping[str, FloatArray], distance: Any) -> EncounterSimilarity | None:
    """Find the one sensor that stands for many, whose parameters differ, (n,) each, from distances at the start [m].

    Returns:
        The likeness, or None where there is none, or where a curve does not hold from the start to contact.
    """
    curve, own = sensor.bare
    recess = np.asarray(values.get("recess", own))
    low, high = curve.valid_range
    if not (np.all(low - recess <= 0) and np.all(np.asarray(distance) <= high - recess)):
        return None
    alike = curve._similarity(values, recess, distance)
    if alike is None:
        return None
    return EncounterSimilarity(sensor=alike.curve, length=alike.length, gain=alike.gain, parameters=alike.parameters)
