"""Gain and admittance designed together: natural frequency and damping ratio are free, the mass is kept."""

from __future__ import annotations

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
from .search import HELD, GainAxis
from .search.local import descend, kkt_residual
from .search.trials import Trials, make_freedom
from .task import Task, placed

_GAINS: Final = 65
_STARTS: Final = 8
_HOPELESS: Final = 10.0  # times a limit: what misses one by so much on the whole grid meets it nowhere between
_TESTS: Final = 2048  # encounters
_SAME: Final = 1e-3  # of the range of each coordinate: minima closer than this are one
_BETTER: Final = 1e-9  # relative: an objective that is lower by less is the same
_ROUNDS: Final = 4
_NARROW: Final = (1e-2, 1e-3, 1e-4)  # of the gains, around the one that was found
_NEAR: Final = np.linspace(-1.0, 1.0, 17)
_ZOOMS: Final = 3
_ONE: Final = np.ones(1)


@check_arguments
@placed
def design_admittance(task: Task) -> AdmittanceDesign:
    """Find the gain D_p together with the natural frequency, the damping ratio or both that minimize an objective.

    A grid over all that is free shows where the minima lie; from each, SciPy's SLSQP goes to the minimum, with exact
    gradients where the objective is made of quantities at contact. The answer is tested by encounters that had no part
    in finding it, and by a whole design of the gain at the admittance that was found.

    Args:
        task: one encounter, the objective, the bounds, which of natural frequency and damping ratio is free, and where
            given constraints, impact, method, horizon and `evaluate`.

    Returns:
        The design, with that of the gain at the chosen admittance; infeasible and no-contact are statuses of it.

    Raises:
        InvalidInputError: neither natural frequency nor damping ratio is free, or a request makes no sense.

    Examples:
        >>> from pretouch.design import Constraint, excursion_objective
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
        >>> round(design.objective, 4), round(design.as_it_is.objective, 4)
        (0.1441, 0.1564)
    """
    if not task.is_admittance_free:
        raise InvalidInputError(
            "natural_frequency: found neither it nor damping_ratio free, expected bounds of at least one; "
            "use design_gain for the gain alone"
        )
    free = task.natural_frequency, task.damping_ratio
    freedom = make_freedom(task.scenario, task.stable_bounds(), *free, law=task.law)
    problem = GainProblem(task=task, axis=freedom.axis)
    trials = Trials(freedom=freedom, encounters=problem, measures=(problem.merit,))

    def gain_at(encounter: Scenario, axis: GainAxis = problem.axis) -> GainDesign:
        return GainDesign.of(GainProblem(task=task.replace(scenario=encounter), axis=axis))

    search = _AdmittanceSearch(trials)
    found = search.minima()
    for _ in range(_ROUNDS if found else 0):
        chosen = gain_at(freedom.choice(found[0].at)[0])
        if chosen.gain is None or chosen.objective > found[0].objective * (1 - _BETTER):
            break
        found = search.also(np.append(freedom.coordinate(chosen.gain), found[0].at[1:]))
    if not found:
        return search.answer(gain_at(task.scenario), None)
    best, _ = freedom.choice(found[0].at)
    chosen = gain_at(best)
    for share in _NARROW:
        if chosen.status is DesignStatus.OPTIMAL:
            break
        ends = np.clip(found[0].at[0] + np.array([-share, share]), 0.0, 1.0)  # feasible where the scan has no gain
        chosen = gain_at(best, GainAxis.between(freedom.gain(ends[:, None]).tolist()))
    return search.answer(gain_at(task.scenario), chosen)


