"""Find the optimal gain that lies within its bounds and meets all constraints."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.files import plain
from pretouch._core.numbers import float_or_array
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution
from pretouch.motion import DAMPER, ContactResult, ContactStatus
from pretouch.motion.evaluator import NoisyEvaluator
from pretouch.motion.page_sections import outruns

from .certificate import DesignStatus
from .drag.design import chosen_drag
from .evidence import GainEvidence, settle
from .problem import GainProblem
from .search import GainAxis
from .sensitivity import gain_gradient
from .task import Task, at_bound_in_words, with_file_location

_RESIDUAL: Final = 1e-9  # a larger residual of the impulse balance causes a warning
_KEYS: Final = {"objective_parts": "objective_terms", "result": "contact"}


def designed_number(task: Task) -> float | None:
    """Return the designed gain or virtual drag of a task.

    Returns:
        The number, such as D_p [N s] or phi [N s^2]; None if no gain meets the constraints or ends in contact.
    """
    if task.drag_effect is None:
        gain: float | None = design_gain(task.replace(evaluate=None)).gain
        return gain
    return chosen_drag(task, task.drag_effect)[0]


@dataclass(frozen=True, kw_only=True, repr=False)
class GainDesign(GainEvidence):
    """Result of `design_gain`: the optimal gain and its evidence.

    The evidence is computed when it is first accessed.

    Args:
        problem: the task and the bounds of the gain.
        settled: status, gain and objective, if a fast search has found them without the whole scan.
    """

    @classmethod
    def of(cls, problem: GainProblem) -> GainDesign:
        """Design the gain for one or many encounters.

        Returns:
            One design, in which each encounter of an array has its own gain.
        """
        design = cls(problem=problem, settled=settle(problem))
        _ = design.answer  # searches now instead of when the gain is first read
        return design

    def at(self, *index: int) -> GainDesign:
        """Return the design for one encounter of an array.

        `index` has one integer per axis.
        """
        return GainDesign.of(self.problem.at(index)) if self.scenario.shape else self

    @property
    def method(self) -> str:
        """Name of the method that computed the motions.

        It is `closed-form`, `integration`, `uniform-motion` or `loop`.
        """
        return self.no_mitigation.method

    @property
    def objective_parts(self) -> dict[str, float]:
        """The contribution of each quantity to the objective.

        Empty if there is no optimum.

        A user-defined objective declares its parts by a method `parts`; empty if they do not add up to its value.
        """
        if self.result is None:
            return {}
        speed = abs(self.scenario.obstacle.velocity)
        return {k: float(v) for k, v in self.definition.parts(self.result.end, speed, self.impact).items()}

    @property
    def damping_at_contact(self) -> Any:
        """The damping of the virtual force at contact [N s/m].

        It is D_p g(0) for the virtual damper. For other laws, the damping dF/dl' at contact; NaN if the law does not
        give it.
        """
        if self.gain is None:
            return None
        law, slope = self.problem.task.law, self.sensor.log_slope(max(self.sensor.valid_range[0], 0.0))
        if law == DAMPER:
            return self.gain * slope
        return float_or_array(law.damping(self.gain, slope, self.problem.run(self.gain).end.relative_velocity))

    def gradient(self, by: str) -> Any:
        """Differentiate the optimal gain with respect to one input.

        An example of an input is the velocity of the obstacle. The derivative is exact if objective and limits are
        taken at contact.

        Args:
            by: the input, such as `obstacle.velocity` or `sensor.exponent`: one of `ContactGradients.inputs`, except
                the gain.

        Returns:
            d gain / d input, in the unit of the law's number (such as N s) per unit of the input: a float, or an array
            of the scenario's shape. NaN if there is no optimal gain, next to an edge of contact, and at a corner or a
            jump of the objective.
        """
        if self.gain is None:
            return math.nan
        derivative = gain_gradient(self.problem, self.gain, by, lambda index: self.at(*index))
        return derivative if self.scenario.shape else float(derivative)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the designed gain, most important first."""
        return tuple(_warnings(self, self.scan_result))

    @cached_property
    def without_margin(self) -> GainDesign | None:
        """The optimal design without the required gain margin.

        None unless only this margin makes the design infeasible.
        """
        task = self.problem.task
        if self.scenario.shape or self.status is not DesignStatus.INFEASIBLE or task.stability_margin is None:
            return None
        free = design_gain(task.replace(stability_margin=None))
        return None if free.gain is None else free

    @property
    def headline(self) -> str:
        """A summary of the design in one or two sentences."""
        if self.result is not None and self.gain is not None:
            speed = abs(self.result.end.relative_velocity)
            n = self.number
            text = f"Optimal {n.name} {n.equals(self.gain)}: contact at {format_quantity(speed, 'm/s')}"
            before = self.no_mitigation
            if before.reached.all():
                free = abs(before.end.relative_velocity)
                than = " instead of" if speed <= free else ", harder than the"
                text += f"{than} {format_quantity(free, 'm/s')} without mitigation"
            return f"{text}."
        if self.nearest is not None:
            task, conflict = self.problem.task, _conflict(self)
            if self.without_margin is None:
                return f"Infeasible: {conflict}."
            rate, margin = format_quantity(task.loop.chain.rate, "Hz"), task.stability_margin
            return f"Infeasible with a required gain margin of {margin:g} and a sensor rate of {rate}: {conflict}."
        return "No gain within the bounds ends in contact."

    def to_dict(self) -> dict[str, Any]:
        """Return the gain design as a JSON object.

        Numbers are in SI units. Missing numbers are None.
        """
        answer = {"status": self.status, "gain": self.gain, "objective": self.objective}
        if self.scenario.shape:
            return answer
        names = ("method", "objective_parts", "result", "no_mitigation", "nearest", "ideal", "damping_at_contact")
        more = ("bounds", "constraints", "relaxations", "jump", "certificate", "sensitivities", "sensor", "trade_off")
        details = {_KEYS.get(name, name): getattr(self, name) for name in (*names, *more, "warnings")}
        document: dict[str, Any] = plain({**answer, "objective_name": self.definition.name, **details})
        return document

    def __str__(self) -> str:
        return repr(self) if self.scenario.shape else super().__str__()

    def _repr_html_(self) -> str | None:
        return None if self.scenario.shape else super()._repr_html_()

    def __repr__(self) -> str:
        if self.scenario.shape:
            return f"<GainDesign: {(self.status == DesignStatus.OPTIMAL).sum()} of {self.status.size} optimal>"
        return super().__repr__()


