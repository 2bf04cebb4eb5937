"""What a trade-off comes to: the front, its knee, the user's choice, and how far all of it is from what is possible."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import plain
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.vocabulary import in_short, unit_of
from pretouch.motion.contact import ContactResult

from ..constraints import Constraint
from ..problem import Answer
from .physical_bound import BoundComparison, PhysicalBound


class FrontStatus(StrEnum):
    """How the search for a front ended."""

    FOUND = "found"
    INFEASIBLE = "infeasible"
    NO_CONTACT = "no-contact"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FrontPoint(Value):
    """One encounter in the plane of quantities.

    Args:
        name: `knee`, `choice`, or `least` with the quantity that is least there.
        gain: D_p [N s].
        natural_frequency: sqrt(K_a / M_a) [rad/s].
        damping_ratio: D_a / (2 sqrt(M_a K_a)); NaN where the stiffness is 0.
        values: the magnitude of each quantity in SI.
        behind: by how much the front is lower in every quantity, of its extent; 0 on the front, where it may be less by
            the distance of the front's points, and below that where the encounter breaks a limit or lies outside the
            bounds.
        feasible: whether every limit holds.
        depth: of a knee: its distance from the plane through the ends of the front, of its extent; else None.
        bound: the encounter beside the physical bound; None where that does not apply.
        result: the encounter.
    """

    name: str
    gain: float
    natural_frequency: float
    damping_ratio: float
    values: dict[str, float]
    behind: float
    feasible: bool
    depth: float | None
    bound: BoundComparison | None
    result: ContactResult

    def to_dict(self) -> dict[str, Any]:
        """Return the point as one JSON object, in SI."""
        names = ("name", "gain", "natural_frequency", "damping_ratio", "behind", "feasible", "depth")
        known = {name: getattr(self, name) for name in names}
        return {**known, **self.values, **({} if self.bound is None else self.bound.to_dict())}

    def __repr__(self) -> str:
        return f"<FrontPoint {self.name}: gain {self.gain:.4g}>"


@dataclass(frozen=True, kw_only=True, repr=False)
class ParetoFront(Answer):
    """What `pareto_front` returns: choices of which none is better than another in every quantity.

    Args:
        problem: the task, and the gains between which the front was sought.
        status: found, infeasible (no choice meets the constraints) or no-contact.
        quantities: what is traded, two or three names of QUANTITY_UNITS; their magnitudes are minimized.
        free: what was chosen: `gain`, `natural_frequency`, `damping_ratio`.
        gain: D_p of each point of the front [N s], shape (n,).
        natural_frequency: of each point [rad/s].
        damping_ratio: of each point.
        values: magnitudes of the quantities in SI, shape (n, k), ascending in the first one; of three quantities
            over the gain alone, ascending in the gain.
        piece: the number of the piece of the front that each point belongs to, shape (n,): the front may have gaps.
        knee: where giving up a little of one quantity gains most of the others; None where the front bulges outward.
        choice: the user's own choice; None where there is none.
        ends: the points at which each quantity is least.
        comparison: the points beside the physical bound; None where it does not apply.
        bound: the physical bound of a robot with the acceleration (and speed) limit of the constraints; None without.
        no_bound: why there is no comparison; empty where there is one.
        scanned: magnitudes of every feasible encounter that was tried, shape (m, k).
        tried: how many encounters were tried on the way.
        missed: the largest amount by which the points of the front miss an encounter, of the front's extent, in all
            quantities at once. It is sought between the points as well as among all that was tried.
        natural_frequency_bounds: between which it was sought [rad/s]; None where it is not free.
        damping_ratio_bounds: likewise; None where it is not free.
        result: the encounters of the points; None where there are none.
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
    tried: int
    missed: float
    natural_frequency_bounds: tuple[float, float] | None
    damping_ratio_bounds: tuple[float, float] | None
    result: ContactResult | None

    page: ClassVar[str] = "pretouch.design.front.page:front_page"

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The limits."""
        return self.problem.task.limits

    @property
    def marked(self) -> tuple[FrontPoint, ...]:
        """The knee and the choice, as far as there are any."""
        return tuple(point for point in (self.knee, self.choice) if point is not None)

    @property
    def units(self) -> tuple[str, ...]:
        """The SI unit of each quantity."""
        return tuple(map(unit_of, self.quantities))

    def of(self, quantity: str) -> FloatArray:
        """Return the magnitudes of one of its quantities along the front in SI, shape (n,)."""
        if quantity not in self.quantities:
            raise InvalidInputError(f"quantity: found {quantity!r}, expected one of {', '.join(self.quantities)}")
        return np.asarray(self.values[:, self.quantities.index(quantity)])

    def meets(self, **limits: float) -> BoolArray:
        """Tell which points, shape (n,), keep further limits in SI of its quantities, such as `displacement=0.05`."""
        kept = np.ones(len(self.gain), dtype=bool)
        for name, limit in limits.items():
            kept &= self.of(name) <= limit
        return kept

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        names = [in_short(name) for name in self.quantities]
        traded = f"{', '.join(names[:-1])} and {names[-1]}"
        if self.status is FrontStatus.INFEASIBLE:
            return f"Infeasible: no choice within the bounds meets every constraint, so {traded} cannot be traded."
        if self.status is FrontStatus.NO_CONTACT:
            return "No choice within the bounds ends in contact."
        if len(self.gain) == 1:
            every = "both" if len(names) == 2 else "all"
            return f"{traded[0].upper()}{traded[1:]} do not conflict: {self._chosen(self.ends[0])} is best in {every}."
        if self.knee is None:
            return f"{len(self.gain)} choices trade {traded}; no knee stands out among them."
        found = zip(names, self.knee.values.values(), self.units, strict=True)
        values = ", ".join(f"{name} {format_quantity(value, unit)}" for name, value, unit in found)
        return f"The knee of {traded} lies at {self._chosen(self.knee)}: {values}."

    @property
    def free_units(self) -> dict[str, str]:
        """What can be chosen along the front, with its SI unit."""
        return {"gain": self.number.unit, "natural_frequency": "rad/s", "damping_ratio": ""}

    def _chosen(self, point: FrontPoint) -> str:
        own = f"{self.number.symbol} = "
        chosen = {"gain": own, "natural_frequency": "natural frequency ", "damping_ratio": "damping ratio "}
        return ", ".join(
            words + format_quantity(getattr(point, name), self.free_units[name])
            for name, words in chosen.items()
            if name in ("gain", *self.free)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the front as one JSON object: numbers in SI, None where there is none."""
        bound, least = self.bound, None
        if bound is not None:
            speed = bound.least_contact_speed
            least = {
                name: getattr(bound, name) for name in ("acceleration_limit", "speed_limit", "least_contact_speed")
            }
            least["excursion_at_least_contact_speed"] = bound.excursion(speed)
        columns = {name: getattr(self, name) for name in ("gain", "natural_frequency", "damping_ratio", "piece")}
        traded = {name: self.of(name) for name in self.quantities}
        names = ("status", "free", "knee", "choice", "ends", "tried", "missed")
        told: dict[str, Any] = plain(
            {
                **{name: getattr(self, name) for name in names},
                "quantities": [{"name": n, "unit": u} for n, u in zip(self.quantities, self.units, strict=True)],
                "bounds": {
                    "gain": self.bounds,
                    "natural_frequency": self.natural_frequency_bounds,
                    "damping_ratio": self.damping_ratio_bounds,
                },
                "constraints": [{"name": c.name, "unit": c.unit, "limit": c.limit} for c in self.constraints],
                "front": {**columns, **traded, **({} if self.comparison is None else self.comparison.to_dict())},
                "physical_bound": least,
                "no_bound": self.no_bound or None,
            }
        )
        return told
