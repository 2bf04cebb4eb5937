"""Optimize the gain together with natural frequency and damping ratio of the admittance controller."""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, IntArray
from pretouch.motion import Scenario

from .admittance_result import AdmittanceCertificate, AdmittanceDesign, AdmittanceMap, AdmittanceMinimum
from .certificate import DesignStatus
from .gain import GainDesign
from .problem import GainProblem
from .relaxation import relax_trials
from .search.circles import best_gains, follow_kinks
from .search.freedom import make_freedom
from .search.local import descend, kkt_residual, least_violations
from .search.trials import Trials
from .task import Task, with_file_location

_GAINS: Final = 65
_STARTS: Final = 8
_TESTS: Final = 2048  # number of encounters that test the optimum
_SAME: Final = 1e-3  # minima closer than this share of the range in each coordinate are the same
_BETTER: Final = 1e-9  # smallest relative improvement of the objective that counts
_ROUNDS: Final = 4
_STATIONARY: Final = 1e-6  # a larger residual shows that the search by derivatives stopped at a kink
_ZOOMS: Final = 3
_ONE: Final = np.ones(1)


@check_arguments
@with_file_location
def design_admittance(task: Task) -> AdmittanceDesign:
    """Optimize the gain and the admittance together.

    The free parameters are the gain D_p and the natural frequency, the damping ratio or both.

    A grid over all free parameters locates the minima. SciPy's SLSQP refines each one, with exact gradients if the
    objective depends only on quantities at contact. If it stops at a kink, where derivatives jump, the best minimum is
    compared with the admittances around it. Two tests follow: encounters at other points, and a complete design of the
    gain at the optimal admittance.

    Args:
        task: one encounter, the objective, the bounds, and bounds of natural frequency, damping ratio or both;
            optionally constraints, impact, method, horizon and `evaluate`.

    Returns:
        The design, with the design of the gain at the optimal admittance; infeasible and no-contact are statuses.

    Raises:
        InvalidInputError: neither natural frequency nor damping ratio is free, or a request makes no sense.

    Examples:
        >>> from pretouch.designs import Constraint, excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import ExponentialFirstOrder
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     ExponentialFirstOrder(scale=0.458, rate=-61.0),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     bounds=(-10.0, -0.01),
        ...     damping_ratio=(0.7, 2.0),
        ... )
        >>> design = design_admittance(task)
        >>> round(design.gain, 3), design.damping_ratio
        (-1.256, 2.0)
        >>> round(design.objective, 4), round(design.unchanged.objective, 4)
        (0.1441, 0.1564)
    """
    if not task.is_admittance_free:
        raise InvalidInputError(
            "natural_frequency: found no bounds of natural_frequency or damping_ratio, expected bounds of at least "
            "one of them; to optimize only the gain, use design_gain"
        )
    free = task.natural_frequency, task.damping_ratio
    freedom = make_freedom(task.scenario, task.stable_bounds(), *free, law=task.law)
    problem = GainProblem(task=task, axis=freedom.axis)
    trials = Trials(freedom=freedom, encounters=problem, measures=(problem.merit,))

    def gain_at(encounter: Scenario) -> GainDesign:
        return GainDesign.of(GainProblem(task=task.replace(scenario=encounter), axis=problem.axis))

    search = _AdmittanceSearch(trials)
    minima = search.minima()
    for _ in range(_ROUNDS if minima else 0):
        chosen = gain_at(freedom.choice(minima[0].at)[0])
        if chosen.gain is None or chosen.objective > minima[0].objective * (1 - _BETTER):
            break
        search.add_start(np.append(freedom.coordinate(chosen.gain), minima[0].at[1:]))
        minima = search.follow_kinks()
    if not minima:
        return search.answer(gain_at(task.scenario), None)
    best, _ = freedom.choice(minima[0].at)
    return search.answer(gain_at(task.scenario), gain_at(best))


