"""The gain that is optimal within its bounds and constraints, and what it leads to."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.files import plain
from pretouch._core.numbers import float_or_array
from pretouch._core.units import format_quantity
from pretouch.motion import ContactResult, ContactStatus
from pretouch.motion.evaluator import NoisyEvaluator

from .certificate import DesignStatus
from .drag.design import chosen_drag
from .evidence import GainEvidence, settle
from .problem import GainProblem
from .search import GainAxis
from .sensitivity import gain_gradient
from .task import Task, placed

_RESIDUAL: Final = 1e-9  # of the impulse balance: what is above it is told
_KEYS: Final = {"objective_parts": "objective_terms", "result": "contact"}


def designed_number(task: Task) -> float | None:
    """Choose the number of a task's law: by the effect that is asked of a drag, else by the objective.

    Returns:
        The number, such as D_p [N s] or phi [N s^2]; None where no gain meets the constraints or ends in contact.
    """
    if task.effect is None:
        found: float | None = design_gain(task.replace(evaluate=None)).gain
        return found
    return chosen_drag(task, task.effect)[0]


@dataclass(frozen=True, kw_only=True, repr=False)
class GainDesign(GainEvidence):
    """What `design_gain` returns: the gain at once, its evidence when it is first read.

    Args:
        problem: the task, and the gains between which the optimum was sought.
        settled: status, gain [N s] and objective, as far as these were settled without the whole scan.
    """

    page: ClassVar[str] = "pretouch.design.page:gain_page"

    @classmethod
    def of(cls, problem: GainProblem) -> GainDesign:
        """Design the gain of a problem, or of each encounter of an array."""
        found = cls(problem=problem, settled=settle(problem))
        _ = found.answer  # is searched for now, and not when it is read
        return found

    def at(self, *index: int) -> GainDesign:
        """Return the design of one encounter of an array, at one integer per axis, with its evidence."""
        return GainDesign.of(self.problem.at(index)) if self.scenario.shape else self

    @property
    def method(self) -> str:
        """How the encounters were solved: "closed-form", "integration", "uniform-motion", or "loop" by a ClosedLoop."""
        return self.no_mitigation.method

    @property
    def objective_parts(self) -> dict[str, float]:
        """The terms of the objective by quantity, which add up to it; empty unless optimal.

        Of an objective of a user's own what it declares by `parts`; empty where that does not add up to its value.
        """
        if self.result is None:
            return {}
        speed = abs(self.scenario.obstacle.velocity)
        return {k: float(v) for k, v in self.definition.parts(self.result.end, speed, self.impact).items()}

    @property
    def damping_at_contact(self) -> Any:
        """D_p g(0) [N s/m], what the motion feels of gain and sensor together at contact; an array for an array.

        Of another law its damping dF/dl' there; NaN where that is not known.
        """
        if self.gain is None:
            return None
        law, slope = self.problem.task.law, self.sensor.log_slope(max(self.sensor.valid_range[0], 0.0))
        if law.degree == 1:
            return self.gain * slope
        return float_or_array(law.damping(self.gain, slope, self.problem.run(self.gain).end.relative_velocity))

    def gradient(self, by: str) -> Any:
        """Return how the optimal gain follows one input, exact where objective and limits are those of the contact.

        Args:
            by: the input, such as `obstacle.velocity` or `sensor.exponent`: one of `ContactGradients.inputs`, the gain
                excepted.

        Returns:
            d D_p / d input, in N s per unit of the input: a float, or an array of the scenario's shape. NaN where there
            is no optimal gain, beside an edge of contact, and where the objective has a corner or a jump.
        """
        if self.gain is None:
            return math.nan
        found = gain_gradient(self.problem, self.gain, by, lambda index: self.at(*index))
        return found if self.scenario.shape else float(found)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that a user should read before relying on the gain, in order of weight."""
        return tuple(_warnings(self, self.scan_result))

    @property
    def headline(self) -> str:
        """The answer in one or two sentences."""
        if self.result is not None and self.gain is not None:
            left = abs(self.result.end.relative_velocity)
            n = self.number
            text = f"Optimal {n.name} {n.equals(self.gain)}: contact at {format_quantity(left, 'm/s')}"
            before = self.no_mitigation
            if before.reached.all():
                speed = abs(before.end.relative_velocity)
                change = f"{100 * abs(1 - left / speed):.1f} % {'less' if left <= speed else 'more'}"
                text += f" instead of {format_quantity(speed, 'm/s')} without mitigation ({change})"
            return text + f", after an excursion of {format_quantity(self.result.end.largest_excursion, 'm')}."
        if self.nearest is not None:
            return "Infeasible: " + _conflict(self)
        return "No gain within the bounds ends in contact."

    def to_dict(self) -> dict[str, Any]:
        """Return the design as one JSON object: numbers in SI, None where there is none."""
        known = {"status": self.status, "gain": self.gain, "objective": self.objective}
        if self.scenario.shape:
            return known
        names = ("method", "objective_parts", "result", "no_mitigation", "nearest", "ideal", "damping_at_contact")
        more = ("bounds", "constraints", "certificate", "sensitivities", "sensor", "trade_off", "warnings")
        found = {_KEYS.get(name, name): getattr(self, name) for name in (*names, *more)}
        told: dict[str, Any] = plain({**known, "objective_name": self.definition.name, **found})
        return told

    def __str__(self) -> str:
        return repr(self) if self.scenario.shape else super().__str__()

    def _repr_html_(self) -> str | None:
        return None if self.scenario.shape else super()._repr_html_()

    def __repr__(self) -> str:
        if self.scenario.shape:
            return f"<GainDesign: {(self.status == DesignStatus.OPTIMAL).sum()} of {self.status.size} optimal>"
        return super().__repr__()


