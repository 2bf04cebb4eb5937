"""Define the result of optimizing the gain and the admittance together."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.motion import Admittance, Scenario

from .certificate import DesignStatus
from .gain import GainDesign
from .problem import Answer
from .relaxation import Relaxation


@dataclass(frozen=True, slots=True, kw_only=True)
class AdmittanceMinimum(Value):
    """A local minimum of the objective over gain and admittance.

    Args:
        gain: the law's number, such as D_p [N s].
        natural_frequency: sqrt(K_a / M_a) [rad/s].
        damping_ratio: D_a / (2 sqrt(M_a K_a)).
        objective: the objective at the minimum.
        at: the coordinates of the minimum within the bounds, each in [0, 1].
    """

    gain: float
    natural_frequency: float
    damping_ratio: float
    objective: float
    at: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class AdmittanceCertificate(Value):
    """Evidence that the gain and the admittance are globally optimal.

    The optimum is global within the bounds.

    Args:
        grid: number of encounters of the grid over all free parameters.
        tests: number of further encounters, independent of the search; none is better than the optimum.
        local_minima: the local minima, best first.
        residual: residual of the first-order conditions of Karush, Kuhn and Tucker: the largest component of the
            gradient of the Lagrangian, relative to the objective, in coordinates from 0 to 1 between the bounds. It is
            large at an optimum at a kink, such as that of a largest acceleration, where gradients jump; then the
            search has compared the points around the optimum.
        active: the active limits and bounds, each with its multiplier: the relative decrease of the objective per
            relative increase of a limit, or per change of a bound relative to its range.
    """

    grid: int
    tests: int
    local_minima: tuple[AdmittanceMinimum, ...]
    residual: float
    active: tuple[tuple[str, float], ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the evidence for the optimum as one JSON object."""
        active = [{"name": name, "multiplier": multiplier} for name, multiplier in self.active]
        names = ("grid", "tests", "residual", "local_minima")
        return {**{name: getattr(self, name) for name in names}, "active": active}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class AdmittanceMap(Value):
    """The lowest objective for each admittance of a grid.

    It is the lowest objective of all gains of the grid.

    Args:
        natural_frequency: natural frequency [rad/s], with the shape of the grid over the free parameters.
        damping_ratio: damping ratio, of the same shape.
        objective: best objective, of the same shape; infinite if no gain of the grid is feasible.
    """

    natural_frequency: FloatArray
    damping_ratio: FloatArray
    objective: FloatArray

    def __repr__(self) -> str:
        return f"<AdmittanceMap: {self.objective.size} admittances>"


@dataclass(frozen=True, kw_only=True, repr=False)
class AdmittanceDesign(Answer):
    """Result of `design_admittance`: the optimal gain and the optimal admittance.

    Args:
        problem: the task and the bounds of the gain.
        status: optimal, infeasible or no-contact.
        free: the free parameters: `gain` and `natural_frequency`, `damping_ratio` or both.
        natural_frequency_bounds: bounds of the natural frequency [rad/s]; None if it is not free.
        damping_ratio_bounds: bounds of the damping ratio; None if it is not free.
        gain_design: the design of the gain at the optimal admittance, with its evidence; None unless optimal.
        unchanged: the design of the gain with the admittance of the scenario.
        certificate: evidence that the design is the global optimum; None unless optimal.
        map: the best objective over admittances.
        best_ratio: if infeasible, the smallest value of the largest ratio |quantity| / limit; else None.
        relaxations: the limits that must be raised, and to what values, if the design is infeasible; else empty.
    """

    status: DesignStatus
    free: tuple[str, ...]
    natural_frequency_bounds: tuple[float, float] | None
    damping_ratio_bounds: tuple[float, float] | None
    gain_design: GainDesign | None
    unchanged: GainDesign
    certificate: AdmittanceCertificate | None
    map: AdmittanceMap
    best_ratio: float | None
    relaxations: tuple[Relaxation, ...]

    @property
    def gain(self) -> float | None:
        """The optimal gain of the control law.

        None if there is no optimum.
        """
        return None if self.gain_design is None else float(self.gain_design.gain)

    @property
    def objective(self) -> float | None:
        """The objective at the optimal gain and admittance.

        None if there is no optimum.
        """
        return None if self.gain_design is None else float(self.gain_design.objective)

    @property
    def scenario(self) -> Scenario:
        """The encounter with the optimal admittance.

        Without an optimum, it is the encounter of the task.
        """
        return self.problem.task.scenario if self.gain_design is None else self.gain_design.scenario

    @property
    def admittance(self) -> Admittance:
        """The optimal admittance: virtual mass, damping and stiffness.

        Raises:
            ResultUnavailableError: there is no optimum; `status` says why.
        """
        if self.gain_design is None:
            raise ResultUnavailableError(
                f"admittance: the design found no optimal admittance; its status is {self.status.value}"
            )
        return self.gain_design.scenario.admittance

    @property
    def natural_frequency(self) -> float | None:
        """The optimal natural frequency [rad/s]; None if there is no optimum."""
        return None if self.certificate is None else self.certificate.local_minima[0].natural_frequency

    @property
    def damping_ratio(self) -> float | None:
        """The optimal damping ratio; None if there is no optimum."""
        return None if self.certificate is None else self.certificate.local_minima[0].damping_ratio

    def to_dict(self) -> dict[str, Any]:
        """Return the gain and admittance design as a JSON object.

        The evidence of optimality is included.
        """
        names = ("free", "natural_frequency", "damping_ratio", "natural_frequency_bounds", "damping_ratio_bounds")
        chosen = None if self.gain_design is None else self.admittance
        document = {
            **{name: getattr(self, name) for name in (*names, "best_ratio", "relaxations")},
            **{name: getattr(chosen, name, None) for name in ("mass", "damping", "stiffness")},
            "unchanged": {"gain": self.unchanged.gain, "objective": self.unchanged.objective},
            "certificate": self.certificate,
            "map": {f.name: getattr(self.map, f.name).reshape(-1) for f in fields(self.map)},
        }
        gain = (self.gain_design or self.unchanged).to_dict()
        return {**gain, "status": self.status.value, "admittance": plain(document)}

    @property
    def headline(self) -> str:
        """A summary of the design in one to three sentences."""
        if self.gain_design is None or self.objective is None:
            if self.status is DesignStatus.NO_CONTACT:
                return "No gain and admittance within the bounds end in contact."
            excess = (
                ""
                if self.best_ratio is None
                else f" Even the best gain and admittance exceed a limit by {100 * (self.best_ratio - 1):.3g} %."
            )
            return f"Infeasible: within the bounds, no gain and admittance together meet every constraint.{excess}"
        text = (
            "The optimal admittance has a natural frequency of "
            f"{format_quantity(self.natural_frequency or 0.0, 'rad/s')} and a damping ratio of "
            f"{self.damping_ratio:.4g}. The optimal gain is {self.number.equals(self.gain or 0.0)}."
        )
        if self.unchanged.objective is not None:
            change = 100 * (self.objective / self.unchanged.objective - 1)
            return (
                f"{text} Compared with the admittance of the task, the objective changes by {change:+.3g} % "
                f"(new value: {self.objective:.4g})."
            )
        return (
            f"{text} The objective is {self.objective:.4g}. With the admittance of the task, no gain "
            "meets every constraint."
        )
