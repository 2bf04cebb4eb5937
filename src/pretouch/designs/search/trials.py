"""Evaluate objective, constraints and derivatives for trial parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.motion import ContactResult

from ..constraints import Constraint
from ..problem import Criterion, GainProblem, along, ratio
from .freedom import Freedom
from .landscape import HELD, Landscape

_STEP: Final = 2e-4  # step in [0, 1] at which differences of order 4 are as accurate as the contacts
_NODES: Final = np.arange(-2.0, 3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trials:
    """Evaluation of the gains and admittances that a search tries.

    Points have the shape (n, size).
    """

    freedom: Freedom  # the free parameters
    encounters: GainProblem  # the task, which solves encounters and has the constraints
    measures: tuple[Criterion, ...]  # the criteria to minimize

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The constraints of the task."""
        return self.encounters.task.limits

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """The objectives to minimize, followed by the constraint ratios.

        A constraint ratio is |quantity| / limit.
        """
        return (*self.measures, *(ratio(c, self.encounters.task.impact) for c in self.constraints))

    def run(self, at: FloatArray) -> ContactResult:
        """Return the encounters for several search points.

        Each search point represents a gain and an admittance.
        """
        return self.encounters.solve(self.freedom.scenarios(at), self.freedom.gain(at))

    def rows(self, at: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return objectives and constraint ratios of each search point.

        Constraint ratios are |quantity| / limit. Return also which points result in contact.
        """
        result = self.run(at)
        reached = np.asarray(result.reached)
        rows = self.rows_of(result)
        return np.where(reached[:, None], np.reshape(rows, (len(at), -1)), np.inf), reached

    def landscape(self, at: FloatArray) -> Landscape:
        """Return objectives and constraint ratios of each search point, for a scan along one coordinate."""
        rows, _ = self.rows(at)
        count = len(self.measures)
        return Landscape(objective=rows[:, :count].T, ratios=rows[:, count:].T)

    def feasible(self, rows: FloatArray) -> BoolArray:
        """Return which search points are feasible.

        They end in contact and meet every limit.
        """
        ratios = rows[:, len(self.measures) :]
        return np.asarray(np.isfinite(rows).all(axis=1) & (ratios <= HELD).all(axis=1))

    def values(self, at: FloatArray) -> FloatArray:
        """Return the objectives to minimize for each search point.

        They are infinite if the point is not feasible.
        """
        rows, _ = self.rows(at)
        return np.where(self.feasible(rows)[:, None], rows[:, : len(self.measures)], np.inf)

    def differentiate(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Differentiate objectives and constraints at one search point.

        They are infinite, with zero derivatives, without contact. Derivatives are exact if the result has gradients for
        all quantities of a row, else differences are used.

        Returns:
            Values and derivatives; the value of a constraint is |quantity| / limit.
        """
        if not self._has_gradients:
            return self._differences(at)
        result = self.run(at[None])
        if not np.asarray(result.reached).all():
            return np.full(len(self.criteria), np.inf), np.zeros((len(self.criteria), len(at)))
        slopes = self._exact(result, at)
        return self._differences(at) if np.isnan(slopes).any() else (np.reshape(self.rows_of(result), -1), slopes)

    @property
    def _has_gradients(self) -> bool:
        """True if all objectives and constraints have exact derivatives."""
        return self.encounters.is_differentiable and all(criterion.has_gradients for criterion in self.criteria)

    def rows_of(self, result: ContactResult) -> FloatArray:
        """Return objectives and constraint ratios of computed encounters."""
        return np.stack([np.asarray(c.value(result), dtype=np.float64) for c in self.criteria], axis=-1)

    def _exact(self, result: ContactResult, at: FloatArray) -> FloatArray:
        """Return the exact derivatives of objectives and constraint ratios."""
        gradients, state = result.gradients, result.end
        chain = self.freedom.chain(at)
        names = {name for inputs in chain for name, _ in inputs}
        slopes = np.empty((len(self.criteria), len(at)))
        for i, criterion in enumerate(self.criteria):
            by = {name: criterion.slope(state, along(gradients.of, name)).item() for name in names}
            slopes[i] = [sum(rate * by[name] for name, rate in inputs) for inputs in chain]
        return slopes

    def _differences(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return objectives and constraint ratios, with derivatives by finite differences."""
        size = len(at)
        steps = _NODES + np.clip(0.0, 2 - at / _STEP, (1 - at) / _STEP - 2)[:, None]  # away from the bounds
        points = np.repeat(at[None], 1 + 5 * size, axis=0)
        for j, nodes in enumerate(points[1:].reshape(size, 5, size)):
            nodes[:, j] = np.clip(at[j] + _STEP * steps[j], 0.0, 1.0)
        rows, _ = self.rows(points)
        powers = steps[:, None] ** np.arange(5.0)[:, None]
        weights = np.linalg.solve(powers, np.array([[0.0], [1.0 / _STEP], [0.0], [0.0], [0.0]]))[:, None, :, 0]
        with np.errstate(invalid="ignore"):
            slopes = (weights @ rows[1:].reshape(size, 5, -1))[:, 0].T
        slopes = np.where(np.isfinite(slopes), slopes, 0.0)  # not finite next to an edge of contact
        return rows[0], slopes if np.isfinite(rows[0]).all() else np.zeros_like(slopes)
