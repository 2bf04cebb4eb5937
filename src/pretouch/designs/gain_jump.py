"""Describe a jump next to the optimum of a design, and the distance that the designed gain keeps from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.motion import LawNumber

from .problem import GainProblem
from .search.jumps import RESERVE, Jump


@dataclass(frozen=True, slots=True, kw_only=True)
class GainJump(Value):
    """A jump of the objective, of a constraint or of contact, next to which the lowest objective lies.

    A slightly different gain, or a slightly different encounter, lies on the other side of the jump. Therefore the
    designed gain keeps a distance from it.

    Args:
        gains: two gains on both sides of the jump, the stronger one first: the law's number, such as D_p [N s].
        objective: the objective on both sides; infinite without contact or beyond a limit.
        relative_velocity: the relative velocity at contact on both sides [m/s]; None without contact, and for a design
            over many encounters.
        reserve: the distance from the jump, in the unit of the gain: 1 % of the gain and the rounding of its printed
            digits.
        kept: whether the designed gain keeps this distance; False if no feasible gain does.
        misses: whether the encounter ends without contact on one side.
    """

    gains: tuple[float, float]
    objective: tuple[float, float]
    relative_velocity: tuple[float | None, float | None]
    reserve: float
    kept: bool
    misses: bool

    def warning(self, number: LawNumber) -> str:
        """Return the warning about the jump, with the values on both sides."""
        strong, weak = self.relative_velocity
        place, distance = number.equals(self.gains[0]), format_quantity(self.reserve, number.unit, 2)
        if math.isfinite(self.objective[0]) and math.isfinite(self.objective[1]) and None not in {strong, weak}:
            speeds = [format_quantity(abs(v or 0.0), "m/s") for v in (strong, weak)]
            values = (
                f"contact at {speeds[0]} with a slightly stronger {number.name}, and at {speeds[1]} with a weaker one"
            )
        else:
            shown = [f"{f:.4g}" if math.isfinite(f) else "infinite or not allowed" for f in self.objective]
            values = f"it is {shown[0]} with a slightly stronger {number.name}, and {shown[1]} with a weaker one"
        where = f"the lowest objective lies next to a jump at {place}: {values}"
        if self.misses:
            side = "stronger" if strong is None else "weaker"
            where = (
                f"the lowest objective lies at the edge of contact, {place}: with a slightly {side} {number.name}, the "
                "object is missed"
            )
        if not self.kept:
            return caution("PT313", f"{where}. No feasible {number.name} stays {distance} (1 %) away from it")
        code = "PT302" if self.misses else "PT312"
        return caution(
            code, f"{where}. The designed {number.name} keeps a distance of at least {distance} (1 %) from it"
        )


def describe_jump(problem: GainProblem, jump: Jump | None, *, contact: bool = True) -> GainJump | None:
    """Describe a jump by the gains and values on both sides.

    Args:
        problem: the problem of one encounter, or of many.
        jump: the jump on the axis of gains.
        contact: whether the values include the relative velocity of the contact.

    Returns:
        The description; None without a jump.
    """
    if jump is None:
        return None
    ends = np.array([jump.low, jump.high])
    gains, landscape = problem.axis.gain(ends), problem.landscape(ends)
    merit = landscape.merit
    speeds: list[float | None] = [None, None]
    if contact:
        result = problem.run(gains)
        speeds = [
            float(v) if hit else None for v, hit in zip(result.end.relative_velocity, result.reached, strict=True)
        ]
    one, other = np.argsort(-np.abs(gains), kind="stable").tolist()
    return GainJump(
        gains=(float(gains[one]), float(gains[other])),
        objective=(float(merit[one]), float(merit[other])),
        relative_velocity=(speeds[one], speeds[other]),
        reserve=RESERVE * float(np.abs(gains).max()),
        kept=jump.avoided,
        misses=not np.isfinite(landscape.objective).all(),
    )
