"""What a trade-off comes to: the front, its knee, the user's choice, and how far all of it is from what is possible."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.values import Value
from pretouch.motion.contact import ContactResult
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel

from .constraints import Constraint
from .impact import ImpactModel
from .physical_bound import PhysicalBound
from .quantities import QUANTITY_UNITS

__all__ = ["BoundComparison", "FrontPoint", "FrontStatus", "ParetoFront"]


class FrontStatus(StrEnum):
    """How the search for a front ended."""

    FOUND = "found"
    INFEASIBLE = "infeasible"
    NO_CONTACT = "no-contact"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BoundComparison(Value):
    """Encounters beside the best that a robot with the same largest acceleration could do; floats or arrays.

    Args:
        acceleration: the largest acceleration that the encounter takes [m/s^2].
        excursion: its deviation from the reference at contact, |x - x_d| [m].
        least_excursion: the least excursion with which any robot of that acceleration comes to the same contact speed
            [m]; NaN where the plant first moves toward the obstacle, of which the bound does not speak.
        least_acceleration: the least acceleration with which any robot comes to that contact speed from the same
            detection distance [m/s^2].
    """

    acceleration: Any
    excursion: Any
    least_excursion: Any
    least_acceleration: Any

    @property
    def ratio(self) -> Any:
        """How many times the least excursion the encounter takes, never below 1; NaN where the least is 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(
                np.asarray(self.least_excursion) > 0, np.divide(self.excursion, self.least_excursion), np.nan
            )
        return float(found) if found.ndim == 0 else found

    def __repr__(self) -> str:
        return f"<BoundComparison: {np.size(self.acceleration)} encounters>"


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

    def __repr__(self) -> str:
        return f"<FrontPoint {self.name}: D_p = {self.gain:.4g} N s>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ParetoFront(Value):
    """What `pareto_front` returns: choices of which none is better than another in every quantity.

    Args:
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
        missed: the largest amount by which the front misses an encounter that was tried, of its extent, in all
            quantities at once: what lies between its points.
        bounds: the gains between which the front was sought [N s].
        natural_frequency_bounds: likewise [rad/s]; None where it is not free.
        damping_ratio_bounds: likewise; None where it is not free.
        constraints: the limits.
        scenario: the encounter.
        sensor: the sensor curve.
        impact: the physical properties, where given.
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
    bounds: tuple[float, float]
    natural_frequency_bounds: tuple[float, float] | None
    damping_ratio_bounds: tuple[float, float] | None
    constraints: tuple[Constraint, ...]
    scenario: Scenario
    sensor: SensorModel
    impact: ImpactModel | None
    result: ContactResult | None

    @property
    def units(self) -> tuple[str, ...]:
        """The SI unit of each quantity."""
        return tuple(QUANTITY_UNITS[name] for name in self.quantities)

    def of(self, quantity: str) -> FloatArray:
        """Return the magnitudes of one quantity along the front, shape (n,).

        Args:
            quantity: one of `quantities`.

        Returns:
            The magnitudes in SI.

        Raises:
            InvalidInputError: the front does not trade this quantity.
        """
        if quantity not in self.quantities:
            raise InvalidInputError(f"quantity: found {quantity!r}, expected one of {', '.join(self.quantities)}")
        return np.asarray(self.values[:, self.quantities.index(quantity)])

    def meets(self, **limits: float) -> BoolArray:
        """Tell which points keep further limits, such as `displacement=0.05`.

        Args:
            limits: the largest magnitude of quantities of the front, in SI.

        Returns:
            Shape (n,).
        """
        kept = np.ones(len(self.gain), dtype=bool)
        for name, limit in limits.items():
            kept &= self.of(name) <= limit
        return kept

    def to_dict(self) -> dict[str, Any]:
        """Return the front as one JSON object: numbers in SI, None where there is none."""
        return front_as_dict(self)

    def __repr__(self) -> str:
        return f"<ParetoFront: {front_headline(self)}>"

    def __str__(self) -> str:
        return front_as_text(self)

    def _repr_html_(self) -> str:
        return front_as_html(self)


from .front_summary import front_as_dict, front_as_html, front_as_text, front_headline  # noqa: E402 - it describes the class above