class _AdmittanceSearch:
    """The grid, the tests, and the minima found from them."""

    def __init__(self, trials: Trials) -> None:
        self.trials = trials
        self.grid = trials.freedom.lattice(_GAINS)
        self.rows, _ = trials.rows(self.grid)
        self.values = np.where(trials.feasible(self.rows), self.rows[:, 0], np.inf)
        self.tests: FloatArray = trials.freedom.spread(_TESTS)
        self.test_values = trials.values(self.tests)[:, 0]
        self.known: list[AdmittanceMinimum] = []

    def minima(self) -> list[AdmittanceMinimum]:
        """Search from the lowest places of the grid, then from each test that is better than what was found."""
        for i in self._starts():
            self.also(self.grid[i])
        for _ in range(_ROUNDS):
            best = int(self.test_values.argmin())
            if not self.test_values[best] < (self.known[0].objective if self.known else np.inf):
                break
            before = self.known[0].objective if self.known else np.inf
            self.also(self.tests[best])
            if not self.known or self.known[0].objective >= before:
                break
        return self.known

    def also(self, start: FloatArray) -> list[AdmittanceMinimum]:
        """Search from one more start; return all minima, best first."""
        trials = self.trials
        descended = descend(trials, start, _ONE)
        tried = [start] if descended is None else [descended, start]
        values = trials.values(np.stack(tried))[:, 0]
        at, value = tried[int(values.argmin())], float(values.min())
        if np.isfinite(value) and not any(np.abs(m.at - at).max() < _SAME and m.objective <= value for m in self.known):
            self.known = [m for m in self.known if np.abs(m.at - at).max() >= _SAME]
            frequency, ratio = (float(v[0]) for v in trials.freedom.admittance(at[None]))
            self.known.append(
                AdmittanceMinimum(
                    gain=trials.freedom.choice(at)[1],
                    natural_frequency=frequency,
                    damping_ratio=ratio,
                    objective=value,
                    at=at,
                )
            )
            self.known.sort(key=lambda m: m.objective)
        return self.known

    def _starts(self) -> IntArray:
        """Return the grid's local minima, best first; where nothing is feasible, the places that miss limits least."""
        from scipy.ndimage import minimum_filter  # noqa: PLC0415

        shape = self._shape()
        function = self.values if np.isfinite(self.values).any() else self._worst()
        table = function.reshape(shape)
        low = (table <= minimum_filter(table, size=3, mode="nearest")) & np.isfinite(table)
        if function is not self.values:
            low &= table < _HOPELESS
        lowest = np.flatnonzero(low)
        return np.asarray(lowest[np.argsort(function[lowest], kind="stable")][:_STARTS], dtype=np.int64)

    def _worst(self) -> FloatArray:
        ratios = self.rows[:, 1:]
        return np.asarray(ratios.max(axis=1) if ratios.shape[1] else np.full(len(self.rows), np.inf))

    def _shape(self) -> tuple[int, ...]:
        return tuple(len(np.unique(column)) for column in self.grid.T)

    def map(self) -> AdmittanceMap:
        """Return the best objective over the gains, for each admittance of the grid: that of the grid, zoomed in on."""
        shape = self._shape()
        grid, values = self.grid.reshape(*shape, -1), self.values.reshape(shape)
        best, middle = values.min(axis=0), np.take_along_axis(grid[..., 0], values.argmin(axis=0)[None], axis=0)[0]
        half = 1 / (shape[0] - 1)
        for _ in range(_ZOOMS):
            near = np.repeat(grid[:1], len(_NEAR), axis=0)
            near[..., 0] = np.clip(middle + half * _NEAR.reshape(-1, *[1] * middle.ndim), 0.0, 1.0)
            found = self.trials.values(near.reshape(-1, near.shape[-1]))[:, 0].reshape(near.shape[:-1])
            middle = np.take_along_axis(near[..., 0], found.argmin(axis=0)[None], axis=0)[0]
            best, half = np.minimum(best, found.min(axis=0)), 2 * half / (len(_NEAR) - 1)
        frequency, ratio = (v.reshape(shape)[0] for v in self.trials.freedom.admittance(self.grid))
        return AdmittanceMap(natural_frequency=frequency, damping_ratio=ratio, objective=best)

    def best_ratio(self) -> float | None:
        """Return by how much, at best, the worst limit is missed on the grid: |quantity| / limit."""
        worst = self._worst()
        if not self.trials.constraints or not np.isfinite(worst).any():
            return None
        return float(worst.min()) if worst.min() > HELD else None

    def answer(self, as_it_is: GainDesign, chosen: GainDesign | None) -> AdmittanceDesign:
        """Put the answer together with its evidence: the gain with the admittance as it is, and with the chosen one."""
        freedom, certificate = self.trials.freedom, None
        status = DesignStatus.INFEASIBLE if np.isfinite(self.rows).all(axis=1).any() else DesignStatus.NO_CONTACT
        if chosen is not None:
            status = chosen.status
            residual, active, multipliers = kkt_residual(self.trials, self.known[0].at, _ONE)
            certificate = AdmittanceCertificate(
                grid=len(self.grid),
                tests=len(self.tests),
                local_minima=tuple(self.known),
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
            as_it_is=as_it_is,
            certificate=certificate,
            map=self.map(),
            best_ratio=self.best_ratio(),
        )
