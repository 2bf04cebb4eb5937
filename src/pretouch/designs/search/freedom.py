"""Define the free parameters of a design: gain, natural frequency and damping ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, nonnegative
from pretouch.motion import DAMPER, DRAG, Admittance, ContinuousLaw, Scenario
from pretouch.motion.scenario import map_fields

from .gain_axis import GainAxis

_LOGARITHMIC: Final = 2.0  # ratio of the bounds above which the logarithm is the coordinate
Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Freedom:
    """The free parameters of a search, scaled from 0 to 1.

    The gain comes first. Points have the shape (n, size).
    """

    scenario: Scenario  # the encounter, with the admittance whose mass is kept
    axis: GainAxis  # the coordinate of the gain, with its bounds
    natural_frequency: Range | None  # bounds of sqrt(K / M) [rad/s]; None if it is not free
    damping_ratio: Range | None  # bounds of D / (2 sqrt(M K)); None if it is not free

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the free search parameters.

        Their order is that of the search coordinates.
        """
        free = (("natural_frequency", self.natural_frequency), ("damping_ratio", self.damping_ratio))
        return ("gain", *(name for name, bounds in free if bounds is not None))

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return len(self.names)

    def gain(self, at: FloatArray) -> FloatArray:
        """Convert search coordinates between 0 and 1 to gains."""
        low, high = self.axis.span
        return self.axis.gain(low + (high - low) * at[:, 0])

    def coordinate(self, gain: float) -> float:
        """Convert a gain to its search coordinate between 0 and 1."""
        low, high = self.axis.span
        return float(np.clip((self.axis.coordinate(gain) - low) / (high - low), 0.0, 1.0))

    def admittance(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Convert search coordinates to natural frequencies and damping ratios.

        Search coordinates are between 0 and 1.

        Returns:
            The natural frequencies [rad/s] and the damping ratios.
        """
        fixed = self.scenario.admittance
        column = iter(at.T[1:])
        frequency = (
            np.full(len(at), fixed.natural_frequency)
            if self.natural_frequency is None
            else _between(self.natural_frequency, next(column))
        )
        if self.damping_ratio is not None:
            return frequency, _between(self.damping_ratio, next(column))
        ratio = fixed.damping_ratio if fixed.stiffness > 0 else np.nan
        return frequency, np.full(len(at), ratio)

    def scenarios(self, at: FloatArray) -> Scenario:
        """Return the encounters with the admittances of several search points."""
        if self.size == 1:
            return self.scenario
        frequency, ratio = self.admittance(at)
        mass = np.full(len(at), self.scenario.admittance.mass)
        admittance = Admittance.from_natural_frequency(mass=mass, natural_frequency=frequency, damping_ratio=ratio)
        return replace(self.scenario, admittance=admittance)

    def choice(self, at: FloatArray) -> tuple[Scenario, float]:
        """Return the encounter and the gain that one search point represents."""
        scenario = map_fields(self.scenarios(at[None]), lambda v: v.item() if np.ndim(v) else v)
        return scenario, float(self.gain(at[None])[0])

    def chain(self, at: FloatArray) -> tuple[tuple[tuple[str, float], ...], ...]:
        """Differentiate physical inputs with respect to each search coordinate.

        Returns:
            For each search coordinate, names and derivatives of the inputs, such as the stiffness.
        """
        point = at[None]
        low, high = self.axis.span
        gain = float(self.gain(point)[0])
        inputs: list[tuple[tuple[str, float], ...]] = [(("gain", (high - low) * self.axis.stretch(gain)),)]
        frequency, ratio = (float(v[0]) for v in self.admittance(point))
        mass = self.scenario.admittance.mass
        if self.natural_frequency is not None:
            rate = _rate(self.natural_frequency, frequency)
            damping, stiffness = 2 * ratio * mass * rate, 2 * frequency * mass * rate
            inputs.append((("admittance.damping", damping), ("admittance.stiffness", stiffness)))
        if self.damping_ratio is not None:
            inputs.append((("admittance.damping", 2 * frequency * mass * _rate(self.damping_ratio, ratio)),))
        return tuple(inputs)

    def lattice(self, gains: int) -> FloatArray:
        """Return a regular grid of search points.

        It includes the bounds of all free parameters.
        """
        counts = {1: (), 2: (17,), 3: (13, 9)}[self.size]
        columns = [np.linspace(0.0, 1.0, count) for count in (gains, *counts)]
        return np.stack(np.meshgrid(*columns, indexing="ij"), axis=-1).reshape(-1, self.size)

    def spread(self, count: int) -> FloatArray:
        """Return evenly spread search points.

        They are a low-discrepancy sequence over all free parameters. The points are multiples of the inverse powers of
        x, modulo 1, where x^(size + 1) = x + 1 generalizes the golden section (H. Niederreiter, Random Number
        Generation and Quasi-Monte Carlo Methods, 1992).
        """
        x = float(np.roots([1.0, *([0.0] * (self.size - 1)), -1.0, -1.0]).real.max())
        steps = x ** -np.arange(1.0, self.size + 1)
        return np.asarray((0.5 + np.arange(count)[:, None] * steps) % 1.0)


def make_freedom(
    scenario: Scenario,
    bounds: Range,
    natural_frequency: Sequence[float] | None,
    damping_ratio: Sequence[float] | None,
    law: ContinuousLaw = DAMPER,
) -> Freedom:
    """Return the free parameters of a search.

    Raises:
        InvalidInputError: the parameters cannot be free, or the scenario has several encounters.
    """
    axis = GainAxis.between(bounds, law.number)
    if law == DRAG and not (natural_frequency is None and damping_ratio is None):
        raise InvalidInputError(
            f"{'damping_ratio' if natural_frequency is None else 'natural_frequency'}: found bounds, expected none for "
            "a virtual drag; remove these bounds. A virtual drag switches off the admittance. Therefore, stiffness and "
            "damping do not affect the encounter"
        )
    if scenario.shape:
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {scenario.shape}, expected a single encounter; "
            "call this function once for each encounter"
        )
    stiffness = scenario.admittance.stiffness
    if natural_frequency is not None and damping_ratio is None and stiffness == 0:
        raise InvalidInputError(
            "natural_frequency: found bounds, but the stiffness is 0 N/m, so there is no damping ratio to keep; "
            "add bounds of the damping ratio"
        )
    if damping_ratio is not None and natural_frequency is None and stiffness == 0:
        raise InvalidInputError(
            "damping_ratio: found bounds, but the stiffness is 0 N/m, so the damping ratio is undefined; "
            "add bounds of the natural frequency"
        )
    return Freedom(
        scenario=scenario,
        axis=axis,
        natural_frequency=_interval(natural_frequency, "natural_frequency", "rad/s"),
        damping_ratio=_interval(damping_ratio, "damping_ratio", ""),
    )


def _interval(bounds: Sequence[float] | None, name: str, unit: str) -> Range | None:
    if bounds is None:
        return None
    ends = np.asarray(nonnegative(bounds, name, unit))
    if ends.shape != (2,) or not ends[0] < ends[1]:
        raise InvalidInputError(
            f"{name}: found {bounds!r}, expected two numbers in the unit {unit or '1'}, the smaller number first",
            value=bounds,
        )
    return float(ends[0]), float(ends[1])


def _is_log(bounds: Range) -> bool:
    return bounds[0] > 0 and bounds[1] > _LOGARITHMIC * bounds[0]


def _between(bounds: Range, at: FloatArray) -> FloatArray:
    """Convert search coordinates between 0 and 1 to parameter values."""
    low, high = bounds
    value = low * np.exp(np.log(high / low) * at) if _is_log(bounds) else low + (high - low) * at
    return np.asarray(np.where(at == 1, high, np.clip(value, low, high)))


def _rate(bounds: Range, value: float) -> float:
    low, high = bounds
    return float(value * np.log(high / low)) if _is_log(bounds) else high - low
