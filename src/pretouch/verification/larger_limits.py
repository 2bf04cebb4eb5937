"""Find the limits that must be raised so that a gain keeps all of them on the sampled loop."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch.designs import HertzImpact, SpringImpact, Task
from pretouch.designs.robust.required import Required, limits_of
from pretouch.designs.search import Effort, Landscape, search_axis

from .appraisal import AT_CONTACT, LoopProblem
from .gain_search import GainSearch

FIRST_LIMIT: Final = 2  # place of the first limit among the shortfalls, after contact and contact speed
_THOROUGH: Final = Effort(first=17, largest=17, most=1, nodes=5, finest=2e-3, smooth=False)
_MOST: Final = 1e6  # larger shortfalls are not distinguished


def nearest_limits(search: GainSearch, places: list[int]) -> tuple[float, dict[int, float]] | None:
    """Return the gain that needs the smallest increase of some limits, and the factor on each of them.

    All other requirements must be met. None if they cannot be met, or if no increase is needed.
    """
    rows = [FIRST_LIMIT + i for i in places]

    def landscape(coordinate: FloatArray) -> Landscape:
        shortfalls = np.minimum([search.shortfalls(one) for one in search.results(coordinate)], _MOST).T
        others = np.delete(shortfalls, rows, axis=0)
        return Landscape(objective=shortfalls[rows].max(axis=0), ratios=others)

    _, minima = search_axis(landscape, *search.axis.span, _THOROUGH)
    if not minima or not 1 < minima[0].value < _MOST:
        return None
    best = minima[0].coordinate
    one = search.results(np.array([best]))[0]
    shortfalls = search.shortfalls(one)
    return one.gain, {i: float(shortfalls[FIRST_LIMIT + i]) for i in places if shortfalls[FIRST_LIMIT + i] > 1}


def uninformative_limits(task: Task, problem: LoopProblem) -> list[float]:
    """Return the smallest value of each limit that says nothing about the mitigation; infinite for most quantities.

    For quantities at contact, it is their mean without mitigation, or less if the limit would then be met.
    """
    limits, values = limits_of(task.constraints), []
    if problem.unmitigated is None:
        return [math.inf] * len(limits)
    for limit, ratio in zip(limits, problem.appraised(problem.unmitigated, task.loop, 0.0).ratios, strict=True):
        least = min(float(ratio.mean()), float(limit.share(ratio)))
        values.append(least * limit.constraint.limit if limit.constraint.quantity in AT_CONTACT else math.inf)
    return values


def with_limit(constraint: Any, limit: float | None) -> Any:
    """Return a constraint with another limit."""
    if limit is None:
        return constraint
    if isinstance(constraint, Required):
        return replace(constraint, constraint=replace(constraint.constraint, limit=limit))
    return replace(constraint, limit=limit)


def softer_padding(task: Task, limits: tuple[Required, ...], larger: dict[int, float]) -> str:
    """Return a sentence on the padding that keeps a limit of the impact force with the advised gain.

    The peak force of an elastic impact is proportional to k^(1 / (n + 1)) at every speed. So a stiffness that is
    smaller by the factor (limit / raised limit)^(n + 1) results in the same ratios of force and limit in every run.
    Empty if the contact is simulated, or another limit must be raised, too.
    """
    impact: Any = task.impact
    keys: dict[type, str] = {HertzImpact: "effective_modulus", SpringImpact: "stiffness"}
    if len(larger) != 1 or task.loop.contact is not None or type(impact) not in keys:
        return ""
    ((place, raised),) = larger.items()
    constraint = limits[place].constraint
    if constraint.quantity != "impact_force":
        return ""
    key = keys[type(impact)]
    present, (factor, unit) = getattr(impact, key), (1e6, "MPa") if key == "effective_modulus" else (1.0, "N/m")
    needed = present * (constraint.limit / raised) ** (impact.exponent + 1)
    return (
        f". Instead, a padding with {key} = {_rounded_down(needed / factor):g} {unit} instead of {present / factor:g} "
        f"{unit} keeps {format_quantity(constraint.limit, 'N')} with this gain (computed with the impact model at the "
        "simulated speeds of contact)"
    )


def _rounded_down(value: float) -> float:
    """Round a positive number down to three significant digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.floor(value / step) * step:.3g}")