class _AdmittanceSearch:
    """Local search for the best gains and admittances."""

    def __init__(self, trials: Trials) -> None:
        self.trials = trials
        self.grid = trials.freedom.lattice(_GAINS)
        self.rows, _ = trials.rows(self.grid)
        self.values = np.where(trials.feasible(self.rows), self.rows[:, 0], np.inf)
        self.tests: FloatArray = trials.freedom.spread(_TESTS)
        self.test_values = trials.values(self.tests)[:, 0]
        self.local_minima: list[AdmittanceMinimum] = []

    def minima(self) -> list[AdmittanceMinimum]:
        """Find the local minima of the objective."""
        feasible = np.isfinite(self.values).any() or np.isfinite(self.test_values).any()
        for start in self.grid[self._starts()] if feasible else self.least_violations:
            self.add_start(start)
        for _ in range(_ROUNDS):
            best = int(self.test_values.argmin())
            if not self.test_values[best] < (self.local_minima[0].objective if self.local_minima else np.inf):
                break
            before = self.local_minima[0].objective if self.local_minima else np.inf
            self.add_start(self.tests[best])
            if not self.local_minima or self.local_minima[0].objective >= before:
                break
        return self.follow_kinks()

    def follow_kinks(self) -> list[AdmittanceMinimum]:
        """Improve the best minimum if the search by derivatives stopped at a kink.

        Returns:
            All local minima, best first.
        """
        if self.local_minima:
            best = self.local_minima[0]
            if kkt_residual(self.trials, best.at, _ONE)[0] > _STATIONARY:
                self._add(*follow_kinks(self.trials, best.at, best.objective))
        return self.local_minima

    def add_start(self, start: FloatArray) -> list[AdmittanceMinimum]:
        """Start one more local search at a given point.

        Returns:
            All local minima, best first.
        """
        trials = self.trials
        descended = descend(trials, start, _ONE)
        tried = [start] if descended is None else [descended[0], start]
        values = trials.values(np.stack(tried))[:, 0]
        return self._add(tried[int(values.argmin())], float(values.min()))

    def _add(self, at: FloatArray, value: float) -> list[AdmittanceMinimum]:
        """Add a local minimum unless a better one lies close to it."""
        trials = self.trials
        if np.isfinite(value) and not any(
            np.abs(m.at - at).max() < _SAME and m.objective <= value for m in self.local_minima
        ):
            self.local_minima = [m for m in self.local_minima if np.abs(m.at - at).max() >= _SAME]
            frequency, ratio = (float(v[0]) for v in trials.freedom.admittance(at[None]))
            self.local_minima.append(
                AdmittanceMinimum(
                    gain=trials.freedom.choice(at)[1],
                    natural_frequency=frequency,
                    damping_ratio=ratio,
                    objective=value,
                    at=at,
                )
            )
            self.local_minima.sort(key=lambda m: m.objective)
        return self.local_minima

    def _starts(self) -> IntArray:
        """Return the grid points at which the local searches start, best first."""
        from scipy.ndimage import minimum_filter  # noqa: PLC0415

        table = self.values.reshape(self._shape())
        lowest = np.flatnonzero((table <= minimum_filter(table, size=3, mode="nearest")) & np.isfinite(table))
        return np.asarray(lowest[np.argsort(self.values[lowest], kind="stable")][:_STARTS], dtype=np.int64)

    @cached_property
    def least_violations(self) -> FloatArray:
        """The points that exceed the limits least, found by local searches from the grid and the tests.

        The smallest violation comes first. Empty without contact or without limits.
        """
        every = np.concatenate([self.grid, self.tests])
        return least_violations(self.trials, every, self.trials.landscape(every).violation)

    def _shape(self) -> tuple[int, ...]:
        return tuple(len(np.unique(column)) for column in self.grid.T)

    def map(self) -> AdmittanceMap:
        """Return the lowest objective for each admittance of the grid."""
        shape = self._shape()
        grid, values = self.grid.reshape(*shape, -1), self.values.reshape(shape)
        best, middle = values.min(axis=0), np.take_along_axis(grid[..., 0], values.argmin(axis=0)[None], axis=0)[0]
        _, refined = best_gains(
            self.trials, grid[0].reshape(middle.size, -1)[:, 1:], middle.reshape(-1), 1 / (shape[0] - 1), _ZOOMS
        )
        best = np.minimum(best, refined.reshape(best.shape))
        frequency, ratio = (v.reshape(shape)[0] for v in self.trials.freedom.admittance(self.grid))
        return AdmittanceMap(natural_frequency=frequency, damping_ratio=ratio, objective=best)

    def best_ratio(self) -> float | None:
        """Return the smallest constraint violation of any gain and admittance.

        It is a ratio |quantity| / limit. None if a point is feasible, or without constraints or contact.
        """
        if self.local_minima or not len(self.least_violations):
            return None
        return float(self.trials.landscape(self.least_violations[:1]).violation[0])

    def answer(self, unchanged: GainDesign, chosen: GainDesign | None) -> AdmittanceDesign:
        """Combine the gain designs for the given and the optimal admittance.

        Returns:
            One result for both admittances.
        """
        freedom, certificate = self.trials.freedom, None
        status = DesignStatus.INFEASIBLE if np.isfinite(self.rows).all(axis=1).any() else DesignStatus.NO_CONTACT
        if chosen is not None:
            status = chosen.status
            residual, active, multipliers = kkt_residual(self.trials, self.local_minima[0].at, _ONE)
            certificate = AdmittanceCertificate(
                grid=len(self.grid),
                tests=len(self.tests),
                local_minima=tuple(self.local_minima),
                residual=residual,
                active=tuple(zip(active, (float(m) for m in multipliers), strict=True)),
            )
        return AdmittanceDesign(
            problem=self.trials.encounters,
            status=status,
            free=freedom.names,
            natural_frequency_bounds=freedom.natural_frequency,
            damping_ratio_bounds=freedom.damping_ratio,
            gain_design=chosen if status is DesignStatus.OPTIMAL else None,
            unchanged=unchanged,
            certificate=certificate,
            map=self.map(),
            best_ratio=self.best_ratio(),
            relaxations=relax_trials(self.trials, self.least_violations[0]) if self.best_ratio() else (),
        )
