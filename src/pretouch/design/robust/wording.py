"""What is known of inputs, and how often limits hold, in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pretouch._core.units import format_quantity
from pretouch.motion.inputs import SCENARIO_INPUTS, sensor_inputs
from pretouch.sensors import SensorModel
from pretouch.uncertainty import (
    CorrelatedNormal,
    Distribution,
    Empirical,
    Interval,
    Normal,
    TruncatedNormal,
    Uncertainty,
    Uniform,
)

if TYPE_CHECKING:
    from .result import LimitOutcome, RobustDesign

__all__ = ["known_in_words", "outcome_in_words", "share_in_words", "uncertainty_in_words", "units_of"]


def outcome_in_words(outcome: LimitOutcome, confidence: float) -> str:
    """Say how often a constraint holds on fresh samples, and what that shows.

    Args:
        outcome: the constraint.
        confidence: of the lower bound.

    Returns:
        Text such as `held in 99.41 %, at least 99.17 %`.
    """
    constraint = outcome.required.constraint
    low = f"at least {share_in_words(outcome.low)} at {100 * confidence:g} % confidence"
    text = f"held in {share_in_words(outcome.held)}, {low}"
    if math.isfinite(outcome.magnitude):
        p = outcome.required.probability
        some = "all stay" if p == 1 else f"{100 * p:g} % stay"
        text += f"; {some} within {format_quantity(outcome.magnitude, constraint.unit)}"
    return text


def share_in_words(share: float) -> str:
    """Write a share in percent, rounded down: a bound from below stays one, and what is not all never reads as 100 %.

    Args:
        share: from 0 to 1.

    Returns:
        Text such as `99.41 %`.

    Examples:
        >>> share_in_words(0.99998), share_in_words(1.0)
        ('99.99 %', '100 %')
    """
    return f"{math.floor(1e4 * share + 1e-9) / 100:g} %"


def known_in_words(design: RobustDesign) -> list[tuple[str, str]]:
    """Say what is known of each uncertain input of a design, and of the noise where encounters are run on a loop.

    Args:
        design: the design.

    Returns:
        Name and text of each.
    """
    rows = uncertainty_in_words(design.uncertainty, design.sensor)
    if design.on_evaluator:
        of = "of the sampled loop" if design.method == "loop" else "of the function that was given, if it has any"
        rows.append(("noise", f"that {of}, another run in each encounter"))
    return rows


def uncertainty_in_words(uncertainty: Uncertainty, sensor: SensorModel) -> list[tuple[str, str]]:
    """Say what is known of each uncertain input.

    Args:
        uncertainty: what is known, by the names of inputs.
        sensor: the sensor curve, whose parameters may be among them.

    Returns:
        Name and text of each.
    """
    units = units_of(sensor)
    rows: list[tuple[str, str]] = []
    for name, known in uncertainty.items():
        if isinstance(known, CorrelatedNormal):
            for i, member in enumerate(known.names):
                error = math.sqrt(known.covariance[i][i])
                text = f"normal, {_pair(known.mean[i], error, units.get(member, ''))}"
                rows.append((member, f"{text}, together with the others of {name}"))
        else:
            rows.append((name, _said(known, units.get(name, ""))))
    return rows


def _said(known: Distribution, unit: str) -> str:
    low, high = known.support
    between = f"{format_quantity(low, unit)} to {format_quantity(high, unit)}"
    if isinstance(known, Empirical):
        return f"{len(known.samples)} measured values, {between}"
    if isinstance(known, Uniform):
        return f"uniform, {between}"
    if isinstance(known, Interval):
        return f"anywhere, {between}"
    if isinstance(known, TruncatedNormal):
        return f"normal, {_pair(known.location, known.deviation, unit)}, cut to {between}"
    if isinstance(known, Normal):
        return f"normal, {_pair(known.mean, known.deviation, unit)}"
    return f"{type(known).__name__}, {between}"


def _pair(mean: float, deviation: float, unit: str) -> str:
    return f"{format_quantity(mean, unit)} with a standard deviation of {format_quantity(deviation, unit)}"


def units_of(sensor: SensorModel) -> dict[str, str]:
    """Return the SI unit of every input of encounters with a sensor, by name.

    Args:
        sensor: the sensor curve.

    Returns:
        The units.
    """
    return {**SCENARIO_INPUTS, **sensor_inputs(sensor)}