def _conflict(design: GainDesign) -> str:
    """Name the constraints that prevent a feasible gain."""
    exceeded = [o for o in design.constraints if o.margin is None or o.margin < 0]
    n = design.number
    gain = n.equals(float(design.nearest.gain) if design.nearest else 0.0)
    if len(exceeded) == 1:
        one = exceeded[0]
        value, limit = (format_quantity(x or 0.0, one.unit) for x in (one.value, one.limit))
        margin = design.problem.task.stability_margin
        bounded = "within the bounds" if margin is None else f"within the bounds and the gain margin of {margin:g}"
        words = n.entry(one.quantity).words
        return f"the {words} cannot be limited to {limit}: its smallest value {bounded} is {value}, with {gain}"
    nearest = " and ".join(
        f"{n.entry(o.quantity).words} {value} (limit {limit})"
        for o in exceeded
        for value, limit in [[format_quantity(x or 0.0, o.unit) for x in (o.value, o.limit)]]
    )
    alone = (
        f"the {n.entry(o.quantity).words} within the bounds is at least {format_quantity(o.best_value or 0.0, o.unit)}"
        for o in exceeded
        if not o.achievable
    )
    names = " and ".join(n.entry(o.quantity).words for o in exceeded)
    together = f"the limits of {names} cannot be met together; the {n.name} {gain} violates the limits least: {nearest}"
    return "; ".join((together, *alone))