def _conflict(design: GainDesign) -> str:
    """Name the constraint that cannot be met and its nearest achievable value, or those that exclude each other."""
    impossible = [o for o in design.constraints if not o.achievable]
    if impossible:
        return "; ".join(
            f"{o.name} cannot be held at {format_quantity(o.limit, o.unit)}: the nearest achievable value is "
            f"{format_quantity(o.best_value or 0.0, o.unit)}, at {design.number.equals(o.best_gain or 0.0)}"
            for o in impossible
        )
    names = " and ".join(o.name for o in design.constraints)
    nearest = ", ".join(
        f"{o.name} {format_quantity(o.value or 0.0, o.unit)} (limit {format_quantity(o.limit, o.unit)})"
        for o in design.constraints
    )
    gain = design.number.equals(float(design.nearest.gain) if design.nearest else 0.0)
    return f"{names} cannot be held together; nearest, at {gain}: {nearest}"


def _warnings(design: GainDesign, scanned: ContactResult) -> Iterator[str]:
    """Yield what should be read before relying on a design, in order of weight."""
    yield from _about_contact(design, scanned)
    if design.certificate is not None and design.certificate.at == "bound":
        yield (
            f"the optimum lies on the bound {design.number.text(design.gain or 0.0)}: a wider range of gains may "
            "hold a better one"
        )
    if design.certificate is not None and design.certificate.at == "edge of contact":
        yield "the optimum lies where contact is just still made: a slightly larger gain misses the object"
    if design.method == "uniform-motion":
        yield (
            "the uniform motion L(16)-(19) is one particular motion that does not start from the given state; it "
            "shifts the optimal gain by about 10 %: compare with method 'integration'"
        )
    if _is_luck(design):
        yield (
            "the gain is optimal for one run and its noise: another run has another optimum; design_robust_gain with "
            "the same evaluate averages over runs"
        )
    n = design.number
    if design.gain is not None and n.sign * design.gain < 0:
        sign = "positive" if design.gain > 0 else "negative"
        yield f"the optimal {n.name} is {sign}: it drives the plant toward the object"
    if design.result is not None:
        residual = float(np.asarray(design.result.impulse_residual))
        if residual > _RESIDUAL:
            yield f"the impulse balance of the motion is met to {residual:.0e} only: its numbers are less certain"


def _is_luck(design: GainDesign) -> bool:
    """Tell whether the encounter at the optimum comes out otherwise with the noise of another run."""
    evaluator = design.problem.task.evaluate
    if design.result is None or not isinstance(evaluator, NoisyEvaluator):
        return False
    again = evaluator.after(1)(design.scenario, design.sensor, design.gain)
    return bool(again.end.time != design.result.end.time)


def _about_contact(design: GainDesign, scanned: ContactResult) -> Iterator[str]:
    """Yield what became of the gains without contact."""
    status = np.asarray(scanned.status)
    for kind in ContactStatus:
        count = int((status == kind).sum())
        if kind is ContactStatus.CONTACT or not count:
            continue
        share = "every gain" if count == status.size else f"{count} of {status.size} scanned gains"
        text = f"{share} ended without contact ({kind.label}): {kind.meaning[0].lower()}{kind.meaning[1:]}"
        distances = np.asarray(scanned.closest_distance)[status == kind]
        text += f" Nearest approach {format_quantity(float(distances.min()), 'm')}."
        low = design.sensor.valid_range[0]
        recedes = np.all(np.asarray(design.scenario.relative_velocity) > 0)
        if recedes:
            text += " The object recedes: an approach has a negative velocity."
        if kind is ContactStatus.LEFT_RANGE and low > 0 and not recedes:
            text += (
                f" The curve starts at {format_quantity(low, 'm')}: mount the sensor that far behind the contact "
                "surface and give this as its recess."
            )
        yield text
    if design.gain is not None and not design.no_mitigation.reached.all():
        yield "without mitigation the encounter would not end in contact at all"


@check_arguments
@placed
def design_gain(task: Task) -> GainDesign:
    """Find the gain D_p that minimizes an objective like L(20) or L(22) at contact, L(21), L(23), within constraints.

    The whole range of gains is scanned until neighbors predict each other, each local minimum is refined, and the
    best one is the answer; nothing depends on a starting point.

    Args:
        task: the encounter, or an array of them, the objective, the bounds, and where given constraints, impact,
            method, horizon and `evaluate`.

    Returns:
        The design; infeasible and no-contact are statuses of it, not errors. For an array of encounters, status,
        gain and objective are arrays, and `at` gives a single design with its evidence.

    Examples:
        >>> from pretouch.design import excursion_objective
        >>> from pretouch.motion import Admittance, Obstacle, Scenario
        >>> from pretouch.sensors import InversePower
        >>> task = Task(
        ...     Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ...     ),
        ...     InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
        ...     excursion_objective(position_scale=0.5, velocity_scale=0.3),
        ...     bounds=(-10.0, -0.01),
        ... )
        >>> design = design_gain(task)
        >>> round(design.gain, 4), round(design.objective, 5)
        (-0.7463, 0.10698)
    """
    return GainDesign.of(GainProblem(task=task, axis=GainAxis.between(task.stable_bounds(), task.law.number)))
