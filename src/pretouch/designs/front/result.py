"""Define the result of a Pareto front computation."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.motion.contact import ContactResult

from ..constraints import Constraint
from ..problem import Answer
from ..relaxation import Relaxation
from .bound_comparison import BoundComparison
from .physical_bound import PhysicalBound


class FrontStatus(StrEnum):
    """Status of the search for a Pareto front."""

    FOUND = "found"
    INFEASIBLE = "infeasible"
    NO_CONTACT = "no-contact"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FrontPoint(Value):
    """A marked encounter of a Pareto plot.

    Args:
        name: `knee`, `choice`, or `least` with the quantity whose smallest value it has.
        gain: the law's number, such as D_p [N s].
        natural_frequency: sqrt(K_a / M_a) [rad/s].
        damping_ratio: D_a / (2 sqrt(M_a K_a)); NaN if the stiffness is 0.
        values: the magnitude of each quantity in SI.
        distance_to_front: amount by which the front is better in every quantity, as a share of the front's
            extent. It is 0 on the front, slightly negative between its points, and clearly negative if the encounter
            exceeds a limit or lies outside of the bounds.
        feasible: whether the encounter meets every limit.
        depth: for a knee, its distance from the plane through the ends of the front, relative to the extent; else None.
        bound: the comparison with the physical bound; None if the bound does not apply.
        result: the solved encounter.
    """

    name: str
    gain: float
    natural_frequency: float
    damping_ratio: float
    values: dict[str, float]
    distance_to_front: float
    feasible: bool
    depth: float | None
    bound: BoundComparison | None
    result: ContactResult

    def to_dict(self) -> dict[str, Any]:
        """Return the Pareto point as a JSON object.

        Numbers are in SI units.
        """
        names = ("name", "gain", "natural_frequency", "damping_ratio", "distance_to_front", "feasible", "depth")
        document = {name: getattr(self, name) for name in names}
        return {**document, **self.values, **({} if self.bound is None else self.bound.to_dict())}

    def __repr__(self) -> str:
        return f"<FrontPoint {self.name}: gain {self.gain:.4g}>"


@dataclass(frozen=True, kw_only=True, repr=False)
class ParetoFront(Answer):
    """Result of `pareto`: the best compromises between contact quantities.

    No point can improve in one quantity without becoming worse in another.

    Args:
        problem: the task and the bounds of the gain.
        status: found, infeasible (no point meets the constraints) or no-contact.
        quantities: two or three names of QUANTITY_UNITS, whose magnitudes are minimized.
        free: the free parameters: `gain`, `natural_frequency`, `damping_ratio`.
        gain: the law's number of each point, such as D_p [N s], shape (n,).
        natural_frequency: natural frequency of each point [rad/s].
        damping_ratio: damping ratio of each point.
        values: magnitudes of the quantities in SI, shape (n, k), ascending in the first one; for three quantities
            over the gain alone, ascending in the gain.
        piece: index of the connected piece of each point, shape (n,): the front may have gaps.
        knee: the point at which a small loss in one quantity gains most in the others; None if the front is straight
            or bulges outward.
        choice: the user's choice; None without a choice.
        ends: the points with the smallest value of each quantity.
        comparison: the comparison of the points with the physical bound; None if the bound does not apply.
        bound: the physical bound for the acceleration (and speed) limit of the constraints; None without such a limit.
        no_bound: why there is no comparison; empty if there is one.
        scanned: magnitudes of every feasible encounter of the search, shape (m, k).
        evaluated: number of encounters of the search.
        approximation_error: largest amount by which an encounter is better than the front in every quantity,
            as a share of the front's extent. Compared are all encounters of the search, and further ones between the
            points.
        natural_frequency_bounds: bounds of the natural frequency [rad/s]; None if it is not free.
        damping_ratio_bounds: bounds of the damping ratio; None if it is not free.
        result: the encounters of the points; None without points.
        relaxations: the limits that must be raised, and to what values, if the front is infeasible; else empty.
    """

    status: FrontStatus
    quantities: tuple[str, ...]
    free: tuple[str, ...]
    gain: FloatArray
    natural_frequency: FloatArray
    damping_ratio: FloatArray
    values: FloatArray
    piece: Any
    knee: FrontPoint | None
    choice: FrontPoint | None
    ends: tuple[FrontPoint, ...]
    comparison: BoundComparison | None
    bound: PhysicalBound | None
    no_bound: str
    scanned: FloatArray
    evaluated: int
    approximation_error: float
    natural_frequency_bounds: tuple[float, float] | None
    damping_ratio_bounds: tuple[float, float] | None
    result: ContactResult | None
    relaxations: tuple[Relaxation, ...]

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The constraints of the task."""
        return self.problem.task.limits

    @property
    def marked(self) -> tuple[FrontPoint, ...]:
        """The points marked in a plot of the Pareto front.

        They are the knee and the user's choice, if they exist.
        """
        return tuple(point for point in (self.knee, self.choice) if point is not None)

    @property
    def units(self) -> tuple[str, ...]:
        """The SI unit of each quantity of the Pareto front."""
        return tuple(self.number.entry(name).unit for name in self.quantities)

    def of(self, quantity: str) -> FloatArray:
        """Return one quantity at every point of the Pareto front.

        The result is its magnitude in SI units.

        Raises:
            InvalidInputError: the front does not contain the quantity.
        """
        if quantity not in self.quantities:
            raise InvalidInputError(**not_one_of("quantity", quantity, self.quantities))
        return np.asarray(self.values[:, self.quantities.index(quantity)])

    def meets(self, **limits: float) -> BoolArray:
        """Return which Pareto points meet additional limits.

        Limits are in SI units, such as `displacement=0.05`.
        """
        meets = np.ones(len(self.gain), dtype=bool)
        for name, limit in limits.items():
            meets &= self.of(name) <= limit
        return meets

    @property
    def headline(self) -> str:
        """A summary of the search for the Pareto front in one or two sentences."""
        names = [self.number.entry(name).short for name in self.quantities]
        traded = f"{', '.join(names[:-1])} and {names[-1]}"
        if self.status is FrontStatus.INFEASIBLE:
            return (
                "Infeasible: no design within the bounds meets every constraint. Therefore, the Pareto front of "
                f"{traded} is empty."
            )
        if self.status is FrontStatus.NO_CONTACT:
            return "No point within the bounds ends in contact."
        if len(self.gain) == 1:
            every = "both" if len(names) == 2 else "all"
            return f"{traded[0].upper()}{traded[1:]} do not conflict: {self._chosen(self.ends[0])} is best in {every}."
        if self.knee is None:
            return f"The Pareto front of {traded} has {len(self.gain)} points and no knee."
        quantities = zip(names, self.knee.values.values(), self.units, strict=True)
        values = ", ".join(f"{name} {format_quantity(value, unit)}" for name, value, unit in quantities)
        chosen = self._chosen(self.knee)
        return f"The knee of the Pareto front of {traded} is the design with {chosen}, which results in {values}."

    @property
    def free_units(self) -> dict[str, str]:
        """SI units of the possible parameters of a Pareto search."""
        return {"gain": self.number.unit, "natural_frequency": "rad/s", "damping_ratio": ""}

    def _chosen(self, point: FrontPoint) -> str:
        gain = f"{self.number.symbol} = "
        labels = {"gain": gain, "natural_frequency": "natural frequency ", "damping_ratio": "damping ratio "}
        return ", ".join(
            label + format_quantity(getattr(point, name), self.free_units[name])
            for name, label in labels.items()
            if name in ("gain", *self.free)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the Pareto front as a JSON object.

        Numbers are in SI units. Missing numbers are None.
        """
        bound, least = self.bound, None
        if bound is not None:
            speed = bound.least_contact_speed
            least = {
                name: getattr(bound, name) for name in ("acceleration_limit", "speed_limit", "least_contact_speed")
            }
            least["excursion_at_least_contact_speed"] = bound.excursion(speed)
        columns = {name: getattr(self, name) for name in ("gain", "natural_frequency", "damping_ratio", "piece")}
        traded = {name: self.of(name) for name in self.quantities}
        names = ("status", "free", "knee", "choice", "ends", "evaluated", "approximation_error", "relaxations")
        document: dict[str, Any] = plain(
            {
                **{name: getattr(self, name) for name in names},
                "quantities": [{"name": n, "unit": u} for n, u in zip(self.quantities, self.units, strict=True)],
                "bounds": {
                    "gain": self.bounds,
                    "natural_frequency": self.natural_frequency_bounds,
                    "damping_ratio": self.damping_ratio_bounds,
                },
                "constraints": [
                    {"name": c.name, "unit": self.number.entry(c.quantity).unit, "limit": c.limit}
                    for c in self.constraints
                ],
                "front": {**columns, **traded, **({} if self.comparison is None else self.comparison.to_dict())},
                "physical_bound": least,
                "no_bound": self.no_bound or None,
            }
        )
        return document