def _warnings(design: GainDesign, scanned: ContactResult) -> Iterator[str]:
    """Yield the warnings about a designed gain, most important first."""
    yield from _about_contact(design, scanned)
    yield from design.problem.task.start_warnings(design.gain)
    yield from design.problem.task.warnings
    if design.certificate is not None and design.certificate.at == "bound":
        yield caution(
            "PT301",
            at_bound_in_words(design.problem.task, design.gain or 0.0),
        )
    if design.jump is not None:
        yield design.jump.warning(design.number)
    if design.certificate is not None and design.certificate.at == "edge of contact" and design.jump is None:
        yield caution(
            "PT302", "the optimum lies at the edge of contact: with a slightly stronger gain, the object is missed"
        )
    if design.method == "uniform-motion":
        yield caution(
            "PT303",
            "the uniform motion L(16)-(19) does not start from the given state, which shifts the optimal gain by about "
            "10 %: compare with method 'integration'",
        )
    if _depends_on_noise(design):
        yield caution(
            "PT304",
            "the gain is optimal only for the noise of one run; with other noise, another gain is optimal: use "
            "robust with the same evaluate, which averages over runs",
        )
    n = design.number
    if design.gain is not None and n.sign * design.gain < 0:
        sign = "positive" if design.gain > 0 else "negative"
        yield caution(
            "PT305", f"the optimal {n.name} is {sign}, so the virtual force moves the robot toward the object"
        )
    if design.result is not None:
        residual = float(np.asarray(design.result.impulse_residual))
        if residual > _RESIDUAL:
            yield caution(
                "PT306",
                "the results are less accurate than usual: the impulse balance of the computed motion has a relative "
                f"error of {residual:.0e} (usually at most {_RESIDUAL:.0e})",
            )


def _depends_on_noise(design: GainDesign) -> bool:
    """Return True if the contact depends on the sensor noise. The test is another random draw at the optimal gain."""
    evaluator = design.problem.task.evaluate
    if design.result is None or not isinstance(evaluator, NoisyEvaluator):
        return False
    rerun = evaluator.after(1)(design.scenario, design.sensor, design.gain)
    return bool(rerun.end.time != design.result.end.time)


def _about_contact(design: GainDesign, scanned: ContactResult) -> Iterator[str]:
    """Yield warnings about gains with which the object does not reach contact."""
    status = np.asarray(scanned.status)
    for kind in ContactStatus:
        count = int((status == kind).sum())
        if kind is ContactStatus.CONTACT or not count:
            continue
        share = "every gain" if count == status.size else f"{count} of {status.size} scanned gains"
        low, outcome = design.sensor.valid_range[0], f"for {share}, the encounter ended without contact"
        if np.all(np.asarray(design.scenario.relative_velocity) > 0):
            why = "the object recedes: an approach has a negative velocity"
            if outruns(design.scenario):
                why = "the robot recedes faster than the object approaches: let the robot recede more slowly"
            outcome = f"{outcome}, because {why}"
        elif kind is ContactStatus.LEFT_RANGE and low > 0:
            outcome = (
                f"{outcome}, because the sensor curve starts at {format_quantity(low, 'm')}: mount the sensor this far "
                "behind the contact surface, and set its recess"
            )
        nearest = format_quantity(float(np.asarray(scanned.closest_distance)[status == kind].min()), "m")
        distance = f"The smallest distance to the object was {nearest}."
        yield caution("PT307", f"{outcome}. {kind.meaning} {distance}")
    if design.gain is not None and not design.no_mitigation.reached.all():
        yield caution("PT308", "without mitigation the encounter does not end in contact")


@check_arguments
@with_file_location
def design_gain(task: Task) -> GainDesign:
    """Find the gain that minimizes an objective within constraints.

    The gain D_p solves the letter's design problems L(20) to L(23).

    The whole range of gains is scanned until each gain is well interpolated from its neighbors. Then each local
    minimum is refined, and the best one is the answer. The result does not depend on a starting point. With another
    law, the number of that law is designed in the same way.

    Args:
        task: one encounter or an array of encounters, the objective and the bounds; optionally constraints, impact,
            method, horizon and `evaluate`.

    Returns:
        The design; infeasible and no-contact are statuses, not errors. For an array of encounters, status, gain and
        objective are arrays, and `at` returns a single design with its evidence.

    Examples:
        >>> from pretouch.designs import excursion_objective
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
